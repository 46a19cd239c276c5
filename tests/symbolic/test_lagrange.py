"""Lagrange's equations: the chapter's example 2.7, its properties a to e as laws, stored values, and Pinocchio."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import oracle
import pytest
import sympy
from arms import rx90
from beside import stored_values
from chains import random_chain
from printed_models import printed
from symbolic_models import tilted

from identify.errors import InputError
from identify.robot.robot import Joint, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.expression import Expression, Graph, reachable
from identify.symbolic.lagrange import lagrange, symbolic_lagrange
from identify.symbolic.model import CORIOLIS, SymbolicModel
from identify.symbolic.naming import named
from identify.symbolic.polarisation import directional
from identify.symbolic.written_out import written_out

ARMS = range(4)
"""Seeds of chains with prismatic joints, full inertias, general angles and lengths; every second one branches."""


@lru_cache(maxsize=8)
def chain(seed: int) -> Robot:
    rng = np.random.default_rng(seed)
    return tilted(random_chain(rng, 3 + seed % 3, special=seed % 4 == 3, tree=seed % 2 == 1))


@lru_cache(maxsize=8)
def model(seed: int) -> SymbolicModel:
    return symbolic_lagrange(chain(seed))


def motion(seed: int, robot: Robot) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(100 + seed)
    return dict(zip(("q", "dq", "ddq"), rng.uniform(-1.5, 1.5, (3, robot.n)), strict=True))


def carrier() -> Robot:
    """The first three axes of the RX-90: the arm of example 2.7."""
    robot = rx90()
    return replace(robot, joints=robot.joints[:3])


def chapters_carrier() -> dict[str, sympy.Expr]:
    """A, U and Q of example 2.7 as the chapter prints them."""
    k = {name: sympy.Symbol(name) for name in carrier().standard_names}
    q2, q3, d3, g3 = sympy.symbols("q2 q3 D3 G3")
    s2, c2, s3, c3, s23, c23 = (f(x) for x in (q2, q3, q2 + q3) for f in (sympy.sin, sympy.cos))
    return {
        "A11": k["Ia1"] + k["ZZ1"] + s2**2 * k["XX2"] + 2 * c2 * s2 * k["XY2"] + c2**2 * k["YY2"] + s23**2 * k["XX3"]
        + 2 * c23 * s23 * k["XY3"] + c23**2 * k["YY3"] + 2 * c2 * c23 * d3 * k["MX3"] - 2 * c2 * s23 * d3 * k["MY3"]
        + c2**2 * d3**2 * k["M3"],
        "A12": s2 * k["XZ2"] + c2 * k["YZ2"] + s23 * k["XZ3"] + c23 * k["YZ3"] - s2 * d3 * k["MZ3"],
        "A13": s23 * k["XZ3"] + c23 * k["YZ3"],
        "A22": k["Ia2"] + k["ZZ2"] + k["ZZ3"] + 2 * c3 * d3 * k["MX3"] - 2 * s3 * d3 * k["MY3"] + d3**2 * k["M3"],
        "A23": k["ZZ3"] + c3 * d3 * k["MX3"] - s3 * d3 * k["MY3"],
        "A33": k["Ia3"] + k["ZZ3"],
        "U": -g3 * (k["MZ1"] + s2 * k["MX2"] + c2 * k["MY2"] + s23 * k["MX3"] + c23 * k["MY3"] + d3 * s2 * k["M3"]),
        "Q1": sympy.Integer(0),
        "Q2": -g3 * (c2 * k["MX2"] - s2 * k["MY2"] + c23 * k["MX3"] - s23 * k["MY3"] + d3 * c2 * k["M3"]),
        "Q3": -g3 * (c23 * k["MX3"] - s23 * k["MY3"]),
    }  # fmt: skip


def without_names(found: SymbolicModel) -> dict[str, sympy.Expr]:
    """Every expression of the model with earlier ones put in for their names."""
    whole: dict[sympy.Symbol, sympy.Expr] = {}
    for name, expression in found.expressions.items():
        whole[sympy.Symbol(name)] = expression.xreplace(whole)
    return {symbol.name: expression for symbol, expression in whole.items()}


def christoffel(a: sympy.Matrix, i: int, k: int) -> sympy.Expr:
    """C_ik by [2.49] from A in q1 …"""
    q = sympy.symbols(f"q1:{a.rows + 1}")
    return sum(
        (sympy.diff(a[i, k], q[m]) + sympy.diff(a[i, m], q[k]) - sympy.diff(a[k, m], q[i]))
        * sympy.Symbol(f"dq{m + 1}") / 2
        for m in range(a.rows)
    )  # fmt: skip


def test_example_2_7() -> None:
    found = without_names(symbolic_lagrange(carrier()))
    chapter = chapters_carrier()
    for name, expression in chapter.items():
        assert sympy.expand(found[name] - expression) == 0, name
    a = sympy.Matrix(3, 3, lambda i, k: chapter[f"A{min(i, k) + 1}{max(i, k) + 1}"])
    for i in range(3):
        for k in range(3):
            assert sympy.expand(found[f"{CORIOLIS}{i + 1}{k + 1}"] - christoffel(a, i, k)) == 0, (i, k)


def test_example_2_7_is_printed_as_the_chapter_has_it() -> None:
    """Not only equal: cosines and sines of q2 + q3, no term that c² + s² = 1 would take away, no other variables."""
    model = symbolic_lagrange(carrier())
    chapter = chapters_carrier()
    for name, expression in chapter.items():
        assert len(sympy.Add.make_args(model.expressions[name])) == len(sympy.Add.make_args(sympy.expand(expression)))
    assert [name for name, e in model.expressions.items() if e.has(sympy.cos, sympy.sin)] == [
        "C2", "S2", "C23", "S23", "C3", "S3",
    ]  # fmt: skip


def test_example_2_7_in_base_parameters() -> None:
    """The grouped parameters put back give A of the chapter, and Q."""
    robot = carrier()
    found = without_names(symbolic_lagrange(robot, "base"))
    grouping = {sympy.Symbol(name): formula for name, formula in base_parameters(robot).grouping.items()}
    read = set().union(*(found[name].free_symbols for name in chapters_carrier()))
    assert {"ZZR1", "XXR2", "XZR2", "MXR2"} < {s.name for s in read} <= {s.name for s in grouping} | {
        "q1", "q2", "q3", "D3", "G3",
    }  # fmt: skip
    for name, expression in chapters_carrier().items():
        difference = found[name].xreplace(grouping) - expression
        if name == "U":
            # What is regrouped has potential energy that does not move: U is left a constant behind.
            assert sympy.expand(difference) == sympy.Symbol("G3") * sympy.Symbol("MZ1")
        else:
            assert sympy.simplify(sympy.expand_trig(difference)) == 0, name


def stored() -> tuple[dict, Robot, dict[str, float]]:
    known = stored_values("rx90-dynamics.json")
    names = {"IA": "Ia", "FS": "Fs", "FV": "Fv"}
    constants = {
        f"{names.get(name, name)}{j}": value
        for j, link in enumerate(known["std_params"], start=1)
        for name, value in link.items()
    }
    return known, rx90(known["RL4"]), constants


def test_stored_dynamics_of_the_rx90() -> None:
    known, robot, constants = stored()
    signals = {"q": known["q"], "dq": known["qd"], "ddq": known["qdd"], "F": known["fe6"][:3], "N": known["fe6"][3:]}
    found = printed(symbolic_lagrange(robot))(constants, **signals)
    expected = {
        "A": "A", "C": "C_christoffel", "Q": "Q", "tau_f": "tau_friction", "tau_e": "tau_external",
        "tau": "tau_total", "E": "kinetic_energy_with_IA", "U": "potential_energy",
    }  # fmt: skip
    for name, key in expected.items():
        scale = np.abs(known[key]).max()
        np.testing.assert_allclose(found[name], known[key], rtol=0, atol=1e-12 * scale, err_msg=name)
    np.testing.assert_allclose(found["C"] @ known["qd"], known["C_qd"], rtol=0, atol=1e-12)
    base = constants | {name.replace("IA", "Ia"): x for name, x in known["base_params"].items()}
    regrouped = printed(symbolic_lagrange(robot, "base"))(base, **signals)
    for name in ("A", "C", "Q", "tau", "E"):
        np.testing.assert_allclose(regrouped[name], found[name], rtol=0, atol=1e-12 * np.abs(found[name]).max())


@pytest.mark.parametrize("seed", ARMS)
def test_torque_and_inertia_against_pinocchio(seed: int) -> None:
    robot = chain(seed)
    signals = motion(seed, robot)
    found = printed(model(seed))(**signals)
    expected = oracle.inertia_matrix(robot, signals["q"])
    np.testing.assert_allclose(found["A"], expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    torque = oracle.inverse_dynamics(robot, *(signals[x][None] for x in ("q", "dq", "ddq")))[0]
    scale = np.abs(torque).max()
    np.testing.assert_allclose(found["tau"] - found["tau_f"], torque, rtol=0, atol=1e-12 * scale)
    drives = [joint.drive for joint in robot.joints]
    friction = [d.viscous * v + d.coulomb * np.sign(v) + d.offset for d, v in zip(drives, signals["dq"], strict=True)]
    np.testing.assert_allclose(found["tau_f"], friction, rtol=1e-14)


@pytest.mark.parametrize("seed", ARMS)
def test_property_a_inertia_is_symmetric_and_positive(seed: int) -> None:
    """Symmetric although each triangle comes from other efforts: A_ik is joint i's for an acceleration of joint k."""
    robot, run = chain(seed), printed(model(seed))
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.5, 1.5, robot.n)
    full = np.array([run(q=q, ddq=unit)["tau"] - run(q=q)["tau"] for unit in np.eye(robot.n)]).T
    found = run(q=q)["A"]
    scale = np.abs(found).max()
    np.testing.assert_allclose(full, found, rtol=0, atol=1e-12 * max(scale, np.abs(run(q=q)["Q"]).max()))
    assert np.linalg.eigvalsh(found).min() > 1e-6 * scale
    dq = rng.normal(size=robot.n)
    assert run(q=q, dq=dq)["E"] == pytest.approx(dq @ found @ dq / 2, rel=1e-13)


