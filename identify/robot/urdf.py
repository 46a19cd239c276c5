"""Robots from URDF, with the standard library's XML alone: no mesh, package or network is touched."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from identify.errors import RobotError
from identify.robot import checks
from identify.robot.frames import Body, robot_from_bodies, tidy
from identify.robot.robot import PRISMATIC, REVOLUTE, Drive, Limits, Link, Robot
from identify.robot.toml import read_text
from identify.robot.transforms import (
    QUARTER,
    from_roll_pitch_yaw,
    inverse,
    make_link,
    merge_links,
    move_link,
    snap_angle,
)

GRAVITY = (0.0, 0.0, -9.81)
"""URDF has no gravity of its own: z of the root frame is up."""

MOVING = {"revolute": REVOLUTE, "continuous": REVOLUTE, "prismatic": PRISMATIC}
FIXED = "fixed"
NEARLY_RIGHT = 1e-4
"""An angle this close to a multiple of π/2 [rad], yet not within rounding of it, earns a note."""


@dataclass(frozen=True)
class _Edge:
    """A joint of the file; origin (4, 4) places its frame in the parent link's."""

    name: str
    type: str
    parent: str
    child: str
    origin: np.ndarray
    element: Element


def read_urdf(text: str | Path, source: str = "") -> Robot:
    """Robot from URDF text, or from the file at a `Path`; q, dq and ddq are the URDF's own joint variables.

    Frames become modified Denavit-Hartenberg ones (identify.robot.frames), `Robot.base` places R_0 in the
    root link and `Robot.tool` the last link's frame. Fixed joints are merged; the root link's inertia, which
    no torque feels, is dropped. Joints come depth first, children in the file's order. Velocity or effort
    limits of 0 and equal position limits count as not given. Angles within 1e-9 rad of a multiple of π/2
    are taken for it. Inertias no body can have are kept and named in `Robot.note`.
    Raises RobotError, in one line, for anything that is no URDF of a serial or tree-shaped arm.
    """
    if isinstance(text, Path):
        source = source or str(text)
        text = read_text(text)
    source = source or "robot"
    root = _parse(text, source)
    links = _links(root, source)
    edges = _edges(root, links, source)
    base = _root(links, edges, source)
    children = {name: [edge for edge in edges if edge.parent == name] for name in links}

    notes: list[str] = []
    bodies: list[Body] = []
    tip = np.eye(4)
    # Depth first: (joint to visit, index of the moving body that carries its parent link, that link in the root).
    pending = [(edge, -1, np.eye(4)) for edge in reversed(children[base])]
    while pending:
        edge, anchor, frame = pending.pop()
        reached = tidy(frame @ edge.origin)
        link = _link(links[edge.child], f"{source}: link {edge.child!r}", notes)
        carrier = anchor
        if edge.type != FIXED:
            carrier = len(bodies)
            bodies.append(_body(edge, anchor, reached, link, f"{source}: joint {edge.name!r}"))
        elif anchor >= 0:
            own = bodies[anchor]
            moved = move_link(link, tidy(inverse(own.frame) @ reached))
            bodies[anchor] = replace(own, link=merge_links(own.link, moved))
        if carrier == len(bodies) - 1:
            tip = reached
        pending += [(below, carrier, reached) for below in reversed(children[edge.child])]
    if not bodies:
        raise RobotError(
            f"{source}: no moving joint; a robot needs at least one revolute, continuous or prismatic joint"
        )
    notes += [note for edge in edges if (note := _nearly_right(edge))]
    return robot_from_bodies(root.get("name") or "robot", bodies, GRAVITY, tip, source, " ".join(notes))


def _parse(text: str, source: str) -> Element:
    """The <robot> element; DOCTYPE and entities, which can blow up or reach out, are refused unread."""
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise RobotError(f"{source}: holds a DOCTYPE or ENTITY declaration, which is refused; remove it")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RobotError(f"{source}: not valid XML: {error}") from None
    if root.tag != "robot":
        raise RobotError(f"{source}: not a URDF: expected the element <robot> at the top, found <{root.tag}>")
    if any("xacro" in element.tag for element in root.iter()) or "${" in text:
        raise RobotError(f"{source}: holds xacro macros; expand it first:  xacro FILE > arm.urdf")
    return root


