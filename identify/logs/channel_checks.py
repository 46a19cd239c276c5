"""What is odd about single channels: spikes, jumps, frozen, held, clipped, coarse or copied values."""

from __future__ import annotations

import numpy as np

from identify.logs.finding import ERROR, KEPT, REFUSED, WARNING, Finding
from identify.logs.log import Log
from identify.logs.outliers import jumps, robust_range, runs, spikes
from identify.logs.wording import counted

SMALLEST = {"position": 0.002, "effort": 0.05, "velocity": 0.05}
"""Share of its range from which an outlier of a channel could matter."""
FROZEN_S = 0.02
"""A channel that keeps one value for so long [s] while its joint moves is frozen, if its own value jumps after."""
HELD_SHARE = 0.8
"""Share of the changes of a channel that come at one and the same distance, from which it is held between them."""
CLIPPED_LEAST = 3
"""So many samples at exactly the largest value are a plateau."""
CLIPPED_SHARE = 1e-3
"""Share of the samples on plateaus from which a channel is clipped."""
COARSE = 0.01
"""Error of rounding, as a share of what is measured, from which a channel is coarse."""
BAND_HZ = 10.0
"""Band in which acceleration counts, for the error that rounding of positions makes in it."""
_ENOUGH = 100_000
_LEAST = 20

LEFT = "kept; the low-pass spreads them out: remove them, or record again"


def of_joint(log: Log, j: int, speed: np.ndarray, moving: np.ndarray) -> list[Finding]:
    """Findings of joint j's channels, of those that hold finite numbers alone; speed (N,): mean, from position; moving
    (N,): where it is above that of rest."""
    findings: list[Finding] = []
    if log.samples < _LEAST:
        return findings
    joint = log.joints[j]
    for what, values in (("position", log.position), ("velocity", log.velocity), ("effort", log.effort)):
        x = np.empty(0) if values is None else np.ascontiguousarray(values[:, j])
        if not len(x) or not np.isfinite(x).all() or np.ptp(x) == 0:
            continue
        smallest = SMALLEST[what] * robust_range(x)
        spiked = spikes(x, smallest)
        findings += _of_spikes(what, joint, x, log.time, spiked)
        if what == "position":
            findings += _of_jumps(joint, x, log.time, smallest, spiked)
        held = _of_held(what, joint, x, moving, log.time)
        findings += held or _of_frozen(what, joint, x, moving, log.time)
        findings += _of_clipping(what, joint, x)
        findings += _of_quantisation(what, joint, x, speed, log.time)
    return findings


def _of_spikes(what: str, joint: str, x: np.ndarray, time: np.ndarray, found: np.ndarray) -> list[Finding]:
    if not len(found):
        return []
    largest = float(np.abs(x[found] - x[found - 1]).max())
    number, first = counted(len(found), "spike"), time[found[0]]
    text = f"the {what} of {joint} has {number} of up to {largest:.3g}, first at {first:.3f} s"
    return [Finding("spikes", WARNING, text, LEFT, (joint,))]


def _of_jumps(joint: str, x: np.ndarray, time: np.ndarray, smallest: float, spiked: np.ndarray) -> list[Finding]:
    found = jumps(x, time, smallest)
    # Both flanks of a spike look like jumps.
    found = np.array([k for k in found if not len(spiked) or np.abs(spiked - k).min() > 5], dtype=int)
    if not len(found):
        return []
    sizes = x[found + 1] - x[found]
    k, size = int(found[0]), float(sizes[0])
    same = x[:-1] == x[1:]
    before = 0
    while k - before - 1 >= 0 and same[k - before - 1]:
        before += 1
    if before >= CLIPPED_LEAST:
        text = f"the position of {joint} freezes for {before} samples and jumps by {size:.3f} at {time[k + 1]:.3f} s"
        return [Finding("frozen", ERROR, text, REFUSED, (joint,))]
    turns = size / (2 * np.pi)
    if abs(turns) > 0.5 and abs(turns - round(turns)) < 0.02:
        text = f"the position of {joint} jumps by {round(turns):+d} × 2π at {time[k + 1]:.3f} s: unwrap the encoder"
        return [Finding("wrap", ERROR, text, REFUSED, (joint,))]
    text = f"the position of {joint} jumps {counted(len(found), 'time')}, by {size:.3f} at {time[k + 1]:.3f} s"
    return [Finding("jump", ERROR, text, REFUSED, (joint,))]


def _of_held(what: str, joint: str, x: np.ndarray, moving: np.ndarray, time: np.ndarray) -> list[Finding]:
    """A channel that changes at every k-th sample alone, while its joint moves."""
    rows = np.flatnonzero(np.diff(x)[moving[1:]])[:_ENOUGH]
    if len(rows) < 20:
        return []
    distance = np.diff(rows)
    common = int(np.bincount(distance).argmax())
    if common < 2 or (distance == common).mean() < HELD_SHARE:
        return []
    rate = (len(time) - 1) / (time[-1] - time[0])
    text = f"the {what} of {joint} changes at every {common}. sample alone: it is measured at {rate / common:.4g} Hz"
    return [Finding("mixed rates", WARNING, text, KEPT, (joint,))]


