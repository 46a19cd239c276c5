"""How a log's motion was commanded: reference, gains and feed-forward, as the log itself tells them.

A simulation with other parameters closes the same loop with it. The feed-forward is a signal that the controller had,
whatever it was made from: no description of the robot is asked, and none has to be right.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.errors import InputError, UnsupportedLogError
from identify.experiment.closed_loop import closed_loop, steps_of
from identify.experiment.trajectory import Trajectory
from identify.logs.log import MOTION_START, Log
from identify.robot.robot import Robot

REFERENCE, FEEDFORWARD = "trajectory.toml", "feedforward.npy"
"""Attachments: the reference, and the feed-forward's samples (M, n) with a column for each of its joints."""

POSITION_GAIN, VELOCITY_GAIN, RATE = "position_gain", "velocity_gain", "feedforward_rate_hz"
"""Metadata: gains as {joint: number} in JSON, and the rate of the feed-forward's samples."""

UNTOLD = (
    "the log does not tell its controller; a closed loop needs the reference, gains and feed-forward that "
    "`identify simulate` records"
)

OFF_TRACK = 0.1
"""A joint farther than this from its reference (rms, in shares of the reference's own) does not follow it."""


@dataclass(frozen=True, eq=False)
class Control:
    """Γ = Kp·(q_ref − q) + Kd·(q̇_ref − q̇) + Γ_ff of n joints, in the trajectory's order.

    position_gain, velocity_gain (n,) [N·m/rad, N·m·s/rad or N/m, N·s/m]; feedforward (M, n) [N·m or N] at `rate` [Hz]
    from the trajectory's start, which is at `start` [s] of the log's time.
    """

    trajectory: Trajectory
    position_gain: np.ndarray
    velocity_gain: np.ndarray
    feedforward: np.ndarray
    rate: float
    start: float = 0.0

    def metadata(self) -> dict[str, str]:
        """What of it a log tells in its metadata."""

        def named(values: np.ndarray) -> str:
            return json.dumps(dict(zip(self.trajectory.joints, values.tolist(), strict=True)), ensure_ascii=False)

        return {
            POSITION_GAIN: named(self.position_gain),
            VELOCITY_GAIN: named(self.velocity_gain),
            "feedforward": "inverse dynamics and friction of the controller's own model along the reference, "
            f"as a signal in {FEEDFORWARD}, a column for each joint of {REFERENCE}",
            RATE: f"{self.rate:.10g}",
        }

    def attachments(self) -> dict[str, bytes]:
        """What of it a log carries along, name → content."""
        stream = io.BytesIO()
        np.save(stream, self.feedforward, allow_pickle=False)
        return {REFERENCE: self.trajectory.to_toml().encode(), FEEDFORWARD: stream.getvalue()}

    def command(self) -> np.ndarray:
        """(steps + 1, n) what of Γ does not depend on the state, at the steps of the loop."""
        time = steps_of(self.trajectory)
        q, dq, _ = self.trajectory.sample(time)
        at = np.arange(len(self.feedforward)) / self.rate
        forward = np.column_stack([np.interp(time, at, column) for column in self.feedforward.T])
        return self.position_gain * q + self.velocity_gain * dq + forward

    def simulated(self, arm: Robot, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and effort (N, n) at times (N,) of the log, had `arm` been what was controlled.

        Errors as `closed_loop`.
        """
        command = self.command()
        q, dq, _ = closed_loop(arm, self.trajectory, command, self.position_gain, self.velocity_gain)
        effort = command - self.position_gain * q - self.velocity_gain * dq
        at, steps = time - self.start, steps_of(self.trajectory)
        position, drive = (np.column_stack([np.interp(at, steps, column) for column in x.T]) for x in (q, effort))
        return position, drive


def control_of(log: Log, joints: Sequence[str]) -> Control:
    """The controller of a log, its joints in this order. UnsupportedLogError where the log does not tell it, or does
    not follow what it tells."""
    if any(key not in log.metadata for key in (POSITION_GAIN, VELOCITY_GAIN, RATE)) or any(
        name not in log.attachments for name in (REFERENCE, FEEDFORWARD)
    ):
        raise UnsupportedLogError(UNTOLD)
    try:
        trajectory = trajectory_of(log)
        rows = [trajectory.joints.index(name) for name in joints]
        gains = [json.loads(log.metadata[key]) for key in (POSITION_GAIN, VELOCITY_GAIN)]
        position, velocity = (np.array([float(gain[name]) for name in joints]) for gain in gains)
        feedforward = np.load(io.BytesIO(log.attachments[FEEDFORWARD]), allow_pickle=False)
        rate, start = float(log.metadata[RATE]), float(log.metadata.get(MOTION_START, "0"))
        found = Control(ordered(trajectory, joints), position, velocity, feedforward[:, rows], rate, start)
        numbers = np.concatenate([position, velocity, found.feedforward.ravel(), [rate, start]]).astype(float)
        if len(trajectory.joints) != len(rows) or not (rate > 0 and np.isfinite(numbers).all() and len(feedforward)):
            raise ValueError("not of these joints, or not numbers")
    except (InputError, ValueError, KeyError, TypeError, AttributeError, IndexError, EOFError, MemoryError) as error:
        raise UnsupportedLogError(f"what the log tells of its controller can't be used ({error})") from error
    _check_followed(log, found, joints)
    return found


def trajectory_of(log: Log) -> Trajectory:
    """The reference that a log carries. KeyError without one; InputError or ValueError for one that can't be read."""
    return Trajectory.from_toml(log.attachments[REFERENCE].decode(), REFERENCE)


def ordered(trajectory: Trajectory, joints: Sequence[str]) -> Trajectory:
    """The trajectory with its rows in this order of joints. ValueError where one is missing."""
    rows = [trajectory.joints.index(name) for name in joints]
    return replace(trajectory, joints=tuple(joints), q0=trajectory.q0[rows], a=trajectory.a[rows], b=trajectory.b[rows])


def _check_followed(log: Log, control: Control, joints: Sequence[str]) -> None:
    """UnsupportedLogError where the log's motion is not the reference's: another trajectory, or another time."""
    reference = control.trajectory.sample(log.time - control.start)[0]
    position = log.position[:, [log.joints.index(name) for name in joints]]
    off = np.sqrt(np.mean((position - reference) ** 2, axis=0))
    size = np.std(reference, axis=0)
    lost = [name for name, a, b in zip(joints, off, size, strict=True) if not a <= OFF_TRACK * max(b, 1e-3)]
    if lost:
        raise UnsupportedLogError(f"the log does not follow the trajectory that it carries ({', '.join(lost)})")
