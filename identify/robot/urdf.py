"""Robots from URDF, with the standard library's XML alone: no mesh, package or network is touched."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from identify.errors import RobotError
from identify.robot import checks
from identify.robot.files import read_text
from identify.robot.frames import Body, robot_from_bodies, tidy
from identify.robot.robot import PRISMATIC, REVOLUTE, Drive, Limits, Link, Robot
from identify.robot.selection import Candidate, Coupling, Selection, held_joints
from identify.robot.transforms import (
    QUARTER,
    from_roll_pitch_yaw,
    inverse,
    make_link,
    merge_links,
    move_link,
    screw_z,
    snap_angle,
)
from identify.robot.xml_text import UNEXPANDED, attribute, number, parse_xml, vector

GRAVITY = (0.0, 0.0, -9.81)
"""URDF has no gravity of its own: z of the root frame is up."""

MOVING = {"revolute": REVOLUTE, "continuous": REVOLUTE, "prismatic": PRISMATIC}
FIXED = "fixed"
UNUSABLE = ("floating", "planar")
"""Types that are read to be held fixed at their origin, where --joints leaves them out."""

SHORTEST = 1e-6
"""Length of an axis below which it counts as zero."""

XACRO = "xacro"
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


def read_urdf(
    text: str | Path, source: str = "", selection: Selection | None = None, gravity: Sequence[float] = GRAVITY
) -> Robot:
    """Robot from URDF text, or from the file at a `Path`; q, dq and ddq are the URDF's own joint variables.

    gravity (3,): acceleration in the root link's frame [m/s²]. selection: joints to keep, all by default, except
    joints that mimic others and the ones these follow: they are held, as identify.robot.selection says.
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
    children: dict[str, list[_Edge]] = {name: [] for name in links}
    for edge in edges:
        children[edge.parent].append(edge)
    held, note = _held(edges, selection or Selection(), source)

    notes: list[str] = [note] if note else []
    bodies: list[Body] = []
    tip = np.eye(4)
    # Depth first: (joint to visit, index of the moving body that carries its parent link, that link in the root).
    pending = [(edge, -1, np.eye(4)) for edge in reversed(children[base])]
    while pending:
        edge, anchor, frame = pending.pop()
        reached = tidy(frame @ edge.origin)
        link = _link(links[edge.child], f"{source}: link {edge.child!r}", notes)
        carrier = anchor
        where = f"{source}: joint {edge.name!r}"
        if held.get(edge.name):
            reached = reached @ _moved(edge, held[edge.name], where)
        if edge.type != FIXED and edge.name not in held:
            carrier = len(bodies)
            bodies.append(_body(edge, anchor, reached, link, where))
        elif anchor >= 0:
            own = bodies[anchor]
            moved = move_link(link, tidy(inverse(own.frame) @ reached))
            bodies[anchor] = replace(own, link=merge_links(own.link, moved))
        if carrier == len(bodies) - 1:
            tip = reached
        pending += [(below, carrier, reached) for below in reversed(children[edge.child])]
    notes += [note for edge in edges if (note := _nearly_right(edge))]
    return robot_from_bodies(
        (root.get("name") or "robot")[: checks.LONGEST], bodies, gravity, tip, source, " ".join(notes)
    )


def _parse(text: str, source: str) -> Element:
    """The <robot> element."""
    root = parse_xml(text, source)
    if root.tag != "robot":
        raise RobotError(f"{source}: not a URDF: expected the element <robot> at the top, found <{root.tag}>")
    # What an expanded file still quotes, in comments or plugins, does no harm.
    if any(XACRO in element.tag for element in root):
        raise RobotError(f"{source}: {UNEXPANDED}")
    return root


