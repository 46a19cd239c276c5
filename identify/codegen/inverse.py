"""Inverse geometry for a controller: the stages of Paul's method as text that C and Python share.

Every formula is a sum of products of names and numbers, so that both languages read it alike; the solvers of the
equations' types and the last refinement are written once in each language.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.equations import Unknown
from identify.symbolic.geometry import POSE, exact_number, letters, trigonometric
from identify.symbolic.inverse_geometry import reliable
from identify.symbolic.inverse_model import FORMS, by_parts, compact, label_of, name_of
from identify.symbolic.paul import Plan, Stage, plan

if TYPE_CHECKING:
    import sympy

ROOTS = {1: 1, 2: 2, 3: 1, 10: 2}
"""Solutions that an equation of each type has at most. The quartic of type 9 has no formula worth generating."""

ENTRIES = tuple(f"pose[{4 * (k % 3) + k // 3}]" for k in range(12))
"""Where the entries of POSE stand in a pose stored row by row."""


@dataclass(frozen=True)
class Level:
    """One unknown: what is computed before, the equation's type and its coefficients, and what follows from it.

    before, after: (name, value) pairs in order; sizes: usual magnitudes of the coefficients; now: the unknown's
    current value; label: 2 for q2, 23 for q2 + q3.
    """

    about: str
    label: str
    before: tuple[tuple[str, str], ...]
    type: int
    coefficients: tuple[str, ...]
    sizes: tuple[float, ...]
    unknown: str
    now: str
    after: tuple[tuple[str, str], ...]

    @property
    def roots(self) -> int:
        return ROOTS[self.type]

    @property
    def scale(self) -> float:
        """Usual magnitude of type 2's coefficients, and of type 3's determinant."""
        s = self.sizes
        return float(f"{s[0] * s[4] + s[3] * s[1]:.3g}") if self.type == 3 else max(s)


@dataclass(frozen=True)
class Inverse:
    """The whole model: entries of U0 by the pose's, the levels in order, names of the joint variables (n,)."""

    pose: tuple[tuple[str, str], ...]
    levels: tuple[Level, ...]
    joints: tuple[str, ...]

    @property
    def most(self) -> int:
        """Largest number of solutions."""
        return int(np.prod([level.roots for level in self.levels]))


def left_out(robot: Robot) -> str | None:
    """Why the generated code of this robot has no inverse geometry, in a few words; None where it has."""
    if any(joint.parent != j - 1 for j, joint in enumerate(robot.joints)):
        return "the robot's joints branch, so that it has no one end frame"
    if robot.n > 6:
        return f"{robot.n} joints reach a pose of six coordinates in infinitely many ways; fix {robot.n - 6} of them"
    found = plan(robot)
    if found.missing:
        joints = ", ".join(f"q{j + 1}" for j in found.missing)
        return f"Paul's method finds no equation of a known type for {joints}"
    if not reliable(robot):
        return "the equations that Paul's method finds do not hold on trial"
    hard = [name_of(stage.step.unknown) for stage in found.stages if stage.step.type not in ROOTS]
    if hard:
        return f"Paul's method leaves an equation of the fourth degree (type 9) for {', '.join(hard)}"
    return None


def inverse(robot: Robot) -> Inverse | None:
    """The model, None where `left_out` says why there is none."""
    if left_out(robot) is not None:
        return None
    found = plan(robot)
    levels = _read([_level(found, stage) for stage in found.stages], found)
    read = _names([text for level in levels for text in (*level.coefficients, *(v for _, v in level.before))])
    pose = tuple((name, text) for name, text in _inner_pose(found) if name in read)
    joints = tuple(name_of(((j, 1),) if joint.revolute else j) for j, joint in enumerate(robot.joints))
    return Inverse(pose, tuple(levels), joints)


