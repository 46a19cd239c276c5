"""Section 9: is σ believable?"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from identify.numbers import count, finite, percent, significant
from identify.report import data_figures
from identify.report.markup import Notes, Section, absent, esc, figures, fold, legend, prose, table, unit
from identify.report.record import UNKNOWN, Record, items, joints, part, reason

EXPECTED = 5.0
"""Share of lags [%] that white noise has outside the band."""


def section(record: Record, curves: Mapping[str, np.ndarray]) -> Section:
    """Where σ comes from, how white the residuals are in words and in tests, and their autocorrelation."""
    title, question = "Residuals", "Is σ believable?"
    told, body = _told(record), _source(record) + _whiteness(record)
    lag, values = curves.get("residual/lag"), curves.get("residual/autocorrelation")
    if lag is None or values is None or np.ndim(values) != 2 or len(lag) < 2:
        why = reason(record, "residual")
        why = "the result folder holds no autocorrelation" if why == UNKNOWN else why
        body += absent("No autocorrelation.", why)
        alone = "" if told or part(record, "statistics") else why
        return Section("residuals", 9, title, question, body, "; ".join(told) or why, folded=True, why=alone)
    finding = "; ".join(told) or "autocorrelation of every joint"
    return Section("residuals", 9, title, question, body + _drawn(record, lag, values), finding, folded=True)


def _told(record: Record) -> list[str]:
    """How wide σ is and how white residuals are, in plain text."""
    told = []
    widening = finite(part(record, "statistics", "covariance", "widening"))
    rows, effective = finite(part(record, "settings", "rows")), finite(part(record, "settings", "effective_samples"))
    if widening is not None:
        told.append(f"σ is {significant(widening, 2)} times the textbook’s, in the median over all parameters")
    elif rows and effective:
        factor = significant(math.sqrt(rows / effective), 2)
        told.append(f"{count(rows)} rows are worth {count(effective)} independent ones, which widens σ {factor}-fold")
    found = [str(part(row, "told") or "") for row in items(record, "statistics", "whiteness")]
    if found:
        coloured = sum(not text.startswith("white") for text in found)
        told.append(f"residuals of {coloured} of {len(found)} {_groups(record)} are coloured")
    return told


def _groups(record: Record) -> str:
    return "models" if part(record, "model") == "energy" else "joints"


def _source(record: Record) -> str:
    """How σ was reckoned, and the noise in each band of frequency that it rests on."""
    covariance = part(record, "statistics", "covariance")
    if not isinstance(covariance, Mapping):
        return ""
    rows = [row for row in items(covariance, "noise") if isinstance(row, Mapping)]
    ends = [finite(x) or 0.0 for x in items(covariance, "edges_hz")]
    told = f"σ: {covariance.get('method')}. The textbook’s, {covariance.get('textbook_method')}, stands beside it in "
    told += "the table of parameters"
    shown = f'<p class="remark">{prose(told)}</p>'
    if not rows or not ends:
        return shown
    starts = [0.0, *ends[:-1]]
    head = [("of", "text")]
    head += [
        (f"{esc(significant(a, 2))} to {esc(significant(b, 2))}{unit('Hz')}", "number")
        for a, b in zip(starts, ends, strict=True)
    ]
    head.append(("unit", "text"))
    body = [
        [esc(row.get("group", "")), *(esc(significant(x, 2)) for x in items(row, "std")), esc(row.get("unit") or "")]
        for row in rows
        if len(items(row, "std")) == len(ends)
    ]
    noise = table(head, body, "Noise by band of frequency")
    return shown + fold("Noise by band of frequency", noise, "standard deviation of the rows, were it all in that band")


def _whiteness(record: Record) -> str:
    """Each group of rows: how alike neighbours are, two tests, and what they say."""
    rows = [row for row in items(record, "statistics", "whiteness") if isinstance(row, Mapping)]
    if not rows:
        why = reason(record, "statistics", "whiteness")
        return absent("No tests of whiteness.", why) if part(record, "statistics") else ""
    head = [("rows of", "text"), ("neighbours,<br>correlation", "number"), ("Durbin-<br>Watson", "number")]
    head += [("Ljung-Box,<br>p", "number"), ("in words", "prose")]
    body = []
    for row in rows:
        p = finite(row.get("chance"))
        cells = [esc(row.get("group", "")), esc(significant(row.get("neighbours"), 2))]
        cells += [esc(significant(row.get("durbin_watson"), 3))]
        cells.append("&lt; 0.001" if p is not None and p < 0.001 else esc(significant(p, 2)))
        body.append([*cells, prose(row.get("told") or "")])
    notes = Notes()
    lags = finite(rows[0].get("lags"))
    notes.plain.append(
        "Of the rows that were solved. Durbin and Watson’s figure is 2 where neighbours are independent, less where "
        f"they err alike; Ljung and Box test {count(lags) if lags else 'all'} lags at once, p small where rows are not "
        "white"
    )
    return "<h3>Whiteness</h3>" + table(head, body, "Whiteness of the residuals", notes)


def _drawn(record: Record, lag: np.ndarray, values: np.ndarray) -> str:
    robot, rows = joints(record), finite(part(record, "settings", "rows"))
    bound = 2 / math.sqrt(rows / len(robot)) if rows and robot else None
    outside = _outside(record, lag, values, bound)
    inflation = items(record, "settings", "rows_per_effective_sample")
    inflation = inflation if len(inflation) == len(robot) and not part(record, "statistics") else []
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
    return f"<h3>Autocorrelation</h3>{_words(record, outside)}{marks}{figures(drawn)}"


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
