"""`identify payload`: the load on the last link; and the option by which other commands carry one."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identify.cli.options import LOG, as_json, number, output, reading, result
from identify.cli.places import check_folder, parents_of
from identify.cli.progress import progress_line
from identify.errors import InputError, UnsupportedLogError

if TYPE_CHECKING:
    from identify.estimation.identification import Identification
    from identify.logs.log import Log
    from identify.robot.robot import Link

WORDS = (
    "payload",
    "identify the load on the last link",
    "DIR is a fit of the arm without the load, LOG a log of the same arm with it: mass, centre of mass and inertia,\n"
    "with standard deviations that count what the fit does not know. Friction may have changed with the load. With\n"
    "--mass, the effort of the logs may be a current: the gain of each drive is estimated with the load. OUT gets\n"
    "payload.json and report.html; logs that can't tell a load give the verdict reject with its reasons, and exit\n"
    "status 1.",
    "identify payload result loaded.mcap -o load",
)
"""Name, summary, text and example of the command."""


def payload_option(command: argparse.ArgumentParser, what: str) -> None:
    """--payload, a load in numbers or in a file; `what` it is to the command."""
    command.add_argument(
        "--payload",
        metavar="LOAD",
        help=f"{what}: MASS or MASS,X,Y,Z (a point, kg and m in the last link's frame), or a .toml file with mass, com "
        "and inertia",
    )


def chosen_load(options: argparse.Namespace) -> Link | None:
    """The load of --payload, None without one."""
    from identify.robot.payload import read_payload

    return None if options.payload is None else read_payload(options.payload)


def arguments(command: argparse.ArgumentParser) -> None:
    """What `identify payload` takes."""
    result(command)
    command.add_argument("log", metavar="LOG", help=f"of the arm with its load: {LOG}")
    output(command, "OUT", "result folder to write")
    command.add_argument(
        "--test", metavar="LOG", nargs="+", action="extend", default=[], help="further logs with the load, not fitted"
    )
    reading(command, "; holds for every LOG that is a table")
    command.add_argument("--mass", metavar="KG", type=_mass, help="the load's mass, where known: gives the drive gains")
    command.add_argument(
        "--unloaded",
        metavar="LOG",
        nargs="+",
        action="extend",
        default=[],
        help="with --mass: logs without the load (default: those of DIR, where they lie as they did)",
    )
    command.add_argument(
        "--friction",
        choices=("free", "same"),
        default="free",
        help="whether the load may have changed friction (default: %(default)s)",
    )
    as_json(command)


def payload(options: argparse.Namespace, given: Sequence[str]) -> int:
    """Identify the load into a result folder."""
    from identify.estimation.payload_result import RECORD, summary

    names = [options.log, *options.test]
    check_folder(options.output, RECORD, options.force, [*names, *options.unloaded, options.result, options.map or ""])
    if options.unloaded and options.mass is None:
        raise InputError("--unloaded: says nothing without --mass; give the load's mass too, or leave both out")
    from identify.estimation.identification import Identification
    from identify.payload_workflow import payload_to_folder

    fitted = Identification.load(options.result)
    loaded, *test = [_read(name, options, fitted) for name in names]
    without = _unloaded(options, fitted) if options.mass is not None else []
    with parents_of(options.output), progress_line(sys.stderr) as progress:
        record = payload_to_folder(
            options.result,
            [loaded],
            options.output,
            test=test,
            mass=options.mass,
            unloaded=without,
            friction=options.friction == "free",
            force=options.force,
            command=shlex.join(["identify", *given]),
            progress=progress,
        )
    refused = record["verdict"]["status"] == "reject"
    if options.json:
        import json

        print(json.dumps(record, allow_nan=False))
    elif refused:
        print("reject: the logs can't tell a load")
        for reason in record["verdict"]["reasons"]:
            print(f"- {reason}")
    else:
        print(summary(record))
    if not options.json:
        folder = Path(options.output)
        print(f"\nload:   {folder / RECORD}\nreport: {folder / 'report.html'}")
    return UnsupportedLogError.exit_status if refused else 0


def _read(name: str, options: argparse.Namespace, fitted: Identification) -> Log:
    from identify.logs.reading import read_log

    if options.map and not name.lower().endswith(".mcap"):
        return read_log(name, options.map, fitted.robot.joint_names)
    return read_log(name, None, fitted.robot.joint_names, options.topic)


def _unloaded(options: argparse.Namespace, fitted: Identification) -> list[Log]:
    """The logs without the load: those named, else those that the fit was made of."""
    if options.unloaded:
        return [_read(name, options, fitted) for name in options.unloaded]
    entries: list[dict[str, Any]] = [log for log in fitted.record["logs"] if log["role"] == "train"]
    logs = []
    for entry in entries:
        mend = "name the logs without the load with --unloaded"
        if not Path(entry["path"]).exists():
            raise InputError(f"{entry['path']}: the log that {options.result} was made of is not there; {mend}")
        log = _read(entry["path"], options, fitted)
        if log.sha256 != entry["sha256"]:
            raise InputError(f"{entry['path']}: is not the log that {options.result} was made of; {mend}")
        logs.append(log)
    return logs


def _mass(text: str) -> float:
    value = number(text)
    if not (0 < value < 1e6):
        raise argparse.ArgumentTypeError(f"{text!r} is not a mass above 0 kg")
    return value
