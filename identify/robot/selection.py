"""Which joints of a description become joints of the robot, and where the others are held.

A robot identifies the joints it has. What a log does not move, and what can't be modelled (joints that follow
another one, closed loops, ball joints), is held fixed at a stated position, so that its links count as parts of the
links that carry them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identify.errors import RobotError
from identify.robot.checks import found, suggestion
from identify.robot.fixed import Entry, merge_fixed
from identify.robot.robot import IDENTITY, Joint, Robot, Transmission
from identify.robot.transforms import to_matrix

HINT = "name the joints to keep with --joints"


@dataclass(frozen=True)
class Selection:
    """Joints to keep, () for all that can be; `held`: positions of others [rad or m], 0 where not given."""

    keep: tuple[str, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Candidate:
    """A joint of a description; `parent` is the index of the one that carries it, -1 for the base.

    unusable: why it can't be a joint of a robot, "" if it can. always_held: whether it is held without being told.
    """

    name: str
    parent: int
    unusable: str = ""
    always_held: bool = False


@dataclass(frozen=True)
class Coupling:
    """Joints, by index, that can't move on their own; `why` says so, as in "'b' mimics 'a'".

    Where one follows another, its position is Σ coefficients[i] × (position of the leader − reference)ⁱ; a leader of
    -1 stands for one that never leaves its reference.
    """

    members: tuple[int, ...]
    why: str
    follower: int = -1
    leader: int = -1
    coefficients: tuple[float, ...] = ()
    reference: float = 0.0


def parse_selection(joints: str | Sequence[str]) -> Selection:
    """Selection from "a,b,c=0.3", or its parts in a sequence: a and b are kept, c is held at 0.3 rad or m.

    Without a name to keep, every joint but those with a position is. RobotError for what is no such list.
    """
    parts = [part.strip() for part in (joints.split(",") if isinstance(joints, str) else joints)]
    keep: list[str] = []
    held: dict[str, float] = {}
    for part in parts:
        name, equals, position = (word.strip() for word in part.rpartition("="))
        if not equals:
            name = part
        if not name:
            raise RobotError(f"--joints: expected names and name=position with commas between, found {found(joints)}")
        if name in keep or name in held:
            raise RobotError(f"--joints: {name!r} stands there twice")
        if not equals:
            keep.append(name)
            continue
        try:
            held[name] = float(position)
        except ValueError:
            held[name] = math.nan
        if not abs(held[name]) <= 1e3:
            raise RobotError(f"--joints: {name}: expected a position in rad or m, found {found(position)}")
    return Selection(tuple(keep), held)


def held_joints(
    candidates: Sequence[Candidate], couplings: Sequence[Coupling], selection: Selection, source: str
) -> tuple[dict[int, float], str]:
    """{index: position} of the candidates to hold, and a note that says which and why, "" if none.

    Coupled joints are held if no joint to be kept hangs on them, as with the fingers of a gripper.
    RobotError for names that are not there, for kept joints that can't be, and if nothing is kept.
    """
    index = {candidate.name: k for k, candidate in enumerate(candidates)}
    for name in (*selection.keep, *selection.held):
        if name not in index:
            near = suggestion(name, index) if index else "it has none"
            raise RobotError(f"{source}: --joints: no joint {name!r}; {near}")
    reasons = {member: coupling.why for coupling in reversed(couplings) for member in coupling.members}
    followers = {coupling.follower: coupling for coupling in couplings if coupling.follower >= 0}
    for name in selection.held:
        if index[name] in followers:
            leader = candidates[followers[index[name]].leader].name
            raise RobotError(f"{source}: --joints: {name!r} follows {leader!r}; give the position of that one")
    if selection.keep:
        kept = {index[name] for name in selection.keep}
        for k in sorted(kept):
            if why := candidates[k].unusable or reasons.get(k, ""):
                raise RobotError(f"{source}: --joints: {candidates[k].name!r} can't be kept: {why}")
    else:
        told = {index[name] for name in selection.held}
        kept = set(range(len(candidates))) - told - set(reasons)
        kept -= {k for k in kept if candidates[k].always_held}
        for k in sorted(kept):
            if why := candidates[k].unusable:
                raise RobotError(f"{source}: joint {candidates[k].name!r}: {why}; {HINT}")
            over = next((a for a in _above(candidates, k) if a in reasons and a not in told), None)
            if over is not None:
                raise RobotError(
                    f"{source}: joint {candidates[over].name!r}: {reasons[over]}, and it carries"
                    f" {candidates[k].name!r}: coupled joints can't be used; {HINT}"
                )
    if not kept and reasons:
        why = ", ".join(list(dict.fromkeys(reasons.values()))[:4])
        raise RobotError(f"{source}: no joint is left that moves on its own: {why}")
    if not kept:
        raise RobotError(
            f"{source}: no moving joint; a robot needs at least one revolute, continuous or prismatic joint"
        )
    given = {k: selection.held.get(candidates[k].name, 0.0) for k in range(len(candidates)) if k not in kept}
    positions = {k: _following(followers, given, k) if k in followers else position for k, position in given.items()}
    return positions, _note(candidates, positions, reasons if not selection.keep else {})


def sub_chain(robot: Robot, names: Iterable[str] = (), held: Mapping[str, float] | None = None) -> Robot:
    """The robot with the named joints alone, in its own order; every other one is fixed where `held` says [rad or m].

    Links of held joints join those that carry them, or are dropped on the base, which no torque feels. Without
    names, all joints that `held` does not mention are kept. The tool stays if the last joint does, or moves with it.
    RobotError for unknown names, and where a kept joint is coupled with a held one by the transmission.
    """
    source = robot.source or robot.name
    candidates = [Candidate(joint.name, joint.parent) for joint in robot.joints]
    positions, note = held_joints(candidates, (), Selection(tuple(names), held or {}), source)
    if not positions:
        return robot
    entries = [
        Entry(_fixed(joint, positions[k]) if k in positions else joint, joint.parent)
        for k, joint in enumerate(robot.joints)
    ]
    joints, tail = merge_fixed(entries)
    last = robot.n - 1
    carried = last not in positions or _carrier(robot, last, positions) == max(set(range(robot.n)) - set(positions))
    return replace(
        robot,
        joints=joints,
        tool=to_matrix(tail @ np.array(robot.tool)) if carried else IDENTITY,
        transmission=_reduced(robot, set(positions), source),
        note=" ".join(filter(None, (robot.note, note))),
    )


def _above(candidates: Sequence[Candidate], k: int) -> Iterable[int]:
    """The joints that carry joint k, nearest first."""
    while (k := candidates[k].parent) >= 0:
        yield k


def _following(followers: Mapping[int, Coupling], positions: Mapping[int, float], k: int) -> float:
    """Position of a joint that follows others, which may follow in turn; a circle of them starts at 0."""
    chain: list[Coupling] = []
    while k in followers and followers[k] not in chain:
        chain.append(followers[k])
        k = chain[-1].leader
    position = 0.0 if k < 0 or k in followers else positions[k]
    for coupling in reversed(chain):
        away = position - coupling.reference if coupling.leader >= 0 else 0.0
        position = sum(c * away**i for i, c in enumerate(coupling.coefficients))
    return position


def _note(candidates: Sequence[Candidate], positions: Mapping[int, float], reasons: Mapping[int, str]) -> str:
    positions = {k: position for k, position in positions.items() if not candidates[k].always_held}
    if not positions:
        return ""
    whys = list(dict.fromkeys(reasons[k] for k in positions if k in reasons))
    because = f" ({', '.join(whys)})" if whys else ""
    listed = ", ".join(f"{candidates[k].name!r} at {position:g}" for k, position in positions.items())
    return f"Held fixed, their links part of those that carry them: {listed}{because}."


def _fixed(joint: Joint, position: float) -> Joint:
    turn, slide = (position, 0.0) if joint.revolute else (0.0, position)
    return replace(joint, type="fixed", theta=joint.theta + turn, r=joint.r + slide)


def _carrier(robot: Robot, k: int, held: Mapping[int, float]) -> int:
    while k in held:
        k = robot.joints[k].parent
    return k


def _reduced(robot: Robot, held: set[int], source: str) -> Transmission | None:
    if robot.transmission is None:
        return None
    matrix = robot.transmission.matrix
    kept = [k for k in range(robot.n) if k not in held]
    for motor in held:
        for k in kept:
            if matrix[motor][k]:
                names = robot.joint_names
                raise RobotError(
                    f"{source}: --joints: the motor of {names[motor]!r} turns with {names[k]!r}; keep both, or neither"
                )
    motors = robot.transmission.motors
    reduced = tuple(tuple(matrix[row][k] for k in kept) for row in kept)
    return Transmission(reduced, tuple(motors[k] for k in kept) if motors else ())