def _held(edges: Sequence[_Edge], selection: Selection, source: str) -> tuple[Mapping[str, float], str]:
    """{name: position} of the joints that are read as fixed ones, and a note that says so."""
    moving = [edge for edge in edges if edge.type != FIXED]
    index = {edge.name: k for k, edge in enumerate(moving)}
    above = {edge.child: edge for edge in edges}
    fixed = {edge.name for edge in edges if edge.type == FIXED}

    carried: dict[str, int] = {}  # by link: the moving joint that carries it
    candidates: list[Candidate] = []
    couplings: list[Coupling] = []
    for edge in moving:
        passed, link = [], edge.parent
        while link in above and link not in carried and above[link].type == FIXED:
            passed.append(link)
            link = above[link].parent
        parent = carried[link] if link in carried else index[above[link].name] if link in above else -1
        carried.update(dict.fromkeys(passed, parent))
        mimic = edge.element.find("mimic")
        where = f"{source}: joint {edge.name!r}: mimic"
        leader = attribute(mimic, "joint", where) if mimic is not None else ""
        unusable = f"type {edge.type!r} can't be used" if edge.type in UNUSABLE else ""
        if mimic is not None and (leader == edge.name or (leader not in index and leader not in fixed)):
            unusable = f"mimics {leader!r}, which is no other joint"
        candidates.append(Candidate(edge.name, parent, unusable))
        if mimic is None or unusable:
            continue
        k, at = index[edge.name], index.get(leader, -1)
        couplings.append(
            Coupling(
                members=(k,) if at < 0 else (k, at),
                why=f"{edge.name!r} mimics {leader!r}",
                follower=k,
                leader=at,
                coefficients=tuple(number(mimic, *given, where) for given in (("offset", 0.0), ("multiplier", 1.0))),
            )
        )
    held, note = held_joints(candidates, couplings, selection, source)
    return {moving[k].name: position for k, position in held.items()}, note


