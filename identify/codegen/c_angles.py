"""Cosines and sines in the generated C: all those of a function at once, by own series, without a call into libm."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from identify.symbolic.circular import QUARTER, QUARTERS_PER_RADIAN, taylor

CALL = re.compile(r"(cos|sin)\((.+)\)")
NAME = re.compile(r"\bt\d+\b")

BLOCK = 4
"""Angles are taken in blocks that fill a vector register."""

FARTHEST = 1e5
"""Angle [rad] up to which the turns can be taken off exactly; beyond it, libm is called."""


def _taylor(first: int, last: int) -> str:
    """Horner's form in z = r² of the Taylor series of sine (odd) or cosine (even) from the power `first` on."""
    coefficients = taylor(range(first, last + 1, 2))
    text = repr(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        text = f"{coefficient!r} + z * ({text})"
    return "\n                ".join(textwrap.wrap(text, 100, break_on_hyphens=False))


def cosines_sines() -> list[str]:
    """Lines of the helper."""
    a, b, c = QUARTER
    return f"""\
/* Cosines and sines of `count` angles, to the last bit or two: Taylor's series after taking off quarter turns. Own
   code, for the same bits whatever the library, and because compilers can work on several angles at once. */
static void cosines_sines(int count, const double angle[], double cosine[], double sine[])
{{
    int near = 1;
    for (int i = 0; i < count; ++i) near &= fabs(angle[i]) <= {FARTHEST!r};
    if (!near) {{
        for (int i = 0; i < count; ++i) {{
            cosine[i] = cos(angle[i]);
            sine[i] = sin(angle[i]);
        }}
        return;
    }}
    for (int i = 0; i < count; ++i) {{
        const double x = angle[i];
        const int quarters = (int)(x * {QUARTERS_PER_RADIAN!r} + (x < 0.0 ? -0.5 : 0.5));
        const double k = (double)quarters;
        const double r = ((x - k * {a!r}) - k * {b!r}) - k * {c!r};
        const double z = r * r;
        const double s = r + r * z * (
            {_taylor(3, 17)});
        const double c = 1.0 - 0.5 * z + z * z * (
            {_taylor(4, 18)});
        const double u = quarters & 1 ? s : c, v = quarters & 1 ? c : s;
        cosine[i] = (quarters + 1) & 2 ? -u : u;
        sine[i] = quarters & 2 ? -v : v;
    }}
}}
""".splitlines()


def gathered(work: Sequence[tuple[str, str]]) -> tuple[list[str], list[tuple[str, str]]]:
    """Lines that compute every cosine and sine of a function at once, and its temporaries without these calls.

    work: (temporary, value) in order. The angles' own temporaries, sums of joint positions, come first.
    """
    calls = [found for _, value in work if (found := CALL.fullmatch(value))]
    angles = list(dict.fromkeys(found[2] for found in calls))
    if not angles:
        return [], list(work)
    values = dict(work)
    needed: set[str] = set()
    todo = [name for angle in angles for name in NAME.findall(angle)]
    while todo:
        name = todo.pop()
        needed.add(name)
        todo += NAME.findall(values[name])
    before = [f"    const double {name} = {value};" for name, value in work if name in needed]
    size = -(-len(angles) // BLOCK) * BLOCK
    padded = [*angles, *["0.0"] * (size - len(angles))]
    lines = [
        *before,
        f"    const double angle[{size}] = {{{', '.join(padded)}}};",
        f"    double cosine[{size}], sine[{size}];",
        f"    cosines_sines({size}, angle, cosine, sine);",
    ]
    left = []
    for name, value in work:
        if found := CALL.fullmatch(value):
            left.append((name, f"{'cosine' if found[1] == 'cos' else 'sine'}[{angles.index(found[2])}]"))
        elif name not in needed:
            left.append((name, value))
    return lines, left
