"""Whether motion and effort of a log belong together, by a quick torque model: delay, signs, swaps, excitation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from identify.logs.finding import ERROR, KEPT, REFUSED, WARNING, Finding
from identify.logs.log import Log
from identify.logs.triage import STILL_RANGE, Findings, inspect, refusals
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot
from identify.validation.log_rows import SHIFTS_S, Equations, Rows, equations, rows_of

SUSPICIOUS = 0.25
"""Share of a joint's effort that its model leaves, from which other readings of the log are tried."""
IMPLAUSIBLE = 1.5
"""Ratio of squared residuals, with and without friction and inertia held positive, from which they are tried."""
FAR_BETTER = 0.25
"""Ratio of squared residuals from which another reading of the log is the right one."""
STEP_BETTER = 0.7
"""The same of one fault among several, which together have to be far better."""
AS_GOOD = 1.5
"""Readings whose squared residuals are within this ratio can't be told apart."""
MOST_FAULTS = 3
BETTER = 0.8
"""Ratio of squared residuals from which a shift of the effort is real."""
ALONE_BETTER = 0.5
"""The same for the effort of one joint among several, which chance favours as often."""
CERTAIN = 5.0
"""A delay is so many of its own standard errors long, those of its parts."""
SHIFT_STEP_S = 0.005
PARTS = 6
POSES = 100
WRONG_UNIT = 3.0
"""Ratio of effort and description, or its inverse, from which the effort is in another unit."""
TOLD = 0.5
"""Share of an effort's variation that the description explains, from which their ratio means something."""


@dataclass(frozen=True)
class _Reading:
    """One way to read a log: joint j moved as sign[j] × position order[j], by the effort flip[j] × effort taken[j]."""

    words: str
    joints: tuple[str, ...]
    kind: str
    order: np.ndarray
    sign: np.ndarray
    taken: np.ndarray
    flip: np.ndarray

    def effort(self, measured: np.ndarray) -> np.ndarray:
        return self.flip * measured[:, self.taken]

    def after(self, other: _Reading) -> _Reading:
        """This reading of what `other` reads."""
        return _Reading(
            self.words,
            self.joints,
            self.kind,
            other.order[self.order],
            self.sign * other.sign[self.order],
            other.taken[self.taken],
            self.flip * other.flip[self.taken],
        )


@dataclass(frozen=True)
class _Judged:
    reading: _Reading
    squares: float
    equations: Equations
    residual: np.ndarray


def look_over(log: Log, robot: Robot | None = None, regressor: Regressor | None = None) -> Findings:
    """Everything that is odd about a log: by itself, and with a robot by its limits and dynamics.

    log: with a robot, of its joints in its order. regressor: the robot's, where there is one already. A log that is
    refused by itself is not held against the dynamics: they would find the same again.
    """
    if robot is None:
        return inspect(log)
    found = inspect(log, {joint.name: joint.limits for joint in robot.joints})
    if refusals(found):
        return found
    more = check_log(log, regressor or Regressor(robot))
    return replace(found, findings=(*found.findings, *more))


def check_log(log: Log, regressor: Regressor) -> list[Finding]:
    """Findings that need the robot's dynamics; log: of the robot's joints in its order.

    None where the log has no effort or is too short. A log of whatever motion serves: what it does not tell is left.
    """
    if log.effort is None or not (np.isfinite(log.position).all() and np.isfinite(log.effort).all()):
        return []
    if log.samples < 100 or (np.ptp(log.position, axis=0) <= STILL_RANGE).all():
        return []
    rows = rows_of(log)
    if rows is None or rows.counted.sum() <= 2 * regressor.p:
        return []
    judged, findings = _readings(regressor, rows, rows.effort())
    if findings:
        return findings
    delay, findings = _delay(regressor, rows, judged.equations, log)
    findings += [] if findings else _unexplained(regressor, judged)
    measured = rows.effort(delay)
    findings += _units(regressor, rows, measured)
    return findings + _excitation(regressor, rows, judged.equations, judged.equations.side(measured))


def _judge(regressor: Regressor, rows: Rows, measured: np.ndarray, reading: _Reading) -> _Judged:
    built = equations(regressor, rows.changed(reading.order, reading.sign))
    effort = reading.effort(measured)
    b = built.side(effort)
    residual = b - built.matrix @ built.parameters(b)
    return _Judged(reading, float(residual @ residual), built, residual)


