"""A batch from folder to folder: every log fitted in a process of its own, the summary beside their results."""

from __future__ import annotations

import csv
import io
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from identify.batch.processes import Done, Step, over_processes
from identify.batch.reduction import FAILED, Options, Progress, failed, fit_log
from identify.batch.sources import Source

FORMAT = "identify/batch/1"
RECORD, PAGE, LOGS, PARAMETERS = "summary.json", "summary.html", "summary.csv", "parameters.csv"
Engine = Callable[[Callable[..., dict[str, Any]], Sequence[tuple[Any, ...]]], Iterator[Done | Step]]
"""Calls function(*task) for every task, wherever it likes, and tells of each as it is done, by number."""

STATES = ("accept", "warn", "reject", FAILED)


def fit_batch(
    sources: Sequence[Source],
    robot: str,
    folder: str | os.PathLike[str],
    options: Options = Options(),  # noqa: B008  frozen
    jobs: int | None = None,
    force: bool = False,
    others: Sequence[str] = (),
    progress: Progress = None,
    engine: Engine | None = None,
) -> dict[str, Any]:
    """Fit every source over `jobs` processes (None: one a core) and write results and summary; return the summary.

    robot: name or file. others: files of the folder that were left alone. engine: what maps `fit_log` over the
    logs instead of this machine's processes. The folder is written whole or not at all, whatever becomes of single
    logs. RobotError, InputError or OutputError where no log could be fitted at all.
    """
    from identify.estimation.estimators.registry import choice
    from identify.logs.folders import check_replaceable, replacing_folder
    from identify.robot.library import load_robot

    target = Path(folder)
    check_replaceable(target, RECORD, force)
    load_robot(robot, options.joints, options.gravity)  # type: ignore[arg-type]
    choice(options.model, options.estimator)
    with replacing_folder(target) as part:
        tasks = [(source, robot, str(part), options) for source in sources]
        stream = engine(fit_log, tasks) if engine else over_processes(fit_log, tasks, jobs or cores())
        entries = _gathered(tasks, stream, progress)
        if progress:
            progress(1.0, "summary")
        summary = summarise(entries, options, others)
        for name, text in files(summary).items():
            (part / name).write_text(text, encoding="utf-8", errors="backslashreplace", newline="")
    return summary


def summarise(entries: Sequence[dict[str, Any]], options: Options, others: Sequence[str] = ()) -> dict[str, Any]:
    """The content of summary.json from the entries of `fit_log`, whichever engine mapped it."""
    from identify.estimation.estimators.registry import choice
    from identify.validation.spread import spread

    entries = sorted(entries, key=lambda entry: (entry["unit"], entry["name"]))
    known = next((entry for entry in entries if entry["robot"]), None)
    counts = Counter(entry["status"] for entry in entries)
    again = {name for names in same_files(entries) for name in names[1:]}
    fitted = [entry for entry in entries if entry["parameters"] and entry["name"] not in again]
    return {
        "format": FORMAT,
        "robot": known and known["robot"],
        "model": choice(options.model, options.estimator).model,
        "estimator": next((entry["estimator"] for entry in entries if entry["estimator"]), None),
        "counts": {state: counts[state] for state in STATES},
        **spread(fitted),
        "same": same_files(entries),
        "fits": [{key: value for key, value in e.items() if key not in ("robot", "versions")} for e in entries],
        "others": list(others),
        "versions": known and known["versions"],
        "command": options.command,
    }


def same_files(entries: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Names of logs that are the same file twice or more, by its digest; they are compared once."""
    by_digest: dict[str, list[str]] = {}
    for entry in entries:
        if entry["sha256"]:
            by_digest.setdefault(entry["sha256"], []).append(str(entry["name"]))
    return [names for names in by_digest.values() if len(names) > 1]


def files(summary: dict[str, Any]) -> dict[str, str]:
    """The files of a summary by name: page, tables of logs and of parameters, and all of it as JSON."""
    from identify.report.batch import batch_page

    return {
        RECORD: json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        PAGE: batch_page(summary),
        LOGS: _table(_log_rows(summary)),
        PARAMETERS: _table(_parameter_rows(summary)),
    }


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _gathered(
    tasks: Sequence[tuple[Any, ...]], stream: Iterator[Done | Step], progress: Progress
) -> list[dict[str, Any]]:
    """The entry of every task, in their order, from what an engine tells of them as it comes."""
    entries: dict[int, dict[str, Any]] = {}
    shares = [0.0] * len(tasks)
    for told in stream:
        source: Source = tasks[told.index][0]
        if isinstance(told, Done):
            entries[told.index] = failed(source, told.death) if told.death else told.result
            shares[told.index] = 1.0
            text = f"{source.name}: {entries[told.index]['status']}"
        else:
            shares[told.index] = told.share
            text = f"{source.name}: {told.text}"
        if progress:
            progress(sum(shares) / len(shares), f"{len(entries)} of {len(tasks)} logs done; {text}")
    return [entries[i] for i in range(len(tasks))]


def _log_rows(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A row for each log: what came of it, its residuals, its worst parameters."""
    odd = {o["name"]: [p["name"] for p in o["parameters"]] for o in summary["odd"]}
    rows = []
    for entry in summary["fits"]:
        row = {"log": entry["name"], "unit": entry["unit"], "file": entry["log"], "status": entry["status"]}
        for key in ("samples", "duration_s", "rate_hz", "relative_residual_percent"):
            row[key] = entry[key]
        for key in ("moving_relative_residual_percent", "test_moving_relative_residual_percent", "condition_number"):
            row[key] = entry[key]
        row |= {"identified": entry["identified"], "base_parameters": entry["base_parameters"]}
        row["worst_parameters"] = " ".join(p["name"] for p in entry["worst"])
        row["odd_parameters"] = " ".join(odd.get(entry["name"], ()))
        rows.append(row | {"reasons": "; ".join(entry["reasons"])})
    return rows


def _parameter_rows(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A row for each parameter: over all logs, then estimate and standard deviation of each."""
    fits = {e["name"]: {p["name"]: p for p in e["parameters"]} for e in summary["fits"] if e["parameters"]}
    rows = []
    for parameter in summary["parameters"]:
        row = {**parameter, "odd": " ".join(parameter["odd"])}
        for log, own in fits.items():
            row |= {log: own[parameter["name"]]["estimate"], f"{log} std": own[parameter["name"]]["std"]}
        rows.append(row)
    return rows


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows of equal keys as CSV; nothing stands where a value is not known."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]) if rows else ["name"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()
