"""Normal equations joint by joint, from raw signals: the regressor is made and summed up block by block, never kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.regressor.friction import Sign
from identify.regressor.regressor import Regressor


@dataclass(frozen=True)
class NormalEquations:
    """Sums over samples, one set a joint, so that joints may be weighted afterwards: Σ w_j·gram_j·θ = Σ w_j·moment_j.

    gram (n, p, p) YᵀY, moment (n, p) YᵀΓ and power (n,) ΓᵀΓ of each joint's rows, in (N·m or N)² over the parameters'
    units, columns in the order of `Regressor.names`; samples: their number N. Those of several logs add up. The method
    of normal equations: Björck (1996).
    """

    gram: np.ndarray
    moment: np.ndarray
    power: np.ndarray
    samples: int

    @staticmethod
    def of(
        regressor: Regressor,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        effort: np.ndarray,
        sign: Sign = np.sign,
    ) -> NormalEquations:
        """From joint signals q, dq, ddq and effort [N·m or N], (N, n) each: SI, joint side, in the robot's order.

        sign: of a velocity, as for `Regressor.torque`. ValueError where shapes differ.
        """
        n, p = regressor.robot.n, regressor.p
        sums = [np.zeros((len(support) + 1,) * 2) for support in regressor.supports]
        for block in regressor.rows(q, dq, ddq, effort, sign):
            for total, rows in zip(sums, block, strict=True):
                total += rows @ rows.T
        gram, moment = np.zeros((n, p, p)), np.zeros((n, p))
        for j, (support, total) in enumerate(zip(regressor.supports, sums, strict=True)):
            gram[j][np.ix_(support, support)] = total[:-1, :-1]
            moment[j, support] = total[-1, :-1]
        return NormalEquations(gram, moment, np.array([total[-1, -1] for total in sums]), len(q))

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(
            self.gram + other.gram, self.moment + other.moment, self.power + other.power, self.samples + other.samples
        )

    def solution(self, weights: np.ndarray) -> np.ndarray:
        """(p,) θ of least squares [SI], in the order of `Regressor.names`, by Cholesky's factors. See `refined`.

        weights (n,): one over the variance of each joint's effort [1/(N·m)² or 1/N²]. ValueError where the samples
        can't tell parameters apart.
        """
        return self._solve(weights, weights @ self.moment)

    def residual_power(self, theta: np.ndarray) -> np.ndarray:
        """(n,) Σ (Γ − Y·θ)² [(N·m)² or N²] of each joint at theta (p,): a difference, good to 1e-15 of `power`."""
        quadratic = np.einsum("k,jkl,l->j", theta, self.gram, theta)
        return np.maximum(self.power - 2 * self.moment @ theta + quadratic, 0.0)

    def condition_number(self, weights: np.ndarray) -> float:
        """Condition number (2-norm) of the rows, weights (n,), with columns scaled to norm 1; above 1e7 only its order
        is right, as a Gram matrix holds its square. ValueError where a column is zero."""
        size = np.linalg.eigvalsh(self._scaled(weights)[0])
        return float(np.sqrt(size[-1] / max(size[0], 1e-300)))

    def refined(
        self,
        theta: np.ndarray,
        weights: np.ndarray,
        regressor: Regressor,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        effort: np.ndarray,
        sign: Sign = np.sign,
    ) -> np.ndarray:
        """(p,) θ corrected by the solution for its own residual, in one more pass over the signals: as good as QR's.

        theta (p,) and weights (n,) as in `solution`; the signals (N, n) that the sums were made of.
        """
        moment = np.zeros(regressor.p)
        factors = [np.append(-theta[support], 1.0) for support in regressor.supports]
        for block in regressor.rows(q, dq, ddq, effort, sign):
            for rows, support, factor, weight in zip(block, regressor.supports, factors, weights, strict=True):
                moment[support] += weight * (rows[:-1] @ (factor @ rows))
        return theta + self._solve(weights, moment)

    def _scaled(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(p, p) weighted Gram matrix of columns of norm 1, and the norms (p,) that they were divided by."""
        gram = np.tensordot(weights, self.gram, 1)
        norm = np.sqrt(gram.diagonal())
        if not norm.all():
            raise ValueError("the samples say nothing about some of the parameters")
        return gram / np.outer(norm, norm), norm

    def _solve(self, weights: np.ndarray, moment: np.ndarray) -> np.ndarray:
        gram, norm = self._scaled(weights)
        try:
            root = np.linalg.inv(np.linalg.cholesky(gram))
        except np.linalg.LinAlgError as error:
            raise ValueError("the samples can't tell the parameters apart") from error
        return root.T @ (root @ (moment / norm)) / norm