def _readings(regressor: Regressor, rows: Rows, measured: np.ndarray) -> tuple[_Judged, list[Finding]]:
    """The log as it is, judged, and the signs and swaps that explain it far better."""
    n, names = regressor.robot.n, regressor.robot.joint_names
    same, ones = np.arange(n), np.ones(n)
    as_is = _judge(regressor, rows, measured, _Reading("", (), "", same, ones, same, ones))
    best, findings = as_is, []
    for _ in range(MOST_FAULTS):
        if not _doubtful(best, measured):
            break
        tried = [_judge(regressor, rows, measured, other.after(best.reading)) for other in _others(names)]
        least = min(judged.squares for judged in tried)
        if not least < STEP_BETTER * best.squares:
            break
        as_good = [judged for judged in tried if judged.squares <= AS_GOOD * least]
        as_good.sort(key=lambda judged: judged.squares)
        gain = f"with it mended, the motion explains the effort {np.sqrt(best.squares / least):.1f} times better"
        words = ", or ".join(judged.reading.words for judged in as_good[:3])
        joints = tuple(dict.fromkeys(name for judged in as_good[:3] for name in judged.reading.joints))
        findings.append(Finding(as_good[0].reading.kind, ERROR, f"{words}: {gain}", REFUSED, joints))
        best = as_good[0]
    return as_is, findings if best.squares < FAR_BETTER * as_is.squares else []


def _doubtful(judged: _Judged, measured: np.ndarray) -> bool:
    """Whether the model leaves much of a joint's effort, or needs negative friction or inertia to leave little."""
    shares = judged.equations.shares(judged.residual)
    if np.nanmax(shares) > SUSPICIOUS:
        return True
    free = judged.equations.residual(judged.equations.side(judged.reading.effort(measured)))
    return judged.squares > IMPLAUSIBLE * float(free @ free)


def _others(names: tuple[str, ...]) -> list[_Reading]:
    """Every sign and every swap of two joints."""
    n = len(names)
    same, ones = np.arange(n), np.ones(n)
    found = []
    for j, name in enumerate(names):
        flipped = ones.copy()
        flipped[j] = -1
        found.append(_Reading(f"the effort of {name} has the wrong sign", (name,), "sign", same, ones, same, flipped))
        found.append(_Reading(f"the position of {name} has the wrong sign", (name,), "sign", same, flipped, same, ones))
        both = f"position and effort of {name} have the wrong sign"
        found.append(_Reading(both, (name,), "sign", same, flipped, same, flipped))
    if n > 1:
        found.append(_Reading("every effort has the wrong sign", names, "sign", same, ones, same, -ones))
    for a, b in combinations(range(n), 2):
        swap = same.copy()
        swap[[a, b]] = b, a
        pair = (names[a], names[b])
        told = f"{names[a]} and {names[b]} are swapped"
        found.append(_Reading(told, pair, "swap", swap, ones, swap, ones))
        found.append(_Reading(f"the efforts of {told}", pair, "swap", same, ones, swap, ones))
        found.append(_Reading(f"the positions of {told}", pair, "swap", swap, ones, same, ones))
    return found


def _unexplained(regressor: Regressor, judged: _Judged) -> list[Finding]:
    shares = judged.equations.shares(judged.residual)
    names = regressor.robot.joint_names
    poor = [j for j in np.flatnonzero(np.isfinite(shares)) if shares[j] > 2 * SUSPICIOUS]
    if not poor:
        return []
    told = ", ".join(f"{names[j]} ({100 * shares[j]:.0f} %)" for j in poor)
    text = (
        f"the motion leaves much of the effort unexplained in {told}: is it a command, filtered, of another joint, "
        "or does something touch the arm?"
    )
    return [Finding("unexplained effort", WARNING, text, KEPT, tuple(names[j] for j in poor))]


