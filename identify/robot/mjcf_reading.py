"""Robots from MJCF, resolved by MuJoCo's own compiler: classes, frames, orientations and inertias mean what it says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import RobotError
from identify.robot.files import read_text
from identify.robot.frames import Body, robot_from_bodies, robot_from_frames
from identify.robot.mjcf_compile import Compiled, compile_mjcf
from identify.robot.mjcf_drives import drive, limits
from identify.robot.mjcf_source import mjcf_source
from identify.robot.robot import PRISMATIC, REVOLUTE, Link, Robot
from identify.robot.selection import Candidate, Coupling, Selection, held_joints
from identify.robot.transforms import inverse, make_link, merge_links, move_link, parameters

EXACT = 1e-12
"""How near an axis must be to z, and its anchor to the origin, for a body's frame to serve as R_j."""


def read_mjcf(
    text: str | Path,
    source: str = "",
    selection: Selection | None = None,
    gravity: Sequence[float] | None = None,
    folder: Path | None = None,
) -> Robot:
    """Robot from MJCF text, or from the file at a `Path`; q, dq and ddq are the MJCF's own joint variables, `ref`
    included: at q = ref the arm stands as the file draws it.

    selection: joints to keep, by default all hinges and slides but those that an equality couples, which are held as
    identify.robot.selection says. gravity (3,): acceleration in the world [m/s²], by default the file's. folder: where
    included files are looked for.
    `armature` is the drive's inertia, `damping` its viscous and `frictionloss` its Coulomb friction; armature and
    damping of actuators count with the square of their gear. Ranges are position limits, force ranges effort limits.
    Welded bodies are merged. A free body that carries joints is the base, fixed where the file draws it; one that
    carries none is left out. Meshes are not read: a body that only they give inertia has none that is known.
    Body frames that are modified Denavit-Hartenberg ones, as identify.robot.mjcf writes them, are kept; others are
    replaced as in identify.robot.frames. `Robot.base` places R_0 in the world.
    Raises RobotError, in one line, for anything that is no such model.
    """
    if isinstance(text, Path):
        source, folder = source or str(text), folder or text.parent
        text = read_text(text)
    source = source or "robot"
    reduced = mjcf_source(text, source, folder)
    compiled = compile_mjcf(reduced.text, source)
    model = compiled.model
    import mujoco

    names = _names(model)
    couplings = _couplings(model, names)
    index = {name: k for k, name in enumerate(names)}
    couplings += [Coupling(tuple(index[n] for n in tied if n in index), why) for tied, why in reduced.tied]
    candidates = _candidates(model, names)
    choice = selection or Selection()
    held, note = held_joints(candidates, couplings, choice, source)
    scalar = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    for name in choice.held:
        if name in index and model.jnt_type[index[name]] not in scalar:
            raise RobotError(f"{source}: --joints: {name!r} is no hinge or slide; it takes no position")

    data = mujoco.MjData(model)
    for k in range(model.njnt):
        if model.jnt_type[k] in scalar:
            data.qpos[model.jnt_qposadr[k]] = held.get(k, 0.0)
    mujoco.mj_kinematics(model, data)
    kept = [k for k in range(model.njnt) if k not in held]
    bodies, tip = _bodies(compiled, data, kept, names)
    notes = [note, *_notes(compiled, kept, names)]
    if gravity is None:
        off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        gravity = (0.0, 0.0, 0.0) if off else tuple(float(x) for x in model.opt.gravity)
    told = " ".join(filter(None, notes))
    own = _own_frames(model, data, kept, bodies)
    if own is not None:
        return robot_from_frames(reduced.name, bodies, own, np.eye(4), gravity, tip, source, told)
    return robot_from_bodies(reduced.name, bodies, gravity, tip, source, told)


def _names(model: Any) -> list[str]:
    """(njnt,) names of the joints; those without one get one of their own."""
    given = [model.joint(k).name for k in range(model.njnt)]
    names: list[str] = []
    for k, name in enumerate(given):
        made = name or f"joint_{k + 1}"
        while not name and (made in given or made in names):
            made += "_"
        names.append(made)
    return names


def _last_joints(model: Any) -> list[int]:
    """(nbody,) the last joint of each body, or of the nearest one above that has any, -1 for the world."""
    last = [-1] * model.nbody
    for body in range(1, model.nbody):
        count = model.body_jntnum[body]
        last[body] = int(model.body_jntadr[body] + count - 1) if count else last[model.body_parentid[body]]
    return last


def _candidates(model: Any, names: Sequence[str]) -> list[Candidate]:
    import mujoco

    last = _last_joints(model)
    candidates = []
    for k, name in enumerate(names):
        body = model.jnt_bodyid[k]
        first = k == model.body_jntadr[body]
        parent = last[model.body_parentid[body]] if first else k - 1
        free = model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE
        ball = model.jnt_type[k] == mujoco.mjtJoint.mjJNT_BALL
        why = "a free joint can't be used" if free else "a ball joint can't be used" if ball else ""
        candidates.append(Candidate(name, parent, why, always_held=bool(free)))
    return candidates


