"""Inverse geometric model: every joint position that brings the tool to a pose, by Paul's method or by numbers.

Singular poses leave an angle undetermined: it keeps its current value, and nothing is divided by zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from identify.errors import InputError
from identify.robot.robot import Joint, Robot
from identify.robot.transforms import joint_transform, parameters, placement, to_matrix
from identify.symbolic.equations import Unknown
from identify.symbolic.geometry import direct_geometry, serial
from identify.symbolic.numerical_inverse import refine, search
from identify.symbolic.paul import Plan, Stage, core, plan
from identify.symbolic.trigonometry import evaluate

TOLERANCE = 1e-9
"""Largest entry of (reached − wanted pose) that a solution may have [m, 1]."""

UNDETERMINED = 1e-10
"""Share of the terms' magnitude below which the factors of an unknown count as zero: any value will do."""

EDGE = 1e-7
"""How far below zero, relative, the square under a root may lie: rounding at the edge of the workspace."""

SAME = 1e-7
"""Solutions closer than this [rad or m] are one."""

TRIALS = 16
TRIAL_ERROR = 1e-5
"""Poses that Paul's method is tried on before it is used, and how well it must find their joint positions [rad, m]."""

BLOCK = 2048


@dataclass(frozen=True)
class Solution:
    """One solution of the inverse geometric model.

    q (n,) [rad or m], a full turn added where only that brings a joint inside its limits; inside_limits;
    residual: largest entry of the reached pose minus the wanted one; method: "Paul" or "numerical".
    """

    q: np.ndarray
    inside_limits: bool
    residual: float
    method: str


@dataclass(frozen=True)
class Solutions:
    """Solutions for many poses: row k, q (K, n), is for pose `pose[k]`; residual, inside_limits (K,); see Solution."""

    pose: np.ndarray
    q: np.ndarray
    residual: np.ndarray
    inside_limits: np.ndarray
    method: str


def inverse_geometry(
    robot: Robot,
    pose: np.ndarray,
    current: Sequence[float] | np.ndarray | None = None,
    fixed: Mapping[int, float] | None = None,
) -> list[Solution]:
    """All solutions that bring the tool to `pose` (4, 4) in the world (Z ⁰T_n E = pose [2.10]).

    current (n,): position now (0 if not given); joints that the pose leaves undetermined keep it. fixed: joint
    index -> position, for a robot of more than six joints (the chapter's first strategy). No solution: empty list.
    With fewer than six joints the pose must suit the robot, see `conditions`; else there is no solution.
    """
    found = inverse_geometries(robot, np.asarray(pose, dtype=float)[None], current, fixed)
    rows = zip(found.q, found.inside_limits, found.residual, strict=True)
    return [Solution(q, bool(inside), float(residual), found.method) for q, inside, residual in rows]


def inverse_geometries(
    robot: Robot,
    poses: np.ndarray,
    current: Sequence[float] | np.ndarray | None = None,
    fixed: Mapping[int, float] | None = None,
) -> Solutions:
    """`inverse_geometry` for many poses (N, 4, 4), with current (n,) or (N, n)."""
    poses = np.asarray(poses, dtype=float)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise InputError(f"{robot.name}: poses have shape {poses.shape}; give (4, 4) homogeneous matrices")
    if not np.all(np.isfinite(poses)):
        raise InputError(f"{robot.name}: the pose holds numbers that are not finite; give a rotation and a position")
    turn = poses[:, :3, :3]
    if np.abs(np.swapaxes(turn, 1, 2) @ turn - np.eye(3)).max(initial=0.0) > 1e-6 or np.any(np.linalg.det(turn) < 0):
        raise InputError(f"{robot.name}: the upper left of the pose is no rotation; give orthonormal columns s, n, a")
    now = np.zeros(robot.n) if current is None else np.asarray(current, dtype=float)
    if now.shape not in {(robot.n,), (len(poses), robot.n)}:
        raise InputError(f"{robot.name}: current has shape {now.shape}; give one position for each of {robot.n} joints")
    now = np.broadcast_to(now, (len(poses), robot.n))
    fixed = dict(fixed or {})
    missing = robot.n - len(fixed) - 6
    if missing > 0:
        raise InputError(
            f"{robot.name}: {robot.n} joints for six coordinates leave {missing} relation{'s' * (missing > 1)} missing;"
            " hold as many joints still (fixed = {index: position}, --joints NAME=POSITION) or use inverse kinematics"
            " with an optimisation term"
        )
    if not fixed:
        return _solve(robot, poses, now)
    reduced, moving = with_fixed(robot, fixed)
    found = _solve(reduced, poses, now[:, moving])
    q = np.empty((len(found.q), robot.n))
    q[:, moving] = found.q
    inside = found.inside_limits
    for j, value in fixed.items():
        q[:, j] = value
        low, high = robot.joints[j].limits.position
        inside = inside & (low <= value <= high)
    return replace(found, q=q, inside_limits=inside)


