"""The models a controller carries: each one function of joint signals, with simplified expressions for its entries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from identify.codegen.angles import with_products
from identify.codegen.inverse import Inverse, inverse, left_out
from identify.regressor.columns import READS
from identify.regressor.friction import ASYMMETRIC, CUBE_ROOT, LOAD, PRESLIDING, STRIBECK
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot
from identify.symbolic.chain import Mat, Vec, add, cross, joint_transform, matmul, matvec
from identify.symbolic.customised import customised_torque
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.joint_effort import (
    Column,
    column_effort,
    shared_energy,
    shared_inertia,
    sign_symbol,
    with_effort,
)
from identify.symbolic.motion import Motion
from identify.symbolic.newton_euler import torque_regressor
from identify.symbolic.operations import lifted
from identify.symbolic.polarisation import bilinear_in_rates
from identify.symbolic.representative import representative
from identify.symbolic.simplification import simplified

SIGNALS = {CUBE_ROOT: "root", STRIBECK: "fade", ASYMMETRIC: "pace"}
"""Prefixes of the symbols of friction signals that are not the sign."""

REFERENCES = {"dqr": "dq_ref", "ddqr": "ddq_ref"}
"""Argument names of the symbols that are no argument names themselves."""


@dataclass(frozen=True)
class FrictionSignal:
    """What a column of friction reads of the speed ratios (n,) · q̇: its "sign", "cube_root", magnitude ("asymmetric"),
    or its sign times exp(−|speed|/fading) ("stribeck"). width: the sign is clip(speed/width, −1, 1), or exact where it
    is None."""

    ratios: tuple[float, ...]
    form: str
    width: float | None
    fading: float


@dataclass(frozen=True)
class Function:
    """One function: signals (n,) each in, an array of `shape` out, whose entries by flat index are expressions.

    Entries not listed are zero. `friction_signals` {symbol: what it stands for}: sign1 …, root1 …, fade1 …, pace1 …,
    which friction reads.
    """

    name: str
    inputs: tuple[str, ...]
    shape: tuple[int, ...]
    entries: dict[int, Expression]
    about: str
    friction_signals: dict[str, FrictionSignal] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))


@dataclass(frozen=True)
class Models:
    """All functions of a robot, and the values of their constants: theta (p,) and the dynamic ones {symbol: value}.

    covariance (p, p) of theta, where it was identified; origin: where theta comes from; inverse: the inverse
    geometry, None where `left_out` says why there is none; coulomb_velocity: speed up to which the sign of a velocity
    grows, None for an exact sign.
    """

    robot: Robot
    regressor: Regressor
    theta: np.ndarray
    covariance: np.ndarray | None
    origin: str
    constants: dict[str, float]
    functions: tuple[Function, ...]
    inverse: Inverse | None
    left_out: str | None
    coulomb_velocity: float | None = None


def models(
    regressor: Regressor,
    theta: np.ndarray,
    covariance: np.ndarray | None,
    origin: str,
    coulomb_velocity: float | None = None,
) -> Models:
    """Every model of the regressor's robot, with parameters theta (p,) in the order of its names."""
    robot = regressor.robot
    chosen = representative(robot)
    constants = chosen.values(theta[: len(regressor.base.names)])
    extra = zip(regressor.names[len(regressor.base.names) :], theta[len(regressor.base.names) :], strict=True)
    constants |= {name: float(x) for name, x in extra}
    build: tuple[Callable[[Robot, Regressor], Function], ...] = (
        inverse_dynamics, base_regressor, energy_functions, slotine_li, inertia_matrix, coriolis, gravity,
        direct_geometry, jacobian,
    )  # fmt: skip
    signals = _friction_signals(regressor, coulomb_velocity)
    functions = tuple(replace(function(robot, regressor), friction_signals=signals) for function in build)
    return Models(
        robot, regressor, theta, covariance, origin, constants, functions, inverse(robot), left_out(robot),
        coulomb_velocity,
    )  # fmt: skip


def _made(graph: Graph, entries: Mapping[int, Scalar]) -> dict[int, Expression]:
    """Simplified entries, without those that are zero."""
    outputs = with_products(simplified(lifted(graph, entries.values())))
    return {at: e for at, e in zip(entries, outputs, strict=True) if e.value != 0}


def _torque(graph: Graph, robot: Robot, motion: Motion) -> list[Scalar]:
    chosen = representative(robot)
    return customised_torque(graph, robot, chosen.symbols(graph, robot.n), motion, forms=chosen.forms)


def _columns(regressor: Regressor) -> tuple[Column, ...]:
    return regressor.extra.columns if regressor.extra else ()


def signal_symbol(column: Column, n: int) -> str:
    """Symbol of what a friction column reads: sign1 … and the like of the joints, then of the coupled motors.
    Presliding friction, whose state no function keeps, reads the sign, its state in steady sliding; so does friction
    that grows with the load, as under the mean load."""
    return sign_symbol(column, n).replace("sign", SIGNALS.get(READS.get(column.kind, ""), "sign"))


