"""One log's fit as a function over files, which any engine can map: paths and plain options in, plain values out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identify.batch.sources import Source
from identify.errors import IdentifyError

FAILED = "failed"
"""Status of a log that could not be read or fitted at all; the others are those of a verdict."""

WORST = 3
"""Base parameters of the largest relative standard deviation that an entry names."""

Progress = Callable[[float, str], None] | None


@dataclass(frozen=True)
class Options:
    """What holds for every log of a batch, as the options of `identify fit` of the same names."""

    joints: str = ""
    gravity: tuple[float, ...] | None = None
    map: str | None = None
    topic: str | None = None
    model: str | None = None
    estimator: str | None = None
    command: str = ""


def fit_log(
    source: Source, robot: str, folder: str | None = None, options: Options = Options(), progress: Progress = None
) -> dict[str, Any]:
    """Fit one log of a robot (name or file) and tell in plain values, fit for JSON, what came of it.

    folder: where its result folder goes, None to write none. Never raises for what is wrong with a log: `status` is
    "accept", "warn", "reject" or "failed", and `reasons` says why.
    """
    try:
        record = _record(source, robot, folder, options, progress)
    except IdentifyError as error:
        return failed(source, str(error))
    except MemoryError:
        return failed(source, "does not fit into memory; fit less of it, or on a larger machine")
    except Exception as error:
        return failed(source, f"a defect of identify: {type(error).__name__}: {error}")
    return _head(source) | {"folder": None if folder is None else source.name} | entry(record)


def entry(record: dict[str, Any]) -> dict[str, Any]:
    """Of the record of parameters.json what a summary of many needs."""
    log = next(row for row in record["logs"] if row["role"] == "train")
    verdict = record["verdict"]
    row = {
        "status": verdict["status"],
        "reasons": verdict["reasons"],
        **{key: log[key] for key in ("sha256", "samples", "duration_s", "rate_hz", "simulated")},
        "robot": {key: record["robot"][key] for key in ("name", "source", "sha256")},
        "versions": record["versions"],
        "estimator": record["estimator"],
    }
    if verdict["status"] == "reject":
        return row | _no_figures()
    fit, tests = record["fit"], record["test"]
    values = _parameters(record)
    base = record["base_parameters"]
    worst = sorted(base, key=lambda p: -p["std"] / max(abs(p["estimate"]), 1e-300))[:WORST]
    return row | {
        **{key: fit[key] for key in ("relative_residual_percent", "moving_relative_residual_percent")},
        "test_moving_relative_residual_percent": _largest(t["moving_relative_residual_percent"] for t in tests),
        "condition_number": fit["condition_number"],
        "per_joint": [
            {key: joint[key] for key in ("joint", "unit", "rmse", "moving_rmse")} for joint in fit["per_joint"]
        ],
        "identified": sum(p["identified"] for p in record["base_parameters"]),
        "base_parameters": len(base),
        "worst": [{key: p[key] for key in ("name", "relative_std_percent")} for p in worst],
        "parameters": values,
        "independent_parameters": independent(record["covariance"]),
    }


def independent(covariance: list[list[float]]) -> float:
    """How many independent parameters p correlated ones amount to in a sum of squares: p²/‖correlation‖²."""
    import numpy as np

    matrix = np.array(covariance)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return float(len(matrix) ** 2 / np.sum((matrix / np.outer(scale, scale)) ** 2))


def _record(source: Source, robot: str, folder: str | None, options: Options, progress: Progress) -> dict[str, Any]:
    from identify import workflow
    from identify.logs.reading import read_log
    from identify.robot.library import load_robot

    arm = load_robot(robot, options.joints, options.gravity)  # type: ignore[arg-type]

    def read(path: str) -> Any:
        table = options.map and not (path.lower().endswith(".mcap") or Path(path).is_dir())
        return read_log(path, options.map if table else None, arm.joint_names, None if table else options.topic)

    logs, test = [read(source.log)], [read(path) for path in source.test]
    choice: dict[str, Any] = {"model": options.model, "estimator": options.estimator, "command": options.command}
    choice["friction"] = "plain"  # parameters of one kind, to be compared between logs
    if folder is None:
        return workflow.fit(logs, arm, test, progress=progress, **choice).record
    return workflow.fit_to_folder(logs, arm, Path(folder) / source.name, test, progress=progress, **choice)


def failed(source: Source, reason: str) -> dict[str, Any]:
    """The entry of a log that could not be read, or whose process died."""
    unknown: dict[str, Any] = dict.fromkeys(("folder", "sha256", "samples", "duration_s", "rate_hz", "simulated"))
    unknown |= dict.fromkeys(("robot", "versions", "estimator"))
    return _head(source) | {"status": FAILED, "reasons": [" ".join(reason.split())], **unknown, **_no_figures()}


def _head(source: Source) -> dict[str, Any]:
    return {"name": source.name, "unit": source.unit, "log": source.log, "test_logs": [*source.test]}


def _no_figures() -> dict[str, Any]:
    figures = ("relative_residual_percent", "moving_relative_residual_percent", "test_moving_relative_residual_percent")
    row: dict[str, Any] = dict.fromkeys((*figures, "condition_number", "identified", "base_parameters"))
    return row | {"per_joint": [], "worst": [], "parameters": [], "independent_parameters": None}


def _parameters(record: dict[str, Any]) -> list[dict[str, Any]]:
    """name, unit, estimate and std of every parameter, in the order of the covariance."""
    from identify.estimation.identification import FRICTION

    rows = {row["name"]: row for row in (*record["base_parameters"], *record["transmission"])}
    for j, joint in enumerate(record["friction"], 1):
        rows |= {f"{letters}{j}": joint[key] for key, letters in FRICTION if joint.get(key)}
    return [{"name": name, **{key: rows[name][key] for key in ("unit", "estimate", "std")}} for name in record["names"]]


def _largest(values: Any) -> float | None:
    known = [value for value in values if value is not None]
    return max(known) if known else None
