"""The motion of an experiment: one Fourier series a joint (Swevers et al. 1997), between two rests.

q_j(t) = q0_j + Σ_l a_jl/(lω)·sin(lωt) − b_jl/(lω)·cos(lωt), ω = 2π·fundamental_hz, l = 1 … L. With
Σ_l a_jl = 0 and Σ_l l·b_jl = 0 each period starts and ends with q̇ = q̈ = 0, so the robot can stand still
before and after without a jump in position, velocity or acceleration.
"""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.experiment.limits import working_limits
from identify.logs.files import replacing
from identify.robot.robot import Robot

FORMAT = "identify/trajectory/1"

REST_TOLERANCE = 1e-9
"""Largest |q̇(0)| and |q̈(0)|, relative to the coefficients, that still counts as starting at rest."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A periodic motion of n joints with L harmonics, `rest` seconds of stillness before and after.

    joints: n names in the order of the rows; q0 (n,) [rad or m]; a, b (n, L) [rad/s or m/s];
    fundamental_hz [Hz]; periods: how often the period is run; rest [s]. `criterion` and `seed` say how the
    motion was chosen, `note` anything else its reader should know. Arrays are copied and read-only.
    InputError when shapes disagree, a number is not finite, or the motion doesn't start at rest.
    """

    joints: tuple[str, ...]
    q0: np.ndarray
    a: np.ndarray
    b: np.ndarray
    fundamental_hz: float
    periods: int = 3
    rest: float = 0.5
    criterion: str = ""
    seed: int = 0
    note: str = ""

    def __post_init__(self) -> None:
        n = len(self.joints)
        for name in ("q0", "a", "b"):
            values = np.array(getattr(self, name), dtype=float)
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.q0.shape != (n,):
            raise InputError(f"trajectory: q0 has shape {self.q0.shape}; {n} joints need ({n},)")
        if self.a.ndim != 2 or len(self.a) != n or self.a.shape[1] == 0 or self.a.shape != self.b.shape:
            raise InputError(
                f"trajectory: a has shape {self.a.shape} and b {self.b.shape}; both must be ({n}, L), one row a joint"
            )
        if not all(np.all(np.isfinite(values)) for values in (self.q0, self.a, self.b)):
            raise InputError("trajectory: q0, a and b must be finite numbers")
        if not (math.isfinite(self.fundamental_hz) and self.fundamental_hz > 0):
            raise InputError(f"trajectory: fundamental_hz is {self.fundamental_hz}; it must be a positive frequency")
        if self.periods < 1:
            raise InputError(f"trajectory: periods is {self.periods}; at least one period must be run")
        if not (math.isfinite(self.rest) and self.rest >= 0):
            raise InputError(f"trajectory: rest is {self.rest}; it must be a time of at least 0 s")
        size = np.maximum(np.abs(self.a), np.abs(self.b)).max(axis=1)
        still_a, still_b = at_rest(self.a, self.b)
        drift = np.maximum(np.abs(self.a - still_a), np.abs(self.b - still_b)).max(axis=1)
        moving = np.flatnonzero(drift > REST_TOLERANCE * size)
        if len(moving):
            raise InputError(
                f"trajectory: {self.joints[moving[0]]} doesn't start at rest; "
                "its coefficients must satisfy Σ a_l = 0 and Σ l·b_l = 0"
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def harmonics(self) -> int:
        """Number of harmonics L."""
        return self.a.shape[1]

    @property
    def period(self) -> float:
        """Length of one period [s]."""
        return 1.0 / self.fundamental_hz

    @property
    def duration(self) -> float:
        """Length of the whole experiment, both rests included [s]."""
        return 2 * self.rest + self.periods * self.period

    def sample(self, t: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reference q, q̇, q̈, each (N, n), at times t (N,) [s] counted from the start of the first rest.

        During the rests, and at any time outside the experiment, q is the pose of rest and q̇ = q̈ = 0.
        """
        elapsed = np.atleast_1d(np.asarray(t, dtype=float)) - self.rest
        moving = (elapsed > 0) & (elapsed < self.periods * self.period)
        turns = np.where(moving, elapsed * self.fundamental_hz, 0.0)
        order = np.arange(1, self.harmonics + 1)
        angle = 2 * np.pi * np.mod(turns, 1.0)[:, None] * order  # (N, L)
        sine, cosine = np.sin(angle), np.cos(angle)
        pulsation = 2 * np.pi * self.fundamental_hz * order  # (L,) lω [rad/s]
        q = self.q0 + sine @ (self.a / pulsation).T - cosine @ (self.b / pulsation).T
        dq = cosine @ self.a.T + sine @ self.b.T
        ddq = cosine @ (self.b * pulsation).T - sine @ (self.a * pulsation).T
        dq[~moving] = 0.0
        ddq[~moving] = 0.0
        return q, dq, ddq

    def for_robot(self, robot: Robot) -> Trajectory:
        """The same motion with its rows in the robot's joint order. InputError if the joints are not the robot's."""
        if self.joints == robot.joint_names:
            return self
        if sorted(self.joints) != sorted(robot.joint_names):
            raise InputError(
                f"trajectory for joints {', '.join(self.joints)}: {robot.name} has {', '.join(robot.joint_names)}; "
                "design one for this robot with `identify excite`"
            )
        rows = [self.joints.index(name) for name in robot.joint_names]
        return replace(self, joints=robot.joint_names, q0=self.q0[rows], a=self.a[rows], b=self.b[rows])

    def to_toml(self) -> str:
        """The trajectory as TOML text; `from_toml` gives back the same floats."""
        lines = [
            "# Reference motion of an identification experiment; SI, radians, joint side.",
            "# q(t) = q0 + sum over l of a_l/(l w) sin(l w t) - b_l/(l w) cos(l w t), w = 2 pi fundamental_hz",
            f"format = {_quoted(FORMAT)}",
            f"joints = [{', '.join(_quoted(name) for name in self.joints)}]",
            f"fundamental_hz = {float(self.fundamental_hz)!r}",
            f"periods = {int(self.periods)}",
            f"rest = {float(self.rest)!r}",
            f"criterion = {_quoted(self.criterion)}",
            f"seed = {int(self.seed)}",
            f"note = {_quoted(self.note)}",
            f"q0 = {_row(self.q0)}",
        ]
        for name, rows in (("a", self.a), ("b", self.b)):
            lines += [f"{name} = [", *(f"  {_row(row)}," for row in rows), "]"]
        return "\n".join(lines) + "\n"

    def save(self, path: str | Path) -> None:
        """Write the trajectory as TOML, whole or not at all. OutputError where it can't be written."""
        with replacing(path) as stream:
            stream.write(self.to_toml().encode())

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Read a trajectory written by `save`. InputError naming the file and what is wrong with it."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except FileNotFoundError as error:
            raise InputError(f"{path}: no such trajectory; `identify excite ROBOT -o {path}` makes one") from error
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: not a text file; a trajectory is TOML in UTF-8") from error
        except OSError as error:
            raise InputError(f"{path}: can't be read ({error.strerror or error}); name a trajectory file") from error
        return cls.from_toml(text, str(path))

    @classmethod
    def from_toml(cls, text: str, source: str = "trajectory") -> Trajectory:
        """A trajectory from TOML text; `source` names it in errors. InputError for a bad or incomplete text."""
        try:
            table = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{source}: not valid TOML ({error}); mend the line or design it anew") from error
        if table.get("format") != FORMAT:
            raise InputError(f'{source}: not a trajectory file; it must say format = "{FORMAT}"')
        missing = [key for key in ("joints", "q0", "a", "b", "fundamental_hz") if key not in table]
        if missing:
            raise InputError(f"{source}: {', '.join(missing)} missing; design the trajectory anew or add it")
        if not _is_list_of(table["joints"], str):
            raise InputError(f"{source}: joints must be a list of names")
        try:
            return cls(
                joints=tuple(table["joints"]),
                q0=_numbers(table["q0"], "q0"),
                a=_numbers(table["a"], "a"),
                b=_numbers(table["b"], "b"),
                fundamental_hz=float(_typed(table, "fundamental_hz", (int, float), 0.0)),
                periods=_typed(table, "periods", (int,), 3),
                rest=float(_typed(table, "rest", (int, float), 0.5)),
                criterion=_typed(table, "criterion", (str,), ""),
                seed=_typed(table, "seed", (int,), 0),
                note=_typed(table, "note", (str,), ""),
            )
        except InputError as error:
            raise InputError(f"{source}: {str(error).removeprefix('trajectory: ')}") from error


def at_rest(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest coefficients (n, L) with Σ_l a_l = 0 and Σ_l l·b_l = 0 in every row: q̇(0) = q̈(0) = 0.

    Orthogonal projections, so linear in a and in b; with L = 1 both become zero.
    """
    order = np.arange(1, np.shape(a)[1] + 1)
    return (
        a - np.mean(a, axis=1, keepdims=True),
        b - (b @ order)[:, None] * (order / (order @ order)),
    )


def random_trajectory(
    robot: Robot,
    seed: int,
    *,
    fundamental_hz: float = 0.1,
    harmonics: int = 5,
    periods: int = 3,
    rest: float = 0.5,
    fill: float = 0.8,
) -> Trajectory:
    """A random motion inside `fill` of the robot's position, velocity and acceleration limits.

    Coefficients are normal (seeded), projected on rest at both ends, then scaled joint by joint until the
    first of the three limits is met; the motion lies in the middle of the position limits. `working_limits` says
    what stands for limits that are infinite. Effort limits are not looked at: `simulate` reports an effort beyond them.
    A baseline for designed excitation, and a motion for robots and tests that need any.
    """
    if harmonics < 2:
        raise InputError(f"harmonics is {harmonics}; a motion that starts at rest needs at least 2")
    if seed < 0:
        raise InputError(f"seed is {seed}; it must be a whole number of at least 0")
    generator = np.random.Generator(np.random.PCG64(seed))
    a, b = at_rest(*generator.standard_normal((2, robot.n, harmonics)))
    unit = Trajectory(robot.joint_names, np.zeros(robot.n), a, b, fundamental_hz, periods=1, rest=0.0)
    q, dq, ddq = unit.sample(np.linspace(0.0, unit.period, 200 * harmonics + 1))
    limits = working_limits(robot)
    peaks = np.abs(dq).max(axis=0) / limits.velocity, np.abs(ddq).max(axis=0) / limits.acceleration
    scale = fill / np.max([np.ptp(q, axis=0) / (2 * limits.half), *peaks], axis=0)
    q0 = limits.middle - scale * (q.max(axis=0) + q.min(axis=0)) / 2
    a, b = scale[:, None] * a, scale[:, None] * b
    return Trajectory(robot.joint_names, q0, a, b, fundamental_hz, periods, rest, "random", seed)


def _quoted(text: str) -> str:
    """A TOML basic string: JSON's escapes, and the one control character that JSON leaves as it is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _row(values: np.ndarray) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _is_list_of(value: Any, *kinds: type) -> bool:
    return isinstance(value, list) and all(isinstance(entry, kinds) and not isinstance(entry, bool) for entry in value)


def _numbers(value: Any, key: str) -> np.ndarray:
    """Numbers of a TOML list or list of lists as a float array."""
    rows = value if isinstance(value, list) and value and isinstance(value[0], list) else [value]
    if not all(_is_list_of(row, int, float) for row in rows):
        raise InputError(f"{key} must be a list of numbers, or one list a joint")
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"{key} has rows of different lengths; every joint needs the same number of harmonics")
    try:
        return np.array(value, dtype=float)
    except OverflowError as error:
        raise InputError(f"{key} has a number beyond the range of a float") from error


def _typed(table: dict[str, Any], key: str, kinds: tuple[type, ...], default: Any) -> Any:
    value = table.get(key, default)
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise InputError(f"{key} is {value!r}; it must be {'text' if str in kinds else 'a number'}")
    return value
