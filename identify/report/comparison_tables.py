"""Tables of two results side by side: what they are, how they predict, their parameters, friction and links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from identify.numbers import DASH, column, count, estimate, given, percent, significant
from identify.report.markup import Notes, esc, status, table, unit
from identify.report.record import short
from identify.report.symbols import symbol_html
from identify.validation.comparison_findings import difference_text, plus

SIDES = ("A", "B")
UNITS = {"_rad_s": "rad/s", "_hz": "Hz", "_s": "s", "_velocity": "rad/s", "_distance": "rad"}
"""Units that end the names of settings; of sliding joints m stands for rad."""

Row = Mapping[str, Any]


def about(comparison: Row) -> str:
    """What was fitted to what, and every setting in which the two differ."""
    sides = comparison["results"]

    def logs(side: Row, role: str) -> str:
        mine = [log for log in side["logs"] if log["role"] == role]
        told = [f"{short(log['path'])}, {given(log['duration_s'], 3)}\u00a0s{_kind(log)}" for log in mine]
        return "<br>".join(esc(text) for text in told) or DASH

    rows = [
        ["folder", *(esc(side["folder"]) for side in sides)],
        ["trained on", *(logs(side, "train") for side in sides)],
        ["tested on", *(logs(side, "test") for side in sides)],
        ["effective samples", *(esc(count(side["effective_samples"])) for side in sides)],
        ["parameters", *(esc(count(side["parameters"])) for side in sides)],
        ["scaled condition number", *(esc(significant(side["condition_number"], 2)) for side in sides)],
        ["verdict", *(status(str(side["verdict"]["status"])) for side in sides)],
    ]
    settings = [[esc(setting_name(row["name"])), *map(_setting, row["values"])] for row in comparison["settings"]]
    tables = [{str(use.get("use")): str(use.get("status")) for use in side["verdict"]["uses"] or []} for side in sides]
    uses = [[esc(name), *(_state(table.get(name)) for table in tables)] for name in {**tables[0], **tables[1]}]
    body: list[Sequence[str] | str] = [*rows]
    body += ["Verdict on each use", *uses] if uses else []
    body += ["Settings that differ", *settings] if settings else []
    notes = Notes()
    if not settings:
        notes.plain.append("model, estimator, settings and software are the same")
    return table([("", "text"), *((name, "text") for name in SIDES)], body, "What was compared", notes)


def _kind(log: Row) -> str:
    if not log["simulated"]:
        return ""
    return f", simulated{', noise ' + str(log['noise']) if log['noise'] else ''}"


def setting_name(name: str) -> str:
    """A setting in words, with its unit: "position cutoff [Hz]" of position_cutoff_hz."""
    for ending, text in UNITS.items():
        if name.endswith(ending):
            return f"{name.removesuffix(ending).replace('_', ' ')} [{text}]"
    return name.replace("_", " ")


def _state(word: str | None) -> str:
    return status(word) if word else DASH


def _setting(value: Any) -> str:
    if value is None:
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    return esc(given(value) if isinstance(value, float) else str(value).replace("_", " "))


def residuals(row: Row, label: str) -> str:
    """Errors of both for one log or the training logs: moving RMSE of each joint, and of all joints together."""
    joints = row["per_joint"]
    units = list(dict.fromkeys(joint["unit"] for joint in joints))
    one = unit(units[0]) if len(units) == 1 else ""
    pieces = row.get("per_joint_pieces")
    head = [("joint", "text")] + ([] if one else [("unit", "text")])
    head += [(f"{name}, RMSE<br>moving{one}", "number") for name in SIDES]
    head += [(f"{name}, RMSE<br>at rest{one}", "number") for name in SIDES]
    head += [("moving,<br>B of A" + unit("%"), "number")] + (
        [("seconds that<br>A : B won", "number")] if pieces else []
    )
    columns = []
    for key in ("moving_rmse", "rest_rmse"):
        flat = column([x for joint in joints for x in joint[key]])
        columns += [flat[0::2], flat[1::2]]
    body: list[Sequence[str] | str] = []
    for k, joint in enumerate(joints):
        cells = [esc(joint["joint"])] + ([] if one else [esc(joint["unit"])])
        cells += [esc(texts[k]) for texts in columns]
        a, b = joint["moving_rmse"]
        cells.append(esc(significant(100 * b / a, 3)) if a and b is not None else DASH)
        cells += [f"{pieces[k][0]} : {pieces[k][1]}"] if pieces else []
        body.append(cells)
    return table(head, body, label)


def totals(row: Row) -> str:
    """Both residuals of all joints together as words, HTML."""
    moving, overall = (row["total"][key] for key in ("moving_relative_residual_percent", "relative_residual_percent"))
    return (
        f"A leaves <b>{percent(moving[0], 3)}</b> of the torque unexplained while the joints move, B "
        f"<b>{percent(moving[1], 3)}</b>; with rest counted {percent(overall[0], 3)} and {percent(overall[1], 3)}."
    )


def friction(rows: Sequence[Row]) -> str:
    """Friction of each joint at a slow and a fast speed in both results, the difference, and whether it changed."""
    head = [("joint", "text"), ("speed", "number"), *((name, "number") for name in SIDES)]
    head += [("B − A", "number"), ("unit", "text"), ("of A" + unit("%"), "number"), ("p (Holm)", "number")]
    head += [("state", "word")]
    body = []
    notes = Notes()
    for row in rows:
        for k, level in enumerate(row["levels"]):
            cells = [esc(row["joint"]), f"{esc(significant(level['speed'], 2))} {esc(row['speed_unit'])}"]
            cells += [_shown(side) for side in level["estimates"]]
            cells += [esc(difference_text(level["difference"], level["std"])), esc(row["effort_unit"])]
            a = level["estimates"][0]["estimate"]
            share = 100 * level["difference"] / abs(a) if a else None
            cells += [f"{plus(share)}{significant(share, 2)}" if share is not None else DASH]
            if k:
                cells += ["", ""]
            elif row["p"] is None:
                why = "other forms of friction" if not row["same_forms"] else "both were fitted to the same log"
                cells += [notes.missing(why), status("not tested")]
            else:
                cells += [_p(row["p"]), status("changed" if row["changed"] else "no change")]
            body.append(cells)
    notes.plain.append(
        "Friction at a speed is half the difference between both directions of motion. The test is of all constants "
        "of a joint at once, its offset included, corrected for the number of joints"
    )
    return table(head, body, "Friction of every joint", notes)


def parameters(rows: Sequence[Row]) -> str:
    """Both estimates of every shared parameter, their difference in its σ, and whether it changed."""
    head = [("symbol", "text")]
    for name in SIDES:
        head += [(name, "value"), ("± σ", "sigma")]
    head += [("B − A", "number"), ("unit", "text"), ("in σ", "number"), ("p (Holm)", "number"), ("state", "word")]
    scores = column([row["z"] for row in rows], most=2)
    body = []
    for row, score in zip(rows, scores, strict=True):
        cells = [symbol_html(row["name"])]
        for side in row["estimates"]:
            shown = estimate(side["estimate"], side["std"])
            if shown.determined:
                cells += [esc(shown.value), f"± {esc(shown.sigma)}" if shown.sigma else ""]
            else:
                cells += [f'<span class="bound">|x| &lt; {esc(shown.bound)}</span>', ""]
        cells += [esc(difference_text(row["difference"], row["std"])), esc(row["unit"]), score]
        cells.append("" if row["p"] is None else _p(row["p"]))
        cells.append("" if row["changed"] is None else status("changed" if row["changed"] else "no change"))
        body.append(cells)
    notes = Notes()
    if any(row["kind"] == "friction" for row in rows):
        notes.plain.append("Constants of friction are tested joint by joint, in the table of friction")
    return table(head, body, "Both estimates of every parameter", notes)


def links(rows: Sequence[Row]) -> str:
    """Mass, centre of mass and smallest eigenvalue of every link in both results."""
    head = [("link of", "text"), *((f"{name}, mass{unit('kg')}", "number") for name in SIDES)]
    head += [(f"{name}, centre<br>x, y, z{unit('m')}", "number") for name in SIDES]
    head += [(f"{name}, smallest<br>eigenvalue", "number") for name in SIDES]
    body = []
    for row in rows:
        cells = [esc(row["name"]), *(esc(significant(link.get("mass"), 3)) for link in row["links"])]
        for link in row["links"]:
            cells.append(esc(", ".join(significant(round(x, 6), 2) for x in link.get("com") or ()) or DASH))
        cells += [esc(significant(link.get("min_eigenvalue"), 2)) for link in row["links"]]
        body.append(cells)
    return table(head, body, "Links that physics allows, of both results")


def _shown(side: Row) -> str:
    shown = estimate(side["estimate"], side["std"])
    return esc(shown.text if shown.determined else f"|x| < {shown.bound}")


def _p(p: float) -> str:
    return "&lt; 0.001" if p < 0.001 else esc(significant(p, 2))
