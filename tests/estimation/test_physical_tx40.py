"""On the measured TX40, whose least squares belong to no possible robot: what the nearest possible one costs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from beside import tx40_recording

from identify.estimation.fitting import fit_torque
from identify.estimation.observation import torque_blocks
from identify.estimation.physical import information_of, nearest_consistent
from identify.estimation.reduction import reduced
from identify.estimation.reference import reference
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.logs.reading import read_log
from identify.logs.slicing import window
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.mjcf import to_mjcf

MAP = Path(__file__).parents[2] / "datasets" / "tx40.toml"
PLAIN = Settings(position_cutoff_hz=30.0, coulomb_velocity=0.1, rest_counted=True)
"""What `identify fit --friction plain` chooses on the last 60 % of the recording."""

CHOSEN = replace(PLAIN, position_cutoff_hz=15.0, friction=("cube_root", "presliding"), presliding_distance=1e-4)
"""What `identify fit` chooses there."""


@pytest.fixture(scope="module")
def log() -> Log:
    return read_log(tx40_recording(), MAP)


@pytest.mark.parametrize(("settings", "most"), [(PLAIN, 0.5), (CHOSEN, 2.0)])
@pytest.mark.parametrize("start", [0.0, 3.6])
def test_possible_links_cost_little(start: float, settings: Settings, most: float, log: Log) -> None:
    """Every link ≻ 0, the weighted residual ‖r‖ at most 0.5 % longer with plain friction [issue 4], the solver within
    50 ms.

    Measured: 0.30 % on the whole recording and 0.40 % on its last 60 % (ZZ6 and others come out of least squares
    with the wrong sign); no possible robot does better than 0.30 and 0.39 %. With further forms of friction the
    residual is half as long and the cost 0.78 and 1.85 % of it, of which links alone 0.37 and 1.61 %.
    """
    part = window(log, start, None)
    regressor = Regressor(load_robot("tx40"), settings.friction)
    estimate = fit_torque(regressor, [part], settings, "wls").estimate
    bodies = reference(regressor, estimate.parameters, description=True)
    information = information_of(estimate.covariance)
    runs = [
        nearest_consistent(
            regressor, estimate.parameters, information, bodies, coulomb_velocity=settings.coulomb_velocity
        )
        for _ in range(3)
    ]
    found = runs[0]
    assert found.possible
    assert found.cost > 0.5
    assert min(run.seconds for run in runs) < 0.05
    mujoco.MjModel.from_xml_string(to_mjcf(regressor.robot, found.standard, friction=False))
    rows = reduced(torque_blocks(regressor, [part], settings))
    before, after = (
        rows.residual_power(theta) / estimate.sigma**2 for theta in (estimate.parameters, found.parameters)
    )
    assert 1 < np.sqrt(after.sum() / before.sum()) < 1 + most / 100