def _couplings(model: Any, names: Sequence[str]) -> list[Coupling]:
    """Joints that equalities of joints, bodies and sites, where they are active, keep from moving on their own."""
    import mujoco

    kind, last = mujoco.mjtEq, _last_joints(model)
    couplings: list[Coupling] = []
    for i in np.flatnonzero(model.eq_active0):
        one, two = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        if model.eq_type[i] == kind.mjEQ_JOINT:
            zero, *rest = (float(x) for x in model.eq_data[i][:5])
            reference = float(model.qpos0[model.jnt_qposadr[two]]) if two >= 0 else 0.0
            start = float(model.qpos0[model.jnt_qposadr[one]])
            why = f"{names[one]!r} follows {names[two]!r}" if two >= 0 else f"an equality holds {names[one]!r}"
            pair = (one, two) if two >= 0 else (one,)
            couplings.append(Coupling(pair, why, one, two, (start + zero, *rest), reference))
        elif int(model.eq_type[i]) in (int(kind.mjEQ_CONNECT), int(kind.mjEQ_WELD)):
            if model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
                one, two = int(model.site_bodyid[one]), int(model.site_bodyid[two])
            if model.body_mocapid[one] >= 0 or model.body_mocapid[two] >= 0:
                continue
            above = [_joints_above(model, last, last[body]) for body in (one, two)]
            members = tuple(sorted(set(above[0]) ^ set(above[1])))
            if members and not any(model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE for k in members):
                ends = " and ".join(repr(model.body(body).name) for body in (one, two))
                couplings.append(Coupling(members, f"an equality closes a loop between bodies {ends}"))
    return couplings


def _joints_above(model: Any, last: Sequence[int], joint: int) -> list[int]:
    """The joint and those that carry it, nearest first; `last` as `_last_joints` gives it."""
    found = []
    while joint >= 0:
        found.append(joint)
        body = model.jnt_bodyid[joint]
        joint = joint - 1 if joint > model.body_jntadr[body] else last[model.body_parentid[body]]
    return found


def _bodies(compiled: Compiled, data: Any, kept: Sequence[int], names: Sequence[str]) -> tuple[list[Body], np.ndarray]:
    """The kept joints with their links, at q = 0 in the world, and the frame (4, 4) of the last body that moves."""
    import mujoco

    model = compiled.model
    bodies: list[Body] = []
    carrier = [-1] * model.nbody
    tip = np.eye(4)
    chosen = set(kept)
    for b in range(1, model.nbody):
        anchor = carrier[model.body_parentid[b]]
        own = _frame(data.xpos[b], data.xmat[b])
        first = int(model.body_jntadr[b])
        for k in range(first, first + model.body_jntnum[b]) if first >= 0 else ():
            if k not in chosen:
                continue
            frame = _frame(data.xanchor[k], data.xmat[b])
            axis = frame[:3, :3].T @ data.xaxis[k]
            kind = REVOLUTE if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE else PRISMATIC
            bodies.append(
                Body(names[k], kind, anchor, frame, axis, Link(), limits(model, k), drive(model, k)),
            )
            anchor = len(bodies) - 1
        carrier[b] = anchor
        if anchor < 0:
            continue
        if anchor == len(bodies) - 1:
            tip = own
        if b not in compiled.unknown:
            inertia = make_link(float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b]))
            placed = inverse(bodies[anchor].frame) @ _frame(data.xipos[b], data.ximat[b])
            link = merge_links(bodies[anchor].link, move_link(inertia, placed))
            bodies[anchor] = replace(bodies[anchor], link=link)
    return bodies, tip


def _own_frames(model: Any, data: Any, kept: Sequence[int], bodies: Sequence[Body]) -> list[np.ndarray] | None:
    """The bodies' own frames (4, 4) at q = 0, if all are modified Denavit-Hartenberg ones, one joint to a body."""
    frames: list[np.ndarray] = []
    children: set[int] = set()
    for k, body in zip(kept, bodies, strict=True):
        b = model.jnt_bodyid[k]
        frame = _frame(data.xpos[b], data.xmat[b])
        if model.body_jntnum[b] > 1 or np.linalg.norm(body.axis - (0, 0, 1)) > EXACT:
            return None
        if np.linalg.norm(body.point - data.xpos[b]) > EXACT * (1 + np.linalg.norm(body.point)):
            return None
        parent = frames[body.parent] if body.parent >= 0 else np.eye(4)
        if body.parent not in children and any(parameters(inverse(parent) @ frame)[:2]):
            return None
        children.add(body.parent)
        frames.append(frame)
    return frames


def _notes(compiled: Compiled, kept: Sequence[int], names: Sequence[str]) -> list[str]:
    """What the reader of the robot must know about what was read otherwise than MuJoCo would simulate it."""
    import mujoco

    model = compiled.model
    notes = []
    roots = {int(model.body_rootid[model.jnt_bodyid[k]]) for k in kept}
    for k in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        body = int(model.jnt_bodyid[k])
        below = body in roots
        name = model.body(body).name
        notes.append(
            f"Body {name!r} floats in the file; it is taken for a fixed base, where the file draws it."
            if below
            else f"Body {name!r} floats on its own and is left out."
        )
    if compiled.from_meshes:
        listed = ", ".join(map(repr, compiled.from_meshes))
        notes.append(f"Meshes are not read: the inertia that they give to {listed} is not known.")
    dofs = model.jnt_dofadr[list(kept)]
    for what, found in (
        ("springs", np.flatnonzero(model.jnt_stiffness[list(kept)])),
        ("nonlinear damping", np.flatnonzero(np.any(model.dof_dampingpoly[dofs], axis=1))),
    ):
        if len(found):
            listed = ", ".join(repr(names[kept[int(j)]]) for j in found)
            notes.append(f"The model has no {what}; the file gives {listed} some.")
    return notes


def _frame(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(4, 4) from MuJoCo's position (3,) and row-wise rotation (9,)."""
    frame = np.eye(4)
    frame[:3, :3] = np.asarray(rotation).reshape(3, 3)
    frame[:3, 3] = position
    return frame
