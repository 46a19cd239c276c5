"""The inverse geometric model as formulas and sentences: what Paul's method found, step by step."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic.equations import Step, Unknown
from identify.symbolic.geometry import POSE, Angle, letters, trigonometric
from identify.symbolic.inverse_geometry import reliable
from identify.symbolic.model import SymbolicModel
from identify.symbolic.paul import Plan, Stage, plan

if TYPE_CHECKING:
    import sympy

FORMS = {
    1: "X r = Y",
    2: "X S + Y C = Z",
    3: "X1 S + Y1 C = Z1, X2 S + Y2 C = Z2",
    4: "X1 r S = Y1, X2 r C = Y2",
    5: "X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r",
    6: "W Sj = X Ci + Y Si + Z1, W Cj = X Si - Y Ci + Z2",
    7: "W1 Cj + W2 Sj = X Ci + Y Si + Z1, W1 Sj - W2 Cj = X Si - Y Ci + Z2",
    8: "X Ci + Y Cij = Z1, X Si + Y Sij = Z2",
    9: "A C² + B C S + D C + E S + F = 0",
    10: "A r² + B r + C = 0",
}


QUARTIC = ("QCC", "QCS", "QC", "QS", "Q")
"""Names of the coefficients A, B, D, E and F of type 9, before the unknown's label."""


def symbolic_inverse_geometry(robot: Robot) -> SymbolicModel:
    """Inverse geometric model by Paul's method.

    Inputs: the entries of U0 (the pose of R_n in R_0 less the constant screws at both ends) and e1, e2 … = ±1, one
    for every choice between two solutions. Where a type-9 equation (of the fourth degree) comes up, its coefficients
    are given and not its four roots; q of that joint is then an input.
    """
    if robot.n > 6:
        raise InputError(
            f"{robot.name}: {robot.n} joints for six coordinates leave {_count(robot.n - 6, 'relation')} missing; "
            "Paul's method needs as many joints held still: --joints NAME=POSITION"
        )
    found = plan(robot)
    expressions: dict[str, sympy.Expr] = {}
    inputs, notes = list(POSE), [_frame_note(robot, found)]
    for stage in found.stages:
        notes.append(_sentence(found, stage))
        own, given = _formulas(found, stage)
        expressions |= own
        inputs += given
    coefficients = {f"{c}{label_of(s.step.unknown)}" for s in found.stages if s.step.type == 9 for c in QUARTIC}
    used = _used(expressions, coefficients | {f"q{j + 1}" for j in range(robot.n)})
    if not used:
        raise InputError(
            f"{robot.name}: no formula to print: no known type of equation gives {_joints(found)}; "
            "--pose, or inverse_geometry, searches solutions numerically"
        )
    if any(stage.step.type in (2, 10) for stage in found.stages):
        notes.append(
            "for regular poses within reach: undetermined angles come out as any value, and out of reach roots are not"
            " real; the function of codegen keeps the current value, and --pose lists the solutions of a pose"
        )
    notes += _limits_of_the_method(robot, found)
    return SymbolicModel(robot.name, "inverse-geometry", used, tuple(inputs), letters(robot), tuple(notes))


def name_of(unknown: Unknown) -> str:
    """q2 for a joint, q23 for the sum q2 + q3, q2m3 for a difference."""
    return f"q{unknown + 1}" if isinstance(unknown, int) else f"q{label_of(unknown)}"


def label_of(unknown: Unknown) -> str:
    """2 for a joint, 23 for the sum q2 + q3, 2m3 for a difference."""
    return str(unknown + 1) if isinstance(unknown, int) else trigonometric(unknown)[0].name[1:]


def _frame_note(robot: Robot, found: Plan) -> str:
    sides = [] if _identity(found.core.before) else ["base and screw to the first axis"]
    sides += [] if _identity(found.core.after) else [f"tool and r{robot.n}"]
    taken = f", with the constant {' and '.join(sides)} taken out" if sides else ""
    return f"U0 = [s n a P]: pose of R{robot.n} in R0{taken}; e1, e2 ... = +1 or -1 choose between solutions"


