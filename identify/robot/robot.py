"""What the arm is: geometry, links, drives, limits and transmission, as one frozen value.

Geometry is modified Denavit-Hartenberg (Khalil & Kleinfinger 1986): the frame R_j of link j follows
from its parent's by  Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r),
[2.3] with the two parameters gamma and b that branches need and a serial chain does without.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Vector = tuple[float, float, float]
Matrix = tuple[tuple[float, ...], ...]

REVOLUTE = "revolute"
PRISMATIC = "prismatic"
INFINITY = float("inf")
IDENTITY: Matrix = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))

LINK_PARAMETERS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
LINK_UNITS = ("kg·m²",) * 6 + ("kg·m",) * 3 + ("kg",)
"""The ten standard inertial parameters of a link [2.91], about O_j in the axes of R_j."""


GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")
"""What places a joint in the frame of its parent: modified Denavit-Hartenberg parameters, with γ and b of a tree."""


@dataclass(frozen=True)
class Link:
    """Inertia of one link, as catalogues and CAD programs give it.

    mass [kg]; com (3,) centre of mass in R_j [m]; inertia (6,) Ixx Ixy Ixz Iyy Iyz Izz about the
    centre of mass in the axes of R_j [kg·m²].
    """

    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 6

    @property
    def inertia_matrix(self) -> np.ndarray:
        """(3, 3) inertia about the centre of mass in the axes of R_j [kg·m²]."""
        ixx, ixy, ixz, iyy, iyz, izz = self.inertia
        return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])

    @property
    def principal_moments(self) -> np.ndarray:
        """(3,) eigenvalues of the inertia matrix [kg·m²], rising."""
        return np.linalg.eigvalsh(self.inertia_matrix)

    @property
    def standard(self) -> np.ndarray:
        """(10,) XX XY XZ YY YZ ZZ MX MY MZ M about O_j in the axes of R_j, SI."""
        c = np.asarray(self.com)
        inertia = self.inertia_matrix + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return np.array([*inertia[np.triu_indices(3)], *(self.mass * c), self.mass])


@dataclass(frozen=True)
class Drive:
    """Actuator and friction of one joint, seen from the joint side.

    inertia Ia [kg·m² or kg] (2.65); viscous Fv [N·m·s/rad or N·s/m]; coulomb Fs [N·m or N];
    offset [N·m or N]. Γf = Fs·sign(q̇) + Fv·q̇ + offset [2.63].
    """

    inertia: float = 0.0
    viscous: float = 0.0
    coulomb: float = 0.0
    offset: float = 0.0


@dataclass(frozen=True)
class Limits:
    """Limits of one joint: position (low, high) [rad or m], velocity, acceleration, effort (magnitudes, SI); mass (low,
    high) [kg] of the link that it carries, with what is fixed to it."""

    position: tuple[float, float] = (-INFINITY, INFINITY)
    velocity: float = INFINITY
    acceleration: float = INFINITY
    effort: float = INFINITY
    mass: tuple[float, float] = (0.0, INFINITY)


@dataclass(frozen=True)
class Joint:
    """One moving joint and the link it carries.

    `parent` is the index of the parent joint in the robot, -1 for the base. `theta` (revolute) or `r`
    (prismatic) is the constant part of the variable: θ = q + theta. `symbols` names the lengths that
    symbolic models keep as letters, as (parameter, letter) pairs. radius [m]: of a capsule around the link, None where
    it is not known.
    """

    name: str
    type: str = REVOLUTE
    parent: int = -1
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    r: float = 0.0
    gamma: float = 0.0
    b: float = 0.0
    symbols: tuple[tuple[str, str], ...] = ()
    limits: Limits = field(default_factory=Limits)
    link: Link = field(default_factory=Link)
    drive: Drive = field(default_factory=Drive)
    radius: float | None = None

    @property
    def revolute(self) -> bool:
        """Whether it turns; else it slides."""
        return self.type == REVOLUTE

    @property
    def effort_unit(self) -> str:
        """Unit of the joint's effort: N·m or N."""
        return "N·m" if self.revolute else "N"

    @property
    def position_unit(self) -> str:
        """Unit of the joint's variable: rad or m."""
        return "rad" if self.revolute else "m"


@dataclass(frozen=True)
class Transmission:
    """Linear transmission: motor position = matrix × joint position; joint effort = matrixᵀ × motor effort.

    matrix (n, n), one row a motor, in the robot's joint order. A row with more than one entry is a
    coupled axis; its motor k adds the columns Iam, Fvm and Fsm to the regressor. motors: what coupled motors have of
    inertia and friction, in units of their joint, as part of which Ia and Fv of each of their joints count it too;
    one a motor, those of motors that are not coupled say nothing; () where nothing is known.
    """

    matrix: Matrix
    motors: tuple[Drive, ...] = ()

    @property
    def array(self) -> np.ndarray:
        """(n, n) the matrix as an array."""
        return np.array(self.matrix, dtype=float)

    @property
    def couplings(self) -> tuple[tuple[int, tuple[float, ...]], ...]:
        """(motor index k, ratios (n,)) of every coupled motor: its speed in units of joint k is ratios · q̇."""
        rows = ((k, np.array(row, dtype=float)) for k, row in enumerate(self.matrix))
        return tuple((k, tuple(row / row[k])) for k, row in rows if np.count_nonzero(row) > 1)


@dataclass(frozen=True)
class Robot:
    """A serial or tree-shaped arm of n moving joints.

    gravity (3,) acceleration 0g in R_0 [m/s²]; base (4, 4) places R_0 in the world (Z of [2.10]) and
    tool (4, 4) the tool in the last frame (E of [2.10]). `source` says where the description came from,
    `note` what its reader must know (that numbers are not measured, say). floor: height in the world that no link may
    reach down to [m], None where it is not known.
    """

    name: str
    joints: tuple[Joint, ...]
    gravity: Vector = (0.0, 0.0, -9.81)
    base: Matrix = IDENTITY
    tool: Matrix = IDENTITY
    transmission: Transmission | None = None
    source: str = ""
    note: str = ""
    floor: float | None = None

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return len(self.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """(n,) names of the joints, in their order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def standard_names(self) -> tuple[str, ...]:
        """(11 n,) "XX1" … "M1", "Ia1", "XX2" … in the order of `standard`."""
        return tuple(f"{p}{j}" for j in range(1, self.n + 1) for p in (*LINK_PARAMETERS, "Ia"))

    @property
    def standard(self) -> np.ndarray:
        """(11 n,) standard parameters: per link XX XY XZ YY YZ ZZ MX MY MZ M about O_j in R_j, then Ia. SI."""
        return np.concatenate([[*joint.link.standard, joint.drive.inertia] for joint in self.joints])

    @property
    def couplings(self) -> tuple[tuple[int, tuple[float, ...]], ...]:
        """The transmission's coupled motors; see `Transmission.couplings`."""
        return self.transmission.couplings if self.transmission else ()