def _friction_signals(regressor: Regressor, width: float | None) -> dict[str, FrictionSignal]:
    """{symbol: what it stands for} of the friction columns; width [rad/s or m/s] of the sign, None for an exact one."""
    n = regressor.robot.n
    found = {}
    for column in _columns(regressor):
        if column.kind in READS:
            own = tuple(float(i == column.index) for i in range(n))
            form = READS[column.kind]
            form, fading = form if form in SIGNALS else "sign", regressor.constants.stribeck_velocity
            found[signal_symbol(column, n)] = FrictionSignal(column.ratios or own, form, width, fading)
    return found


def friction_note(models: Models) -> str:
    """What the functions make of friction near rest; empty where it is the sign of the velocity."""
    told = []
    if models.coulomb_velocity is not None:
        told.append(f"Coulomb friction grows linearly up to {models.coulomb_velocity:g} rad/s or m/s.")
    if PRESLIDING in models.regressor.forms:
        told.append("Presliding friction (Fp) is that of steady sliding: no function keeps its state.")
    if LOAD in models.regressor.forms:
        told.append("Friction that grows with the load (Fl) is that under the mean load of the training logs.")
    return " ".join(told)


def inverse_dynamics(robot: Robot, regressor: Regressor) -> Function:
    """Γ (n,) [N·m or N] at q, dq, ddq: customised Newton-Euler [2.69]–[2.89], friction and shared motors."""
    graph = Graph()
    rigid = _torque(graph, robot, Motion.of(graph, robot))
    torque = with_effort(graph, rigid, _columns(regressor), signal_symbol)
    about = "Joint effort [N·m or N] with base parameters, friction and offset."
    entries = _made(graph, dict(enumerate(torque)))
    return Function("inverse_dynamics", ("q", "dq", "ddq"), (robot.n,), entries, about)


def _regressor_entries(graph: Graph, robot: Robot, regressor: Regressor) -> dict[int, Scalar]:
    """{flat index into (n, p): entry} of the base parameters' columns."""
    column = {standard: at for at, standard in enumerate(regressor.base.kept)}
    entries = torque_regressor(graph, robot, regressor.base.kept)
    return {i * regressor.p + column[c]: e for (i, c), e in entries.items()}


def _with_columns(graph: Graph, entries: dict[int, Scalar], regressor: Regressor, ddq: str) -> dict[int, Scalar]:
    """The entries, {flat index into (n, p): entry}, and those of friction and shared motors at accelerations `ddq`."""
    for at, column in enumerate(_columns(regressor), len(regressor.base.names)):
        signal = signal_symbol(column, regressor.robot.n)
        for i, effort in column_effort(graph, column, signal, "dq", ddq).items():
            entries[i * regressor.p + at] = effort
    return entries


def base_regressor(robot: Robot, regressor: Regressor) -> Function:
    """Y (n, p) with Γ = Y·θ at q, dq, ddq, in the order of `Regressor.names`; effort [N·m or N] per unit of each."""
    graph = Graph()
    entries = _with_columns(graph, _regressor_entries(graph, robot, regressor), regressor, "ddq")
    about = "Torque regressor: effort = regressor · parameters."
    shape = (robot.n, regressor.p)
    return Function("torque_regressor", ("q", "dq", "ddq"), shape, _made(graph, entries), about)


def slotine_li(robot: Robot, regressor: Regressor) -> Function:
    """Ys (n, p) of `Regressor.slotine_li` at q, dq, dq_ref, ddq_ref (Slotine & Li 1987); effort [N·m or N] per unit."""
    graph = Graph()
    entries = _regressor_entries(graph, robot, regressor)
    polar = bilinear_in_rates(lifted(graph, entries.values()), robot.n)
    both = _with_columns(graph, dict(zip(entries, polar, strict=True)), regressor, "ddqr")
    about = "Slotine-Li regressor: A·ddq_ref + C·dq_ref + Q and friction at dq = regressor · parameters, Christoffel C."
    inputs, shape = ("q", "dq", "dqr", "ddqr"), (robot.n, regressor.p)
    return Function("slotine_li_regressor", inputs, shape, _made(graph, both), about)


def energy_functions(robot: Robot, regressor: Regressor) -> Function:
    """h (p,) [2.93] with H = h·θ [J] at q, dq; zero for friction and offset."""
    graph = Graph()
    rows = energy_regressor(graph, robot)
    entries = {at: rows[c] for at, c in enumerate(regressor.base.kept)}
    for at, column in enumerate(_columns(regressor), len(entries)):
        if column.kind == "Iam":
            entries[at] = shared_energy(graph, column)
    about = "Energy regressor: kinetic plus potential energy [J] = regressor · parameters, up to a constant"
    about += f"{_held_offsets(regressor)}."
    return Function("energy_regressor", ("q", "dq"), (regressor.p,), _made(graph, entries), about)


