"""Direct geometry with the orientation as Euler angles, roll-pitch-yaw or a quaternion, as formulas.

The conventions are those of `orientation`; the formulas hold in the singular case too, where only the sum of two angles
is determined: they then give one of the pairs.
"""

from __future__ import annotations

from dataclasses import replace

import sympy

from identify.symbolic.model import Result, SymbolicModel

ORIENTATIONS = ("cosines", "euler", "roll-pitch-yaw", "quaternion")

NOTES = {
    "euler": "P and Euler angles phi, theta, psi [rad]: rotation Rot(z, phi) Rot(x, theta) Rot(z, psi)",
    "roll-pitch-yaw": "P, roll, pitch, yaw [rad]: rotation Rot(z, roll) Rot(y, pitch) Rot(x, yaw)",
    "quaternion": "P and quaternion Q1 = cos(angle/2), (Q2, Q3, Q4) = sin(angle/2) axis; -Q is the same orientation",
}


def with_orientation(model: SymbolicModel, orientation: str) -> SymbolicModel:
    """The direct geometric model, its entries of s, n, a turned into one of ORIENTATIONS."""
    if orientation == "cosines":
        return model

    def entry(name: str) -> sympy.Expr:
        value = model.expressions[name]
        return value if value.is_number else sympy.Symbol(name)

    sx, sy, sz, nx, ny, _, ax, ay, az = (entry(f"{column}{row}") for column in "sna" for row in "xyz")
    own: dict[str, sympy.Expr] = {}

    def state(name: str, value: sympy.Expr) -> sympy.Expr:
        own[name] = value
        return value if value.is_number else sympy.Symbol(name)

    if orientation == "euler":
        phi = state("phi", _angle(ax, -ay))
        state("theta", _angle(sympy.sqrt(ax**2 + ay**2), az))
        c, s = sympy.cos(phi), sympy.sin(phi)
        state("psi", _angle(-c * nx - s * ny, c * sx + s * sy))
        wanted: tuple[str, ...] = ("phi", "theta", "psi")
    else:
        roll = state("roll", _angle(sy, sx))
        pitch = state("pitch", _angle(-sz, sympy.sqrt(sx**2 + sy**2)))
        c, s = sympy.cos(roll), sympy.sin(roll)
        yaw = state("yaw", _angle(s * ax - c * ay, c * ny - s * nx))
        wanted = ("roll", "pitch", "yaw")
    if orientation == "quaternion":
        # From half the angles: no root that rounding makes imaginary, no sign that is lost at half a turn.
        (cr, sr), (cp, sp), (cy, sy_) = ((sympy.cos(x / 2), sympy.sin(x / 2)) for x in (roll, pitch, yaw))
        own["Q1"] = cr * cp * cy + sr * sp * sy_
        own["Q2"] = cr * cp * sy_ - sr * sp * cy
        own["Q3"] = cr * sp * cy + sr * cp * sy_
        own["Q4"] = sr * cp * cy - cr * sp * sy_
        wanted = ("Q1", "Q2", "Q3", "Q4")
    used = {s.name for e in own.values() for s in e.free_symbols}
    position = ("Px", "Py", "Pz")
    # Intermediate values that these entries do not read are left out.
    kept: dict[str, sympy.Expr] = {}
    for name, value in reversed(model.expressions.items()):
        if name in position or name in used:
            kept[name] = value
            used |= {s.name for s in value.free_symbols}
    return replace(
        model,
        expressions=dict(reversed(kept.items())) | own,
        results=tuple(Result(name, (name,)) for name in (*position, *wanted)),
        notes=("pose of the tool in the world: Z · 0Tn · E", NOTES[orientation]),
    )


def _angle(sine: sympy.Expr, cosine: sympy.Expr) -> sympy.Expr:
    """atan2, 0 where both are zero everywhere: an axis that never tilts."""
    return sympy.Integer(0) if sine == 0 and cosine == 0 else sympy.atan2(sine, cosine)
