"""A result on one page of text."""

from __future__ import annotations

from typing import Any

from identify.estimation.identification import FRICTION
from identify.numbers import DASH, estimate, significant


def summary(record: dict[str, Any]) -> str:
    """Verdict, residuals per joint and parameters ± standard deviation of a record, with notes where one is due."""
    robot, verdict = record["robot"]["name"], record["verdict"]
    status = {"accept": "accepted", "warn": "accepted with warnings", "reject": "refused"}[verdict["status"]]
    lines = [f"{robot}: {record['model']} model, {record.get('estimator') or 'nothing fitted'}: {status}"]
    for log in record["logs"]:
        kind = "simulated" if log["simulated"] else "measured"
        lines.append(f"  {log['role']:<5} {log['path']} ({kind}, {log['duration_s']:.1f} s, {log['samples']} samples)")
    if verdict["status"] == "reject":
        return "\n".join([*lines, "", *(f"- {reason}" for reason in verdict["reasons"] + verdict["actions"])])
    lines += ["", *_residuals(record), "", *_parameters(record), ""]
    if record.get("estimators"):
        lines += [*_estimators(record["estimators"]), ""]
    lines += [f"- {use['use']}: {use['status']}, {use['result']}" for use in verdict["uses"]]
    lines += [f"- {text}" for text in [*verdict["reasons"], *verdict["actions"]]]
    return "\n".join(lines)


def _residuals(record: dict[str, Any]) -> list[str]:
    """Root mean square error per joint while moving and at rest, of the training logs and of each held-out log."""
    tables = [("train", record["fit"]), *((f"test {k + 1}", test) for k, test in enumerate(record["test"]))]
    head = f"{'residual':<10}" + "".join(f"{name + ' moving':>15}{name + ' rest':>13}" for name, _ in tables) + "  unit"
    lines = [head]
    for j, joint in enumerate(record["fit"]["per_joint"]):
        cells = "".join(
            f"{significant(t['per_joint'][j]['moving_rmse']):>15}{significant(t['per_joint'][j]['rest_rmse']):>13}"
            for _, t in tables
        )
        lines.append(f"{joint['joint']:<10}{cells}  {joint['unit']}")
    total = "".join(f"{significant(t['moving_relative_residual_percent']):>15}{'':>13}" for _, t in tables)
    everything = "".join(f"{significant(t['relative_residual_percent']):>15}{'':>13}" for _, t in tables)
    return [*lines, f"{'moving':<10}{total}  % of the torque", f"{'all':<10}{everything}  % of the torque"]


def _estimators(rows: list[dict[str, Any]]) -> list[str]:
    """Every estimator's residuals, in percent of the torque, moving; of one that the logs do not support, why."""
    lines = [f"{'estimator':<10}{'train moving':>15}{'test moving':>15}{'condition':>12}"]
    for row in rows:
        if "reason" in row:
            lines.append(f"{row['estimator']:<10}  {row['reason']}")
            continue
        cells = (significant((row[role] or {}).get("moving_relative_residual_percent")) for role in ("train", "test"))
        columns = "".join(f"{cell:>15}" for cell in cells)
        lines.append(f"{row['estimator']:<10}{columns}{significant(row['condition_number']):>12}")
    return lines


def _parameters(record: dict[str, Any]) -> list[str]:
    rows = [(b["name"], b) for b in record["base_parameters"]]
    for j, joint in enumerate(record["friction"], 1):
        rows += [(f"{name}{j}", joint[key]) for key, name in FRICTION if joint.get(key) is not None]
    rows += [(t["name"], t) for t in record["transmission"]]
    condition = record["fit"]["condition_number"]
    settings = record["settings"]
    lines = [
        f"{len(rows)} parameters from {settings['rows']} equations ({settings['effective_samples']:.0f} effective), "
        f"column-scaled condition number {significant(condition)}"
    ]
    for name, row in rows:
        value = estimate(row["estimate"], row["std"])
        truth = f"  truth {significant(row['truth'], 4)}" if row.get("truth") is not None else ""
        relative = significant(row["relative_std_percent"], 2) if value.determined else DASH
        lines.append(f"  {name:<6} {value.text:>34} {row['unit']:<10} {relative:>8} %{truth}")
    return lines
