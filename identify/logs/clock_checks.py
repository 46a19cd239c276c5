"""What is odd about a recording's clock."""

from __future__ import annotations

import numpy as np

from identify.logs.finding import WARNING, Finding
from identify.logs.wording import counted

GAP = 5.0
"""A step of more than so many median steps is a gap in the recording."""
UNEVEN = 1.5
"""A step of more than so many median steps is late."""
JITTER = 0.02
"""Deviation of the steps, of the median one, from which a fit resamples the recording."""
RATES_APART = 1.25
"""Ratio of the median steps of two tenths of a recording from which its rate has changed."""
_PARTS = 10
_LEAST_PER_PART = 20

RESAMPLED = "resampled onto an even clock, by straight lines between samples"


def of_clock(time: np.ndarray) -> list[Finding]:
    """Findings of the strictly increasing times (N,) [s]."""
    if len(time) < 2:
        return []
    steps = np.diff(time)
    median = float(np.median(steps))
    findings = _of_rate(time, steps)
    late = steps > GAP * median
    if late.any():
        worst = int(steps.argmax())
        text = (
            f"the recording has {counted(int(late.sum()), 'gap')} of more than {GAP:g} median steps, "
            f"the longest {steps[worst]:.3f} s at {time[worst]:.3f} s"
        )
        findings.append(Finding("gap", WARNING, text, RESAMPLED))
    if findings:
        return findings
    if steps.max() > UNEVEN * median:
        text = f"the sampling is uneven: the longest step is {steps.max() / median:.1f} times the median one"
        return [Finding("jitter", WARNING, text, RESAMPLED)]
    spread = float(np.sqrt(np.mean((steps - median) ** 2)))
    if spread > JITTER * median:
        text = f"the sampling jitters: its steps of {1e3 * median:.3f} ms vary by {100 * spread / median:.0f} % rms"
        return [Finding("jitter", WARNING, text, RESAMPLED)]
    return []


def _of_rate(time: np.ndarray, steps: np.ndarray) -> list[Finding]:
    """Whether the rate of one tenth of the recording differs from another's."""
    if len(steps) < _PARTS * _LEAST_PER_PART:
        return []
    parts = np.array_split(steps, _PARTS)
    medians = np.array([np.median(part) for part in parts])
    if medians.max() <= RATES_APART * medians.min():
        return []
    turn = int(np.abs(np.diff(np.log(medians))).argmax()) + 1
    text = (
        f"the sampling rate changes from {1 / medians[turn - 1]:.4g} to {1 / medians[turn]:.4g} Hz "
        f"near {time[sum(map(len, parts[:turn]))]:.1f} s"
    )
    return [Finding("mixed rates", WARNING, text, RESAMPLED)]
