"""Other ways to read a log: with a sign turned or two joints swapped, it may explain the effort far better."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from identify.logs.finding import ERROR, REFUSED, Finding
from identify.regressor.regressor import Regressor
from identify.validation.log_rows import Equations, Rows, equations

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


@dataclass(frozen=True)
class Reading:
    """One way to read a log: joint j moved as sign[j] × position order[j], by the effort flip[j] × effort taken[j].

    words: what would be wrong with the log; joints: whom it concerns; kind: of the finding; arrays (n,).
    """

    words: str
    joints: tuple[str, ...]
    kind: str
    order: np.ndarray
    sign: np.ndarray
    taken: np.ndarray
    flip: np.ndarray

    def effort(self, measured: np.ndarray) -> np.ndarray:
        """Efforts (R, n) of the joints, from those measured (R, n)."""
        return self.flip * measured[:, self.taken]

    def after(self, other: Reading) -> Reading:
        """This reading of what `other` reads."""
        return Reading(
            self.words,
            self.joints,
            self.kind,
            other.order[self.order],
            self.sign * other.sign[self.order],
            other.taken[self.taken],
            self.flip * other.flip[self.taken],
        )


@dataclass(frozen=True)
class Judged:
    """What the torque model makes of a reading: its equations, the residual (K,) of least squares, and its square."""

    reading: Reading
    squares: float
    equations: Equations
    residual: np.ndarray


def readings(regressor: Regressor, rows: Rows, measured: np.ndarray) -> tuple[Judged, list[Finding]]:
    """The log as it is, judged, and the signs and swaps that explain it far better."""
    n, names = regressor.robot.n, regressor.robot.joint_names
    same, ones = np.arange(n), np.ones(n)
    as_is = _judge(regressor, rows, measured, Reading("", (), "", same, ones, same, ones))
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


def _judge(regressor: Regressor, rows: Rows, measured: np.ndarray, reading: Reading) -> Judged:
    built = equations(regressor, rows.changed(reading.order, reading.sign))
    effort = reading.effort(measured)
    b = built.side(effort)
    residual = b - built.matrix @ built.parameters(b)
    return Judged(reading, float(residual @ residual), built, residual)


def _doubtful(judged: Judged, measured: np.ndarray) -> bool:
    """Whether the model leaves much of a joint's effort, or needs negative friction or inertia to leave little."""
    shares = judged.equations.shares(judged.residual)
    if np.nanmax(shares) > SUSPICIOUS:
        return True
    free = judged.equations.residual(judged.equations.side(judged.reading.effort(measured)))
    return judged.squares > IMPLAUSIBLE * float(free @ free)


def _others(names: tuple[str, ...]) -> list[Reading]:
    """Every sign and every swap of two joints."""
    n = len(names)
    same, ones = np.arange(n), np.ones(n)
    found = []
    for j, name in enumerate(names):
        flipped = ones.copy()
        flipped[j] = -1
        found.append(Reading(f"the effort of {name} has the wrong sign", (name,), "sign", same, ones, same, flipped))
        found.append(Reading(f"the position of {name} has the wrong sign", (name,), "sign", same, flipped, same, ones))
        both = f"position and effort of {name} have the wrong sign"
        found.append(Reading(both, (name,), "sign", same, flipped, same, flipped))
    if n > 1:
        found.append(Reading("every effort has the wrong sign", names, "sign", same, ones, same, -ones))
    for a, b in combinations(range(n), 2):
        swap = same.copy()
        swap[[a, b]] = b, a
        pair = (names[a], names[b])
        told = f"{names[a]} and {names[b]} are swapped"
        found.append(Reading(told, pair, "swap", swap, ones, swap, ones))
        found.append(Reading(f"the efforts of {told}", pair, "swap", same, ones, swap, ones))
        found.append(Reading(f"the positions of {told}", pair, "swap", swap, ones, same, ones))
    return found
