"""What the arm did: one frozen value, joint side, SI, joints by name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

START_TIME = "start_time_ns"
"""Key in `Log.metadata` of the first sample's absolute time, Unix time [ns], where it is known."""

MOTION_START = "motion_start_s"
"""Key in `Log.metadata` of the time [s] at which the attached trajectory started, where it is not 0."""

KEPT = ("trajectory.toml", "feedforward.npy")
"""Attachments of a recording that say how its motion was commanded; a log carries them along, and no others."""


@dataclass(frozen=True)
class Log:
    """Measured motion of n joints over N samples, on the joint side.

    time (N,) [s], strictly increasing, counted from the recording's first sample; position (N, n)
    [rad or m]; velocity (N, n) [rad/s or m/s] or None; effort (N, n) [N·m or N] or None; joints: n names
    in the order of the columns. `source` is the file it came from, `sha256` that file's digest.
    `findings`: sentences on what was found wrong with the recording and what was done about it.
    `metadata`: provenance as strings; a simulated log says `simulated` = "true". `dropped`: rows left out
    while reading, because they were not finite or their time did not run forward. `attachments`: those of KEPT that the
    recording has, name → content.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None
    joints: tuple[str, ...]
    source: str = ""
    sha256: str = ""
    findings: tuple[str, ...] = ()
    metadata: dict[str, str] = field(default_factory=dict)
    dropped: int = 0
    attachments: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return len(self.time)

    @property
    def rate_hz(self) -> float:
        """Mean sampling rate [Hz]."""
        return (self.samples - 1) / (self.time[-1] - self.time[0])

    @property
    def duration(self) -> float:
        """Time between the first and the last sample [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def simulated(self) -> bool:
        """Whether the recording is a simulation, as its provenance says."""
        return self.metadata.get("simulated") == "true"

    def save(
        self, path: str | os.PathLike[str], force: bool = False, attachments: Mapping[str, bytes] | None = None
    ) -> None:
        """Write the log to .mcap or .csv; see identify.logs.writing.save."""
        from identify.logs.writing import save

        save(self, path, force=force, attachments=attachments)
