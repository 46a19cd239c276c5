"""A Robot as the text of a file, and what the file's format does not carry."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from identify.errors import InputError
from identify.robot.mjcf import to_mjcf
from identify.robot.robot import Robot
from identify.robot.toml_writing import write_toml
from identify.robot.urdf_writing import lost_in_urdf, to_urdf

FORMATS = {"toml": (".toml",), "urdf": (".urdf", ".xml"), "mjcf": (".xml", ".mjcf")}
"""Formats of a robot file, and the endings that each may have."""

_COUPLED = ("Iam", "Fvm", "Fsm")
"""What a `Drive` holds of a coupled motor, by the names of its parameters."""


def written(robot: Robot, form: str, lost: Sequence[str]) -> str:
    """Text of the robot in one of FORMATS; lost: sentences on what it does not carry, which stand in it.

    InputError for an unknown format; RobotError, naming the link, where MJCF has to hold an inertia that is not known
    or that no body can have.
    """
    if form == "toml":
        return "".join(f"# Not carried: {' '.join(line.split())}.\n" for line in lost) + write_toml(robot)
    if form == "urdf":
        return _commented(to_urdf(robot), robot.note, lost)
    if form == "mjcf":
        nothing = np.zeros(robot.n)
        return _commented(to_mjcf(robot, position_gain=nothing, velocity_gain=nothing), robot.note, lost)
    raise InputError(f"format {form!r}: choose one of {', '.join(FORMATS)}")


def not_carried(robot: Robot, form: str) -> tuple[str, ...]:
    """What of the robot a file in this format leaves out, a sentence each."""
    if form == "toml":
        return ()
    lost = list(lost_in_urdf(robot)) if form == "urdf" else []
    motors = robot.transmission.motors if robot.transmission else ()
    coupled = [
        f"{kind}{k + 1} = {value:.4g}"
        for k, _ in robot.couplings
        if motors
        for kind, value in zip(_COUPLED, astuple(motors[k]), strict=False)
    ]
    if coupled:
        lost.append(f"coupled motors' inertia and friction ({', '.join(coupled)}): the format has no place for them")
    if robot.transmission:
        lost.append("the transmission from motors to joints: the file's joints and efforts are those of the joint side")
    if robot.floor is not None or any(joint.radius is not None for joint in robot.joints):
        lost.append("floor and radii of links, from which motions that are designed keep away")
    return tuple(lost)


def _commented(text: str, note: str, lost: Sequence[str]) -> str:
    """The XML with a comment before its root element."""
    lines = [note] if note else []
    lines += [f"Not carried: {line}." for line in lost]
    if not lines:
        return text
    said = "\n".join("".join(c for c in line if c.isprintable()) for line in lines)
    while "--" in said:  # which the name of a log may hold and a comment may not
        said = said.replace("--", "- -")
    return ElementTree.tostring(ElementTree.Comment(f"\n{said}\n"), encoding="unicode") + "\n" + text
