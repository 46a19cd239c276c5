"""Fixed joints merged away, so that a Robot holds moving joints alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.robot.robot import PRISMATIC, REVOLUTE, Joint, Link
from identify.robot.transforms import joint_transform, merge_links, move_link, parameters


@dataclass(frozen=True)
class Entry:
    """A joint as a file lists it, moving or fixed; `parent` is the index of an earlier entry, -1 for the base."""

    joint: Joint
    parent: int


def merge_fixed(entries: Sequence[Entry]) -> tuple[tuple[Joint, ...], np.ndarray]:
    """The moving joints, and the (4, 4) frame of the last entry in that of the last moving joint.

    A fixed joint's link joins the nearest moving ancestor's, or is dropped on the base, which no torque
    feels; its placement multiplies that of its children. A letter for a length goes where the length changes.
    """
    joints: list[Joint] = []
    anchors: list[tuple[int, np.ndarray | None]] = []  # per entry: its moving joint, its frame there (None: the same)
    for entry in entries:
        anchor, offset = anchors[entry.parent] if entry.parent >= 0 else (-1, None)
        if entry.joint.type in (REVOLUTE, PRISMATIC):
            joints.append(replace(_shifted(entry.joint, offset), parent=anchor))
            anchors.append((len(joints) - 1, None))
            continue
        own = joint_transform(entry.joint, 0.0)
        offset = own if offset is None else offset @ own
        if anchor >= 0 and entry.joint.link != Link():
            link = merge_links(joints[anchor].link, move_link(entry.joint.link, offset))
            joints[anchor] = replace(joints[anchor], link=link)
        anchors.append((anchor, None if np.array_equal(offset, np.eye(4)) else offset))
    anchor, offset = anchors[-1] if anchors else (-1, None)
    trailing = offset is not None and anchor == len(joints) - 1
    return tuple(joints), offset if trailing and offset is not None else np.eye(4)


def _shifted(joint: Joint, offset: np.ndarray | None) -> Joint:
    """The joint placed in the frame that `offset` (4, 4) is relative to."""
    if offset is None:
        return joint
    gamma, b, alpha, d, theta, r = parameters(offset @ joint_transform(joint, 0.0))
    lengths = {"b": b, "d": d, "r": r}
    kept = tuple((key, letter) for key, letter in joint.symbols if getattr(joint, key) == lengths[key])
    return replace(joint, gamma=gamma, b=b, alpha=alpha, d=d, theta=theta, r=r, symbols=kept)
