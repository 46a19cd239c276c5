"""`identify batch`: many logs, one page."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from identify.cli.places import check_folder, parents_of
from identify.cli.progress import progress_line
from identify.errors import UnsupportedLogError


def batch(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Fit every log of a folder; 1 where one of them gave no model."""
    from identify.batch.folder import PAGE, RECORD, fit_batch
    from identify.batch.reduction import Options
    from identify.batch.sources import find_sources

    sources, others = find_sources(options.folder, bool(options.map), options.test)
    read = [path for source in sources for path in (source.log, *source.test)]
    check_folder(options.output, RECORD, options.force, [*read, options.map or ""])
    choice = Options(
        options.joints,
        options.gravity,
        options.map,
        options.topic,
        options.model,
        options.estimator,
        command=shlex.join(["identify", *arguments]),
    )
    with parents_of(options.output), progress_line(sys.stderr) as progress:
        summary = fit_batch(
            sources, options.robot, options.output, choice, options.jobs, options.force, others, progress
        )
    lost = summary["counts"]["reject"] + summary["counts"]["failed"]
    if options.json:
        import json

        print(json.dumps(summary, allow_nan=False))
    else:
        _told(summary)
        print(f"\nsummary: {Path(options.output) / PAGE}")
    return UnsupportedLogError.exit_status if lost else 0


def _told(summary: dict[str, Any]) -> None:
    """A line for each log, then what they say together."""
    from identify.numbers import percent
    from identify.report.batch import verdict_on_sigma

    width = max(len(fit["name"]) for fit in summary["fits"])
    for fit in summary["fits"]:
        if fit["parameters"]:
            told = f"error {percent(fit['moving_relative_residual_percent'])} of the torque, moving"
            if fit["test_moving_relative_residual_percent"] is not None:
                told += f"; {percent(fit['test_moving_relative_residual_percent'])} on unseen motion"
        else:
            told = "; ".join(fit["reasons"])
        print(f"{fit['name']:<{width}}  {fit['status']:<6}  {told}")
    print(f"\n{verdict_on_sigma(summary)}")
    for row in summary["odd"]:
        print(f"odd: {row['name']}, by {', '.join(p['name'] for p in row['parameters'])}")
