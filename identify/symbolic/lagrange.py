"""Lagrange's equations [2.45]–[2.50]: Γ = A(q)·q̈ + C(q,q̇)·q̇ + Q(q), with friction, actuator inertia and a wrench.

A and Q are the effort of unit accelerations and of gravity; C is the matrix of the Christoffel symbols. Arms whose A
takes few terms are written out as in example 2.7; others keep intermediate variables, as written out they would fill
volumes.
"""

from __future__ import annotations

from dataclasses import dataclass

from identify.robot.robot import Robot
from identify.symbolic.chain import (
    Vec,
    dot,
    exact_cos_sin,
    joint_transform,
    matmul,
    matvec,
    rotation_x,
    rotation_z,
    transpose,
)
from identify.symbolic.constants import gravity_symbols, gravity_values, inertial_parameters, standard_symbols
from identify.symbolic.customised import customised_torque
from identify.symbolic.expression import Expression, Graph, Scalar, arguments, cos, reachable, sin
from identify.symbolic.geometry import letters
from identify.symbolic.joint_effort import friction, joint_columns, joint_parameters, shared_inertia, signs
from identify.symbolic.link_motion import velocities
from identify.symbolic.model import CORIOLIS, Result, SymbolicModel, entry_name, matrix, vector
from identify.symbolic.motion import Motion
from identify.symbolic.naming import short_statements
from identify.symbolic.operations import lifted
from identify.symbolic.polarisation import directional
from identify.symbolic.second_moments import parameter_name, second_moments
from identify.symbolic.written_out import written_out

TERMS = 300
"""Terms that the entries of A may have together to be written out."""


@dataclass(frozen=True)
class Lagrange:
    """Expressions of one graph, in q, dq, gravity G1 G2 G3, lengths and inertial parameters.

    inertia: upper triangle of A(q) by (i, k); coriolis: C(q,q̇) by (i, k); gravity Q (n,); potential: U; wrench: Γe (n,)
    for F1 F2 F3, N1 N2 N3.
    """

    inertia: dict[tuple[int, int], Expression]
    coriolis: dict[tuple[int, int], Expression]
    gravity: list[Expression]
    potential: Expression
    wrench: list[Expression]


def second_moment_names(robot: Robot, which: str) -> dict[str, Scalar]:
    """{SXX1: ½(YY1 + ZZ1 − XX1) …}, of a graph of their own."""
    graph = Graph()
    return {parameter_name(k): x for k, x in enumerate(second_moments(standard_symbols(graph, robot, which)))}


def lagrange(graph: Graph, robot: Robot, which: str = "standard") -> Lagrange:
    """The terms of Lagrange's equations, as short as the arm's structure makes them."""
    n, zero = robot.n, graph.constant(0)
    still: list[Scalar] = [zero] * n
    null: Vec = (zero, zero, zero)
    standard = standard_symbols(graph, robot, which)
    moments = second_moments(standard)
    down = gravity_symbols(graph, robot)

    def effort(motion: Motion, parameters: list[Scalar] = moments) -> list[Expression]:
        return lifted(graph, customised_torque(graph, robot, parameters, motion, letters=True))

    inertia: dict[tuple[int, int], Expression] = {}
    shared = shared_inertia(graph, n, joint_columns(robot))
    for k in range(n):
        unit: list[Scalar] = [graph.constant(float(i == k)) for i in range(n)]
        column = effort(Motion(still, unit, null))
        inertia |= {(i, k): lifted(graph, [column[i] + shared[i][k]])[0] for i in range(k + 1)}
    # Coriolis effort is quadratic in q̇, and half its derivative along q̇_k is column k of the C of [2.49].
    quadratic = effort(Motion.of(graph, robot, ddq=False, gravity=False))
    coriolis: dict[tuple[int, int], Expression] = {}
    for k in range(n):
        column = directional(quadratic, {f"dq{k + 1}": graph.constant(1)})
        coriolis |= {(i, k): 0.5 * column[i] for i in range(n)}
    wrench = Motion(still, still, null, *(tuple(graph.symbol(f"{x}{i}") for i in (1, 2, 3)) for x in "FN"))  # type: ignore[arg-type]
    return Lagrange(
        inertia,
        coriolis,
        effort(Motion(still, still, down)),
        lifted(graph, [potential(graph, robot, standard, down)])[0],
        effort(wrench, [zero] * (11 * n)),
    )


