"""Force and moment of one body by its second moments Σ = ∫ r rᵀ dm, its first moments and its mass.

With U = ω̇^ + ω^ω^ and the acceleration V̇ of the origin, the moment is the skew part of U Σ and MS×V̇, the force
U·MS + M·V̇.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.symbolic.chain import Mat, Vec, cross, number
from identify.symbolic.expression import Scalar
from identify.symbolic.turning import Motions

SECOND_MOMENTS = ("SXX", "SXY", "SXZ", "SYY", "SYZ", "SZZ", "MX", "MY", "MZ", "M", "Ia")
"""Parameters of one link and its drive: ∫ r rᵀ dm, ∫ r dm and ∫ dm about O_j in R_j, and the actuator inertia."""

XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M, IA = range(11)


def parameter_name(k: int) -> str:
    """Name of the second-moment parameter of index k: "SXX1" …"""
    return f"{SECOND_MOMENTS[k % 11]}{k // 11 + 1}"


def second_moments(standard: list[Scalar]) -> list[Scalar]:
    """(11 n,) SXX SXY … SZZ MX MY MZ M Ia of each link from the standard parameters: SXX = ½(YY + ZZ − XX)."""
    moments: list[Scalar] = []
    for j in range(0, len(standard), 11):
        xx, xy, xz, yy, yz, zz, *rest = standard[j : j + 11]
        moments += [0.5 * (yy + zz - xx), -xy, -xz, 0.5 * (xx + zz - yy), -yz, 0.5 * (xx + yy - zz), *rest]
    return moments


def standard_from_second_moments(n: int) -> np.ndarray:
    """(11 n, 11 n): standard parameters = matrix @ second-moment ones; XX = SYY + SZZ, XY = −SXY …"""
    link = np.eye(11)
    for i, (a, c) in {0: (3, 5), 3: (0, 5), 5: (0, 3)}.items():
        link[i, i] = 0
        link[i, a] = link[i, c] = 1
    for i in (1, 2, 4):
        link[i, i] = -1
    return np.kron(np.eye(n), link)


def first_wrench(u: Mat, a: Vec, first: Vec, mass: Scalar) -> tuple[Vec, Vec]:
    """Force U·MS + M·V̇ and moment MS×V̇ of the first moments and the mass."""
    force: Vec = tuple(  # type: ignore[assignment]
        u[i][0] * first[0] + u[i][1] * first[1] + u[i][2] * first[2] + a[i] * mass for i in range(3)
    )
    return force, cross(first, a)


def inertial_moment(m: Motions, k: Sequence[Scalar]) -> Vec:
    """The skew part of U Σ."""
    u, (d32, d13, d21) = m.u, m.differences
    return (
        u[2][0] * k[XY] + u[2][1] * k[YY] - u[1][0] * k[XZ] + d32 * k[YZ] - u[1][2] * k[ZZ],
        d13 * k[XZ] + u[0][1] * k[YZ] - u[2][0] * k[XX] - u[2][1] * k[XY] + u[0][2] * k[ZZ],
        u[1][0] * k[XX] - u[0][1] * k[YY] + d21 * k[XY] + u[1][2] * k[XZ] - u[0][2] * k[YZ],
    )


def unturned_moment(m: Motions, k: Sequence[Scalar], c: Scalar, s: Scalar) -> Vec:
    """The same in axes that do not turn with the joint: second moments turn instead, SXX + SYY does not."""
    u, (d32, d13, d21) = m.u, m.differences
    xx, xy, xz, yy, yz, zz, *_ = turned_body(k, c, s)
    return (
        u[2][0] * xy + u[2][1] * yy - u[1][0] * xz + d32 * yz - u[1][2] * zz,
        d13 * xz + u[0][1] * yz - u[2][0] * xx - u[2][1] * xy + u[0][2] * zz,
        m.p12 * (xx - yy) + m.alpha[2] * (k[XX] + k[YY]) + d21 * xy + u[1][2] * xz - u[0][2] * yz,
    )


def turned_body(k: Sequence[Scalar], c: Scalar, s: Scalar) -> list[Scalar]:
    """Second and first moments and mass in axes turned back by the angle of cosine c and sine s about z."""
    e = (k[XX] - k[YY]) * s + (2 * k[XY]) * c
    return [
        k[XX] - s * e, c * e - k[XY], c * k[XZ] - s * k[YZ], k[YY] + s * e, s * k[XZ] + c * k[YZ], k[ZZ],
        c * k[MX] - s * k[MY], s * k[MX] + c * k[MY], k[MZ], k[M],
    ]  # fmt: skip


def difference(parent: Motions, fixed: Mat) -> Scalar:
    """U22 − U11 in axes that are the parent's but for right angles, of the parent's differences."""
    x, y = (max(range(3), key=lambda i: abs(number(fixed[i][c]))) for c in (0, 1))
    d32, d13, d21 = parent.differences
    return {(0, 1): d21, (1, 0): -d21, (1, 2): d32, (2, 1): -d32, (2, 0): d13, (0, 2): -d13}[x, y]


def as_forces(m: Motions, a: Vec, k: Sequence[Scalar], inverse: Scalar) -> Vec:
    """Forces at a distance along x, given by its inverse, that have the moment about z of MX, MY, SXZ and SYZ of a link
    with motions m and acceleration a; in the axes of m, which the link turns against."""
    mx, my, xz, yz = (k[i] * inverse for i in (MX, MY, XZ, YZ))
    x = mx * a[0] + my * a[1] + xz * m.u[0][2] + yz * m.u[1][2]
    y = mx * a[1] - my * a[0] + xz * m.u[1][2] - yz * m.u[0][2]
    return (x, y, 0.0)


def levered_moment(m: Motions, a: Vec, k: Sequence[Scalar], inverse: Scalar, x: Scalar, y: Scalar) -> Vec:
    """Moment across z of the same parameters; (x, y) is the lever that turns with the link."""
    mx, my, xz, yz = (k[i] * inverse for i in (MX, MY, XZ, YZ))
    hx, hy = mx * x - my * y, mx * y + my * x
    (s1, s2, _), p12, (tx, ty) = m.squares, m.p12, m.turned(x, y)
    return (
        xz * (-ty - s2 * y - p12 * x) + yz * (-tx - s2 * x + p12 * y) + hy * a[2],
        xz * (tx + s1 * x + p12 * y) + yz * (p12 * x - s1 * y - ty) - hx * a[2],
        0.0,
    )