def _identity(matrix: object) -> bool:
    import numpy as np

    return bool(np.array_equal(np.asarray(matrix), np.eye(4)))


def _sentence(found: Plan, stage: Stage) -> str:
    step = stage.step
    text = f"{name_of(step.unknown)}: type {step.via or step.type}, {FORMS[step.via or step.type]}, from {step.origin}"
    if step.via is not None:
        assert step.eliminated is not None
        text += f"; {name_of(step.eliminated)} eliminated leaves type {step.type}, {FORMS[step.type]}"
    solutions = {2: 2, 9: 4, 10: 2}.get(step.type, 1)
    text += f"; {solutions} solution{'s' if solutions > 1 else ''}"
    if step.type == 2:
        x, y = (_shown(found, step, k) for k in (0, 1))
        return f"{text}; undetermined where {x} = {y} = 0" if x and y else text
    return text


def _shown(found: Plan, step: Step, k: int) -> str:
    import sympy

    polynomial = step.coefficients[k]
    if not polynomial:
        return ""
    # A common constant and a sign say nothing about where it vanishes.
    _, factors = sympy.factor_list(found.space.expression(polynomial))
    lengths = {sympy.Symbol(name) for name, _ in letters(found.core.robot)}
    return str(sympy.Mul(*(f for f, _ in factors if f.free_symbols - lengths)))


def compact(found: Plan, polynomial: Any) -> sympy.Expr:
    """The polynomial, factored where that is shorter."""
    import sympy

    expression = found.space.expression(polynomial)
    return min(expression, sympy.factor(expression), sympy.horner(expression), key=lambda e: e.count_ops())


def _formulas(found: Plan, stage: Stage) -> tuple[dict[str, sympy.Expr], list[str]]:
    """Named expressions of one stage, cosines and sines of what it settles included, and the inputs it adds."""
    import sympy

    step = stage.step
    label = label_of(step.unknown)
    named = {f"B{chr(97 + k) if k else ''}{label}": part for k, part in enumerate(step.parts)}
    own = {name: compact(found, part) for name, part in named.items()}
    parts = [by_parts(found, p, named) for p in step.coefficients]
    writers: dict[int, Callable] = {1: _type_1, 2: _type_2, 3: _type_3, 9: _type_9, 10: _type_10}
    formulas, inputs = writers[step.type](label, parts)
    own |= formulas
    for derived in stage.derived:
        if derived.angle != step.unknown:
            total = sympy.Add(*(factor * sympy.Symbol(name_of(angle)) for angle, factor in derived.terms))
            own[name_of(derived.angle)] = total
        own |= _cosine_sine(derived.angle, own)
    return own, inputs


def by_parts(found: Plan, polynomial: Any, named: Mapping[str, Any]) -> sympy.Expr:
    """The polynomial in powers of the named sums, if one of them makes it shorter."""
    import sympy

    best = compact(found, polynomial)
    for name, part in named.items():
        terms, left, power = [], polynomial, 0
        while left:
            left, rest = left.div(part)
            terms.append(compact(found, rest) * sympy.Symbol(name) ** power)
            power += 1
        best = min(best, sympy.factor_terms(sympy.Add(*terms)), key=lambda e: e.count_ops())
    return best


def _cosine_sine(angle: Angle, own: dict[str, sympy.Expr]) -> dict[str, sympy.Expr]:
    import sympy

    c, s = trigonometric(angle)
    q = sympy.Symbol(name_of(angle))
    return {name: f for name, f in ((c.name, sympy.cos(q)), (s.name, sympy.sin(q))) if name not in own}


Formulas = tuple[dict[str, "sympy.Expr"], list[str]]


def _named(label: str, letters_of: str, parts: list[sympy.Expr]) -> tuple[dict[str, sympy.Expr], list[sympy.Expr]]:
    """Long coefficients under a name of their own (X2, Y2 …), and all as they appear in the solution."""
    import sympy

    own, shown = {}, []
    for letter, part in zip(letters_of, parts, strict=True):
        if part.count_ops() > 1:
            own[f"{letter}{label}"] = part
            part = sympy.Symbol(f"{letter}{label}")
        shown.append(part)
    return own, shown