def _inner_pose(found: Plan) -> list[tuple[str, str]]:
    """Entries of U0 = before · pose · after [2.10] in those of the pose."""
    import sympy

    pose = sympy.eye(4)
    names = sympy.symbols(" ".join(f"_p{k:02d}" for k in range(12)))
    for k, name in enumerate(names):
        pose[k % 3, k // 3] = name
    before, after = (
        sympy.Matrix(4, 4, lambda i, j, m=m: exact_number(_rounded(m[i, j])))
        for m in (found.core.before, found.core.after)
    )
    moved = before * pose * after
    places = {name.name: place for name, place in zip(names, ENTRIES, strict=True)}
    return [(entry, written(sympy.expand(moved[k % 3, k // 3]), places)) for k, entry in enumerate(POSE)]


def _rounded(value: float) -> float:
    """The number, without the rounding error of a zero or a one."""
    nearest = round(float(value))
    return float(nearest) if abs(value - nearest) < 1e-15 else float(value)


def _level(found: Plan, stage: Stage) -> Level:
    step = stage.step
    label = label_of(step.unknown)
    parts = {f"B{chr(97 + k) if k else ''}{label}": part for k, part in enumerate(step.parts)}
    values = {name: exact_number(value) for name, value in letters(found.core.robot)}
    names = {f"q{j + 1}": name_of(j) for j in found.space.prismatic}

    def text(expression: sympy.Expr) -> str:
        return written(_with_lengths(expression, values), names)

    before = [(name, text(compact(found, part))) for name, part in parts.items()]
    coefficients = tuple(text(by_parts(found, polynomial, parts)) for polynomial in step.coefficients)
    after: list[tuple[str, str]] = []
    for derived in stage.derived:
        if derived.angle != step.unknown:
            after.append((name_of(derived.angle), _sum(derived.terms)))
        own = name_of(derived.angle)
        cosine, sine = trigonometric(derived.angle)
        after += [(cosine.name, f"cos({own})"), (sine.name, f"sin({own})")]
    sizes = tuple(float(f"{size:.3g}") for size in stage.sizes)
    return Level(
        _about(stage), label, tuple(before), step.type, coefficients, sizes, name_of(step.unknown),
        _now(step.unknown), tuple(after),
    )  # fmt: skip


def _about(stage: Stage) -> str:
    step = stage.step
    text = f"{name_of(step.unknown)}: type {step.via or step.type}, {FORMS[step.via or step.type]}"
    if step.via is not None and step.eliminated is not None:
        text += f"; {name_of(step.eliminated)} eliminated leaves type {step.type}, {FORMS[step.type]}"
    return text.replace("²", "^2")


def _now(unknown: Unknown) -> str:
    return f"current[{unknown}]" if isinstance(unknown, int) else _sum([(f"current[{j}]", s) for j, s in unknown])


def _sum(terms: Sequence[tuple[Any, int]]) -> str:
    """An integer combination of angles, or of names, as text."""
    text = ""
    for term, factor in terms:
        name = term if isinstance(term, str) else name_of(term)
        size = name if abs(factor) == 1 else f"{float(abs(factor))!r} * {name}"
        text += (" - " if factor < 0 else " + ") + size
    return text[3:] if text.startswith(" + ") else "-" + text[3:]


def _read(levels: list[Level], found: Plan) -> list[Level]:
    """The levels without cosines, sines and sums that nothing later reads."""
    from dataclasses import replace

    needed = {name_of(((j, 1),) if joint.revolute else j) for j, joint in enumerate(found.core.robot.joints)}
    kept = []
    for level in reversed(levels):
        after = []
        for name, value in reversed(level.after):
            if name in needed:
                after.append((name, value))
                needed |= _names([value])
        before = []
        wanted = _names(level.coefficients)
        for name, value in reversed(level.before):
            if name in wanted:
                before.append((name, value))
        needed |= wanted | _names([value for _, value in before])
        kept.append(replace(level, before=tuple(before[::-1]), after=tuple(after[::-1])))
    return kept[::-1]


def _names(texts: Sequence[str]) -> set[str]:
    import re

    return {name for text in texts for name in re.findall(r"[A-Za-z_]\w*", text)}


def _with_lengths(expression: sympy.Expr, values: Mapping[str, Any]) -> sympy.Expr:
    return expression.xreplace({s: values[s.name] for s in expression.free_symbols if s.name in values})  # type: ignore[attr-defined]


def written(expression: sympy.Expr, names: Mapping[str, str]) -> str:
    """A polynomial as text that C and Python read alike; `names` {symbol: text}, other symbols by their own name."""
    import sympy

    if expression.is_number:
        return repr(float(expression))
    if isinstance(expression, sympy.Symbol):
        return names.get(expression.name, expression.name)
    if isinstance(expression, sympy.Add):
        numbers = [term for term in expression.args if term.is_number]
        text = ""
        for term in expression.as_ordered_terms():
            if not term.is_number:
                size = written(term, names)
                text += f" - {size[1:]}" if size.startswith("-") else f" + {size}"
        constant = float(sympy.Add(*numbers))
        if constant:
            text += f" - {-constant!r}" if constant < 0 else f" + {constant!r}"
        return text[3:] if text.startswith(" + ") else "-" + text[3:]
    if isinstance(expression, sympy.Pow):
        return " * ".join([_factor(expression.base, names)] * int(expression.exp))
    number = float(sympy.Mul(*(factor for factor in expression.args if factor.is_number)))
    factors = [_factor(factor, names) for factor in expression.as_ordered_factors() if not factor.is_number]
    if abs(number) != 1.0:
        factors.insert(0, repr(abs(number)))
    return ("-" if number < 0 else "") + " * ".join(factors)


def _factor(expression: sympy.Expr, names: Mapping[str, str]) -> str:
    text = written(expression, names)
    return f"({text})" if expression.is_Add else text