def read(graph: Graph, *outputs: Expression) -> set[str]:
    return {graph.nodes[i][1] for i in reachable(graph, outputs) if graph.nodes[i][0] == "symbol"}


@pytest.mark.parametrize("seed", ARMS)
def test_properties_b_and_c(seed: int) -> None:
    """b: energies of link j move with the joints that carry it alone. c: joint i feels the links that it carries."""
    robot, graph = chain(seed), Graph()
    terms = lagrange(graph, robot)
    way = [{j} for j in range(robot.n)]
    for j, joint in enumerate(robot.joints):
        way[j] |= way[joint.parent] if joint.parent >= 0 else set()
    run = printed(model(seed))
    for j in range(robot.n):
        own = {name for name in robot.standard_names if name.rstrip("0123456789") + str(j + 1) == name}
        others = {name: 0.0 for name in robot.standard_names if name not in own}
        rng = np.random.default_rng(seed)
        q, dq = rng.uniform(-1.5, 1.5, (2, robot.n))
        strangers = [i for i in range(robot.n) if i not in way[j]]
        moved, faster = q.copy(), dq.copy()
        moved[strangers] += 0.7
        faster[strangers] -= 1.1
        here, there = run(others, q=q, dq=dq), run(others, q=moved, dq=faster)
        for name in ("E", "U"):
            assert there[name] == pytest.approx(here[name], rel=1e-12, abs=1e-12), (name, j)
    for i in range(robot.n):
        carried = {j + 1 for j in range(robot.n) if i in way[j]}
        row = [terms.inertia[min(i, k), max(i, k)] for k in range(robot.n)]
        row += [terms.gravity[i], *(terms.coriolis[i, k] for k in range(robot.n))]
        names = read(graph, *row) & set(robot.standard_names)
        assert {int(name.lstrip("XYZMIa")) for name in names} <= carried


