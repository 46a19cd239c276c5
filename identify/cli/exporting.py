"""The command that hands an identified robot to other programs: export."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from identify.cli.places import check_file, parents_of


def export(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Write the robot of a result with its identified links and drives."""
    from identify import workflow
    from identify.estimation.identified_robot import FORMATS

    check_file(options.output, FORMATS[options.format], options.force, [options.result])
    with parents_of(options.output):
        lost = workflow.export(options.result, options.format, options.output, options.force)
    print(options.output)
    for line in lost:
        print(f"- not carried: {line}")
    return 0
