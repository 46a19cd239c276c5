"""What each command does: read, hand to the workflow, write, and say so in a few lines. No mathematics."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identify.cli import batching, carrying, comparing, designing, exporting, models
from identify.cli.places import check_file, check_folder, parents_of
from identify.cli.progress import progress_line
from identify.errors import UnsupportedLogError

if TYPE_CHECKING:
    from identify.logs.log import Log

UNSUPPORTED = UnsupportedLogError.exit_status


def demo(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """The whole path on the simulated RX-90, into one folder."""
    check_folder(options.output, "trajectory.toml", options.force)
    from identify import workflow

    with parents_of(options.output), progress_line(sys.stderr) as progress:
        record = workflow.demo(options.output, force=options.force, progress=progress)
    return _told_result(Path(options.output) / "result", record)


def simulate(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Run a motion on the simulated robot; write the log, and the truth beside it."""
    from identify.experiment.simulation import truth_path

    truth = truth_path(options.output)
    check_file(options.output, (".mcap",), options.force, [options.trajectory or ""])
    check_file(str(truth), (".json",), options.force)
    from identify import workflow
    from identify.experiment.trajectory import Trajectory
    from identify.robot.library import load_robot

    robot = load_robot(options.robot, options.joints, options.gravity)
    trajectory = None if options.trajectory is None else Trajectory.load(options.trajectory)
    with parents_of(options.output), progress_line(sys.stderr) as progress:
        log = workflow.run_experiment(
            robot,
            options.output,
            trajectory,
            noise=options.noise,
            seed=options.seed,
            force=options.force,
            progress=progress,
            load=carrying.chosen_load(options),
        )
    print(f"{_size(options.output, log)}, noise {options.noise}, seed {options.seed}")
    print(f"{truth}: the true parameters")
    _told_findings(log)
    return 0


