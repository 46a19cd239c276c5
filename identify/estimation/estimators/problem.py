"""What every estimator is given: the logs, and how they become the rows of either model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.energy import EnergyObservation, energy_observation, stacked_energy
from identify.estimation.observation import Observation, torque_blocks, torque_residual
from identify.estimation.reduction import Reduction, reduced
from identify.estimation.settings import CONSTANTS, Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor


@dataclass(frozen=True, eq=False)
class Problem:
    """Training logs, and for each model the regressor whose parameters are sought and the settings of its rows.

    regressor, settings: of the torque model, with the forms of friction that were chosen for it. plain,
    energy_settings: of the energy model, with viscous and Coulomb friction and offset alone, and with a window; None
    where no window lets the logs tell its parameters apart, and energy_reason says so.
    What is asked for more than once is computed once; an hour's log is never in memory as rows.
    """

    regressor: Regressor
    logs: Sequence[Log]
    settings: Settings
    plain: Regressor
    energy_settings: Settings | None
    energy_reason: str = ""

    @cached_property
    def reduction(self) -> Reduction:
        """The torque model's rows as triangular factors."""
        return reduced(self.blocks())

    def blocks(self) -> Iterator[Observation]:
        """The torque model's rows, block by block."""
        return torque_blocks(self.regressor, self.logs, self.settings)

    def residual(self, parameters: np.ndarray) -> np.ndarray:
        """(rows, n) effort − W·parameters of the torque model's rows [N·m or N]."""
        return torque_residual(self.regressor, self.logs, self.settings, parameters)

    @cached_property
    def energy(self) -> EnergyObservation:
        """The energy model's rows. UnsupportedLogError where there is no window for them."""
        return stacked_energy([energy_observation(self.plain, log, self.windows) for log in self.logs])

    @property
    def windows(self) -> Settings:
        """Settings of the energy model. UnsupportedLogError with energy_reason where there are none."""
        if self.energy_settings is None:
            raise UnsupportedLogError(self.energy_reason)
        return self.energy_settings

    @cached_property
    def work(self) -> EnergyObservation:
        """The energy model's rows with the torque model's columns, further forms of friction included."""
        names = ("coulomb_velocity", "friction", *chain(*CONSTANTS.values()))
        settings = replace(self.windows, **{name: getattr(self.settings, name) for name in names})
        return stacked_energy([energy_observation(self.regressor, log, settings) for log in self.logs])