def _links(root: Element, source: str) -> dict[str, Element]:
    links: dict[str, Element] = {}
    for element in root.findall("link"):
        name = _attribute(element, "name", f"{source}: a <link>")
        if name in links:
            raise RobotError(f"{source}: link {name!r}: a second link of this name; every link needs a name of its own")
        links[name] = element
    if not links:
        raise RobotError(f"{source}: no <link>; is it a URDF of an arm?")
    return links


def _edges(root: Element, links: dict[str, Element], source: str) -> list[_Edge]:
    edges: list[_Edge] = []
    for element in root.findall("joint"):
        name = _attribute(element, "name", f"{source}: a <joint>")
        where = f"{source}: joint {name!r}"
        if any(edge.name == name for edge in edges):
            raise RobotError(f"{where}: a second joint of this name; every joint needs a name of its own")
        kind = _attribute(element, "type", where)
        if kind not in (*MOVING, FIXED):
            raise RobotError(f"{where}: type {kind!r} can't be used; {checks.suggestion(kind, (*MOVING, FIXED))}")
        if element.find("mimic") is not None:
            raise RobotError(f"{where}: mimics another joint, which can't be used; make it fixed or a joint of its own")
        ends = {}
        for end in ("parent", "child"):
            part = element.find(end)
            if part is None:
                raise RobotError(f'{where}: no <{end} link="..."/>')
            ends[end] = _attribute(part, "link", f"{where}: <{end}>")
            if ends[end] not in links:
                raise RobotError(f"{where}: {end}: no link {ends[end]!r}; {checks.suggestion(ends[end], links)}")
        other = next((edge for edge in edges if edge.child == ends["child"]), None)
        if other:
            raise RobotError(
                f"{where}: link {ends['child']!r} hangs on joint {other.name!r} already; closed loops can't be used"
            )
        origin = _origin(element.find("origin"), where)
        edges.append(_Edge(name, kind, ends["parent"], ends["child"], origin, element))
    return edges


def _root(links: dict[str, Element], edges: list[_Edge], source: str) -> str:
    """Name of the one link that is nobody's child, from which every other is reached."""
    roots = [name for name in links if all(edge.child != name for edge in edges)]
    if len(roots) > 1:
        raise RobotError(f"{source}: links {', '.join(map(repr, roots[:4]))} have no parent; a robot has one root link")
    # Each link but the root has one parent, so what the root does not reach closes on itself.
    reached = set(roots)
    for _ in edges:
        reached |= {edge.child for edge in edges if edge.parent in reached}
    lost = [name for name in links if name not in reached]
    if lost:
        raise RobotError(f"{source}: links {', '.join(map(repr, lost[:4]))} form a closed loop, which can't be used")
    return roots[0]


def _body(edge: _Edge, anchor: int, frame: np.ndarray, link: Link, where: str) -> Body:
    axis_element = edge.element.find("axis")
    axis = np.array([1.0, 0.0, 0.0])
    if axis_element is not None:
        axis = np.array(_vector(axis_element, "xyz", (1.0, 0.0, 0.0), f"{where}: axis"))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise RobotError(f"{where}: axis: expected a direction, found a zero vector")
    drive, limits = _drive(edge.element, where), _limits(edge, where)
    return Body(edge.name, MOVING[edge.type], anchor, frame, axis / length, link, limits, drive)


