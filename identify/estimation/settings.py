"""How a log is turned into equations: the choices that the estimate depends on, each stated in the report."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from identify.estimation.motion import Smoothing
from identify.logs.triage import REST_SPEED
from identify.regressor.columns import smooth_sign
from identify.regressor.friction import (
    LOAD,
    PRESLIDING,
    STRIBECK,
    STRIBECK_VELOCITY,
    FrictionConstants,
    Presliding,
    Sign,
    further_forms,
)
from identify.regressor.regressor import Regressor

CONSTANTS = {
    PRESLIDING: ("presliding_distance",),
    STRIBECK: ("stribeck_velocity",),
    LOAD: ("load_parameters", "mean_load"),
}
"""What further forms of friction depend on beside their parameters."""

STILL = REST_SPEED
"""A joint slower than this [rad/s or m/s] counts as at rest."""


@dataclass(frozen=True)
class Settings:
    """Processing of a log.

    position_cutoff_hz: low-pass of the position before it is differentiated; quiet_cutoff_hz: a lower one away from
    starts, stops and reversals, see `Smoothing`. effort_cutoff_hz: parallel low-pass of
    effort and of every column of the observation matrix, which is then decimated to decimated_rate_hz (Gautier 1997).
    coulomb_velocity: None for the exact sign of the velocity, but for a straight line through rest, |q̇| ≤ STILL, where
    nothing is known of friction; else clip(q̇ / coulomb_velocity, −1, 1) [rad/s or m/s].
    rest_counted: whether rows of a joint at rest are used; if not, they and those within guard_s of them are set to
    zero on both sides before the parallel filter. window_s: length of the energy model's windows; energy_cutoff_hz:
    low-pass of the position for its energies, which want less noise and need no acceleration. friction: forms of it
    beside the plain ones, of `identify.regressor.friction`; presliding_distance [rad or m]: the way on which a joint's
    presliding state changes; stribeck_velocity [rad/s or m/s], at which 1/e of Stribeck friction is left;
    load_parameters (b,) base parameters whose effort is the load that friction grows with, and mean_load (n,) its mean
    magnitude at each joint [N·m or N]. Each is there with its form of friction alone.
    """

    position_cutoff_hz: float = 40.0
    effort_cutoff_hz: float = 10.0
    decimated_rate_hz: float = 20.0
    coulomb_velocity: float | None = None
    rest_counted: bool = False
    guard_s: float = 0.025
    window_s: float | None = None
    energy_cutoff_hz: float | None = None
    friction: tuple[str, ...] = ()
    presliding_distance: float | None = None
    stribeck_velocity: float | None = None
    load_parameters: tuple[float, ...] | None = None
    mean_load: tuple[float, ...] | None = None
    quiet_cutoff_hz: float | None = None

    def __post_init__(self) -> None:
        for name in ("position_cutoff_hz", "effort_cutoff_hz", "decimated_rate_hz"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.quiet_cutoff_hz is not None and not self.quiet_cutoff_hz > 0:
            raise ValueError(f"quiet_cutoff_hz is {self.quiet_cutoff_hz}; it must be positive where it is given")
        for form, names in CONSTANTS.items():
            for name in names:
                value = getattr(self, name)
                given = value is not None and (name == "load_parameters" or np.min(value) > 0)
                if (form in self.friction) != given:
                    raise ValueError(f"friction {self.friction} with {name} {value}")

    @property
    def smoothing(self) -> Smoothing:
        """What is done to positions."""
        return Smoothing(self.position_cutoff_hz, self.quiet_cutoff_hz)

    @property
    def sign(self) -> Sign:
        """The Coulomb columns' function of the velocity."""
        # The sign of a velocity that is noise around zero would predict ±Fs of a joint at rest.
        return smooth_sign(STILL if self.coulomb_velocity is None else self.coulomb_velocity)

    def suited(self, regressor: Regressor) -> Regressor:
        """The regressor of the same robot with these forms of friction."""
        if not self.friction and not regressor.forms:
            return regressor
        fading = self.stribeck_velocity or STRIBECK_VELOCITY
        constants = FrictionConstants(fading, self.load_parameters, self.mean_load)
        return regressor.with_forms(self.friction, constants)

    @property
    def plain(self) -> Settings:
        """The same without further forms of friction."""
        nothing: dict[str, Any] = dict.fromkeys(name for names in CONSTANTS.values() for name in names)
        return replace(self, friction=(), **nothing)

    @property
    def any_motion(self) -> Settings:
        """The same without the lower cut-off, which was found low enough for the motion of one log: of another one it
        may take away what moves, and what it takes is missing from the inertias."""
        return replace(self, quiet_cutoff_hz=None)

    def presliding(self, regressor: Regressor | None) -> Presliding | None:
        """What follows the regressor's presliding states along a log, or None where no friction reads them."""
        if regressor is None or self.presliding_distance is None:
            return None
        return regressor.presliding(self.presliding_distance)

    def to_dict(self) -> dict[str, Any]:
        """All of it for JSON, less what does not apply."""
        form = "sign" if self.coulomb_velocity is None else "smooth sign"
        applying = {key: value for key, value in asdict(self).items() if value is not None}
        applying = {key: list(value) if isinstance(value, tuple) else value for key, value in applying.items()}
        return {**applying, "still_rad_s": STILL, "coulomb_form": form}

    @staticmethod
    def from_dict(record: dict[str, Any]) -> Settings:
        known = {k: v for k, v in record.items() if k in Settings.__dataclass_fields__}
        known = {k: tuple(v) if isinstance(v, list) else v for k, v in known.items()}
        return Settings(**known | {"friction": further_forms(known.get("friction", ()))})
