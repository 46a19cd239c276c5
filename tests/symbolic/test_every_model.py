"""Every model of dynamics of any small arm can be built and printed, and Newton and Euler's is Lagrange's."""

from __future__ import annotations

import numpy as np
from chains import random_chain
from hypothesis import given, settings
from hypothesis import strategies as st
from printed_models import printed

from identify.symbolic.models import symbolic_model
from identify.symbolic.operation_table import operations


@given(seed=st.integers(0, 10**6), n=st.integers(1, 3), special=st.booleans(), tree=st.booleans())
@settings(max_examples=10, deadline=None, derandomize=True)
def test_models_of_any_chain(seed: int, n: int, special: bool, tree: bool) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, n, special=special, tree=tree)
    q, dq, ddq, force, moment = (rng.uniform(-1.5, 1.5, k) for k in (n, n, n, 3, 3))
    signals = {"q": q, "dq": dq, "ddq": ddq, "F": force, "N": moment}
    lagrange = printed(symbolic_model(robot, "lagrange"))(**signals)
    torque = printed(symbolic_model(robot, "newton-euler"))(**signals)
    scale = max(np.abs(x).max() for x in (lagrange["tau"], lagrange["Q"], lagrange["tau_f"]))
    np.testing.assert_allclose(torque, lagrange["tau"], rtol=0, atol=1e-10 * scale)
    free = lagrange["tau"] - lagrange["tau_e"]
    again = printed(symbolic_model(robot, "direct-dynamics"))(q=q, dq=dq, tau=free)
    size = np.linalg.cond(lagrange["A"]) * max(1.0, scale / np.linalg.norm(lagrange["A"], 2))
    np.testing.assert_allclose(again, ddq, rtol=0, atol=1e-11 * max(size, 1.0))
    assert np.isfinite(printed(symbolic_model(robot, "energy"))(q=q, dq=dq)["H"])
    assert all(min(r.operations.multiplications, r.operations.additions) >= 0 for r in operations(robot))
