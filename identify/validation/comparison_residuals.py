"""Which of two results predicts better: on their training logs, and on logs that neither was fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.estimation.identification import Identification
from identify.validation.significance import LEVEL, sign_test

BLOCK = 1.0
"""Length of the pieces of a log [s] whose errors are held against each other."""

LEAST_BLOCKS = 6
"""Pieces below which even a clean sweep could be chance."""

_FIGURES = ("moving_relative_residual_percent", "relative_residual_percent")
_OF_A_JOINT = ("moving_rmse", "rest_rmse", "std_of_signal")


def training_rows(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Residual figures of both on their own training logs, all joints together and one by one."""
    return _side_by_side([record["fit"] for record in records])


def shared_logs(pair: Sequence[Identification]) -> list[dict[str, Any]]:
    """Logs that both results know by their digest, with the role and the figures each has for them.

    `fair`: neither was fitted to it. Of fair logs, `better` is "A" or "B" where the pieces of BLOCK s in which one
    has the smaller error are more than chance explains, else None, with the reason where it can't be told.
    """
    known = [_known(result.record) for result in pair]
    rows = []
    for digest in known[0]:
        if digest not in known[1]:
            continue
        sides = [table[digest] for table in known]
        fair = all(side["role"] == "test" for side in sides)
        row = {
            "path": sides[0]["path"],
            "sha256": digest,
            "roles": [side["role"] for side in sides],
            "fair": fair,
            **_side_by_side([side["figures"] for side in sides]),
        }
        rows.append(row | (_contest(pair, sides) if fair else {"better": None, "better_reason": _unfair(sides)}))
    return rows


def _known(record: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Of each log by its digest: role, path, its place among those of its role, and its figures where there are any.

    A log that was both fitted and tested counts as fitted.
    """
    found: dict[str, dict[str, Any]] = {}
    logs = {role: [log for log in record["logs"] if log["role"] == role] for role in ("test", "train")}
    results = {"test": record.get("test") or [], "train": [record["fit"]] if len(logs["train"]) == 1 else []}
    for role, mine in logs.items():
        for k, log in enumerate(mine):
            if log.get("sha256"):
                figures = results[role][k] if k < len(results[role]) else {}
                found[log["sha256"]] = {"role": role, "path": log["path"], "index": k, "figures": figures}
    return found


def _unfair(sides: Sequence[Mapping[str, Any]]) -> str:
    fitted = [name for name, side in zip("AB", sides, strict=True) if side["role"] == "train"]
    return f"{' and '.join(fitted)} {'was' if len(fitted) == 1 else 'were'} fitted to it"


def _side_by_side(sides: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Figures of two results for the same joints: `total` by name, then a row a joint; [A, B] each."""
    tables = [{row["joint"]: row for row in side.get("per_joint") or []} for side in sides]
    return {
        "total": {key: [side.get(key) for side in sides] for key in _FIGURES},
        "per_joint": [
            {
                "joint": name,
                "unit": row["unit"],
                **{key: [table.get(name, {}).get(key) for table in tables] for key in _OF_A_JOINT},
            }
            for name, row in (tables[0] or tables[1]).items()
        ],
    }


def _contest(pair: Sequence[Identification], sides: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """In how many pieces of a log each has the smaller squared error in motion, all joints together and one by one."""
    arrays = [_curves(result, side["index"]) for result, side in zip(pair, sides, strict=True)]
    if any(a is None for a in arrays):
        return {"better": None, "better_reason": "the curves of the log are not in both result folders"}
    a, b = (found for found in arrays if found is not None)
    if a["time"].shape != b["time"].shape or not np.allclose(a["time"], b["time"], rtol=0, atol=1e-9):
        return {"better": None, "better_reason": "the curves of the log were kept at other times in each folder"}
    squares = [np.where(f["moving"], np.square(f["measured"] - f["predicted"]), 0.0) for f in (a, b)]
    piece = ((a["time"] - a["time"][0]) // BLOCK).astype(int)
    sums = np.array([[np.bincount(piece, weights=column) for column in square.T] for square in squares])  # (2, n, k)
    wins = _wins(sums.sum(axis=1))
    joints = [_wins(sums[:, k]) for k in range(sums.shape[1])]
    p = sign_test(*wins)
    found = {"pieces": wins, "per_joint_pieces": joints, "p": p}
    if sum(wins) < LEAST_BLOCKS:
        short = f"only {sum(wins)} pieces of {BLOCK:g} s with motion"
        return found | {"better": None, "better_reason": short}
    if p >= LEVEL:
        return found | {"better": None, "better_reason": "each is better at times, as chance would have it"}
    return found | {"better": "A" if wins[0] > wins[1] else "B"}


def _wins(sums: np.ndarray) -> list[int]:
    """Pieces that A and B win, of sums (2, k) of squared errors; pieces that are alike count for none."""
    return [int((sums[0] < sums[1]).sum()), int((sums[1] < sums[0]).sum())]


def _curves(result: Identification, k: int) -> dict[str, np.ndarray] | None:
    names = ("time", "measured", "predicted", "moving")
    found = {name: np.asarray(result.curves.get(f"test{k}/{name}", ())) for name in names}
    return found if all(len(array) for array in found.values()) else None