def _of_frozen(what: str, joint: str, x: np.ndarray, moving: np.ndarray, time: np.ndarray) -> list[Finding]:
    """A stretch at one value while the joint moves, many times longer than the channel's other ones."""
    if what == "position":
        return []
    starts, lengths = runs(np.diff(x) == 0)
    moved = np.zeros(len(moving) + 1, dtype=np.int32)
    np.cumsum(moving, out=moved[1:])
    throughout = moved[starts + lengths] - moved[starts] == lengths
    starts, lengths = starts[throughout], lengths[throughout]
    if not len(starts):
        return []
    worst = int(lengths.argmax())
    others = np.delete(lengths, worst)
    usual = float(np.quantile(others, 0.9)) if len(others) else 1.0
    start, length = int(starts[worst]), int(lengths[worst])
    lasts = float(time[start + length] - time[start])
    at_end = x[start] in (x.min(), x.max())
    if lasts < FROZEN_S or length < 10 * usual or at_end:
        return []
    text = (
        f"the {what} of {joint} is frozen at {x[start]:.4g} for {lasts:.3f} s from {time[start]:.3f} s while it moves"
    )
    return [Finding("frozen", WARNING, text, KEPT, (joint,))]


def _of_clipping(what: str, joint: str, x: np.ndarray) -> list[Finding]:
    """Plateaus at exactly the largest or smallest value that are entered and left at speed, which no rest is."""
    findings = []
    for end, word in ((x.max(), "largest"), (x.min(), "smallest")):
        at_end = x == end
        if at_end.sum() <= CLIPPED_SHARE * len(x):
            continue
        step = np.abs(np.diff(x))
        usual = float(np.median(step[step > 0][:_ENOUGH]))
        starts, lengths = runs(at_end)
        inner = (starts > 0) & (starts + lengths < len(x))
        starts, lengths = starts[inner], lengths[inner]
        into, out = step[starts - 1], step[starts + lengths - 1]
        sharp = (lengths >= CLIPPED_LEAST) & (np.maximum(into, out) > 0.25 * usual)
        # An encoder that dwells on its last count does so on the one before as well.
        inside = x[(x != end) & (np.abs(x - end) <= 1.5 * usual)]
        near = int(np.unique(inside, return_counts=True)[1].max()) if len(inside) else 0
        clipped = int(lengths[sharp].sum())
        if clipped > max(CLIPPED_SHARE * len(x), 5 * near):
            text = f"the {what} of {joint} is clipped: {clipped:,} samples lie exactly at its {word} value {end:.4g}"
            findings.append(Finding("saturation", WARNING, text, "kept; move less, or raise the limit", (joint,)))
    return findings


def _of_quantisation(what: str, joint: str, x: np.ndarray, speed: np.ndarray, time: np.ndarray) -> list[Finding]:
    """Values on a coarse grid: its rounding error against the effort, or against the acceleration of the motion."""
    values = np.unique(x[:_ENOUGH])
    if what == "velocity" or len(values) < 3:
        return []
    gaps = np.diff(values)
    # Rounding leaves gaps far above a float's own.
    size = float(np.median(gaps))
    if len(values) > 0.5 * min(len(x), _ENOUGH) or size <= 1e-9 * float(np.abs(values).max()):
        return []
    unit = float(gaps[gaps > 0.01 * size].min())
    if (np.abs(gaps / unit - np.round(gaps / unit)) > 0.05).mean() > 0.05:
        return []
    noise = unit / np.sqrt(12)
    if what == "effort":
        share, of = noise / max(float(np.std(x)), 1e-300), "of its variation"
    else:
        rate = (len(time) - 1) / (time[-1] - time[0])
        band = min(BAND_HZ, 0.4 * rate)
        # Second derivative of white noise, in the band: ∫ (2πf)⁴ df.
        jitter = noise * np.sqrt(2 / rate * (2 * np.pi) ** 4 * band**5 / 5)
        stride = max(1, round(rate / (4 * band)))
        share = jitter / max(float(np.std(np.gradient(speed[::stride], time[::stride]))), 1e-300)
        of = f"of its acceleration up to {band:g} Hz"
    if share <= COARSE:
        return []
    text = f"the {what} of {joint} is coarse: its steps of {unit:.3g} make an error of {100 * share:.1f} % {of}"
    return [Finding("quantisation", WARNING, text, KEPT, (joint,))]


def of_copies(log: Log) -> list[Finding]:
    """Two channels that hold the same numbers bit by bit, though they change."""
    if log.samples < _LEAST:
        return []
    channels: dict[bytes, tuple[str, str]] = {}
    stride = max(1, log.samples // _ENOUGH)
    findings = []
    for what, values in (("position", log.position), ("velocity", log.velocity), ("effort", log.effort)):
        if values is None:
            continue
        for joint, x in zip(log.joints, values[::stride].T, strict=True):
            if not np.isfinite(x).all() or np.ptp(x) == 0:
                continue
            name, first = channels.setdefault(x.tobytes(), (what, joint))
            if (name, first) != (what, joint):
                text = f"the {what} of {joint} is a copy of the {name} of {first}"
                findings.append(Finding("copied channel", ERROR, text, REFUSED, tuple({first: 0, joint: 0})))
    return findings