def with_fixed(robot: Robot, fixed: Mapping[int, float]) -> tuple[Robot, list[int]]:
    """The robot with some joints (index -> position) made rigid, and the indices of those that still move."""
    serial(robot)
    if not all(0 <= j < robot.n for j in fixed):
        raise InputError(f"{robot.name}: fixed names a joint outside 0 to {robot.n - 1}")
    joints: list[Joint] = []
    moving: list[int] = []
    ahead = np.eye(4)
    for j, joint in enumerate(robot.joints):
        if j in fixed:
            ahead = ahead @ joint_transform(joint, fixed[j])
            continue
        own = placement(joint.gamma, joint.b, joint.alpha, joint.d, joint.theta, joint.r)
        merged = joint
        if not np.array_equal(ahead, np.eye(4)):
            gamma, b, alpha, d, theta, r = parameters(ahead @ own)
            merged = replace(joint, gamma=gamma, b=b, alpha=alpha, d=d, theta=theta, r=r, symbols=())
        joints.append(replace(merged, parent=len(joints) - 1))
        moving.append(j)
        ahead = np.eye(4)
    tool = to_matrix(ahead @ np.array(robot.tool))
    return replace(robot, joints=tuple(joints), tool=tool, transmission=None), moving


def _solve(robot: Robot, poses: np.ndarray, current: np.ndarray) -> Solutions:
    """Paul's method where it finds every joint, else the numerical search; spurious solutions dropped."""
    paul = plan(robot)
    numerical = not reliable(robot)
    inner = core(robot)
    wanted = inner.before @ poses @ inner.after
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for start in range(0, len(poses), BLOCK):
        block = wanted[start : start + BLOCK]
        now = current[start : start + BLOCK]
        if numerical:
            found = [search(inner.robot, pose, q) for pose, q in zip(block, now, strict=True)]
            index = np.repeat(np.arange(len(block)), [len(q) for q in found])
            q = np.concatenate(found) if found else np.empty((0, robot.n))
        else:
            index, q = run(paul, block, now)
        q, residual = refine(inner.robot, q, block[index])
        good = residual <= TOLERANCE
        index, q, residual = _distinct(robot, index[good], q[good], residual[good])
        parts.append((index + start, q, residual))
    index, q, residual = (np.concatenate(x) for x in zip(*parts, strict=True)) if parts else _none(robot.n)
    q, inside = _inside(robot, q, current[index])
    return Solutions(index, q, residual, inside, "numerical" if numerical else "Paul")


@lru_cache(maxsize=16)
def reliable(robot: Robot) -> bool:
    """Whether Paul's method finds every joint, and finds again the positions behind a few poses it is tried on."""
    paul = plan(robot)
    if paul.missing:
        return False
    inner = paul.core.robot
    q = np.random.default_rng(21).uniform(-2.5, 2.5, (TRIALS, robot.n))
    poses = direct_geometry(inner, q, robot.n - 1)
    index, found = run(paul, poses, np.zeros_like(q))
    nearest = np.full(TRIALS, np.inf)
    np.minimum.at(nearest, index, np.abs(differences(robot, found, q[index])).max(axis=1, initial=0.0))
    return bool(np.all(nearest < TRIAL_ERROR))


