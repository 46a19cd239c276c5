"""Whether motion and effort of a log belong together, by a quick torque model: readings, delay, units, excitation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.logs.finding import KEPT, WARNING, Finding
from identify.logs.log import Log
from identify.logs.triage import STILL_RANGE, Findings, inspect, refusals
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot
from identify.validation.log_delay import effort_delay
from identify.validation.log_excitation import excitation
from identify.validation.log_readings import SUSPICIOUS, Judged, readings
from identify.validation.log_rows import Rows, rows_of

WRONG_UNIT = 3.0
"""Ratio of effort and description, or its inverse, from which the effort is in another unit."""
TOLD = 0.5
"""Share of an effort's variation that the description explains, from which their ratio means something."""

EFFORT_UNIT = "effort unit"
"""Kind of finding that the description of the robot's links is asked for."""


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
    judged, findings = readings(regressor, rows, rows.effort())
    if findings:
        return findings
    delay, findings = effort_delay(rows, judged.equations, log)
    findings += [] if findings else _unexplained(regressor, judged)
    measured = rows.effort(delay)
    findings += _units(regressor, rows, measured)
    return findings + excitation(regressor, rows, judged.equations, judged.equations.side(measured))


def _unexplained(regressor: Regressor, judged: Judged) -> list[Finding]:
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
    return [Finding(EFFORT_UNIT, WARNING, text, f"{KEPT}; give its gain in a map", tuple(wrong))]