@pytest.mark.parametrize("seed", ARMS)
def test_property_d_the_derivative_of_a_less_twice_c_is_skew(seed: int) -> None:
    """With dA/dt exact, by the derivative of A's own expressions along dq."""
    robot, graph = chain(seed), Graph()
    terms = lagrange(graph, robot)
    along = {f"q{j + 1}": graph.symbol(f"dq{j + 1}") for j in range(robot.n)}
    slopes = directional(list(terms.inertia.values()), along)
    outputs = {f"slope{i}_{k}": e for (i, k), e in zip(terms.inertia, slopes, strict=True)}
    statements = SymbolicModel(
        robot.name, "slope", named(outputs), tuple(f"{p}{j + 1}" for p in ("q", "dq") for j in range(robot.n)), (), (),
        tuple(zip(robot.standard_names, robot.standard.tolist(), strict=True)),
    )  # fmt: skip
    signals = motion(seed, robot)
    values = printed(statements)(q=signals["q"], dq=signals["dq"])
    rate = np.array([[values[f"slope{min(i, k)}_{max(i, k)}"] for k in range(robot.n)] for i in range(robot.n)])
    difference = rate - 2 * printed(model(seed))(**signals)["C"]
    scale = np.abs(rate).max()
    assert scale > 0
    np.testing.assert_allclose(difference, -difference.T, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("seed", ARMS)
def test_property_e_linear_in_the_parameters(seed: int) -> None:
    """For any numbers, possible bodies or not; and no product of parameters."""
    robot, signals = chain(seed), motion(seed, chain(seed))
    names = robot.standard_names
    rng = np.random.default_rng(seed)
    one, two = rng.normal(size=(2, len(names)))
    run = printed(model(seed))
    results = [run(dict(zip(names, k, strict=True)), **signals) for k in (one, two, 0.3 * one - 1.7 * two)]
    for name in ("E", "U", "A", "C", "Q"):
        a, b, both = (x[name] for x in results)
        np.testing.assert_allclose(both, 0.3 * a - 1.7 * b, rtol=0, atol=1e-12 * max(1.0, np.abs(both).max()))


@pytest.mark.parametrize("robot", [carrier(), chain(3), chain(7)], ids=lambda r: r.name)
def test_written_out_is_what_the_statements_compute(robot: Robot) -> None:
    """The two ways to C and Q: derivatives of A and U by sympy, and the recurrence's own."""
    n, graph = robot.n, Graph()
    terms = lagrange(graph, robot)
    whole = written_out(n, terms.inertia, terms.potential, {})
    outputs = {f"{CORIOLIS}{i + 1}{k + 1}": e for (i, k), e in terms.coriolis.items()}
    outputs |= {f"A{i + 1}{k + 1}": e for (i, k), e in terms.inertia.items()}
    outputs |= {f"Q{j + 1}": e for j, e in enumerate(terms.gravity)} | {"U": terms.potential}
    steps = named(outputs)
    inputs = tuple(f"{p}{j + 1}" for p in ("q", "dq") for j in range(n))
    values = dict(zip(robot.standard_names, robot.standard.tolist(), strict=True)) | {"D3": 0.45}
    values |= {f"G{i + 1}": x for i, x in enumerate(robot.gravity)}
    signals = motion(1, robot)
    a, b = (
        printed(SymbolicModel(robot.name, "both", e, inputs, (), (), tuple(values.items())))(
            q=signals["q"], dq=signals["dq"]
        )
        for e in (whole, steps)
    )
    for name in outputs:
        assert a[name] == pytest.approx(b[name], rel=1e-11, abs=1e-11), name


def test_big_models_have_intermediate_variables_and_small_ones_none() -> None:
    assert "t1" in symbolic_lagrange(rx90()).expressions
    assert "t1" not in symbolic_lagrange(carrier()).expressions
    with pytest.raises(InputError, match="choose one of standard, base"):
        symbolic_lagrange(carrier(), "all")


def test_an_arm_without_revolute_joints_has_no_angles() -> None:
    """Three slides along x, y, z: A is the masses that each carries, Q the weight of all on the vertical one."""
    right = np.pi / 2
    rows = [(0.0, 0.0), (right, right), (right, right)]
    joints = tuple(Joint(f"joint_{j + 1}", "prismatic", j - 1, a, 0, theta) for j, (a, theta) in enumerate(rows))
    found = symbolic_lagrange(Robot("slides", joints)).expressions
    m = sympy.symbols("M1:4")
    ia = sympy.symbols("Ia1:4")
    for i in range(3):
        assert found[f"A{i + 1}{i + 1}"] == ia[i] + sum(m[i:])
    assert [found[x] for x in ("A12", "A13", "A23", "Q2", "Q3")] == [0] * 5
    assert found["Q1"] == sympy.expand(-sympy.Symbol("G3") * sum(m))


def test_sums_of_angles_across_a_slide_have_one_name() -> None:
    """C2 C4 - S2 S4 is C24 although the slide between them ends the run of parallel axes."""
    turn = carrier().joints[0]
    places: tuple[dict, ...] = ({}, {"d": 0.4}, {"d": 0.3, "type": "prismatic"}, {})
    joints = tuple(replace(turn, name=f"j{k}", parent=k - 1, **place) for k, place in enumerate(places))
    found = symbolic_lagrange(Robot("scara", joints, (0.0, 0.0, -9.81))).expressions
    assert "C24" in found
    for name in ("A11", "A14", "A44"):
        for term in sympy.expand(found[name]).as_ordered_terms():
            assert len(term.free_symbols & {sympy.Symbol(x) for x in ("C2", "S2", "C4", "S4")}) <= 1, term
