"""The friction of each joint in two results: at a slow and a fast speed, and whether it changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import numpy as np

from identify.estimation.identification import FRICTION, Identification
from identify.numbers import finite
from identify.validation.friction_law import LETTERS, both_ways, fitted_terms, friction_columns, same_law
from identify.validation.significance import LEVEL, holm, joint_test

SHARES = (0.1, 0.8)
"""Speeds at which friction is compared, of the largest that both training motions reach."""

GRID = np.concatenate([[1e-9], np.linspace(0.02, 1.0, 24) ** 2])
"""Speeds of a drawn curve, of the largest one: dense near zero, where friction bends."""

_LEAST = 0.1
"""Largest speed [rad/s or m/s] taken where the records tell none."""


def friction_rows(pair: Sequence[Identification]) -> list[dict[str, Any]]:
    """A row for each joint: which forms of friction each result has, the friction at SHARES of the top speed, and over
    velocity.

    Friction at a speed is half the difference between both directions of motion, which leaves the offset out.
    """
    records = [result.record for result in pair]
    rows = []
    for j, sides in enumerate(zip(*(record["friction"] for record in records), strict=True), 1):
        terms = [fitted_terms(row) for row in sides]
        top = _top_speed(records, j - 1)
        joint = records[0]["robot"]["joints"][j - 1]
        rows.append(
            {
                "joint": sides[0]["joint"],
                "effort_unit": joint["effort_unit"],
                "speed_unit": f"{joint['position_unit']}/s",
                "forms": [list(found) for found in terms],
                "same_forms": same_law([set(found) for found in terms], [record.get("settings") for record in records]),
                "top_speed": top,
                "levels": [_level(pair, j, terms, share * top) for share in SHARES],
                "curve": _curve(pair, j, terms, top),
                "p": None,
                "changed": None,
            }
        )
    return rows


def friction_tests(
    rows: Sequence[dict[str, Any]],
    names: Sequence[str],
    difference: np.ndarray,
    covariance: np.ndarray,
    freedom: float = inf,
) -> None:
    """Put into each row whether the joint's friction changed: all its constants at once, Holm over the joints.

    Joints whose forms of friction differ can't be tested: a form that one result lacks is shared out among its others.
    """
    at = {name: k for k, name in enumerate(names)}
    tested = []
    for j, row in enumerate(rows, 1):
        own = [at[name] for _, letters in FRICTION if (name := f"{letters}{j}") in at]
        found = joint_test(difference[own], covariance[np.ix_(own, own)], freedom) if own else None
        if row["same_forms"] and found is not None:
            row |= {"statistic": found.statistic, "combinations": found.combinations}
            tested.append((row, found.p))
    for (row, _), p in zip(tested, holm(np.array([p for _, p in tested])), strict=True):
        row |= {"p": float(p), "changed": bool(p < LEVEL)}


def _level(
    pair: Sequence[Identification], j: int, terms: Sequence[Mapping[str, float]], speed: float
) -> dict[str, Any]:
    """Friction of joint j at a speed in both results and its difference B − A, with σ as of independent errors."""
    sides = []
    for result, values in zip(pair, terms, strict=True):
        row = both_ways(list(values), result.record.get("settings"), speed)
        value, std = _of_columns(result, j, values, row[None])
        sides.append({"estimate": float(value[0]), "std": float(std[0])})
    return {
        "speed": speed,
        "estimates": sides,
        "difference": sides[1]["estimate"] - sides[0]["estimate"],
        "std": float(np.hypot(sides[0]["std"], sides[1]["std"])),
    }


def _curve(pair: Sequence[Identification], j: int, terms: Sequence[Mapping[str, float]], top: float) -> dict[str, Any]:
    """Friction of joint j over velocity, up to the top speed both ways: that of both results, and σ of each."""
    velocity = top * np.concatenate([-GRID[::-1], GRID])
    sides = [
        _of_columns(result, j, values, friction_columns(list(values), result.record.get("settings"))(velocity))
        for result, values in zip(pair, terms, strict=True)
    ]
    return {
        "velocity": velocity.tolist(),
        "estimates": [value.tolist() for value, _ in sides],
        "std": [std.tolist() for _, std in sides],
    }


def _of_columns(
    result: Identification, j: int, values: Mapping[str, float], columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Friction (N,) and its σ (N,) of columns (N, k) per unit of the constants `values` of joint j."""
    at = [result.names.index(f"{LETTERS[key]}{j}") for key in values]
    covariance = result.covariance[np.ix_(at, at)]
    variance = np.einsum("nk,kl,nl->n", columns, covariance, columns)
    return columns @ np.array(list(values.values())), np.sqrt(np.maximum(variance, 0.0))


def _top_speed(records: Sequence[Mapping[str, Any]], j: int) -> float:
    """The largest speed of joint j (from 0) that both training motions reach [rad/s or m/s]."""
    found = []
    for record in records:
        rows = (record.get("coverage") or {}).get("per_joint") or []
        speed = finite(rows[j].get("velocity_max")) if j < len(rows) else None
        if speed:
            found.append(speed)
    return min(found, default=_LEAST)
