"""Energy functions: their recurrence, how inertia moves between frames, and that they store the joints' work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracle
import pinocchio as pin
import pytest
import sympy
from chains import random_chain
from printed_models import printed
from symbolic_models import Motion, function_of, states, tilted

from identify.robot.library import load_robot
from identify.robot.robot import Joint, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.chain import dot, symbolic_links
from identify.symbolic.energy import energy_functions, energy_regressor, inertia_transform, velocity_term
from identify.symbolic.energy_model import symbolic_energy
from identify.symbolic.expression import Expression, Graph, Scalar, evaluate
from identify.symbolic.lagrange import symbolic_lagrange
from identify.symbolic.newton_euler import direct_torque


def parameters_of_points(points: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """(10,) XX XY XZ YY YZ ZZ MX MY MZ M of point masses, straight from the definitions."""
    x, y, z = points.T
    sums = (y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y, x, y, z, np.ones(len(x)))
    return np.array([masses @ s for s in sums])


def test_inertia_moves_with_its_points() -> None:
    """[2.95] against a cloud of point masses, moved by hand."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        points, masses = rng.normal(size=(9, 3)), rng.uniform(0.1, 2, 9)
        rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        rotation *= np.linalg.det(rotation)
        position = rng.normal(size=3)
        transform = np.array(inertia_transform(rotation.tolist(), position.tolist()), dtype=float)
        moved = parameters_of_points(points @ rotation.T + position, masses)
        np.testing.assert_allclose(transform @ parameters_of_points(points, masses), moved, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_energy_functions_follow_the_recurrence(seed: int) -> None:
    """h_j = h_p·λ_j + q̇_j·η_j [2.94]–[2.96], serial chains and trees, gravity in a general direction."""
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 4, special=seed % 3 == 2, tree=seed % 2 == 1))
    graph = Graph()
    links = symbolic_links(graph, robot)
    left: list[Scalar] = []
    right: list[Scalar] = []
    for j, (joint, link) in enumerate(zip(robot.joints, links, strict=True)):
        dq = graph.symbol(f"dq{j + 1}")
        base = [0.0] * 6 + [-x for x in robot.gravity] + [0.0]
        before = energy_functions(links[joint.parent]) if joint.parent >= 0 else base
        columns = zip(*inertia_transform(link.rotation, link.position), strict=True)
        eta = velocity_term(joint.revolute, link.omega, link.velocity, dq)
        left += energy_functions(link)
        right += [dot(before, column) + dq * term for column, term in zip(columns, eta, strict=True)]
    values = function_of(graph, robot.n, [*left, *right])(*states(rng, robot, 30)[:2])
    scale = np.abs(values).max()
    assert scale > 1
    np.testing.assert_allclose(values[:, : len(left)], values[:, len(left) :], rtol=0, atol=1e-12 * scale)


def to_sympy(expressions: list[Scalar]) -> list[sympy.Expr]:
    """The expressions over symbols c1, s1 … for cos q1, sin q1, with rational constants."""
    graph = next(e.graph for e in expressions if isinstance(e, Expression))
    done: list[sympy.Expr] = []
    for kind, *arguments in graph.nodes:
        match kind:
            case "constant":
                done.append(sympy.nsimplify(arguments[0], rational=True))
            case "symbol":
                done.append(sympy.Symbol(arguments[0]))
            case "cos" | "sin":
                done.append(sympy.Symbol(kind[0] + str(done[arguments[0]])[1:]))
            case _:
                combine = {"add": sympy.Add, "mul": sympy.Mul, "sub": lambda a, b: a - b, "neg": lambda a: -a}
                done.append(combine[kind](*(done[k] for k in arguments)))
    return [done[e.index] if isinstance(e, Expression) else sympy.nsimplify(e) for e in expressions]


def test_the_recurrence_holds_symbolically() -> None:
    """Exactly, with letters for the lengths: a revolute and a prismatic step of the RX-90's shoulder."""
    quarter = np.pi / 2
    robot = Robot(
        "shoulder and slide",
        (
            Joint("a"),
            Joint("b", "revolute", 0, alpha=quarter, d=0.2, r=0.3, symbols=(("d", "D2"), ("r", "R2"))),
            Joint("c", "prismatic", 1, alpha=-quarter, d=0.4, theta=quarter, symbols=(("d", "D3"),)),
        ),
        (0.0, 0.0, -9.81),
    )
    graph = Graph()
    links = symbolic_links(graph, robot, letters=True)
    circle = [sympy.Symbol(f"c{j}") ** 2 + sympy.Symbol(f"s{j}") ** 2 - 1 for j in (1, 2)]
    generators = sympy.symbols("c1 s1 c2 s2")
    for j in (1, 2):
        link, dq = links[j], graph.symbol(f"dq{j + 1}")
        before = energy_functions(links[j - 1])
        columns = zip(*inertia_transform(link.rotation, link.position), strict=True)
        eta = velocity_term(robot.joints[j].revolute, link.omega, link.velocity, dq)
        differences = [
            h - (dot(before, column) + dq * term)
            for h, column, term in zip(energy_functions(link), columns, eta, strict=True)
        ]
        for difference in to_sympy(differences):
            remainder = sympy.reduced(sympy.expand(difference), circle, *generators)[1]
            assert sympy.expand(remainder) == 0
    assert {"D2", "R2", "D3"} <= {node[1] for node in graph.nodes if node[0] == "symbol"}


