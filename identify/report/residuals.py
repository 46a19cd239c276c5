"""Section 9: is σ believable?"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from identify.numbers import count, finite, percent, significant
from identify.report import data_figures
from identify.report.markup import Section, absent, esc, figures, legend, prose
from identify.report.record import UNKNOWN, Record, items, joints, part, reason

EXPECTED = 5.0
"""Share of lags [%] that white noise has outside the band."""


def section(record: Record, curves: Mapping[str, np.ndarray]) -> Section:
    """Autocorrelation of the residuals, what it says in words, and how far it widened σ."""
    title, question = "Residuals", "Is σ believable?"
    rows, effective = finite(part(record, "settings", "rows")), finite(part(record, "settings", "effective_samples"))
    told = []
    if rows and effective:
        factor = significant(math.sqrt(rows / effective), 2)
        told.append(f"{count(rows)} rows are worth {count(effective)} independent ones, which widens σ {factor}-fold")
    lag, values = curves.get("residual/lag"), curves.get("residual/autocorrelation")
    robot = joints(record)
    if lag is None or values is None or np.ndim(values) != 2 or len(lag) < 2:
        why = reason(record, "residual")
        why = "the result folder holds no autocorrelation" if why == UNKNOWN else why
        body = absent("No autocorrelation.", why)
        return Section(
            "residuals", 9, title, question, body, "; ".join(told) or why, folded=True, why="" if told else why
        )
    bound = 2 / math.sqrt(rows / len(robot)) if rows and robot else None
    outside = _outside(record, lag, values, bound)
    inflation = items(record, "settings", "rows_per_effective_sample")
    inflation = inflation if len(inflation) == len(robot) else []
    drawn = []
    for k, joint in enumerate(robot[: values.shape[1]]):
        crossing = np.flatnonzero(values[:, k] < math.exp(-1))
        falls = f"under 1/e after {significant(float(lag[crossing[0]]), 2)} s" if len(crossing) else "stays above 1/e"
        later = f", {percent(outside[k])} of later lags outside" if outside is not None else ""
        ratio = finite(inflation[k]) if k < len(inflation) else None
        factor = significant(math.sqrt(ratio), 2) if ratio and ratio > 1 else ""
        widened = f", σ widened {factor}-fold" if factor and factor != "1.0" else ""
        label = f"{joint['name']}: the autocorrelation of the residual, {falls}{later}{widened}."
        svg = data_figures.autocorrelation(lag, values[:, k], bound, f"a-{k}", label)
        drawn.append((esc(joint["name"]), esc(falls + later + widened), svg))
    marks = legend(("error", "residual"), *([("rest", "where white noise would stay, 95 %")] if bound else []))
    finding = "; ".join(told) or "autocorrelation of every joint"
    body = _words(record, outside) + marks + figures(drawn)
    return Section("residuals", 9, title, question, body, finding, folded=True)


def _settled(record: Record) -> float:
    """Lag [s] beyond which the low-pass of the effort leaves nothing alike: one period of its cut-off."""
    cutoff = finite(part(record, "settings", "effort_cutoff_hz"))
    return 1 / cutoff if cutoff else 0.0


def _outside(record: Record, lag: np.ndarray, values: np.ndarray, bound: float | None) -> np.ndarray | None:
    """(n,) share of the lags beyond the low-pass at which each joint's residual leaves the band [%]."""
    later = lag > _settled(record)
    if bound is None or not later.any():
        return None
    return 100 * np.mean(np.abs(np.nan_to_num(values[later])) > bound, axis=0)


def _words(record: Record, outside: np.ndarray | None) -> str:
    """What a curve means, and what these curves say."""
    told = [
        "A curve shows how much of a residual is still there after a lag. Were residuals white, each row independent "
        "of those before, it would fall at once and stay in the band"
    ]
    settled = _settled(record)
    if settled:
        told.append(f"the low-pass alone keeps it up for about {significant(settled, 2)} s")
    if outside is not None:
        names = [joint["name"] for joint in joints(record)][: len(outside)]
        worst = int(np.argmax(outside))
        told.append(
            f"of later lags, {percent(float(outside.mean()))} lie outside the band, most for {names[worst]} "
            f"({percent(float(outside[worst]))}), where white noise has {EXPECTED:g} %: what is outside is "
            "motion that the model lacks, or noise that lasts"
        )
    told.append("σ is widened for it, yet no σ knows of errors that this motion does not show")
    return f'<p class="remark">{prose("; ".join(told))}</p>'
