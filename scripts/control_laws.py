"""Control laws that carry a regressor along: PD, computed torque, and Slotine and Li's adaptive control.

A law takes its parameters theta (p,), the measured q and q̇ (n,) and the reference q, q̇ and q̈ (n,), and gives the
torque (n,) [N·m] and the parameters for the next tick. `scripts/example_control` runs them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import identify
from identify.regressor.columns import smooth_sign

PERIOD = 0.001
"""Control period [s]."""

OMEGA = 2 * np.pi * 5.0
"""Every law wants the closed loop ë + 2ω·ė + ω²·e = 0: critically damped, 5 Hz [rad/s]."""

COULOMB = smooth_sign(0.02)
"""Sign of the measured velocity for friction: linear below 0.02 rad/s, where the velocity is half noise."""

MAY_CARRY, WITHIN = 6.0, 0.2
"""What the adaptive law expects: a payload of some 6 kg, some 0.2 m from the wrist [kg, m]."""

FRICTION_DRIFT, FIT_ERRORS = 0.1, 10.0
"""It also expects friction to drift by some 10 %, as it does while an arm warms up, and whatever else the fit found to
be off by some ten of its standard deviations."""

ADAPTATION = 0.5
"""Speed of the adaptation, at its fastest, as a share of the loop's ω."""

Array = np.ndarray
Answer = tuple[Array, Array]
Law = Callable[[Array, Array, Array, Array, Array, Array], Answer]


def pd(inertia: Array) -> Law:
    """Γ = D·(2ω·ė + ω²·e), e = q_ref − q; D (n,) mean diagonal of the inertia matrix [kg·m²]."""

    def law(theta: Array, q: Array, dq: Array, q_ref: Array, dq_ref: Array, ddq_ref: Array) -> Answer:
        return inertia * (2 * OMEGA * (dq_ref - dq) + OMEGA**2 * (q_ref - q)), theta

    return law


def computed_torque(regressor: identify.Regressor) -> Law:
    """Γ = A(q)·w + C(q,q̇)·q̇ + Q(q) + friction, w = q̈_ref + 2ω·ė + ω²·e, e = q_ref − q."""

    def law(theta: Array, q: Array, dq: Array, q_ref: Array, dq_ref: Array, ddq_ref: Array) -> Answer:
        w = ddq_ref + 2 * OMEGA * (dq_ref - dq) + OMEGA**2 * (q_ref - q)
        return regressor.inverse_dynamics(q, dq, w, theta, COULOMB), theta

    return law


def adaptive(regressor: identify.Regressor, inertia: Array, gain: Array) -> Law:
    """Γ = Y·θ − K·s and θ̇ = −P·Yᵀ·s (Slotine & Li 1987): s = ė + ω·e with e = q − q_ref, K = ω·D, P = gain (p, p).

    Y·θ = A·(q̈_ref − ω·ė) + C·(q̇_ref − ω·e) + Q + friction; with A = D the loop is ë + 2ω·ė + ω²·e = 0 again. No
    acceleration is measured and no matrix inverted. V = ½·sᵀ·A·s + ½·θ̃ᵀ·P⁻¹·θ̃, θ̃ = θ − true θ, can't grow: V̇ = −sᵀ·K·s.
    """

    def law(theta: Array, q: Array, dq: Array, q_ref: Array, dq_ref: Array, ddq_ref: Array) -> Answer:
        error, error_rate = q - q_ref, dq - dq_ref
        s = error_rate + OMEGA * error
        y = regressor.slotine_li(q, dq, dq_ref - OMEGA * error, ddq_ref - OMEGA * error_rate, COULOMB)  # (n, p)
        return y @ theta - OMEGA * inertia * s, theta - PERIOD * (gain @ (y.T @ s))

    return law


def inertia_matrices(regressor: identify.Regressor, theta: Array, q: Array) -> Array:
    """(N, n, n) A(q) at q (N, n) from the parameters theta (p,): the torque of one unit of q̈ after another."""
    still = np.zeros_like(q)
    gravity = regressor.inverse_dynamics(q, still, still, theta)
    columns = [regressor.inverse_dynamics(q, still, still + one, theta) - gravity for one in np.eye(regressor.robot.n)]
    return np.stack(columns, axis=2)


def adaptation_gain(
    regressor: identify.Regressor, result: identify.Identification, q: Array, dq: Array, ddq: Array
) -> Array:
    """P (p, p): the covariance of what is not known, times the factor at which adaptation is slower than the loop.

    q, dq, ddq (N, n): samples of the motion to come. Not known are the fit's own errors, a payload on the last link
    and a drift of friction. The payload's ten parameters come in through the base parameters that they add to, so
    that what is adapted stays an arm with a load.
    """
    last, base = slice(-11, -1), len(regressor.base.names)
    deviation = MAY_CARRY * np.array([WITHIN**2] * 6 + [WITHIN] * 3 + [1.0])  # of XX … ZZ, MX MY MZ, M
    payload = np.zeros((regressor.p, 10))
    payload[:base] = regressor.base.matrix[:, last] * deviation
    friction = {c: x for c, x in zip(result.names, result.parameters, strict=True) if c.startswith(("Fv", "Fs"))}
    drift = FRICTION_DRIFT * np.array([friction.get(c.replace("off", "Fs"), 0.0) for c in result.names])
    unknown = FIT_ERRORS**2 * result.covariance + payload @ payload.T + np.diag(drift**2)
    # s̈ = −A⁻¹·Y·P·Yᵀ·s without damping: the eigenvalues are squares of the frequencies that P brings [rad²/s²]
    y = regressor.torque(q, dq, ddq)
    rate = np.linalg.solve(inertia_matrices(regressor, result.parameters, q), y @ unknown @ y.swapaxes(1, 2))
    return unknown * (ADAPTATION * OMEGA) ** 2 / np.abs(np.linalg.eigvals(rate)).max()