def import_log(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Turn a table or a log into a log of our own, whole or in part."""
    check_file(options.output, (".mcap", ".csv"), options.force, [options.table, options.map or ""])
    from identify.logs.reading import read_log
    from identify.logs.slicing import window

    whole = read_log(options.table, options.map, topic=options.topic)
    origin = {
        "imported_from": Path(options.table).name,
        "imported_sha256": whole.sha256,
        "imported_seconds": f"{options.start or 0:g} to {whole.duration if options.stop is None else options.stop:g}",
        "import_findings": "; ".join(whole.findings),
    }
    log = window(replace(whole, metadata=whole.metadata | origin), options.start, options.stop)
    keeps_map = options.map and Path(options.output).suffix.lower() == ".mcap"
    with parents_of(options.output):
        attachments = {"map.toml": Path(options.map).read_bytes()} if keeps_map else None
        log.save(options.output, force=options.force, attachments=attachments)
    channels = ["position"]
    channels += [name for name in ("velocity", "effort") if getattr(log, name) is not None]
    print(f"{_size(options.output, log)}, {', '.join(channels)} of {', '.join(log.joints)}")
    _told_findings(log)
    return 0


def inspect(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """What a log holds, what is odd about it, and whether it can support a fit."""
    if options.html:
        check_file(options.html, (".html",), options.force, [options.log, options.map or ""])
    from identify.logs.reading import read_log
    from identify.logs.triage import inspect as look_over
    from identify.logs.triage import refusals

    robot = None
    if options.robot is None:
        log = read_log(options.log, options.map, None, options.topic)
        found = look_over(log)
    else:
        from identify.fit_workflow import looked_over
        from identify.robot.library import load_robot

        robot = load_robot(options.robot, options.joints, options.gravity)
        log = read_log(options.log, options.map, robot.joint_names, options.topic)
        (found,) = looked_over([log], robot)
    reasons = refusals(found)
    if options.html:
        from identify.logs.files import replacing
        from identify.report.inspection import inspection_page

        page = inspection_page(found, log, reasons, robot)
        with parents_of(options.html), replacing(options.html) as stream:
            stream.write(page.encode())
    if options.json:
        _print_json({**found.as_dict(), "can_support_a_fit": not reasons, "reasons": reasons})
        return 0
    print(found.summary())
    print()
    if options.picture or sys.stdout.isatty():
        from identify.report.terminal import picture

        print(picture(log))
        print()
    print("can't support a fit:" if reasons else "nothing here speaks against a fit")
    for reason in reasons:
        print(f"- {reason}")
    if options.html:
        print(f"page: {options.html}")
    return 0


def recover(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Save what can be read of a damaged log, and say what can't."""
    check_file(options.output, (".mcap",), options.force, [options.log])
    from identify.logs.recovery import recover as save

    with parents_of(options.output):
        found = save(options.log, options.output)
    if options.json:
        _print_json(
            {
                "output": options.output,
                "messages": found.messages,
                "topics": found.topics,
                "duration_s": found.duration,
                "lost": list(found.lost),
            }
        )
        return 0
    topics = ", ".join(f"{count:,} on {topic}" for topic, count in found.topics.items())
    print(f"{options.output}: {found.messages:,} messages over {found.duration:.3f} s: {topics}")
    for sentence in found.lost or ("nothing was lost",):
        print(f"- {sentence}")
    return 0


def fit(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Identify, test, check and report into a result folder."""
    names = [*options.logs, *options.test]
    check_folder(options.output, "parameters.json", options.force, [*names, options.map or ""])
    from identify import workflow
    from identify.logs.reading import read_log
    from identify.robot.library import load_robot

    robot = load_robot(options.robot, options.joints, options.gravity)
    tables = [name for name in names if not name.lower().endswith(".mcap")] or names
    logs = [
        read_log(name, options.map, robot.joint_names)
        if options.map and name in tables
        else read_log(name, None, robot.joint_names, options.topic)
        for name in names
    ]
    with parents_of(options.output), progress_line(sys.stderr) as progress:
        record = workflow.fit_to_folder(
            logs[: len(options.logs)],
            robot,
            options.output,
            test=logs[len(options.logs) :],
            model=options.model,
            estimator=options.estimator,
            force=options.force,
            command=shlex.join(["identify", *arguments]),
            progress=progress,
            friction=options.friction,
            prior=options.prior,
        )
    if options.json:
        _print_json(record)
        return UNSUPPORTED if _rejected(record) else 0
    return _told_result(Path(options.output), record)


def predict(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """The torque that a fitted model expects for a motion; effort is never read."""
    check_file(options.output, (".csv",), options.force, [options.log, options.map or ""])
    from identify.estimation.identification import Identification
    from identify.logs.reading import read_log
    from identify.logs.writing import write_table

    result = Identification.load(options.result)
    log = read_log(options.log, options.map, result.robot.joint_names, options.topic, effort=False)
    torque = result.predict(log)
    with parents_of(options.output):
        header = ["t", *(f"tau{j}" for j in range(1, torque.shape[1] + 1))]
        write_table(options.output, header, log.time, torque)
    units = [joint.effort_unit for joint in result.robot.joints]
    if options.json:
        _print_json(
            {
                "output": options.output,
                "result": options.result,
                "log": {"path": log.source, "sha256": log.sha256, "dropped": log.dropped},
                "samples": log.samples,
                "duration_s": log.duration,
                "joints": list(log.joints),
                "units": units,
                "largest": [float(value) for value in abs(torque).max(axis=0)],
                "findings": list(log.findings),
            }
        )
        return 0
    print(f"{_size(options.output, log)}")
    for joint, unit, column in zip(log.joints, units, torque.T, strict=True):
        print(f"  {joint:<16} {column.min():10.3f} to {column.max():10.3f} {unit}")
    _told_findings(log)
    return 0


def check(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """The equations of a robot against two other libraries."""
    from identify.robot.library import load_robot
    from identify.validation.cross_check import check_robot

    found = check_robot(load_robot(options.robot, options.joints, options.gravity))
    if options.json:
        _print_json(found)
    else:
        print(f"{found['robot']}: {found['base_parameters']} base parameters, numeric rank {found['rank']}")
        for name, key in (("Pinocchio", "pinocchio"), ("MuJoCo", "mujoco")):
            engine = found[key]
            print(
                f"  {name:<10} not compared: {found[f'{key}_reason']}"
                if engine is None
                else f"  {name:<10} differs by {engine['max_abs_error']:.1e} of the torque scale at most, "
                f"over {engine['samples']:,} random states"
            )
        print("all agree" if found["agree"] else "they do NOT agree")
    return 0 if found["agree"] else UNSUPPORTED


def report(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Write the report of a result folder anew."""
    from identify.estimation.payload_result import RECORD
    from identify.report.page import write
    from identify.report.payload import write_payload_page

    print((write_payload_page if (Path(options.result) / RECORD).is_file() else write)(options.result))
    return 0


COMMANDS: dict[str, Callable[[argparse.Namespace, Sequence[str]], int]] = {
    "demo": demo,
    "excite": designing.excite,
    "simulate": simulate,
    "import": import_log,
    "inspect": inspect,
    "recover": recover,
    "fit": fit,
    "predict": predict,
    "payload": carrying.payload,
    "batch": batching.batch,
    "compare": comparing.compare,
    "check": check,
    "report": report,
    "model": models.model,
    "codegen": models.codegen,
    "export": exporting.export,
}


def _rejected(record: dict[str, Any]) -> bool:
    return record["verdict"]["status"] == "reject"


def _told_result(folder: Path, record: dict[str, Any]) -> int:
    """Say what is in a result folder that was just written; the exit status."""
    if _rejected(record):
        print("reject: no parameters, as the input can't support a result")
        for reason in record["verdict"]["reasons"]:
            print(f"- {reason}")
    else:
        from identify.estimation.identification import Identification

        print(Identification.load(folder).summary())
    print()
    print(f"parameters: {folder / 'parameters.json'}")
    print(f"report:     {folder / 'report.html'}")
    return UNSUPPORTED if _rejected(record) else 0


def _size(path: str, log: Log) -> str:
    return f"{path}: {log.samples:,} samples in {log.duration:.3f} s"


def _told_findings(log: Log) -> None:
    for finding in log.findings:
        print(f"- {finding}")


def _print_json(value: dict[str, Any]) -> None:
    import json

    print(json.dumps(value, allow_nan=False))
