"""Direct dynamics [2.43]: q̈ from A(q)·q̈ = Γ − H(q,q̇), A factored once a call and nothing inverted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from identify.robot.robot import Robot
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.geometry import letters
from identify.symbolic.inverse_dynamics import about_parameters, assembled, customised_effort, customised_motion
from identify.symbolic.joint_effort import friction, joint_columns, shared_inertia
from identify.symbolic.link_motion import velocities
from identify.symbolic.model import SymbolicModel, entry_name, vector
from identify.symbolic.motion import Motion
from identify.symbolic.naming import short_statements
from identify.symbolic.operations import lifted

if TYPE_CHECKING:
    import sympy


def equations(graph: Graph, robot: Robot) -> dict[str, Expression]:
    """A11 … of the upper triangle of A(q), and H1 … the effort without acceleration, friction included."""
    n, zero = robot.n, graph.constant(0)
    shared = shared_inertia(graph, n, joint_columns(robot))
    outputs: dict[str, Expression] = {}
    for k in range(n):
        unit: list[Scalar] = [graph.constant(float(i == k)) for i in range(n)]
        column = customised_effort(graph, robot, Motion([zero] * n, unit, (zero, zero, zero)))
        outputs |= {entry_name("A", n, i, k): column[i] + shared[i][k] for i in range(k + 1)}
    rest = customised_effort(graph, robot, customised_motion(graph, robot, ddq=False))
    effort = lifted(graph, (a + b for a, b in zip(rest, friction(graph, robot), strict=True)))
    return outputs | {f"H{j + 1}": e for j, e in enumerate(effort)}


def solution(a: Sequence[Sequence[sympy.Expr]], effort: Sequence[sympy.Expr]) -> dict[str, sympy.Expr]:
    """Statements that solve A·ddq = effort for ddq1 …, from the upper triangle of A (n, n) by A = Lᵀ·D·L.

    Factored from the last joint to the first, so that what is zero in A between branches is zero in L (Featherstone
    2005). d is the diagonal of D, W = D·L off the diagonal.
    """
    import sympy

    n = len(effort)
    found: dict[str, sympy.Expr] = {}
    lower: dict[tuple[int, int], sympy.Symbol] = {}
    scaled: dict[tuple[int, int], sympy.Symbol] = {}

    def state(name: str, expression: sympy.Expr) -> sympy.Expr:
        if expression == 0 or expression.is_Symbol:
            return expression
        found[name] = expression
        return sympy.Symbol(name)

    pivots: list[sympy.Expr] = [sympy.Integer(0)] * n
    for k in reversed(range(n)):
        after = range(k + 1, n)
        taken = sympy.Add(*(lower.get((i, k), 0) * scaled.get((i, k), 0) for i in after))
        pivots[k] = state(f"d{k + 1}", a[k][k] - taken)
        for j in range(k):
            taken = sympy.Add(*(lower.get((i, k), 0) * scaled.get((i, j), 0) for i in after))
            w = state(entry_name("W", n, k, j), a[j][k] - taken)
            if w != 0:
                scaled[k, j], lower[k, j] = w, state(entry_name("L", n, k, j), w / pivots[k])
    free: list[sympy.Expr] = [sympy.Integer(0)] * n
    for k in reversed(range(n)):
        taken = sympy.Add(*(lower.get((i, k), 0) * free[i] for i in range(k + 1, n)))
        free[k] = state(f"b{k + 1}", effort[k] - taken)
    for k in range(n):
        before = sympy.Add(*(lower.get((k, j), 0) * sympy.Symbol(f"ddq{j + 1}") for j in range(k)))
        found[f"ddq{k + 1}"] = free[k] / pivots[k] - before
    return found


def symbolic_direct_dynamics(robot: Robot) -> SymbolicModel:
    """ddq for q, dq, tau, with the base parameters, friction and actuator inertia."""
    import sympy

    n = robot.n
    lengths = {name for name, _ in letters(robot)}
    system = equations(Graph(), robot)
    own = {name: f"{name}_" if name in lengths else name for name in system}
    statements = short_statements({own[name]: e for name, e in system.items()}, velocities(robot))
    symbols = {name: statements[new] if statements[new] == 0 else sympy.Symbol(new) for name, new in own.items()}
    a = [[symbols[entry_name("A", n, min(i, k), max(i, k))] for k in range(n)] for i in range(n)]
    effort = [sympy.Symbol(f"tau{j + 1}") - symbols[f"H{j + 1}"] for j in range(n)]
    statements, parameters = assembled(robot, {name: e for name, e in statements.items() if e != 0})
    solved = _renamed(solution(a, effort), {*statements, *(name for name, _ in parameters), *lengths})
    notes = (
        "ddq from A(q) ddq = tau - H(q, dq) [2.43]; H = C dq + Q + friction Fv dq + Fs sign(dq) + off",
        "A = L' D L, D with diagonal d, L with a diagonal of ones, W = D L: factored from the last joint to the first",
        "with base parameters and actuator inertia Ia; gravity G1 G2 G3 in R0",
        "with a wrench on the last link, give tau less its effort tau_e of the model lagrange",
        *about_parameters(robot),
    )
    inputs = tuple(f"{p}{j + 1}" for p in ("q", "dq", "tau") for j in range(n))
    return SymbolicModel(
        robot.name, "direct-dynamics", statements | solved, inputs, letters(robot), notes, parameters,
        (vector("ddq", n),),
    )  # fmt: skip


def _renamed(statements: dict[str, sympy.Expr], taken: set[str]) -> dict[str, sympy.Expr]:
    """The statements with an underscore after names that lengths, parameters or earlier statements have."""
    import sympy

    new: dict[sympy.Symbol, sympy.Symbol] = {}
    for name in statements:
        other = name
        while other in taken:
            other += "_"
        new[sympy.Symbol(name)] = sympy.Symbol(other)
    return {new[sympy.Symbol(name)].name: e.xreplace(new) for name, e in statements.items()}
