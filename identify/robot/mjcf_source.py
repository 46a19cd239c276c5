"""MJCF reduced to what tells of rigid bodies and joints, before MuJoCo's compiler sees it.

Meshes, textures, sensors, keyframes and the like are left out unread, so that it does not matter whether their files
are there; what would take memory or time without bound is refused.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from identify.errors import RobotError
from identify.robot.checks import LARGEST, LONGEST
from identify.robot.files import read_text
from identify.robot.xml_text import MOST, parse_xml

SECTIONS = ("compiler", "option", "default", "worldbody", "actuator", "equality")
DECORATION = ("camera", "light", "plugin", "composite", "flexcomp", "skin")
CONSTRAINTS = ("connect", "weld", "joint")
ACTUATORS = ("general", "motor", "position", "velocity", "intvelocity", "damper")
FILES = ("meshdir", "texturedir", "assetdir", "strippath")
WORDS = {"name", "class", "childclass", "file", "prefix", "mesh", "material", "hfield", "user", "model"}
WORDS |= {"joint", "joint1", "joint2", "body", "body1", "body2", "site", "site1", "site2", "jointinparent"}
"""Attributes that hold names, in which "nan" and "inf" are no numbers."""

DEEPEST_INCLUDE = 10
MOST_PARTS = 10_000
"""Bodies, joints and geoms: MuJoCo's compiler takes time and memory with the square of their number."""


@dataclass(frozen=True)
class MjcfSource:
    """name of the model; text: the reduced MJCF; tied: (joint names, why) of joints that a tendon equality couples."""

    name: str
    text: str
    tied: tuple[tuple[tuple[str, ...], str], ...]


def mjcf_source(text: str, source: str, folder: Path | None) -> MjcfSource:
    """What MuJoCo's compiler needs of an MJCF text; files it includes are looked for in and below `folder`.

    RobotError, in one line, for what is no MJCF, for an include that is missing or lies elsewhere, for an attached
    model, and for numbers that are not finite.
    """
    root = parse_xml(text, source)
    if root.tag != "mujoco":
        raise RobotError(f"{source}: not an MJCF model: expected the element <mujoco> at the top, found <{root.tag}>")
    whole = Element("mujoco")
    whole.extend(_included(list(root), source, folder, 0))
    tied = _tied(whole)
    reduced = Element("mujoco")
    for section in whole:
        if section.tag in SECTIONS:
            reduced.append(_section(section, source))
    _check(reduced, source)
    return MjcfSource((root.get("model") or "robot")[:LONGEST], ElementTree.tostring(reduced, encoding="unicode"), tied)


def _included(children: list[Element], source: str, folder: Path | None, depth: int) -> list[Element]:
    """The elements with every <include> replaced by what its file holds; not inside sections that are left out."""
    result: list[Element] = []
    for child in children:
        if child.tag == "include":
            result += _included(_file(child, source, folder, depth), source, folder, depth + 1)
            continue
        if depth > 0 or child.tag in (*SECTIONS, "tendon", "body", "frame", "replicate"):
            inner = _included(list(child), source, folder, depth)
            for old in list(child):
                child.remove(old)
            child.extend(inner)
        result.append(child)
    return result


def _file(include: Element, source: str, folder: Path | None, depth: int) -> list[Element]:
    name = include.get("file") or ""
    where = f"{source}: include {name!r}"
    place = PurePosixPath(name.replace("\\", "/"))
    if not name or place.is_absolute() or ".." in place.parts or ":" in name:
        raise RobotError(f"{where}: files are included from the folder of the model alone")
    if folder is None:
        raise RobotError(f"{where}: a text can't include files; give the model as a file")
    if depth >= DEEPEST_INCLUDE:
        raise RobotError(f"{where}: includes more than {DEEPEST_INCLUDE} deep; does the file include itself?")
    try:
        text = read_text(folder / place)
    except RobotError as error:
        raise RobotError(f"{where}: {error}") from None
    return list(parse_xml(text, f"{source}: include {name!r}"))


def _tied(root: Element) -> tuple[tuple[tuple[str, ...], str], ...]:
    fixed = {
        tendon.get("name", ""): [joint.get("joint", "") for joint in tendon.findall("joint")]
        for tendon in root.findall("tendon/fixed")
    }
    found = []
    for equality in root.findall("equality/tendon"):
        names = [equality.get(key, "") for key in ("tendon1", "tendon2")]
        joints = tuple(joint for name in names for joint in fixed.get(name, []))
        if equality.get("active", "true") == "true" and joints:
            found.append((joints, f"tendon {names[0]!r} ties them together"))
    return tuple(found)


def _section(section: Element, source: str) -> Element:
    kept = Element(section.tag, section.attrib)
    if section.tag == "compiler":
        for key in FILES:
            kept.attrib.pop(key, None)
    elif section.tag == "option":
        kept.attrib = {key: value for key, value in section.attrib.items() if key == "gravity"}
        flags = [flag.get("gravity", "enable") for flag in section.findall("flag")]
        if flags:
            ElementTree.SubElement(kept, "flag", gravity=flags[-1])
    elif section.tag == "actuator":
        kept.extend([a for a in section if a.tag in ACTUATORS and (a.get("joint") or a.get("jointinparent"))])
    elif section.tag == "equality":
        kept.extend([constraint for constraint in section if constraint.tag in CONSTRAINTS])
    else:
        kept.extend(list(_bare(list(section), source)))
    return kept


def _bare(children: list[Element], source: str) -> Iterator[Element]:
    """The elements of a body or a default class without what has no mass and moves nothing."""
    for child in children:
        if child.tag in DECORATION:
            continue
        if child.tag == "attach":
            raise RobotError(f"{source}: attaches another model; write both into one file (mujoco.MjSpec.to_xml)")
        bare = Element(child.tag, child.attrib)
        bare.extend(list(_bare(list(child), source)))
        yield bare


def _check(root: Element, source: str) -> None:
    """Refuse numbers that no robot has, and copies without number."""
    pending: list[tuple[Element, int]] = [(root, 1)]
    count = parts = 0
    while pending:
        element, copies = pending.pop()
        count += copies
        parts += copies * (element.tag in ("body", "joint", "geom", "site"))
        if count > MOST or parts > MOST_PARTS:
            raise RobotError(f"{source}: more than {MOST_PARTS:,} bodies, joints and shapes; no robot needs that")
        for key, value in element.attrib.items():
            if len(value) > LONGEST and key in WORDS - {"user"}:
                raise RobotError(f"{source}: <{element.tag}> {key}: longer than {LONGEST} characters: {value[:40]!r}")
            if key not in WORDS:
                _check_numbers(value, f"{source}: <{element.tag}> {key}")
        if element.tag == "replicate":
            try:
                copies *= max(1, int(float(element.get("count", "1"))))
            except (ValueError, OverflowError):
                raise RobotError(f"{source}: <replicate> count: expected a whole number") from None
        pending += [(child, copies) for child in element]


def _check_numbers(value: str, where: str) -> None:
    for word in value.split():
        try:
            number = float(word)
        except ValueError:
            continue
        if not math.isfinite(number) or abs(number) > LARGEST:
            raise RobotError(f"{where}: expected numbers up to {LARGEST:g}, found {word[:40]}")
