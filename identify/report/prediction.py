"""Sections 2 and 3: how wrong on unseen motion, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify import numbers
from identify.numbers import finite, given, percent, significant
from identify.report import curve_figures
from identify.report.markup import Notes, Section, absent, esc, figures, fold, legend, mark, prose, status, table, unit
from identify.report.record import (
    UNKNOWN,
    Record,
    items,
    joint_row,
    joints,
    logs,
    part,
    ratio,
    reason,
    rejected,
    short,
    tests,
)

SIDE_BY_SIDE = 8  # joints up to which every panel is open
WORST = 6  # panels that stay open beyond that
PANELS = 40  # curve panels a page may hold
WORTH_TELLING = 1.0  # share of time outside the training range [%] from which it is a warning; the table has all


def section(record: Record) -> Section:
    """The residuals on held-out logs; without one the section says so and shows the training fit, named as such."""
    held_out, warnings, body = tests(record), [], []
    if held_out:
        for k, test in enumerate(held_out):
            shown = _summary(test, f"On unseen motion ({short(part(test, 'path'))})") + _table(record, test, True)
            body.append(shown if k == 0 else fold(f"Test log {k + 1}", shown, short(part(test, "path"))))
            warnings += _outside(record, test)
    else:
        why = reason(record, "test")
        words = "How wrong the model is on unseen motion is not known: "
        words += "no test log was given" if why == UNKNOWN else why
        body.append(f'<p class="lead"><b>{status("NOT TESTED")}</b> {prose(words)}</p>')
    fit = part(record, "fit")
    if fit:
        shown = _summary(fit, "On the motion it was fitted to") + _table(record, fit, False)
        if held_out:
            body.append(fold("The same figures on the training logs", shown, "not a test: the fit has seen them"))
        else:
            body.append("<h3>Fit on the training logs, which is no test</h3>" + shown)
    elif held_out or not rejected(record):
        body.append(absent("No model was fitted.", reason(record, "fit")))
    else:
        body = [absent("No model was fitted.", reason(record, "fit"))]
    shown, question = "".join(body), "How wrong on unseen motion?"
    why = "" if held_out or fit else reason(record, "fit")
    return Section("prediction", 2, "Prediction", question, shown, warnings=tuple(warnings), why=why)


def _summary(results: Mapping[str, Any], where: str) -> str:
    moving, overall = results.get("moving_relative_residual_percent"), results.get("relative_residual_percent")
    told = f"{esc(where)} the model leaves <b>{percent(moving)}</b> of the torque unexplained while the joints move"
    told += f", and {percent(overall)} with the samples at rest counted."
    nominal = finite(results.get("nominal_relative_residual_percent"))
    if nominal is not None:
        told += f" The nominal model leaves {percent(nominal)}."
    energy = finite(results.get("energy_residual_percent"))
    if energy is not None:
        told += f" Of the energy that the model was fitted to, {percent(energy)} stays unexplained."
    motion = part(results, "motion", "told")
    new = f'<p class="remark">{prose(f"How new this motion is: {motion}")}</p>' if motion else ""
    return f'<p class="lead">{told}</p>{new}'


def _table(record: Record, results: Mapping[str, Any], held_out: bool) -> str:
    rows = [row for row in items(results, "per_joint") if isinstance(row, Mapping)]
    if not rows:
        return absent("No figures for single joints.", reason(results, "per_joint"))
    notes = Notes()
    units = list(dict.fromkeys(str(row.get("unit", "")) for row in rows))
    one = units[0] if len(units) == 1 else ""
    suffix = unit(one) if one else ""
    names = {"moving_rmse": "RMSE<br>moving", "rest_rmse": "RMSE<br>at rest", "max_abs_error": "largest<br>error"}
    nominal = any(row.get("nominal_moving_rmse") is not None for row in rows)
    keys = ["moving_rmse", "rest_rmse", *(["nominal_moving_rmse"] if nominal else []), "max_abs_error"]
    names["nominal_moving_rmse"] = "nominal,<br>moving"
    columns = {key: numbers.column([row.get(key) for row in rows]) for key in keys}
    shares = numbers.column([ratio(row.get("moving_rmse"), row.get("std_of_signal")) for row in rows])
    rests = numbers.column([row.get("rest_share_percent") for row in rows], most=0)
    outside: list[float | None] = [None] * len(rows)
    if held_out:
        outside = [_outside_share(results, k, row) for k, row in enumerate(rows)]
    limit, whose = _limit(record)
    head = [("joint", "text")] + ([] if one else [("unit", "text")])
    head += [(names[key] + suffix, "number") for key in keys]
    head += [("moving, of<br>signal’s std" + unit("%"), "number"), ("time at<br>rest" + unit("%"), "number")]
    head += [("time outside<br>training range" + unit("%"), "number")] if held_out else []
    verdicts = [_verdict(row, limit) for row in rows] if held_out and _judged(rows, limit) else []
    head += [("verdict", "word")] if verdicts else []
    body = []
    for k, row in enumerate(rows):
        cells = [esc(row.get("joint", ""))] + ([] if one else [esc(row.get("unit", ""))])
        cells += [_cell(columns[key][k], row, key, notes) for key in keys]
        cells += [_cell(shares[k], row, "std_of_signal", notes), _cell(rests[k], row, "rest_share_percent", notes)]
        if held_out:
            told = outside[k]
            why = reason(results, "outside_training_percent")
            cells += [notes.missing(why) if told is None else significant(told, 2)]
        cells += verdicts[k : k + 1]
        body.append(cells)
    if held_out and not nominal:
        why = reason(rows[0], "nominal_moving_rmse")
        why = reason(results, "nominal_relative_residual_percent") if why == UNKNOWN else why
        notes.plain.append(f"No nominal model to compare with: {why}")
    if limit is not None and verdicts:
        notes.plain.append(f"Verdict: moving RMSE under {given(limit)} % of the signal’s std{whose}")
    return table(head, body, "Error of every joint", notes)


def _cell(text: str, row: Mapping[str, Any], key: str, notes: Notes) -> str:
    if text != numbers.DASH:
        return esc(text)
    why = reason(row, key)
    if why == UNKNOWN and key == "rest_rmse":
        why = "the joint was never at rest"
    return notes.missing(why)


def _limit(record: Record) -> tuple[float | None, str]:
    """The limit [% of a signal's std] that the verdict holds joints to, and whose it is; None where it names none."""
    for use in items(record, "verdict", "uses"):
        limit = finite(part(use, "limit_percent"))
        if limit is not None and str(part(use, "use")).startswith("prediction"):
            source = part(use, "limit_source")
            return limit, f" ({source})" if source else ""
    return None, ""


def _judged(rows: Sequence[Mapping[str, Any]], limit: float | None) -> bool:
    """Whether any joint can be given a verdict without a limit being invented for it."""
    return limit is not None or any(row.get("status") or finite(row.get("nominal_moving_rmse")) for row in rows)


def _verdict(row: Mapping[str, Any], limit: float | None) -> str:
    """The joint's verdict where the record gives one or a limit for it; and how it compares with the nominal model."""
    ours, nominal = finite(row.get("moving_rmse")), finite(row.get("nominal_moving_rmse"))
    share = ratio(ours, row.get("std_of_signal"))
    compared = ""
    if ours is not None and nominal is not None:
        compared = "better than nominal" if ours < nominal else "no better than nominal"
    if row.get("status"):
        return status(str(row["status"]))
    if limit is not None and share is not None:
        word = status("MET" if share < limit else "NOT MET")
        return f"{word}, {compared}" if compared else word
    return f"{mark('MET' if compared.startswith('better') else 'warn')}{compared}" if compared else status("NOT TESTED")


def _outside_share(results: Mapping[str, Any], k: int, row: Mapping[str, Any]) -> float | None:
    listed = items(results, "outside_training_percent")
    value = row.get("outside_training_percent", listed[k] if k < len(listed) else None)
    return finite(value)


def _outside(record: Record, test: Mapping[str, Any]) -> list[str]:
    names = []
    for k, row in enumerate(items(test, "per_joint")):
        share = _outside_share(test, k, row)
        if share is not None and share >= WORTH_TELLING:
            names.append(f"{esc(row.get('joint', ''))} {significant(share, 2)} %")
    if not names:
        return []
    return [f"{esc(short(test.get('path')))} leaves the range of the training motion: {', '.join(names)} of its time."]


def curves_section(record: Record, curves: Mapping[str, np.ndarray]) -> Section:
    """Curves of the first test log open (of the first training log where there is none), the others folded."""
    robot = joints(record)
    found = [(f"test{k}", test, "held out") for k, test in enumerate(tests(record))]
    train = logs(record, "train")
    count = max(len(train), sum(key.startswith("train") and key.endswith("/time") for key in curves))
    fit = part(record, "fit") or {}
    found += [(f"train{k}", {**(train[k] if k < len(train) else {}), "fit": fit}, "training") for k in range(count)]
    body: list[str] = []
    left: list[str] = []
    spent = 0
    for key, log, kind in found:
        arrays = select(curves, key)
        if arrays is None:
            continue
        size = arrays["measured"].shape[1]
        title = f"{short(log.get('path', key))}, {kind}"
        if body and spent + size > PANELS:
            left.append(title)
            continue
        spent += size
        shown = _panels(robot[:size], arrays, log.get("fit", log), key, bins=300 if size <= SIDE_BY_SIDE else 150)
        body.append(f"<h3>{esc(title)}</h3>{shown}" if not body else fold(f"Curves of {title}", shown))
    if left:
        body.append(
            f'<p class="remark">Not drawn, to keep the page small, but in curves.npz: {esc("; ".join(left))}.</p>'
        )
    if not body:
        why = reason(record, "curves")
        known = why != UNKNOWN
        why = why if known else "the result folder holds no arrays"
        return Section("curves", 3, "Curves", "Where is it wrong?", absent("No curves.", why), why=why)
    body.insert(0, _legend(curves))
    question = "What was recorded?" if rejected(record) else "Where is it wrong?"
    return Section("curves", 3, "Curves", question, "".join(body))


def _legend(curves: Mapping[str, np.ndarray]) -> str:
    """Swatches for what the arrays hold; a record that was refused has neither prediction nor low-pass."""
    modelled, rested = (any(name.endswith(f"/{what}") for name in curves) for what in ("predicted", "moving"))
    lines = [("measured", "measured, low-passed"), ("predicted", "predicted"), ("error", "error")]
    return legend(*(lines if modelled else [("measured", "measured")]), *([("rest", "at rest")] if rested else []))


def select(curves: Mapping[str, np.ndarray], key: str) -> dict[str, np.ndarray] | None:
    """The arrays of one log by their bare names, or None where there is nothing to draw."""
    found = {name.partition("/")[2]: np.asarray(curves[name]) for name in curves if name.startswith(f"{key}/")}
    if "time" not in found or "measured" not in found or len(found["time"]) < 2:
        return None
    shape = found["measured"].shape
    return {name: a for name, a in found.items() if name == "time" or a.shape == shape}


def _panels(
    robot: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], results: Any, key: str, bins: int
) -> str:
    rows = [joint_row(results, joint["name"]) for joint in robot]
    drawn = []
    for k, (joint, row) in enumerate(zip(robot, rows, strict=True)):
        svg = curve_figures.panel(arrays, k, joint, row, f"c-{key}-{k}", bins)
        drawn.append((esc(joint["name"]), _remark(row, joint), svg))
    if len(robot) <= SIDE_BY_SIDE or "predicted" not in arrays:
        return figures(drawn)
    error = np.nan_to_num(arrays["measured"] - arrays["predicted"])
    if "moving" in arrays:
        error = error * arrays["moving"]
    size = np.nanstd(arrays["measured"], axis=0)
    order = np.argsort(-np.sqrt(np.mean(error**2, axis=0)) / np.where(size > 0, size, np.inf), kind="stable")
    worst = [int(k) for k in order[:WORST]]
    strip = curve_figures.heat_strip(arrays, robot, f"h-{key}", robot[worst[0]]["name"])
    swatches = [(f"heat heat-{k}", words) for k, words in enumerate(curve_figures.BOUNDS)]
    others = [drawn[k] for k in range(len(robot)) if k not in worst]
    return (
        f'<figure class="wide"><figcaption><b>All joints</b><span>error in % of each signal’s std</span></figcaption>'
        f'<div class="scroll">{strip}</div>{legend(*swatches)}</figure>'
        f"<h4>The {WORST} worst while moving, worst first</h4>{figures([drawn[k] for k in worst])}"
        + fold(f"The other {len(others)} joints", figures(others))
    )


def _remark(row: Mapping[str, Any], joint: Mapping[str, Any]) -> str:
    """Moving and at-rest error in one line, for the caption."""
    pairs = [("moving", row.get("moving_rmse")), ("at rest", row.get("rest_rmse"))]
    told = [f"{word} {significant(value, 2)}" for word, value in pairs if finite(value) is not None]
    return f"RMSE {', '.join(told)} {esc(joint['effort_unit'])}" if told else ""
