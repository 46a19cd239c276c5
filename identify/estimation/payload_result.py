"""What was learnt of a load: its ten parameters, their uncertainty, and the record of how they came about."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from identify.errors import InputError
from identify.estimation.identification import CURVES
from identify.logs.folders import check_replaceable, replacing_folder
from identify.numbers import entry, significant
from identify.robot.robot import Link

FORMAT = "identify/payload/1"
RECORD = "payload.json"

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


@dataclass(frozen=True, eq=False)
class Payload:
    """The result of `identify payload`.

    parameters (10,) XX XY XZ YY YZ ZZ MX MY MZ M of the load about O_n in the axes of R_n, covariance (10, 10), SI; NaN
    where the logs don't tell. gains (n,): torque or force per unit of logged effort, where the mass was known. `record`
    is payload.json as a table, `curves` the arrays that figures need.
    """

    parameters: np.ndarray
    covariance: np.ndarray
    gains: np.ndarray | None
    record: dict[str, Any]
    curves: dict[str, np.ndarray]

    @property
    def possible(self) -> Link | None:
        """The load as a body that can be, in R_n: the nearest to the estimate; None where none was found."""
        physical = self.record["physical"]
        if physical is None:
            return None
        mass, x, y, z, *inertia = (row["value"] for row in physical["body"])
        return Link(mass, (x, y, z), tuple(inertia))

    def summary(self) -> str:
        """A page of text: verdict, the load with its standard deviations, residuals without and with it."""
        return summary(self.record)

    def save(self, folder: str | os.PathLike[str], force: bool = False) -> Path:
        """Write the result folder, whole or not at all: payload.json, curves.npz.

        OutputError if it exists and force is not set.
        """
        return save_payload(self.record, self.curves, folder, force)


def save_payload(
    record: dict[str, Any],
    curves: dict[str, np.ndarray],
    folder: str | os.PathLike[str],
    force: bool = False,
    page: str = "",
) -> Path:
    """Write a result folder beside its place and rename it there; page: the report's HTML, where there is one."""
    target = Path(folder)
    check_replaceable(target, RECORD, force)
    with replacing_folder(target) as part:
        text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
        (part / RECORD).write_text(text + "\n", encoding="utf-8")
        with open(part / CURVES, "wb") as stream:
            np.savez_compressed(stream, **curves)  # type: ignore[arg-type]
        if page:
            (part / "report.html").write_text(page, encoding="utf-8")
    return target


def load_payload(folder: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The record and the curves of a payload's folder, a refused one's too. InputError where it is none."""
    path = folder / RECORD
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        with open(folder / CURVES, "rb") as stream, np.load(stream, allow_pickle=False) as stored:
            curves = {name: stored[name] for name in stored.files}
    except (ValueError, OSError, EOFError, BadZipFile) as error:
        raise InputError(
            f"{folder}: its {RECORD} or {CURVES} can't be read ({error}); identify the load again"
        ) from error
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(f'{path}: is not of format "{FORMAT}"; identify the load again')
    return record, curves


def answer(record: dict[str, Any]) -> str:
    """The load in one sentence."""
    if record["verdict"]["status"] == "reject":
        return "The load can't be told from these logs."
    body = {row["name"]: row for row in record["load"]["body"]}
    mass = body["mass"]
    told = (
        f"The load has the stated mass of {significant(mass['estimate'], 5)} kg"
        if record["gains"]
        else f"The load has a mass of {_plus_minus(mass)} kg"
    )
    centre = [body[f"com_{axis}"] for axis in "xyz"]
    if all(row["estimate"] is not None for row in centre):
        places = ", ".join(" ± ".join(entry(1e3 * row["estimate"], 1e3 * row["std"])) for row in centre)
        told += f"; its centre of mass is at x, y, z = {places} mm in {subscripts(record['load']['frame'])}"
    return f"{told}."


def summary(record: dict[str, Any]) -> str:
    """Verdict, load, gains and residuals of a record, with notes where one is due."""
    verdict = record["verdict"]
    status = {"accept": "accepted", "warn": "accepted with warnings", "reject": "refused"}[verdict["status"]]
    lines = [f"{record['robot']['name']}: load on {record['load']['link']}: {status}"]
    for log in record["logs"]:
        kind = "simulated" if log["simulated"] else "measured"
        lines.append(f"  {log['role']:<8} {log['path']} ({kind}, {log['duration_s']:.1f} s, {log['samples']} samples)")
    lines.append(f"  unloaded {record['unloaded']['path']}")
    if verdict["status"] == "reject":
        return "\n".join([*lines, "", *(f"- {reason}" for reason in verdict["reasons"] + verdict["actions"])])
    frame = subscripts(record["load"]["frame"])
    lines += [
        "",
        answer(record),
        "",
        f"load in {frame}, inertia about its centre of mass",
        *_rows(record["load"]["body"]),
    ]
    lines += [f"about O{frame[1:]}, first moments and inertia", *_rows(record["load"]["standard"])]
    if record["load"]["flange"]:
        lines += ["in the tool's frame, inertia about its centre of mass", *_rows(record["load"]["flange"])]
    if record["gains"]:
        lines += ["drive gains, torque per unit of logged effort"]
        lines += [f"  {row['joint']:<16} {_plus_minus(row):>24} {row['unit']}" for row in record["gains"]]
    lines += ["", *_residuals(record), ""]
    return "\n".join([*lines, *(f"- {text}" for text in [*verdict["reasons"], *verdict["actions"]])])


def subscripts(text: str) -> str:
    """R_6 as R₆, and O_6 as O₆."""
    return re.sub(r"\b([RO])_(\d+)", lambda found: found[1] + found[2].translate(_SUBSCRIPTS), text)


def _plus_minus(row: dict[str, Any]) -> str:
    if row["estimate"] is None:
        return "not told"
    return " ± ".join(part for part in entry(row["estimate"], row["std"]) if part)


def _rows(rows: list[dict[str, Any]]) -> list[str]:
    lines = []
    for row in rows:
        truth = f"  truth {significant(row['truth'], 4)}" if row.get("truth") is not None else ""
        lines.append(f"  {row['name']:<6} {_plus_minus(row):>34} {row['unit']}{truth}".rstrip())
    return lines


def _residuals(record: dict[str, Any]) -> list[str]:
    """Root mean square error per joint while moving: by the arm without its load, and with it."""
    lines = [f"{'error moving':<16}{'without load':>14}{'with load':>14}  unit"]
    for bare, loaded in zip(record["fit"]["without"]["per_joint"], record["fit"]["with"]["per_joint"], strict=True):
        cells = "".join(f"{significant(row['moving_rmse']):>14}" for row in (bare, loaded))
        lines.append(f"{bare['joint']:<16}{cells}  {bare['unit']}")
    total = (record["fit"][key]["moving_relative_residual_percent"] for key in ("without", "with"))
    return [*lines, f"{'all joints':<16}{''.join(f'{significant(x):>14}' for x in total)}  % of the torque"]
