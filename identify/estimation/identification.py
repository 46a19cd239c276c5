"""What was learnt: parameters, their uncertainty, and the record of how they came about."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from identify.errors import InputError
from identify.estimation.prediction import predicted_effort
from identify.estimation.settings import Settings
from identify.logs.folders import check_replaceable, replacing_folder
from identify.logs.log import Log
from identify.logs.slicing import select
from identify.regressor.columns import MORE
from identify.regressor.friction import FURTHER
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

FORMAT = "identify/parameters/1"
FRICTION = (("viscous", "Fv"), ("coulomb", "Fs"), ("offset", "off"), *((form, MORE[form][0]) for form in FURTHER))
"""Keys of a joint's friction in the record, and the letters of their columns; further forms are there where they were
fitted."""

RECORD, CURVES, ROBOT = "parameters.json", "curves.npz", "robot.toml"


@dataclass(frozen=True, eq=False)
class Identification:
    """The result of a fit.

    names (p,) those of `regressor`: base parameters, then per joint Fv, Fs, offset, then transmission columns, then
    those of further forms of friction. parameters, std (p,) and covariance (p, p) in that order, SI. `record` is
    parameters.json as a table, `curves` the arrays that figures need.
    """

    robot: Robot
    names: tuple[str, ...]
    parameters: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    record: dict[str, Any]
    curves: dict[str, np.ndarray]

    @property
    def settings(self) -> Settings:
        """How logs were, and for predictions are, processed."""
        return Settings.from_dict(self.record["settings"])

    @property
    def regressor(self) -> Regressor:
        """The regressor of the parameters, with the forms of friction that they are for."""
        return self.settings.suited(Regressor(self.robot))

    def predict(self, log: Log) -> np.ndarray:
        """(N, n) joint effort [N·m or N] at the log's samples, from its positions alone, in the robot's joint order."""
        log = select(log, self.robot.joint_names)
        return predicted_effort(self.regressor, log, self.parameters, self.settings)

    def summary(self) -> str:
        """A page of text: verdict, residuals per joint, parameters with their standard deviations."""
        from identify.estimation.summary import summary

        return summary(self.record)

    def save(self, folder: str | os.PathLike[str], force: bool = False) -> Path:
        """Write the result folder, whole or not at all: parameters.json, curves.npz, robot.toml.

        OutputError if it exists and force is not set.
        """
        return save_folder(self.record, self.curves, self.robot, folder, force)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Identification:
        """Read a result folder. InputError, in one line, where it is none, is damaged, or holds no parameters."""
        from identify.robot.library import robot_digest
        from identify.robot.toml import read_toml

        folder = Path(folder)
        record, curves = load_folder(folder)
        if record["verdict"]["status"] == "reject":
            raise InputError(f"{folder}: the log was refused, so there are no parameters; see {folder / RECORD}")
        try:
            names, parameters, covariance = _estimates(record)
            Settings.from_dict(record["settings"])
            source, digest = str(record["robot"]["source"]), record["robot"]["sha256"]
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{folder / RECORD}: is damaged ({error!r}); fit again") from error
        robot = read_toml(folder / ROBOT, source=source)
        if robot_digest(robot) != digest:
            raise InputError(f"{folder / ROBOT}: is not the robot that was fitted; fit again")
        return cls(robot, names, parameters, np.sqrt(np.diag(covariance)), covariance, record, curves)


def _estimates(record: dict[str, Any]) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Names (p,), parameters (p,) and covariance (p, p) of a record. KeyError, TypeError or ValueError without them."""
    rows = [*record["base_parameters"], *record["transmission"]]
    values = {row["name"]: row["estimate"] for row in rows}
    for j, row in enumerate(record["friction"], 1):
        values |= {f"{c}{j}": row[k]["estimate"] for k, c in FRICTION if row.get(k) is not None}
    names = tuple(record["names"])
    parameters = np.array([values[name] for name in names], dtype=float)
    covariance = np.array(record["covariance"], dtype=float)
    if not names or covariance.shape != (len(names), len(names)):
        raise ValueError(f"covariance {covariance.shape} of {len(names)} parameters")
    return names, parameters, covariance


def load_folder(folder: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The record and the curves of a result folder, a refused log's too. InputError where it is none."""
    path = folder / RECORD
    if not path.is_file():
        raise InputError(f"{folder}: is no result folder, {RECORD} is missing; `identify fit` makes one")
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: can't be read ({error}); fit again") from error
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(f'{path}: is not of format "{FORMAT}"; fit again')
    verdict = record.get("verdict")
    if not isinstance(verdict, dict) or not isinstance(verdict.get("status"), str):
        raise InputError(f"{path}: is damaged, it has no verdict; fit again")
    curves: dict[str, np.ndarray] = {}
    if (folder / CURVES).is_file():
        try:
            # numpy leaves a damaged file open when it opens it itself.
            with open(folder / CURVES, "rb") as stream, np.load(stream, allow_pickle=False) as stored:
                curves = {name: stored[name] for name in stored.files}
        except (ValueError, OSError, EOFError, BadZipFile) as error:
            raise InputError(f"{folder / CURVES}: can't be read ({error}); fit again") from error
    return record, curves


def save_folder(
    record: dict[str, Any],
    curves: dict[str, np.ndarray],
    robot: Robot,
    folder: str | os.PathLike[str],
    force: bool = False,
    extra: dict[str, str] | None = None,
) -> Path:
    """Write a result folder beside its place and rename it there: the old one is replaced whole or not at all.

    extra: further text files by name (the report). OutputError if the folder exists and force is not set.
    """
    from identify.robot.toml import write_toml

    target = Path(folder)
    check_replaceable(target, RECORD, force)
    with replacing_folder(target) as part:
        text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
        (part / RECORD).write_text(text + "\n", encoding="utf-8")
        (part / ROBOT).write_text(write_toml(robot), encoding="utf-8")
        with open(part / CURVES, "wb") as stream:
            np.savez_compressed(stream, **curves)  # type: ignore[arg-type]
        for name, content in (extra or {}).items():
            (part / name).write_text(content, encoding="utf-8")
    return target