def _delay(regressor: Regressor, rows: Rows, built: Equations, log: Log) -> tuple[float, list[Finding]]:
    """Delay of the effort behind the position that all joints share [s], and what there is to say of delays."""
    names = regressor.robot.joint_names
    shifts = np.arange(-SHIFTS_S, SHIFTS_S + 1e-9, SHIFT_STEP_S)
    sides = [built.side(rows.effort(shift)) for shift in shifts]
    squares = np.array([float(r @ r) for r in map(built.residual, sides)])
    none = squares[len(shifts) // 2]
    common = _lowest(shifts, squares)
    step = float(np.median(np.diff(log.time)))
    middles, delays, followed = _delays_of_parts(rows, built, sides, shifts, common)
    # Clocks that run apart: a line through the parts' delays.
    line = np.polynomial.polynomial.polyfit(middles, delays, 1)
    rest = delays - np.polynomial.polynomial.polyval(middles, line)
    spread = np.sqrt(rest @ rest / (PARTS - 2) / ((middles - middles.mean()) ** 2).sum())
    drift = line[1] * np.ptp(middles)
    least = min(float(np.interp(common, shifts, squares)), none)
    if abs(line[1]) > CERTAIN * spread and abs(drift) > 2 * step and followed < BETTER * least:
        ends = " to ".join(f"{1e3 * delay:.1f}" for delay in (delays[0], delays[-1]))
        text = f"position and effort have clocks apart: the effort's delay goes from {ends} ms through the log"
        return common, [Finding("clock apart", WARNING, text, KEPT, names)]
    alone, gain = _delay_of_joint(names, built, sides, shifts, step)
    if alone and gain < 0.9 * squares.min() / none:
        return 0.0, alone
    error = float(np.std(delays, ddof=1) / np.sqrt(PARTS))
    if abs(common) > max(step, CERTAIN * error) and squares.min() < BETTER * none:
        fine = common + np.arange(-SHIFT_STEP_S, SHIFT_STEP_S + 1e-9, SHIFT_STEP_S / 10)
        left = [built.residual(built.side(rows.effort(shift))) for shift in fine]
        common = _lowest(fine, np.array([float(r @ r) for r in left]))
        text = f"the effort is {_lag(common)} the position (standard error {1e3 * error:.2f} ms)"
        return common, [Finding("delay", WARNING, text, f"{KEPT}; shift one of them", names)]
    return 0.0, []


def _delays_of_parts(
    rows: Rows, built: Equations, sides: list[np.ndarray], shifts: np.ndarray, common: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Middle [s] and delay [s] of each of PARTS parts of the log, by one set of parameters, and what they leave."""
    theta = built.parameters(built.side(rows.effort(common)))
    predicted = built.matrix @ theta
    at = np.concatenate([np.flatnonzero(column) for column in built.counted.T])
    part = np.searchsorted(np.linspace(0, len(rows.time), PARTS + 1)[1:-1], at, side="right")
    by_part = np.array([np.bincount(part, (b - predicted) ** 2, PARTS) for b in sides])
    delays = np.array([_lowest(shifts, column) for column in by_part.T])
    middles = np.array([x.mean() for x in np.array_split(rows.time, PARTS)])
    left = sum(np.interp(delay, shifts, column) for delay, column in zip(delays, by_part.T, strict=True))
    return middles, delays, float(left)


def _delay_of_joint(
    names: tuple[str, ...], built: Equations, sides: list[np.ndarray], shifts: np.ndarray, step: float
) -> tuple[list[Finding], float]:
    """The joint whose effort alone comes late, if there is one, and the ratio of squared residuals that it explains."""
    none = sides[len(shifts) // 2]
    whole = built.basis.T @ none
    found = []
    for j, name in enumerate(names):
        own = built.joint == j
        if not own.any():
            continue
        # Only this joint's rows move: so do only their share of the projection and of the length.
        others = whole - built.basis[own].T @ none[own]
        length = float(none @ none - none[own] @ none[own])
        squares = []
        for b in sides:
            projected = others + built.basis[own].T @ b[own]
            squares.append(length + float(b[own] @ b[own] - projected @ projected))
        y = np.array(squares)
        delay = _lowest(shifts, y)
        gain = y.min() / max(y[len(shifts) // 2], 1e-300)
        if abs(delay) > max(step, SHIFT_STEP_S / 2) and gain < ALONE_BETTER:
            found.append((gain, name, delay))
    if not found:
        return [], 1.0
    gain, name, delay = min(found)
    text = f"the effort of {name} is {_lag(delay)} the position, that of the other joints is not"
    return [Finding("delay", WARNING, text, f"{KEPT}; shift it", (name,))], float(gain)


def _lag(delay: float) -> str:
    return f"{1e3 * abs(delay):.1f} ms {'behind' if delay > 0 else 'ahead of'}"


def _lowest(x: np.ndarray, y: np.ndarray) -> float:
    """Where the parabola through the lowest of y (K,) at even x (K,) and its neighbours is lowest."""
    k = int(np.clip(y.argmin(), 1, len(y) - 2))
    before, at, after = y[k - 1 : k + 2]
    bend = before - 2 * at + after
    return float(x[k] + (0.0 if bend <= 0 else 0.5 * (x[1] - x[0]) * (before - after) / bend))


def _units(regressor: Regressor, rows: Rows, measured: np.ndarray) -> list[Finding]:
    """Ratio of each joint's effort to what the description says, friction of any size aside."""
    robot = regressor.robot
    if not any(joint.link.mass > 0 for joint in robot.joints):
        return []
    rigid = regressor.inverse_dynamics(rows.q, rows.dq, rows.ddq, regressor.theta(robot.standard, {}))
    ratios: dict[str, float] = {}
    for j, joint in enumerate(robot.joints):
        counted = rows.counted[:, j]
        if counted.sum() < 50:
            continue
        dq = rows.dq[counted, j]
        columns = np.column_stack([np.sign(dq), dq, np.ones(len(dq))])
        basis = np.linalg.qr(columns)[0]
        x, y = (v - basis @ (basis.T @ v) for v in (rigid[counted, j], measured[counted, j]))
        power, total = float(x @ y), float(y @ y)
        if total > 0 and x @ x > 0 and power**2 > TOLD * float(x @ x) * total:
            ratios[joint.name] = power / float(x @ x)
    wrong = {name: r for name, r in ratios.items() if r > 0 and max(r, 1 / r) > WRONG_UNIT}
    if not wrong:
        return []
    told = ", ".join(f"{name} {ratio:.2g}" for name, ratio in wrong.items())
    text = f"effort over what the description of {robot.name} predicts: {told}: is it a current, or a motor's torque?"
    return [Finding("effort unit", WARNING, text, f"{KEPT}; give its gain in a map", tuple(wrong))]


def _excitation(regressor: Regressor, rows: Rows, built: Equations, b: np.ndarray) -> list[Finding]:
    """Joints whose inertia the motion does not tell, and parameters that noise drowns.

    The mean inertia that a joint feels is linear in the parameters and positive on any robot: where it is not
    CERTAIN standard deviations above zero, the joint's acceleration makes no effort that is seen. In columns of equal
    length the combination of the k-th singular vector has the standard deviation σ/s_k, drowned where that is more
    than the parameters contribute on average.
    """
    length = np.linalg.norm(built.matrix, axis=0)
    used = np.flatnonzero(length > 0)
    triangle = built.triangle[:, used] / length[used]
    residual = built.residual(b)
    sigma = max(np.sqrt(float(residual @ residual) / max(len(b) - len(used), 1)), 1e-300)
    x = built.parameters(b)[used] * length[used]
    _, sizes, vectors = np.linalg.svd(triangle, full_matrices=False)
    findings = []
    weak = np.flatnonzero(sigma * len(sizes) ** 0.5 > np.linalg.norm(x) * sizes)
    if len(weak):
        share = (vectors[weak] ** 2).sum(axis=0)
        order = np.argsort(-share)
        names = [built.names[used[k]] for k in order if share[k] > 0.5] or [built.names[used[k]] for k in order[:3]]
        shown = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        text = f"the motion tells {len(weak)} of {len(used)} combinations of parameters no better than noise: {shown}"
        findings.append(Finding("under-excited", WARNING, text, KEPT))
    weak_joints = []
    for j, mean in enumerate(_mean_inertia(regressor, rows)):
        if not built.counted[:, j].any():
            continue
        # Directions without information make the standard deviation infinite.
        directions = vectors @ (mean[used] / length[used])
        error = sigma * float(np.linalg.norm(directions / np.maximum(sizes, 1e-300)))
        if mean[used] @ (x / length[used]) < CERTAIN * error:
            weak_joints.append(regressor.robot.joint_names[j])
    if weak_joints:
        text = f"too little acceleration: the inertia at {', '.join(weak_joints)} can't be told from zero"
        findings.append(Finding("under-excited", WARNING, text, f"{KEPT}; move faster", tuple(weak_joints)))
    return findings


def _mean_inertia(regressor: Regressor, rows: Rows) -> np.ndarray:
    """(n, p): the inertia that each joint feels on average over the poses of the rows, per unit of each parameter."""
    q = rows.q[:: max(1, len(rows.q) // POSES)]
    rest = np.zeros_like(q)
    still = regressor.torque(q, rest, rest)
    means = []
    for j in range(regressor.robot.n):
        unit = rest.copy()
        unit[:, j] = 1.0
        means.append((regressor.torque(q, rest, unit) - still)[:, j].mean(axis=0))
    return np.array(means)