def inertia_matrix(robot: Robot, regressor: Regressor) -> Function:
    """A(q) (n, n) [kg·m², kg·m or kg], actuator inertia included: column k is the effort of q̈_k = 1 alone."""
    graph, n = Graph(), robot.n
    zero = graph.constant(0)
    entries: dict[int, Scalar] = {}
    for k in range(n):
        unit: list[Scalar] = [graph.constant(float(i == k)) for i in range(n)]
        torque = _torque(graph, robot, Motion([zero] * n, unit, (zero, zero, zero)))
        for i in range(k + 1):
            entries[i * n + k] = entries[k * n + i] = torque[i]
    shared = shared_inertia(graph, n, _columns(regressor))
    entries = {at: e + shared[at // n][at % n] for at, e in entries.items()}
    return Function("inertia_matrix", ("q",), (n, n), _made(graph, entries), "Inertia matrix A(q).")


def coriolis(robot: Robot, regressor: Regressor) -> Function:
    """C(q, q̇)·q̇ (n,) [N·m or N]: the effort without acceleration, gravity and friction."""
    graph = Graph()
    torque = _torque(graph, robot, Motion.of(graph, robot, ddq=False, gravity=False))
    about = "Coriolis and centrifugal effort C(q, dq)·dq."
    return Function("coriolis", ("q", "dq"), (robot.n,), _made(graph, dict(enumerate(torque))), about)


def gravity(robot: Robot, regressor: Regressor) -> Function:
    """Q(q) (n,) [N·m or N]: the effort at rest, without friction."""
    graph = Graph()
    torque = _torque(graph, robot, Motion.of(graph, robot, dq=False, ddq=False))
    about = f"Gravity effort Q(q){_held_offsets(regressor)}."
    return Function("gravity", ("q",), (robot.n,), _made(graph, dict(enumerate(torque))), about)


def _held_offsets(regressor: Regressor) -> str:
    """Says which offsets the base parameters hold, because no motion tells them from a weight; empty where none."""
    base = set(regressor.base.names)
    names = [name for name, kept in regressor.dropped.items() if name.startswith("off") and base & kept.keys()]
    return f"; holds {', '.join(names)}, like a weight" if names else ""


def _frames(graph: Graph, robot: Robot) -> tuple[dict[int, tuple[Mat, Vec]], Mat, Vec]:
    """Frames (rotation, origin) in the world of the joints on the way to the last one, and of the tool."""
    base, tool = np.array(robot.base), np.array(robot.tool)
    way = [robot.n - 1]
    while robot.joints[way[-1]].parent >= 0:
        way.append(robot.joints[way[-1]].parent)

    def constants(m: np.ndarray) -> tuple[Mat, Vec]:
        rows = tuple(tuple(graph.constant(x) for x in row) for row in m[:3, :3])
        return rows, tuple(graph.constant(x) for x in m[:3, 3])  # type: ignore[return-value]

    rotation, position = constants(base)
    frames = {}
    for j in reversed(way):
        a, p = joint_transform(graph, robot.joints[j], j, letters=False)
        rotation, position = matmul(rotation, a), add(position, matvec(rotation, p))
        frames[j] = (rotation, position)
    a, p = constants(tool)
    return frames, matmul(rotation, a), add(position, matvec(rotation, p))


def direct_geometry(robot: Robot, regressor: Regressor) -> Function:
    """(4, 4) pose of the tool in the world [m, 1] at q, along the joints from the base to the last one."""
    graph = Graph()
    _, rotation, position = _frames(graph, robot)
    entries = {4 * i + k: rotation[i][k] for i in range(3) for k in range(3)}
    entries |= {4 * i + 3: position[i] for i in range(3)} | {15: graph.constant(1.0)}
    about = "Homogeneous transform of the tool in the world."
    return Function("direct_geometry", ("q",), (4, 4), _made(graph, entries), about)


def jacobian(robot: Robot, regressor: Regressor) -> Function:
    """(6, n) velocity of the tool's origin [m/rad or 1], then angular velocity [1 or rad/m], in the world's axes."""
    graph, n = Graph(), robot.n
    frames, _, tip = _frames(graph, robot)
    entries: dict[int, Scalar] = {}
    for j, (rotation, origin) in frames.items():
        axis: Vec = tuple(row[2] for row in rotation)  # type: ignore[assignment]
        lever: Vec = tuple(a - b for a, b in zip(tip, origin, strict=True))  # type: ignore[assignment]
        linear = cross(axis, lever) if robot.joints[j].revolute else axis
        for i in range(3):
            entries[i * n + j] = linear[i]
            entries[(3 + i) * n + j] = axis[i] if robot.joints[j].revolute else graph.constant(0)
    about = "Jacobian: velocity of the tool's origin, then angular velocity, in the world's axes."
    return Function("jacobian", ("q",), (6, n), _made(graph, entries), about)
