"""The friction that a record gives a joint, over the velocity at which the joint slides on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from identify.estimation.identification import FRICTION
from identify.numbers import finite
from identify.regressor.columns import smooth_sign
from identify.regressor.friction import LOAD, STRIBECK, STRIBECK_VELOCITY, sliding_laws

LETTERS = dict(FRICTION)


def fitted_terms(row: Mapping[str, Any]) -> dict[str, float]:
    """Estimates of a joint's friction by the keys of FRICTION; row: that joint's entry in the record. What was not
    fitted is left out."""
    found = {}
    for key in LETTERS:
        entry = row.get(key)
        value = finite(entry.get("estimate")) if isinstance(entry, Mapping) else None
        if value is not None:
            found[key] = value
    return found


def friction_columns(keys: Sequence[str], settings: Mapping[str, Any] | None) -> Callable[[np.ndarray], np.ndarray]:
    """A function of velocities (N,) that gives (N, k) friction per unit of each parameter of `keys`.

    Γf = Fs·s(q̇) + Fv·q̇ + offset [2.63] and the further forms of `sliding_laws`, s the sign or the smooth sign of the
    settings: friction of a joint that slides on, where presliding has come to its end, under the mean load.
    """
    settings = settings or {}
    width = finite(settings.get("coulomb_velocity"))
    sign = smooth_sign(width) if settings.get("coulomb_form") == "smooth sign" and width else np.sign
    laws: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "viscous": lambda v: v,
        "coulomb": sign,
        "offset": np.ones_like,
        **sliding_laws(sign, finite(settings.get("stribeck_velocity")) or STRIBECK_VELOCITY),
    }

    def columns(velocity: np.ndarray) -> np.ndarray:
        velocity = np.asarray(velocity, dtype=float)
        return np.array([laws[key](velocity) for key in keys]).reshape(len(keys), len(velocity)).T

    return columns


def both_ways(keys: Sequence[str], settings: Mapping[str, Any] | None, speed: float) -> np.ndarray:
    """(k,) friction at a speed per unit of each parameter of `keys`: half the difference between both directions of
    motion, which leaves the offset out."""
    there, back = friction_columns(keys, settings)(np.array([speed, -speed]))
    return 0.5 * (there - back)


def same_law(keys: Sequence[set[str]], settings: Sequence[Mapping[str, Any] | None]) -> bool:
    """Whether constants of the same name mean the same in two results: equal forms, of the same speed at which
    Stribeck friction fades and of the same mean load where these count."""
    if keys[0] != keys[1]:
        return False
    a, b = (found or {} for found in settings)
    depends = {STRIBECK: "stribeck_velocity", LOAD: "mean_load"}
    return all(a.get(name) == b.get(name) for form, name in depends.items() if form in keys[0])
