"""Which motion tells a parameter: by laws of mechanics, on arms where the answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_logs import arm

import identify
from identify.estimation.telling_motion import Motion, telling_motions
from identify.regressor.regressor import Regressor

RX90 = Regressor(identify.load_robot("rx90"))


def told(regressor: Regressor, name: str) -> tuple[Motion, ...]:
    return telling_motions(regressor, [regressor.names.index(name)], np.ones(regressor.robot.n))[0]


def test_inertias_of_the_rx90_are_told_by_the_motions_that_feel_them() -> None:
    """ZZR1 acts on joint 1's acceleration alone; first moments of link 2 hang from its horizontal axis; a rotor's
    inertia is felt by its own acceleration; XXR2 is ½·XX·sin 2q2 of joint 1 against joint 2."""
    assert told(RX90, "ZZR1") == (Motion("acceleration", (0,)),)
    assert told(RX90, "MXR2")[0] == Motion("gravity", ())
    assert told(RX90, "Ia5") == (Motion("acceleration", (4,)),)
    assert {j for motion in told(RX90, "XXR2") for j in motion.joints} == {0, 1}
    assert told(RX90, "Fv3") == (Motion("velocity", (2,)),)
    assert told(RX90, "Fs6") == told(RX90, "off6") == (Motion("reversal", (5,)),)


def test_without_gravity_nothing_is_told_by_a_pose() -> None:
    floating = Regressor(replace(identify.load_robot("rx90"), gravity=(0.0, 0.0, 0.0)))
    motions = telling_motions(floating, range(len(floating.base.names)), np.ones(6))
    assert all(motion.kind != "gravity" for found in motions for motion in found)
    assert all(motions)


def test_a_coupled_motor_is_told_by_its_joints_together() -> None:
    coupled = Regressor(identify.load_robot("tx40"))
    assert told(coupled, "Fvm6") == (Motion("velocity", (4, 5)),)
    assert told(coupled, "Iam6") == (Motion("acceleration", (4, 5)),)
    assert told(coupled, "Fsm6") == (Motion("reversal", (4, 5)),)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_motion_named_first_gives_most_information(seed: int) -> None:
    """Held against the whole regressor: the parameter's column has more power in states of that motion than in those
    of any other kind that was not named."""
    regressor = Regressor(arm(seed))
    n, speeds = regressor.robot.n, np.array([j.limits.velocity for j in regressor.robot.joints])
    tops = np.array([j.limits.acceleration for j in regressor.robot.joints])
    low, high = np.array([j.limits.position for j in regressor.robot.joints]).T
    q = np.random.default_rng(5).uniform(low, high, (400, n))
    rest = regressor.torque(q, 0 * q, 0 * q)
    for k, name in enumerate(regressor.base.names):
        power = {"gravity": {(): np.mean(rest[:, :, k] ** 2) * n}, "acceleration": {}}
        for j in range(n):
            term = regressor.torque(q, 0 * q, tops[j] * np.eye(n)[j] + 0 * q) - rest
            power["acceleration"][(j,)] = np.mean(term[:, :, k] ** 2) * n
        power["velocity"] = {
            (j,): np.mean((regressor.torque(q, speeds[j] * np.eye(n)[j] + 0 * q, 0 * q) - rest)[:, :, k] ** 2) * n
            for j in range(n)
        }
        first = told(regressor, name)[0]
        if len(first.joints) == 2:
            continue  # bilinear terms have no state of their own
        best = max(x for kinds in power.values() for x in kinds.values())
        assert power[first.kind][first.joints] > 0.6 * best, name
