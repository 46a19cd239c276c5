"""Forms of friction beside viscous, Coulomb and offset, their constants, and the presliding state that one reads."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from identify.errors import InputError

PLAIN = ("viscous", "coulomb", "offset")
"""What every joint has [2.63]."""

CUBE_ROOT, PRESLIDING, STRIBECK, ASYMMETRIC, LOAD = "cube_root", "presliding", "stribeck", "asymmetric", "load"
FURTHER = (CUBE_ROOT, PRESLIDING, STRIBECK, ASYMMETRIC, LOAD)
"""What it may have besides, with s the sign of the velocity, exact or smooth:
Fc·sign(q̇)·|q̇|^⅓;
Fp·z with Dahl's state z, which is what a Coulomb friction does within some distance of where the joint turned or
stopped;
Fb·s(q̇)·exp(−|q̇|/v_s), what breaks away and fades with speed (Stribeck 1902, in the form of Tustin 1947);
Fa·|q̇|, half of what viscous friction forwards has more than backwards (Coulomb friction that differs between
directions is Fs and the offset);
Fl·|Γ_r|/Γ_m·s(q̇), Coulomb friction that grows with the load Γ_r, the effort of the rigid bodies, in units of its
mean Γ_m."""

STRIBECK_VELOCITY = 0.1
"""Speed v_s [rad/s or m/s] at which 1/e of Stribeck friction is left, where nothing else is said."""

Sign = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class FrictionConstants:
    """What friction forms depend on in a way that is not linear.

    stribeck_velocity [rad/s or m/s]. load_parameters (b,): base parameters whose effort is the load, and mean_load (n,)
    its mean magnitude [N·m or N] at each joint; both None where the load counts as the mean one.
    """

    stribeck_velocity: float = STRIBECK_VELOCITY
    load_parameters: tuple[float, ...] | None = None
    mean_load: tuple[float, ...] | None = None


USUAL = FrictionConstants()


def sliding_laws(
    sign: Sign = np.sign, stribeck_velocity: float = STRIBECK_VELOCITY
) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """What each further form is per unit of its parameter, over the velocity of a joint that slides on under the mean
    load; sign: the Coulomb friction's."""
    return {
        CUBE_ROOT: np.cbrt,
        PRESLIDING: np.sign,
        STRIBECK: lambda v: sign(v) * np.exp(-np.abs(v) / stribeck_velocity),
        ASYMMETRIC: np.abs,
        LOAD: sign,
    }


def further_forms(friction: bool | Collection[str]) -> tuple[str, ...]:
    """The forms of FURTHER that are asked for, in its order; True asks for none. InputError for an unknown name."""
    names = () if isinstance(friction, bool) else tuple(friction)
    for name in names:
        if name not in (*PLAIN, *FURTHER):
            raise InputError(f"friction {name!r} is not known; choose from {', '.join((*PLAIN, *FURTHER))}")
    return tuple(form for form in FURTHER if form in names)


def chosen_forms(friction: str | Collection[str] | None) -> tuple[str, ...] | None:
    """What a user asks for, as forms of FURTHER: None or "auto" leaves the choice to the data, "plain" is none of them,
    else names, in a collection or with commas between. InputError for an unknown name."""
    if friction is None or friction == "auto":
        return None
    names = friction.split(",") if isinstance(friction, str) else friction
    return further_forms(() if friction == "plain" else [name.strip() for name in names])


def presliding_state(q: np.ndarray, distance: float, start: np.ndarray | float = 0.0) -> np.ndarray:
    """(N, c) Dahl's state z along positions q (N, c), −1 … 1: dz = (dq − |dq|·z)/distance, z = start at the first.

    distance [rad or m]: the way on which z comes within 1/e of ±1, where it stays while the joint goes on; at rest it
    keeps its value. Exact for positions that go straight from sample to sample: between reversals
    z = s + (z₀ − s)·exp(−path/distance) with s = ±1 the direction (Dahl 1968).
    """
    step = np.diff(q, axis=0)
    z = np.empty(q.shape)
    z[:1] = start
    for column, steps in zip(z.T, step.T, strict=True):
        if len(steps):
            column[1:] = _along(steps, distance, column[0])
    return z


def _along(step: np.ndarray, distance: float, start: float) -> np.ndarray:
    """(N,) state after each of N steps, which take it from `start`."""
    direction = np.sign(step)
    first = np.concatenate([[0], 1 + np.flatnonzero(direction[1:] != direction[:-1])])
    path = np.concatenate([[0.0], np.cumsum(np.abs(step))])
    last = np.append(first[1:], len(step))
    towards = direction[first]
    decay = np.exp((path[first] - path[last]) / distance)
    starts = []
    z = start
    for s, d in zip(towards.tolist(), decay.tolist(), strict=True):
        starts.append(z)
        z = s + (z - s) * d
    way = np.repeat(path[first], last - first) - path[1:]
    stretch = np.repeat(np.array(starts) - towards, last - first)
    return direction + stretch * np.exp(way / distance)


class Presliding:
    """The presliding states of a robot's joints and coupled motors, kept from call to call: in a controller, from tick
    to tick; over a long log, from piece to piece. `Regressor.presliding` makes one.

    Called with the positions that come next, (n,) or (N, n), it gives their states, (signs,) or (N, signs), for the
    regressor's `slip`. The first position ever has state 0: which way friction pushes there is not known.
    """

    def __init__(self, distance: float, speeds: Callable[[np.ndarray], np.ndarray]) -> None:
        self.distance = distance
        self._arms = speeds
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(self, q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, dtype=float)
        if q.ndim == 1:
            return self(q[None])[0]
        way = self._arms(q)
        if not len(way):
            return np.empty(way.shape)
        before = self._last or (way[0], np.zeros(way.shape[1]))
        z = presliding_state(np.concatenate([before[0][None], way]), self.distance, before[1])[1:]
        self._last = way[-1], z[-1]
        return z
