"""Commands that show models and hand them to a controller: model, codegen."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from identify.errors import InputError, OutputError

if TYPE_CHECKING:
    from identify.symbolic.operations import Operations


def model(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Print a symbolic model of a robot."""
    from identify.robot.library import load_robot
    from identify.symbolic.models import given_options, symbolic_model

    robot = load_robot(options.robot, options.joints, options.gravity)
    chosen = {name: getattr(options, name) for name in ("parameters", "orientation", "frame", "decomposed")}
    given_options(options.what, chosen)
    if options.current is not None and options.pose is None:
        raise InputError("--current: the position now matters for a pose alone; add --pose, or leave it out")
    if options.pose is not None:
        from identify.cli.posing import solutions_text

        if options.what != "inverse-geometry":
            raise InputError(f"--pose: {options.what} takes no pose; choose --what inverse-geometry, or leave it out")
        if options.format not in ("text", "json"):
            raise InputError(f"--format {options.format}: solutions are numbers; choose text or json")
        print(solutions_text(robot, options.pose, options.current, options.format))
        return 0
    if options.what == "operations":
        from identify.symbolic.operation_table import operations

        rows = operations(robot)
        if options.format == "json":
            table = [
                {"model": r.model, **_counts(r.operations), "chapter": _counts(r.chapter) if r.chapter else None}
                for r in rows
            ]
            print(json.dumps({"robot": robot.name, "operations": table}, ensure_ascii=False))
            return 0
        if options.format != "text":
            raise InputError(f"--format {options.format}: operations are a table; choose text or json")
        print(f"{robot.name}: operations a call (base parameters, no friction)")
        print(f"{'model':<46}{'×':>7}{'+':>7}   chapter")
        for row in rows:
            cost, beside = row.operations, str(row.chapter or "")
            print(f"{row.model:<46}{cost.multiplications:>7}{cost.additions:>7}   {beside}".rstrip())
        return 0
    from identify.symbolic.rendering import render

    found = symbolic_model(robot, options.what, **chosen)
    if not found.expressions and options.format in ("python", "c"):
        raise InputError(f"{robot.name}: {options.what}: no formula to print: {found.notes[-1]}")
    print(render(found, options.format), end="")
    return 0


def codegen(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Write a robot's models as C or Python that a controller can carry."""
    from identify.cli.progress import progress_line
    from identify.codegen.generate import generate, left_out
    from identify.logs.files import refuse_existing, replacing
    from identify.regressor.friction import STRIBECK_VELOCITY
    from identify.robot.library import load_robot

    robot = load_robot(options.robot, options.joints, options.gravity)
    parameters = covariance = coulomb_velocity = None
    stribeck_velocity = STRIBECK_VELOCITY
    friction: tuple[str, ...] = ()
    if options.parameters is not None:
        from identify.estimation.identification import Identification
        from identify.regressor.regressor import Regressor

        result = Identification.load(options.parameters)
        friction, coulomb_velocity = result.settings.friction, result.settings.coulomb_velocity
        if result.names != Regressor(robot, friction).names:
            raise InputError(
                f"{options.parameters}: its parameters are those of {result.robot.name}, not of {robot.name}"
            )
        parameters, covariance = result.parameters, result.covariance
        stribeck_velocity = result.settings.stribeck_velocity or STRIBECK_VELOCITY
    with progress_line(sys.stderr) as progress:
        if progress is not None:
            progress(0.0, "models (inverse geometry of arms without right angles takes some seconds)")
        files = generate(robot, options.language, parameters, covariance, friction, coulomb_velocity, stribeck_velocity)
        missing = left_out(robot)
    folder = Path(options.output)
    for name in files:
        refuse_existing(folder / name, options.force)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: is a file; give the name of a folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: can't be made: {error.strerror or error}") from error
    for name, text in files.items():
        with replacing(folder / name) as stream:
            stream.write(text.encode())
        print(folder / name)
    if missing is not None:
        print(f"{robot.name}: inverse geometry is left out: {missing}", file=sys.stderr)
    return 0


def _counts(operations: Operations) -> dict[str, int]:
    return {"multiplications": operations.multiplications, "additions": operations.additions}