def differences(robot: Robot, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, n) a − b, angles brought into [−π, π)."""
    turning = np.array([joint.revolute for joint in robot.joints])
    apart = a - b
    return np.where(turning, np.remainder(apart + np.pi, 2 * np.pi) - np.pi, apart)


def _none(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.empty(0, dtype=int), np.empty((0, n)), np.empty(0)


def _distinct(
    robot: Robot, index: np.ndarray, q: np.ndarray, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Each solution once, ordered by pose."""
    order = np.argsort(index, kind="stable")
    index, q, residual = index[order], q[order], residual[order]
    keep = np.ones(len(q), dtype=bool)
    counts = np.bincount(index) if len(index) else np.empty(0, dtype=int)
    for shift in range(1, int(counts.max(initial=1))):
        apart = differences(robot, q[shift:], q[:-shift])
        same = (index[shift:] == index[:-shift]) & (np.abs(apart).max(axis=1, initial=0.0) < SAME)
        # A solution goes only if an earlier one that stays is the same.
        keep[shift:] &= ~(same & keep[:-shift])
    return index[keep], q[keep], residual[keep]


def _inside(robot: Robot, q: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """q with whole turns added where that brings a joint inside its limits (nearest to now), and what is inside."""
    q = q.copy()
    inside = np.ones(len(q), dtype=bool)
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position
        slack = TOLERANCE
        if joint.revolute:
            q[:, j] = np.pi - np.remainder(np.pi - q[:, j], 2 * np.pi)
            best = np.full(len(q), np.inf)
            chosen = q[:, j].copy()
            reach = 2 if np.isfinite(low) and np.isfinite(high) else 0
            for turns in sorted(range(-reach, reach + 1), key=abs):
                moved = q[:, j] + 2 * np.pi * turns
                cost = np.where((moved >= low - slack) & (moved <= high + slack), np.abs(moved - current[:, j]), np.inf)
                chosen = np.where(cost < best - slack, moved, chosen)
                best = np.minimum(best, cost)
            q[:, j] = chosen
        inside &= (q[:, j] >= low - slack) & (q[:, j] <= high + slack)
    return q, inside


@dataclass(frozen=True)
class _State:
    """Branches on their way: values (generators, M), angles found (M,) each, and (M,) which pose they belong to."""

    values: np.ndarray
    angles: dict[Unknown, np.ndarray]
    index: np.ndarray


def run(paul: Plan, poses: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(M,) pose index and (M, n) q of every branch of the plan, for poses U0 (N, 4, 4) and current (N, n)."""
    robot = paul.core.robot
    values = paul.space.sample(current, poses)
    state = _State(values, {}, np.arange(len(poses)))
    for stage in paul.stages:
        state = _advance(paul, state, stage, current)
    q = np.empty((len(state.index), robot.n))
    for j, joint in enumerate(robot.joints):
        q[:, j] = state.angles[((j, 1),) if joint.revolute else j]
    return state.index, q


def _advance(paul: Plan, state: _State, stage: Stage, current: np.ndarray) -> _State:
    """The step solved on every branch: branches double where it has two solutions and end where it has none."""
    step = stage.step
    parts = [evaluate(p, state.values) for p in step.coefficients]
    sizes = [np.maximum(size, usual) for (_, size), usual in zip(parts, stage.sizes, strict=True)]
    now = _current(step.unknown, current[state.index])
    answers = _SOLVERS[step.type]([v for v, _ in parts], sizes, now)
    pieces = []
    for answer in answers:
        alive = np.isfinite(answer)
        values = state.values[:, alive]
        angles = {u: a[alive] for u, a in state.angles.items()}
        angles[step.unknown] = answer[alive]
        pieces.append(_State(values, angles, state.index[alive]))
    merged = _State(
        np.concatenate([p.values for p in pieces], axis=1),
        {u: np.concatenate([p.angles[u] for p in pieces]) for u in pieces[0].angles},
        np.concatenate([p.index for p in pieces]),
    )
    if isinstance(step.unknown, int):
        merged.values[paul.space.prismatic[step.unknown]] = merged.angles[step.unknown]
    for found in stage.derived:
        total = sum(factor * merged.angles[angle] for angle, factor in found.terms)
        merged.angles[found.angle] = np.asarray(total)
        c, s = paul.space.angles[found.angle]
        merged.values[c], merged.values[s] = np.cos(total), np.sin(total)
    return merged


def _current(unknown: Unknown, current: np.ndarray) -> np.ndarray:
    """(M,) current value of a joint variable or of a sum of them."""
    if isinstance(unknown, int):
        return current[:, unknown]
    return np.asarray(sum(sign * current[:, j] for j, sign in unknown))


def _small(value: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.abs(value) <= UNDETERMINED * size + np.finfo(float).tiny


def _ratio(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """above / below, NaN where below is zero."""
    return np.divide(above, below, out=np.full(np.shape(above), np.nan), where=below != 0)


def _solve_1(v: list[np.ndarray], size: list[np.ndarray], now: np.ndarray) -> list[np.ndarray]:
    """X r = Y, by least squares where several hold."""
    xx = sum(x * x for x in v[::2])
    free = np.all([_small(x, s) for x, s in zip(v[::2], size[::2], strict=True)], axis=0)
    return [np.where(free, now, _ratio(np.asarray(sum(x * y for x, y in zip(v[::2], v[1::2], strict=True))), xx))]


def _solve_2(v: list[np.ndarray], size: list[np.ndarray], now: np.ndarray) -> list[np.ndarray]:
    """X Sθ + Y Cθ = Z: θ = atan2(S, C) with two signs of the root."""
    (x, y, z), (sx, sy, sz) = v, size
    square = x * x + y * y
    scale = np.maximum(np.maximum(sx, sy), sz)
    free = _small(np.sqrt(square), scale)
    under = square - z * z
    under = np.where((under < 0) & (under > -EDGE * square), 0.0, under)
    none = (under < 0) | (free & ~_small(z, scale))
    root = np.sqrt(np.maximum(under, 0.0))
    found = []
    for sign in (1.0, -1.0):
        angle = np.arctan2(x * z + sign * y * root, y * z - sign * x * root)
        found.append(np.where(none, np.nan, np.where(free, now, angle)))
    return found


def _solve_3(v: list[np.ndarray], size: list[np.ndarray], now: np.ndarray) -> list[np.ndarray]:
    """Two equations X Sθ + Y Cθ = Z in one angle."""
    x1, y1, z1, x2, y2, z2 = v
    det = x1 * y2 - x2 * y1
    scale = size[0] * size[4] + size[3] * size[1]
    sense = np.sign(det)
    angle = np.arctan2(sense * (z1 * y2 - z2 * y1), sense * (x1 * z2 - x2 * z1))
    return [np.where(_small(det, scale), now, angle)]


def _solve_9(v: list[np.ndarray], size: list[np.ndarray], now: np.ndarray) -> list[np.ndarray]:
    """A C² + B C S + D C + E S + F = 0: the roots of a quartic in e^{iθ} that lie on the unit circle."""
    a, b, d, e, f = v
    rows = np.stack([(a - 1j * b) / 4, (d - 1j * e) / 2, a / 2 + f, (d + 1j * e) / 2, (a + 1j * b) / 4], axis=1)
    found = np.full((4, len(now)), np.nan)
    for k, row in enumerate(rows):
        scale = np.abs(row).max()
        if scale <= UNDETERMINED * max(float(s[k]) for s in size):
            found[0, k] = now[k]
            continue
        roots = np.roots(np.where(np.abs(row) > 1e-14 * scale, row, 0))
        roots = roots[np.abs(np.abs(roots) - 1) < 1e-4]
        found[: len(roots), k] = np.angle(roots)
    return list(found)


def _solve_10(v: list[np.ndarray], size: list[np.ndarray], now: np.ndarray) -> list[np.ndarray]:
    """A r² + B r + C = 0."""
    a, b, c = v
    under = b * b - 4 * a * c
    under = np.where((under < 0) & (under > -EDGE * b * b), 0.0, under)
    none = under < 0
    half = -0.5 * (b + np.where(b < 0, -1.0, 1.0) * np.sqrt(np.maximum(under, 0.0)))
    free = _small(a, size[0]) & _small(b, size[1])
    first = np.where(free, np.where(_small(c, size[2]), now, np.nan), _ratio(c, half))
    return [np.where(none, np.nan, first), np.where(none | free, np.nan, _ratio(half, a))]


_SOLVERS = {1: _solve_1, 2: _solve_2, 3: _solve_3, 9: _solve_9, 10: _solve_10}
