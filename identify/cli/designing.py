"""`identify excite`: design a motion, save it, and say what to expect of it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from identify.cli.carrying import chosen_load
from identify.cli.places import check_file, parents_of
from identify.cli.progress import progress_line
from identify.errors import InputError


def excite(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Design a motion and save it."""
    check_file(options.output, (".toml",), options.force)
    from identify.estimation.earlier import next_excitation
    from identify.estimation.identification import Identification
    from identify.robot.library import load_robot
    from identify.robot.payload import carrying

    robot = load_robot(options.robot, options.joints, options.gravity)
    if (load := chosen_load(options)) is not None:
        if options.earlier:
            raise InputError("--payload: with --from the effort is that of the earlier results; leave one of them out")
        robot = carrying(robot, load)
    results = [Identification.load(folder) for folder in options.earlier]
    with parents_of(options.output):
        with progress_line(sys.stderr) as progress:
            found = next_excitation(
                robot,
                results,
                options.criterion,
                options.duration,
                options.seed,
                periods=options.periods,
                harmonics=options.harmonics,
                starts=options.starts,
                collision=options.collision,
                progress=progress,
            )
        found.trajectory.save(options.output)
    motion = found.trajectory
    if options.json:
        table = {
            "output": options.output,
            "robot": robot.name,
            "joints": list(motion.joints),
            "harmonics": motion.harmonics,
            "fundamental_hz": motion.fundamental_hz,
            "periods": motion.periods,
            "rest_s": motion.rest,
            "duration_s": motion.duration,
            "seed": motion.seed,
            "earlier": options.earlier,
            "assessment": found.assessment.as_dict(),
            "forecast": found.forecast.as_dict(),
        }
        print(json.dumps(table, allow_nan=False))
        return 0
    print(
        f"{options.output}: {motion.n} joints, {motion.harmonics} harmonics of "
        f"{motion.fundamental_hz:g} Hz, {motion.periods} periods of {motion.period:g} s, "
        f"{motion.rest:g} s at rest before and after"
    )
    print(motion.note)
    print()
    print(found.forecast.table())
    return 0