def _limits(edge: _Edge, where: str) -> Limits:
    element = edge.element.find("limit")
    if element is None:
        return Limits()
    where = f"{where}: limit"
    low, high = (_number(element, key, 0.0, where, infinite=True) for key in ("lower", "upper"))
    if low > high:
        raise RobotError(f"{where}: lower {low:g} lies above upper {high:g}")
    given = edge.type != "continuous" and low < high
    sizes = {}
    for key in ("velocity", "acceleration", "effort"):
        size = checks.not_negative(_number(element, key, 0.0, where, infinite=True), f"{where}: {key}")
        sizes[key] = size or math.inf
    return Limits((low, high) if given else (-math.inf, math.inf), **sizes)


def _drive(element: Element, where: str) -> Drive:
    dynamics = element.find("dynamics")
    if dynamics is None:
        return Drive()
    where = f"{where}: dynamics"
    viscous, coulomb = (
        checks.not_negative(_number(dynamics, key, 0.0, where), f"{where}: {key}") for key in ("damping", "friction")
    )
    return Drive(viscous=viscous, coulomb=coulomb)


def _link(element: Element, where: str, notes: list[str]) -> Link:
    """Inertia in the link's frame; without <inertial> the zero link, which means not known."""
    inertial = element.find("inertial")
    if inertial is None:
        return Link()
    where = f"{where}: inertial"
    mass_element, moments = inertial.find("mass"), inertial.find("inertia")
    if mass_element is None:
        raise RobotError(f'{where}: no <mass value="..."/>')
    _attribute(mass_element, "value", f"{where}: mass")
    mass = checks.not_negative(_number(mass_element, "value", 0.0, f"{where}: mass"), f"{where}: mass")
    xx, xy, xz, yy, yz, zz = (
        _number(moments, key, 0.0, f"{where}: inertia") if moments is not None else 0.0
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    link = make_link(mass, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if problem := checks.inertia_problem(link):
        notes.append(f"Link {element.get('name')!r}: {problem}; kept as the file gives it.")
    return move_link(link, _origin(inertial.find("origin"), where))


def _origin(element: Element | None, where: str) -> np.ndarray:
    """(4, 4) of an <origin>, right angles made exact."""
    if element is None:
        return np.eye(4)
    xyz = _vector(element, "xyz", (0.0, 0.0, 0.0), f"{where}: origin")
    rpy = _vector(element, "rpy", (0.0, 0.0, 0.0), f"{where}: origin")
    return from_roll_pitch_yaw(xyz, [snap_angle(angle) for angle in rpy])


def _nearly_right(edge: _Edge) -> str:
    """A note when the joint's origin turns by almost, but not quite, a multiple of a right angle."""
    origin = edge.element.find("origin")
    angles = [snap_angle(float(a)) for a in origin.get("rpy", "").split()] if origin is not None else []
    missed = [a for a in angles if 0.0 < abs(a - round(a / QUARTER) * QUARTER) < NEARLY_RIGHT]
    if not missed:
        return ""
    return (
        f"Joint {edge.name!r}: the angle {missed[0]:g} is taken as written; write 9 decimals if a right angle is meant."
    )


def _attribute(element: Element, key: str, where: str) -> str:
    value = element.get(key)
    if not value:
        raise RobotError(f"{where}: no attribute {key}")
    return value


def _number(element: Element, key: str, default: float, where: str, infinite: bool = False) -> float:
    value = element.get(key)
    if value is None:
        return default
    numbers = tuple(_floats(value, f"{where}: {key}", infinite))
    if len(numbers) != 1:
        raise RobotError(f"{where}: {key}: expected one number, found {checks.found(value)}")
    return numbers[0]


def _vector(element: Element, key: str, default: tuple[float, ...], where: str) -> tuple[float, ...]:
    value = element.get(key)
    if value is None:
        return default
    numbers = tuple(_floats(value, f"{where}: {key}"))
    if len(numbers) != len(default):
        raise RobotError(f"{where}: {key}: expected {len(default)} numbers, found {checks.found(value)}")
    return numbers


def _floats(text: str, where: str, infinite: bool = False) -> Iterator[float]:
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            raise RobotError(f"{where}: expected numbers, found {checks.found(text)}") from None
        yield checks.number(value, where, infinite)
