"""The energy functions of the base parameters [2.93] as a model to print."""

from __future__ import annotations

from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.constants import base_values, gravity_values
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Expression, Graph
from identify.symbolic.geometry import letters
from identify.symbolic.joint_effort import joint_parameters
from identify.symbolic.link_motion import velocities
from identify.symbolic.model import Result, SymbolicModel
from identify.symbolic.naming import named, recognised
from identify.symbolic.operations import lifted


def energy_outputs(graph: Graph, robot: Robot) -> dict[str, Expression]:
    """{base parameter: its energy function}, shared motors' inertias included."""
    base, rows = base_parameters(robot), energy_regressor(graph, robot, letters=True)
    found = dict(zip(base.names, lifted(graph, (rows[k] for k in base.kept)), strict=True))
    for k, ratios in robot.couplings:
        total = graph.constant(0)
        for i in range(robot.n):
            for j in range(i):
                total = total + graph.symbol(f"dq{j + 1}") * graph.symbol(f"dq{i + 1}") * (ratios[i] * ratios[j])
        found[f"Iam{k + 1}"] = total
    return found


def symbolic_energy(robot: Robot) -> SymbolicModel:
    """h of every base parameter by the recurrence of velocities [2.59], [2.60], and the total energy H."""
    import sympy

    graph = Graph()
    outputs = {f"h_{name}": e for name, e in energy_outputs(graph, robot).items()}
    expressions = named(outputs, recognised(list(outputs.values()), velocities(robot)))
    terms = (sympy.Symbol(name) * sympy.Symbol(name[2:]) for name in outputs if expressions[name] != 0)
    expressions["H"] = sympy.Add(*terms)
    read = {s.name for e in expressions.values() for s in e.free_symbols}
    values = gravity_values(robot) | base_values(robot) | joint_parameters(robot)
    notes = (
        "H = kinetic plus potential energy, up to a constant: the sum of h_K times K over the base parameters K [2.90]",
        "over a motion, H(b) - H(a) is the work of the joints less that of friction",
        "in R_j: w angular velocity [2.59], V velocity of O_j [2.60]; gravity G1 G2 G3 in R0",
        "h_j = h_(j-1) lambda_j + dq_j eta_j [2.94]: what the grouping of the base parameters follows from",
    )
    inputs = tuple(f"{p}{j + 1}" for p in ("q", "dq") for j in range(robot.n))
    results = (Result("H", ("H",)), Result("h", tuple(outputs)))
    return SymbolicModel(
        robot.name, "energy", expressions, inputs, letters(robot), notes,
        tuple((k, v) for k, v in values.items() if k in read), results,
    )  # fmt: skip
