"""What the joints add to the rigid bodies: friction [2.63], offset, and motors that several joints share."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from identify.robot.robot import Robot
from identify.symbolic.expression import Expression, Graph, Scalar

if TYPE_CHECKING:
    import sympy

DRIVE_FIELDS = {"Fv": "viscous", "Fs": "coulomb", "off": "offset"}
"""Parameters of every joint and the fields of its drive that hold their values."""

MOTOR_FIELDS = {"Iam": "inertia", "Fvm": "viscous", "Fsm": "coulomb"}
"""The same of every motor that several joints share."""


@dataclass(frozen=True)
class Column:
    """One parameter and what it multiplies: its kind, the index of its joint or motor, and for a motor k that several
    joints share its ratios (n,).

    The motor turns at ṁ = ratios·q̇ in units of joint k, so that ratios[k] = 1.
    """

    kind: str
    index: int
    ratios: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Of the parameter: Fv3 of joint 3."""
        return f"{self.kind}{self.index + 1}"


def joint_columns(robot: Robot) -> tuple[Column, ...]:
    """Fv, Fs and offset of each joint, then Iam, Fvm and Fsm of each shared motor."""
    own = (Column(kind, j) for j in range(robot.n) for kind in DRIVE_FIELDS)
    shared = (Column(kind, k, ratios) for k, ratios in robot.couplings for kind in MOTOR_FIELDS)
    return (*own, *shared)


def joint_parameters(robot: Robot) -> dict[str, float]:
    """Values [SI, joint side] of `joint_columns` by name, kind by kind, as the robot's description states them; 0 where
    it doesn't."""
    fields = DRIVE_FIELDS.items()
    found = {f"{kind}{j + 1}": getattr(joint.drive, x) for kind, x in fields for j, joint in enumerate(robot.joints)}
    motors = robot.transmission.motors if robot.transmission else ()
    for k, _ in robot.couplings:
        found |= {f"{kind}{k + 1}": getattr(motors[k], x) if motors else 0.0 for kind, x in MOTOR_FIELDS.items()}
    return {name: float(value) for name, value in found.items()}


def column_effort(
    graph: Graph, column: Column, signal: str, rates: str = "dq", accelerations: str = "ddq"
) -> dict[int, Expression]:
    """{joint: effort [N·m or N] per unit of the parameter}, of the symbols rates1 …, accelerations1 … and, for friction
    that is neither viscous nor an offset, the symbol `signal`.

    Of a shared motor's inertia and viscous friction, what falls on single joints is in their Ia and Fv: cross terms
    are left. Its other friction acts whole, by ratiosᵀ.
    """
    j = column.index
    ratios = {i: r for i, r in enumerate(column.ratios) if r}
    match column.kind:
        case "Fv":
            return {j: graph.symbol(f"{rates}{j + 1}")}
        case "off":
            return {j: graph.constant(1.0)}
        case "Iam" | "Fvm":
            x = accelerations if column.kind == "Iam" else rates
            return {
                i: sum((graph.symbol(f"{x}{k + 1}") * (r * s) for k, s in ratios.items() if k != i), graph.constant(0))
                for i, r in ratios.items()
            }
    read = graph.symbol(signal)
    return {i: read * r for i, r in ratios.items()} if ratios else {j: read}


def sign_symbol(column: Column, n: int) -> str:
    """Symbol of the sign of the speed that the column's friction opposes: sign1 … signn of the joints, then
    sign(n + k) of shared motor k."""
    return f"sign{column.index + 1 + (n if column.ratios else 0)}"


def with_effort(
    graph: Graph, effort: Sequence[Scalar], columns: Collection[Column], signal: Callable[[Column, int], str]
) -> list[Scalar]:
    """(n,) the effort [N·m or N] and what these columns add, with their parameters by name as symbols."""
    total = list(effort)
    for column in columns:
        parameter = graph.symbol(column.name)
        for i, own in column_effort(graph, column, signal(column, len(total))).items():
            total[i] = total[i] + parameter * own
    return total


def friction(graph: Graph, robot: Robot) -> list[Scalar]:
    """(n,) Γf_j = Fv_j·q̇_j + Fs_j·sign(q̇_j) + offset [2.63], with shared motors' friction; signs are `signs`."""
    columns = [column for column in joint_columns(robot) if column.kind != "Iam"]
    return with_effort(graph, [graph.constant(0)] * robot.n, columns, sign_symbol)


def shared_effort(graph: Graph, robot: Robot) -> list[Scalar]:
    """(n,) effort [N·m or N] of shared motors' inertia at the accelerations ddq1 …"""
    columns = [column for column in joint_columns(robot) if column.kind == "Iam"]
    return with_effort(graph, [graph.constant(0)] * robot.n, columns, sign_symbol)


def shared_inertia(graph: Graph, n: int, columns: Collection[Column]) -> list[list[Scalar]]:
    """(n, n) what shared motors add to A(q) outside its diagonal: Iam·ratio_i·ratio_k; the diagonal has it in Ia."""
    added: list[list[Scalar]] = [[graph.constant(0)] * n for _ in range(n)]
    for column in columns:
        if column.kind == "Iam":
            symbol = graph.symbol(column.name)
            for i, r in enumerate(column.ratios):
                for k, s in enumerate(column.ratios):
                    if i != k:
                        added[i][k] = added[i][k] + symbol * (r * s)
    return added


def shared_energy(graph: Graph, column: Column) -> Scalar:
    """Kinetic energy [J] per unit of the column Iam, its cross terms alone: half their power with q̇ for q̈."""
    works = (0.5 * graph.symbol(f"dq{i + 1}") * x for i, x in column_effort(graph, column, "", "dq", "dq").items())
    return sum(works, graph.constant(0))


def signs(robot: Robot) -> dict[str, sympy.Expr]:
    """{sign1: sign(dq1) …}, then those of the shared motors: the symbols that `friction` reads."""
    import sympy

    rates = sympy.symbols([f"dq{j + 1}" for j in range(robot.n)])
    own = {f"sign{j + 1}": sympy.sign(rate) for j, rate in enumerate(rates)}
    for k, ratios in robot.couplings:
        speed = sympy.Add(*(sympy.nsimplify(r) * rate for r, rate in zip(ratios, rates, strict=True)))
        own[f"sign{robot.n + k + 1}"] = sympy.sign(speed, evaluate=False)
    return own
