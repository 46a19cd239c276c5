"""The command that hands a robot, identified or as described, to other programs: export."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from identify.cli.places import check_file, parents_of


def export(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Write the robot of a result with its identified links and drives, or a robot as it is described."""
    from identify import workflow
    from identify.robot.writing import FORMATS

    check_file(options.output, FORMATS[options.format], options.force, [options.source])
    with parents_of(options.output):
        lost = workflow.export(
            options.source, options.format, options.output, options.force, options.joints, options.gravity
        )
    print(options.output)
    for line in lost:
        print(f"- not carried: {line}")
    return 0
