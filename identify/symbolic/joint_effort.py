"""What the joints add to the rigid bodies: friction [2.63], offset, and motors that several joints share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from identify.robot.robot import Robot
from identify.symbolic.expression import Expression, Graph, Scalar

if TYPE_CHECKING:
    import sympy

OWN = (("Fv", "viscous"), ("Fs", "coulomb"), ("off", "offset"))
"""Parameters of every joint and the fields of its drive that hold their values."""

COUPLED = (("Iam", "inertia"), ("Fvm", "viscous"), ("Fsm", "coulomb"))
"""The same of every motor that several joints share."""


def joint_parameters(robot: Robot) -> dict[str, float]:
    """Fv1 Fs1 off1 … with the values of the drives, then Iam, Fvm, Fsm of shared motors; 0 where nothing is known."""
    own = {f"{p}{j + 1}": getattr(joint.drive, field) for p, field in OWN for j, joint in enumerate(robot.joints)}
    motors = robot.transmission.motors if robot.transmission else ()
    for k, _ in robot.couplings:
        own |= {f"{p}{k + 1}": getattr(motors[k], field) if motors else 0.0 for p, field in COUPLED}
    return {name: float(value) for name, value in own.items()}


def friction(graph: Graph, robot: Robot) -> list[Scalar]:
    """(n,) Γf_j = Fv_j·q̇_j + Fs_j·sign(q̇_j) + offset [2.63], with shared motors' friction; signs are `signs`.

    Of a shared motor's viscous friction, what falls on a single joint is in that joint's Fv.
    """
    n = robot.n
    rates = [graph.symbol(f"dq{j + 1}") for j in range(n)]
    effort: list[Scalar] = []
    for j, rate in enumerate(rates, start=1):
        viscous, dry, offset, sign = (graph.symbol(f"{name}{j}") for name in ("Fv", "Fs", "off", "sign"))
        effort.append(viscous * rate + dry * sign + offset)
    cross = shared_inertia(graph, robot, "Fvm")
    for k, ratios in robot.couplings:
        dry = graph.symbol(f"Fsm{k + 1}") * graph.symbol(f"sign{n + k + 1}")
        effort = [e + dry * r for e, r in zip(effort, ratios, strict=True)]
    return [e + _row(row, rates) for e, row in zip(effort, cross, strict=True)]


def shared_inertia(graph: Graph, robot: Robot, parameter: str = "Iam") -> list[list[Scalar]]:
    """(n, n) what shared motors add to A(q) outside its diagonal: Iam·ratio_i·ratio_k; the diagonal has it in Ia."""
    n = robot.n
    added: list[list[Scalar]] = [[graph.constant(0)] * n for _ in range(n)]
    for k, ratios in robot.couplings:
        symbol = graph.symbol(f"{parameter}{k + 1}")
        for i in range(n):
            for j in range(n):
                if i != j:
                    added[i][j] = added[i][j] + symbol * (ratios[i] * ratios[j])
    return added


def shared_effort(graph: Graph, robot: Robot) -> list[Scalar]:
    """(n,) effort of shared motors' inertia at the accelerations ddq1 …"""
    accelerations = [graph.symbol(f"ddq{j + 1}") for j in range(robot.n)]
    return [_row(row, accelerations) for row in shared_inertia(graph, robot)]


def signs(robot: Robot) -> dict[str, sympy.Expr]:
    """{sign1: sign(dq1) …}, then those of the shared motors: the symbols that `friction` reads."""
    import sympy

    rates = sympy.symbols([f"dq{j + 1}" for j in range(robot.n)])
    own = {f"sign{j + 1}": sympy.sign(rate) for j, rate in enumerate(rates)}
    for k, ratios in robot.couplings:
        speed = sympy.Add(*(sympy.nsimplify(r) * rate for r, rate in zip(ratios, rates, strict=True)))
        own[f"sign{robot.n + k + 1}"] = sympy.sign(speed, evaluate=False)
    return own


def _row(row: Sequence[Scalar], signals: Sequence[Expression]) -> Scalar:
    total: Scalar = 0
    for entry, signal in zip(row, signals, strict=True):
        total = entry * signal + total
    return total
