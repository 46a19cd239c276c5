"""`identify compare`: two results of one robot held against each other."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from identify.cli.places import check_file, parents_of


def compare(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Say what changed from one result to another, and write a page of it where one is asked for."""
    folders = (options.first, options.second)
    if options.output:
        check_file(options.output, (".html",), options.force)
    from identify.estimation.identification import Identification
    from identify.validation import comparison as sides
    from identify.validation.comparison_findings import cautions, findings

    found = sides.compare(Identification.load(folders[0]), Identification.load(folders[1]), folders)
    found |= {"findings": findings(found), "cautions": cautions(found)}
    if options.output:
        from identify.logs.files import replacing
        from identify.report.comparison import comparison_page

        page = comparison_page(found)
        with parents_of(options.output), replacing(options.output) as stream:
            stream.write(page.encode())
    if options.json:
        import json

        print(json.dumps(found, allow_nan=False))
        return 0
    _told(found)
    if options.output:
        print(f"\npage: {options.output}")
    return 0


def _told(found: Mapping[str, Any]) -> None:
    """The answers, then friction and residuals of every joint, then the parameters that changed."""
    from identify.validation.comparison_findings import TITLES

    for name, side in zip("AB", found["results"], strict=True):
        logs = ", ".join(log["path"] for log in side["logs"] if log["role"] == "train")
        print(f"{name}  {side['folder']}: {side['robot']['name']}, {side['model']} model, trained on {logs}")
    print()
    width = max(len(row["state"]) for row in found["findings"])
    for row in found["findings"]:
        print(f"{row['state']:<{width}}  {TITLES[row['about']]}: {row['text']}")
    for text in found["cautions"]:
        print(f"- {text}")
    print()
    _friction(found["friction"])
    fair = [log for log in found["logs"] if log["fair"]]
    for title, row in [*((f"held out, {log['path']}", log) for log in fair), ("own training", found["training"])]:
        print()
        _residuals(title, row)
    changed = [row for row in found["parameters"] if row["changed"]]
    if changed:
        from identify.numbers import estimate, significant

        print("\nparameters that changed")
        for row in changed:
            a, b = (estimate(side["estimate"], side["std"]).text for side in row["estimates"])
            print(f"  {row['name']:<8} {a:>26} {b:>26}  {row['unit']:<10} {significant(row['z'], 2)} σ")
    for name, names in zip("AB", found["only"], strict=True):
        if names:
            print(f"\nin {name} alone: {', '.join(names)}")


def _friction(rows: Sequence[Mapping[str, Any]]) -> None:
    from identify.numbers import estimate, significant
    from identify.validation.comparison_findings import chance_text, difference_text

    print(f"{'friction':<14} {'speed':>12} {'A':>22} {'B':>22} {'B − A':>22}  unit")
    for row in rows:
        for k, level in enumerate(row["levels"]):
            speed = f"{significant(level['speed'], 2)} {row['speed_unit']}"
            a, b = (estimate(side["estimate"], side["std"]).text for side in level["estimates"])
            apart = difference_text(level["difference"], level["std"])
            word = ""
            if k == 0 and row["changed"] is not None:
                word = f"{'changed' if row['changed'] else 'no change'}, {chance_text(row['p'])}"
            line = f"{row['joint'] if k == 0 else '':<14} {speed:>12} {a:>22} {b:>22} {apart:>22}"
            print(f"{line}  {row['effort_unit']:<4} {word}".rstrip())


def _residuals(title: str, row: Mapping[str, Any]) -> None:
    from identify.numbers import percent, significant

    print(f"RMSE, {title}")
    print(f"{'':<14} {'A moving':>10} {'B moving':>10} {'A at rest':>10} {'B at rest':>10}  unit")
    for joint in row["per_joint"]:
        cells = [significant(x) for key in ("moving_rmse", "rest_rmse") for x in joint[key]]
        print(f"{joint['joint']:<14} {' '.join(f'{cell:>10}' for cell in cells)}  {joint['unit']}")
    keys = ("moving_relative_residual_percent", "relative_residual_percent")
    cells = [percent(x, 3) for key in keys for x in row["total"][key]]
    print(f"{'all joints':<14} {' '.join(f'{cell:>10}' for cell in cells)}  of the torque (right: with rest)")