def stored_and_done(robot: Robot, motion: Motion) -> tuple[float, float, float]:
    """Change of energy, work ∫q̇ᵀΓ dt of the joints, and the largest power, over one second of the motion."""
    graph = Graph()
    torque = direct_torque(graph, robot, list(robot.standard))
    work_of = function_of(graph, robot.n, torque)
    q, dq, ddq = motion.at(motion.nodes)
    power = (work_of(q, dq, ddq) * dq).sum(axis=1)
    graph = Graph()
    energy_of = function_of(graph, robot.n, energy_regressor(graph, robot))
    start, end = energy_of(*motion.at(np.array([0.0, 1.0]))[:2]) @ robot.standard
    return end - start, float(motion.weights @ power), float(np.abs(power).max())


@pytest.mark.parametrize("seed", range(12))
def test_stored_energy_is_the_work_of_the_joints(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 5, tree=seed % 2 == 1))
    stored, done, scale = stored_and_done(robot, Motion(rng, robot.n))
    assert abs(stored) > 1e-3 * scale
    assert stored == pytest.approx(done, rel=0, abs=1e-11 * scale)


@pytest.mark.parametrize("seed", range(8))
def test_energy_against_pinocchio(seed: int) -> None:
    """Differences between random states of kinetic plus potential energy; energy is defined up to a constant."""
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 6, tree=seed % 2 == 1)) if seed else load_robot("rx90")
    q, dq, _ = states(rng, robot, 15)
    graph = Graph()
    ours = function_of(graph, robot.n, energy_regressor(graph, robot))(q, dq) @ robot.standard
    model, order = oracle.pinocchio_model(robot), oracle.branch_order(robot)
    data = model.createData()
    theirs = np.array(
        [
            pin.computeKineticEnergy(model, data, a[order], b[order])
            + pin.computePotentialEnergy(model, data, a[order])
            for a, b in zip(q, dq, strict=True)
        ]
    )
    scale = np.abs(theirs).max()
    np.testing.assert_allclose(np.diff(ours), np.diff(theirs), rtol=0, atol=1e-12 * scale)


def test_energy_functions_of_a_link_at_rest_are_its_weight() -> None:
    """[2.93] with velocities zero: −0g·(axes) for first moments and −0g·P for the mass, read off a drawing."""
    robot = replace(load_robot("rx90"), gravity=(0.0, 0.0, -9.81))
    graph = Graph()
    link = symbolic_links(graph, robot)[2]
    zero = {f"{prefix}{j + 1}": 0.0 for prefix in ("q", "dq") for j in range(6)}
    h = evaluate([graph.constant(0) + x for x in energy_functions(link)], zero | {"q2": np.pi / 2})
    # Joint 2 a quarter turn up: x3 points straight up, y3 level; O_3 stands 0.45 m above O_2.
    np.testing.assert_allclose(h, [0, 0, 0, 0, 0, 0, 9.81, 0, 0, 9.81 * 0.45], atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_printed_energy_is_lagranges(seed: int) -> None:
    """H of the energy functions of the base parameters against E + U of all standard ones, up to a constant."""
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 3, special=seed % 2 == 0, tree=seed == 3)) if seed else load_robot("rx90")
    model = symbolic_energy(robot)
    energy, both = printed(model), printed(symbolic_lagrange(robot))
    changes = []
    for _ in range(2):
        q, dq = rng.uniform(-1.5, 1.5, (2, robot.n))
        here, there = energy(q=q, dq=dq), both(q=q, dq=dq)
        values = dict(model.parameters)
        names = base_parameters(robot).names
        own = sum(h * values[name] for h, name in zip(here["h"], names, strict=True) if name in values)
        assert here["H"] == pytest.approx(own, rel=1e-12)
        changes.append((here["H"], there["E"] + there["U"]))
    (a, b), (c, d) = changes
    assert a - c == pytest.approx(b - d, rel=0, abs=1e-12 * max(abs(b), abs(d)))
    assert abs(b - d) > 1e-3


def test_energy_functions_of_the_rx90_as_printed() -> None:
    """[2.93] of table 2.2's first and last columns by hand: half a square, and what Ia_j stores."""
    model = symbolic_energy(load_robot("rx90"))
    names = base_parameters(load_robot("rx90")).names
    assert [f"h_{name}" for name in names] == [entry for r in model.results if r.name == "h" for entry in r.entries]
    dq1, dq2, dq6, w, g3 = sympy.symbols("dq1 dq2 dq6 w2_1 G3")
    assert model.expressions["h_ZZR1"] == dq1**2 / 2
    assert model.expressions["h_ZZR2"] == dq2**2 / 2
    assert model.expressions["h_Ia6"] == dq6**2 / 2
    assert model.expressions["h_XXR2"] == w**2 / 2
    assert model.expressions["h_MXR2"] == -g3 * sympy.Symbol("S2")
    assert model.expressions["w2_1"] == sympy.Symbol("S2") * dq1