def _type_1(label: str, parts: list[sympy.Expr]) -> Formulas:
    import sympy

    pairs = list(zip(parts[::2], parts[1::2], strict=True))
    if len(pairs) == 1:
        return {f"q{label}": sympy.expand(pairs[0][1] / pairs[0][0])}, []
    return {f"q{label}": sum(x * y for x, y in pairs) / sum(x**2 for x, _ in pairs)}, []


def _type_2(label: str, parts: list[sympy.Expr]) -> Formulas:
    import sympy

    own, (x, y, z) = _named(label, "XYZ", parts)
    sign = sympy.Symbol(f"e{label}")
    if z == 0:
        own[f"q{label}"] = sympy.atan2(-y, x) + (1 - sign) * sympy.pi / 2
        return own, [sign.name]
    root = sympy.Symbol(f"W{label}")
    own[root.name] = sympy.sqrt(x**2 + y**2 - z**2)
    own[f"q{label}"] = sympy.atan2(x * z + sign * y * root, y * z - sign * x * root)
    return own, [sign.name]


def _type_3(label: str, parts: list[sympy.Expr]) -> Formulas:
    import sympy

    x1, y1, z1, x2, y2, z2 = parts
    det = sympy.expand(x1 * y2 - x2 * y1)
    sine, cosine = z1 * y2 - z2 * y1, x1 * z2 - x2 * z1
    if abs(det) != 1:
        det = sympy.factor_terms(det)
    s, c = sympy.Symbol(f"S{label}"), sympy.Symbol(f"C{label}")
    return {s.name: sine / det, c.name: cosine / det, f"q{label}": sympy.atan2(s, c)}, []


def _type_9(label: str, parts: list[sympy.Expr]) -> Formulas:
    names = [f"{letter}{label}" for letter in QUARTIC]
    return dict(zip(names, parts, strict=True)), [f"q{label}"]


def _type_10(label: str, parts: list[sympy.Expr]) -> Formulas:
    import sympy

    own, (x, y, z) = _named(label, "XYZ", parts)
    sign = sympy.Symbol(f"e{label}")
    own[f"q{label}"] = (-y + sign * sympy.sqrt(y**2 - 4 * x * z)) / (2 * x)
    return own, [sign.name]


def _used(expressions: dict[str, sympy.Expr], wanted: Collection[str]) -> dict[str, sympy.Expr]:
    """The expressions of these names and those that they read."""
    kept: dict[str, sympy.Expr] = {}
    read: set[str] = set()
    for name in reversed(list(expressions)):
        if name in read or name in wanted:
            kept[name] = expressions[name]
            read |= {symbol.name for symbol in expressions[name].free_symbols}
    return dict(reversed(kept.items()))


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _joints(found: Plan) -> str:
    """The joints that no step gives: q1, q2."""
    return ", ".join(f"q{j + 1}" for j in found.missing)


def _limits_of_the_method(robot: Robot, found: Plan) -> list[str]:
    notes = []
    if not reliable(robot):
        missing = f"no known type of equation gives {_joints(found)}"
        why = missing if found.missing else "these formulas do not hold on trial"
        notes.append(
            f"{why}: inverse_geometry searches numerically (damped Newton from many starts), and may miss solutions"
        )
    if robot.n < 6:
        listed = "; ".join(f"{compact(found, e.polynomial)} = 0" for e in found.conditions)
        notes.append(
            f"{_count(robot.n, 'joint')} for six coordinates: the pose must meet {_count(6 - robot.n, 'condition')}"
            + (f", among them {listed}" if listed else "")
            + "; where it does not there is no solution"
        )
    return notes


def conditions(robot: Robot) -> tuple[sympy.Expr, ...]:
    """What must vanish for a pose U0 of a robot of fewer than six joints, as far as it is free of joint variables."""
    found = plan(robot)
    return tuple(compact(found, equation.polynomial) for equation in found.conditions)