def _moved(edge: _Edge, position: float, where: str) -> np.ndarray:
    """(4, 4) the child link's frame at a joint position [rad or m], in its frame at zero."""
    if edge.type in UNUSABLE:
        raise RobotError(f"{where}: of type {edge.type!r}: held at its origin, it takes no position")
    axis = _axis(edge, where)
    if MOVING[edge.type] == PRISMATIC:
        shift = np.eye(4)
        shift[:3, 3] = position * axis
        return shift
    # A frame with z along the axis, turned about z, and back.
    across = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(across, axis)
    x /= np.linalg.norm(x)
    turned = np.eye(4)
    turned[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    return turned @ screw_z(position, 0.0) @ turned.T


def _links(root: Element, source: str) -> dict[str, Element]:
    links: dict[str, Element] = {}
    for element in root.findall("link"):
        name = attribute(element, "name", f"{source}: a <link>")
        if name in links:
            raise RobotError(f"{source}: link {name!r}: a second link of this name; every link needs a name of its own")
        links[name] = element
    if not links:
        raise RobotError(f"{source}: no <link>; is it a URDF of an arm?")
    return links


def _edges(root: Element, links: dict[str, Element], source: str) -> list[_Edge]:
    edges: dict[str, _Edge] = {}
    above: dict[str, str] = {}  # link: the joint it hangs on
    for element in root.findall("joint"):
        name = attribute(element, "name", f"{source}: a <joint>")
        where = f"{source}: joint {name!r}"
        if name in edges:
            raise RobotError(f"{where}: a second joint of this name; every joint needs a name of its own")
        kind = attribute(element, "type", where)
        if kind not in (*MOVING, *UNUSABLE, FIXED):
            raise RobotError(f"{where}: type {kind!r} can't be used; {checks.suggestion(kind, (*MOVING, FIXED))}")
        ends = {}
        for end in ("parent", "child"):
            part = element.find(end)
            if part is None:
                raise RobotError(f'{where}: no <{end} link="..."/>')
            ends[end] = attribute(part, "link", f"{where}: <{end}>")
            if ends[end] not in links:
                raise RobotError(f"{where}: {end}: no link {ends[end]!r}; {checks.suggestion(ends[end], links)}")
        child = ends["child"]
        if child in above:
            raise RobotError(
                f"{where}: link {child!r} hangs on joint {above[child]!r} already; closed loops can't be used"
            )
        above[child] = name
        edges[name] = _Edge(name, kind, ends["parent"], child, _origin(element.find("origin"), where), element)
    return list(edges.values())


def _root(links: dict[str, Element], edges: list[_Edge], source: str) -> str:
    """Name of the one link that is nobody's child, from which every other is reached."""
    hanging = {edge.child for edge in edges}
    roots = [name for name in links if name not in hanging]
    if len(roots) > 1:
        raise RobotError(f"{source}: links {', '.join(map(repr, roots[:4]))} have no parent; a robot has one root link")
    # Each link but the root has one parent, so what the root does not reach closes on itself.
    children: dict[str, list[str]] = {}
    for edge in edges:
        children.setdefault(edge.parent, []).append(edge.child)
    reached = set(roots)
    pending = list(roots)
    while pending:
        below = children.get(pending.pop(), [])
        reached.update(below)
        pending += below
    lost = [name for name in links if name not in reached]
    if lost:
        raise RobotError(f"{source}: links {', '.join(map(repr, lost[:4]))} form a closed loop, which can't be used")
    return roots[0]


def _body(edge: _Edge, anchor: int, frame: np.ndarray, link: Link, where: str) -> Body:
    axis = _axis(edge, where)
    drive, limits = _drive(edge.element, where), _limits(edge, where)
    return Body(edge.name, MOVING[edge.type], anchor, frame, axis, link, limits, drive)


def _axis(edge: _Edge, where: str) -> np.ndarray:
    """(3,) unit vector of the joint's axis in its own frame."""
    axis_element = edge.element.find("axis")
    axis = np.array([1.0, 0.0, 0.0])
    if axis_element is not None:
        axis = np.array(vector(axis_element, "xyz", (1.0, 0.0, 0.0), f"{where}: axis"))
    length = float(np.linalg.norm(axis))
    if length < SHORTEST:
        raise RobotError(f"{where}: axis: expected a direction, found a zero vector")
    return axis / length


def _limits(edge: _Edge, where: str) -> Limits:
    element = edge.element.find("limit")
    if element is None:
        return Limits()
    where = f"{where}: limit"
    low, high = (number(element, key, 0.0, where, infinite=True) for key in ("lower", "upper"))
    if low > high:
        raise RobotError(f"{where}: lower {low:g} lies above upper {high:g}")
    given = edge.type != "continuous" and low < high
    sizes = {}
    for key in ("velocity", "acceleration", "effort"):
        size = checks.not_negative(number(element, key, 0.0, where, infinite=True), f"{where}: {key}")
        sizes[key] = size or math.inf
    position = (low, high) if given else (-math.inf, math.inf)
    return Limits(position, sizes["velocity"], sizes["acceleration"], sizes["effort"])


def _drive(element: Element, where: str) -> Drive:
    dynamics = element.find("dynamics")
    if dynamics is None:
        return Drive()
    where = f"{where}: dynamics"
    # `armature` and `offset` are no URDF: identify.robot.urdf_writing puts them there.
    inertia, viscous, coulomb = (
        checks.not_negative(number(dynamics, key, 0.0, where), f"{where}: {key}")
        for key in ("armature", "damping", "friction")
    )
    return Drive(inertia, viscous, coulomb, number(dynamics, "offset", 0.0, where))


def _link(element: Element, where: str, notes: list[str]) -> Link:
    """Inertia in the link's frame; without <inertial> the zero link, which means not known."""
    inertial = element.find("inertial")
    if inertial is None:
        return Link()
    where = f"{where}: inertial"
    mass_element, moments = inertial.find("mass"), inertial.find("inertia")
    if mass_element is None:
        raise RobotError(f'{where}: no <mass value="..."/>')
    attribute(mass_element, "value", f"{where}: mass")
    mass = checks.not_negative(number(mass_element, "value", 0.0, f"{where}: mass"), f"{where}: mass")
    xx, xy, xz, yy, yz, zz = (
        number(moments, key, 0.0, f"{where}: inertia") if moments is not None else 0.0
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
    xyz = vector(element, "xyz", (0.0, 0.0, 0.0), f"{where}: origin")
    rpy = vector(element, "rpy", (0.0, 0.0, 0.0), f"{where}: origin")
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