def potential(graph: Graph, robot: Robot, standard: list[Scalar], gravity: Vec) -> Scalar:
    """U = Σ −0g·(M_j ⁰P_j + ⁰A_j MS_j) [2.62], 0g turned into R_j by the sum of angles of parallel axes."""
    energy: Scalar = graph.constant(0)
    heights: list[Scalar] = []
    down: list[Vec] = []
    # Of each joint: 0g where its run of parallel axes begins, the turn of the run that is constant, and its angle.
    runs: list[tuple[Vec, tuple, Scalar, float]] = []
    for j, joint in enumerate(robot.joints):
        p = joint.parent
        outer, height = (down[p], heights[p]) if p >= 0 else (gravity, graph.constant(0))
        across = rotation_x(*(graph.constant(x) for x in exact_cos_sin(joint.alpha)))
        aside = rotation_z(*(graph.constant(x) for x in exact_cos_sin(joint.gamma)))
        start, fixed, angle, offset = outer, matmul(aside, across), graph.symbol(f"q{j + 1}"), joint.theta
        sense, slant = exact_cos_sin(joint.alpha)
        along = p >= 0 and joint.revolute and robot.joints[p].revolute and slant == 0 and joint.gamma == 0
        if along:
            # Rot(z,a) Rot(x,α) Rot(z,b) = Rot(x,α) Rot(z, b ± a) for α = 0 or π.
            start, before, total, turned = runs[p]
            fixed, angle, offset = matmul(before, across), sense * total + angle, sense * turned + offset
        runs.append((start, fixed, angle, offset))
        c0, s0 = exact_cos_sin(offset)
        c, s = (cos(angle) * c0 - sin(angle) * s0, sin(angle) * c0 + cos(angle) * s0) if joint.revolute else (c0, s0)
        x, y, z = matvec(transpose(fixed), start)
        down.append((c * x + s * y, c * y - s * x, z))
        heights.append(height - dot(outer, joint_transform(graph, joint, j, letters=True)[1]))
        mx, my, mz, m = standard[11 * j + 6 : 11 * j + 10]
        energy = energy + heights[j] * m - dot(down[j], (mx, my, mz))
    return energy


def symbolic_lagrange(robot: Robot, which: str = "standard") -> SymbolicModel:
    """E, U, A, C, Q, friction Γf, wrench Γe and their sum, the joint effort tau; in standard or base parameters."""
    import sympy

    n, graph = robot.n, Graph()
    terms = lagrange(graph, robot, which)
    upper = {entry_name("A", n, i, k): e for (i, k), e in terms.inertia.items()}
    others = {f"tau_e{j + 1}": e for j, e in enumerate(terms.wrench)}
    others |= {f"tau_f{j + 1}": e for j, e in enumerate(lifted(graph, friction(graph, robot)))}
    if sum(_terms(graph, list(upper.values()))) <= TERMS:
        expressions = written_out(n, terms.inertia, terms.potential, others)
    else:
        outputs = upper | {entry_name(CORIOLIS, n, i, k): e for (i, k), e in terms.coriolis.items()}
        outputs |= {f"Q{j + 1}": e for j, e in enumerate(terms.gravity)} | {"U": terms.potential} | others
        expressions = short_statements(outputs, velocities(robot) | second_moment_names(robot, which))
    dq = sympy.symbols([f"dq{j + 1}" for j in range(n)])
    ddq = sympy.symbols([f"ddq{j + 1}" for j in range(n)])
    a = sympy.Matrix(n, n, [sympy.Symbol(name) for name in matrix("A", n, symmetric=True).entries])
    c = sympy.Matrix(n, n, [sympy.Symbol(name) for name in matrix("C", n, CORIOLIS).entries])
    zero = {sympy.Symbol(name): e for name, e in expressions.items() if e == 0}
    a, c = a.xreplace(zero), c.xreplace(zero)
    kinetic = sympy.Add(*(a[i, k] * dq[i] * dq[k] / (2 if i == k else 1) for k in range(n) for i in range(k + 1)))
    expressions = signs(robot) | expressions | {"E": kinetic}
    for i in range(n):
        own = sympy.Add(*(a[i, k] * ddq[k] + c[i, k] * dq[k] for k in range(n)))
        others = sympy.Add(*(sympy.Symbol(f"{x}{i + 1}") for x in ("Q", "tau_f", "tau_e")))
        expressions[f"tau{i + 1}"] = own + others.xreplace(zero)
    inertial = {name: value for name, (_, value) in inertial_parameters(robot, which).items()}
    values = gravity_values(robot) | inertial | joint_parameters(robot)
    read = {s.name for e in expressions.values() for s in e.free_symbols}
    notes = (
        "tau = A(q) ddq + C(q, dq) dq + Q(q) + tau_f + tau_e [2.47]; E = dq' A dq / 2; Q = dU/dq [2.50]",
        "C by Christoffel symbols [2.49]; actuator inertia Ia in the diagonal of A [2.65]",
        "tau_f: friction Fv dq + Fs sign(dq) + off [2.63]",
        f"tau_e = J' (F, N) [2.66]: force and moment that link {n} exerts on its surroundings, at O{n} in R{n}",
        f"{which} inertial parameters of the links; gravity (G1, G2, G3) in R0"
        + ("; U up to a constant" if which == "base" else ""),
    )
    inputs = tuple(f"{p}{j + 1}" for p in ("q", "dq", "ddq") for j in range(n))
    one = tuple(Result(name, (name,)) for name in ("E", "U"))
    matrices = (matrix("A", n, symmetric=True), matrix("C", n, CORIOLIS))
    vectors = (vector(name, n) for name in ("Q", "tau_f", "tau_e", "tau"))
    return SymbolicModel(
        robot.name, "lagrange", expressions,
        inputs + tuple(f"{p}{i}" for p in "FN" for i in (1, 2, 3)),
        letters(robot), notes, tuple((k, v) for k, v in values.items() if k in read), (*one, *matrices, *vectors),
    )  # fmt: skip


def _terms(graph: Graph, outputs: list[Expression]) -> list[int]:
    """How many terms each output has at most when products of sums are written out."""
    size: dict[int, int] = {}
    for i in reachable(graph, outputs):
        kind, x = graph.nodes[i][0], [size[k] for k in arguments(graph.nodes[i])]
        size[i] = sum(x) if kind in ("add", "sub") else x[0] * x[1] if kind == "mul" else x[0] if kind == "neg" else 1
    return [size[e.index] for e in outputs]
