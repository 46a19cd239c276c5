"""Limits that a motion is planned within."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from identify.experiment.limits import working_limits
from identify.robot.robot import Joint, Limits, Robot

INF = float("inf")


def test_own_limits_stand_and_missing_ones_are_replaced_by_kind_of_joint() -> None:
    joints = (
        Joint("full", limits=Limits((-0.5, 2.5), 4.0, 9.0, 70.0)),
        Joint("none", parent=0),
        Joint("slide", "prismatic", parent=1),
        Joint("floor", "prismatic", parent=2, limits=Limits((0.1, INF), 0.7)),
        Joint("ceiling", parent=3, limits=Limits((-INF, 1.0), effort=5.0)),
    )
    limits = working_limits(Robot("arm", joints))
    assert_array_equal(limits.low, [-0.5, -1.5, -0.3, 0.1, -2.0])
    np.testing.assert_allclose(limits.high, [2.5, 1.5, 0.3, 0.7, 1.0], rtol=1e-15)
    np.testing.assert_allclose(limits.velocity, [4.0, 1.5, 0.3, 0.7, 1.5], rtol=1e-15)
    np.testing.assert_allclose(limits.acceleration, [9.0, 3.0, 0.6, 0.6, 3.0], rtol=1e-15)
    assert_array_equal(limits.effort, [70.0, INF, INF, INF, 5.0])
    np.testing.assert_allclose(limits.middle - limits.half, limits.low, atol=1e-15)
    np.testing.assert_allclose(limits.middle + limits.half, limits.high, atol=1e-15)
