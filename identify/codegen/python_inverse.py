"""Inverse geometry in Python: the same levels, branches and refinement as in C, for one pose."""

from __future__ import annotations

from identify.codegen.inverse import Inverse, Level
from identify.codegen.text import wrapped
from identify.robot.robot import Robot
from identify.symbolic.inverse_geometry import EDGE, SAME, TOLERANCE, UNDETERMINED

SOLVERS = {
    1: f'''\
def _solve_1(v, size, now):
    """Type 1, X r = Y: by least squares of several such equations; keeps `now` where every X vanishes."""
    xx = sum(x * x for x in v[::2])
    if xx == 0.0 or all(abs(x) <= {UNDETERMINED!r} * s for x, s in zip(v[::2], size)):
        return now
    return sum(x * y for x, y in zip(v[::2], v[1::2])) / xx
''',
    2: f'''\
def _solve_2(x, y, z, size, now):
    """Type 2, X sin + Y cos = Z: its solutions; keeps `now` where X and Y vanish."""
    square = x * x + y * y
    if sqrt(square) <= {UNDETERMINED!r} * size:
        return [now] if abs(z) <= {UNDETERMINED!r} * size else []
    under = square - z * z
    # Rounding at the edge of the workspace is no reason to find nothing.
    if not under >= -{EDGE!r} * square:
        return []
    if under <= 0.0:
        return [atan2(x * z, y * z)]
    root = sqrt(under)
    return [atan2(x * z + y * root, y * z - x * root), atan2(x * z - y * root, y * z + x * root)]
''',
    3: f'''\
def _solve_3(x1, y1, z1, x2, y2, z2, size, now):
    """Type 3, X1 sin + Y1 cos = Z1 and X2 sin + Y2 cos = Z2; keeps `now` where the two are one."""
    det = x1 * y2 - x2 * y1
    if abs(det) <= {UNDETERMINED!r} * size:
        return now
    sense = 1.0 if det > 0.0 else -1.0
    return atan2(sense * (z1 * y2 - z2 * y1), sense * (x1 * z2 - x2 * z1))
''',
    10: f'''\
def _solve_10(a, b, c, size, now):
    """Type 10, A r^2 + B r + C = 0: its solutions; keeps `now` where A, B and C vanish."""
    if abs(a) <= {UNDETERMINED!r} * size[0] and abs(b) <= {UNDETERMINED!r} * size[1]:
        return [now] if abs(c) <= {UNDETERMINED!r} * size[2] else []
    under = b * b - 4.0 * a * c
    if not under >= -{EDGE!r} * b * b:
        return []
    half = -0.5 * (b + (-1.0 if b < 0.0 else 1.0) * sqrt(max(under, 0.0)))
    return ([c / half] if half != 0.0 else []) + ([half / a] if a != 0.0 else [])
''',
}

REFINEMENT = f'''\
def _pose_error(q, pose):
    """(6,) displacement and small rotation from the tool at q to the pose, and the largest entry of the difference."""
    reached = direct_geometry(q)
    turn = 0.5 * np.cross(reached[:3, :3], pose[:3, :3], axisa=0, axisb=0, axisc=0).sum(axis=1)
    return np.concatenate([pose[:3, 3] - reached[:3, 3], turn]), np.abs(pose[:3] - reached[:3]).max()


def _turned(joint, angle, now):
    """The angle with the whole turns that bring it inside its limits, nearest to `now`; else in (-pi, pi]."""
    low, high = POSITION_LOW[joint], POSITION_HIGH[joint]
    angle = remainder(angle, tau)
    if angle <= -0.5 * tau:
        angle += tau
    best, chosen = inf, angle
    for turns in (0.0, -1.0, 1.0, -2.0, 2.0) if isfinite(low) and isfinite(high) else (0.0,):
        moved = angle + tau * turns
        away = abs(moved - now)
        if low - {TOLERANCE!r} <= moved <= high + {TOLERANCE!r} and away < best - {TOLERANCE!r}:
            best, chosen = away, moved
    return chosen


def _keep(pose, current, branch, found):
    """Appends (q, inside limits) of a branch to `found`, refined, if it reaches the pose and is new."""
    best = np.array(branch)
    error, size = _pose_error(best, pose)
    # Near singular poses the formulas amplify rounding errors: Newton steps take them off.
    for _ in range(3):
        if not 1e-13 < size < 1e-3:
            break
        j = jacobian(best)
        moved = best + np.linalg.solve(j.T @ j + 1e-14 * np.eye(JOINTS), j.T @ error)
        next_error, smaller = _pose_error(moved, pose)
        if not smaller < size:
            break
        best, error, size = moved, next_error, smaller
    if not size <= {TOLERANCE!r}:
        return
    for other, _ in found:
        apart = best - other
        if np.abs(np.where(REVOLUTE, np.remainder(apart + pi, tau) - pi, apart)).max() < {SAME!r}:
            return
    best = np.array([_turned(j, x, current[j]) if REVOLUTE[j] else x for j, x in enumerate(best.tolist())])
    inside = np.all((best >= POSITION_LOW - {TOLERANCE!r}) & (best <= POSITION_HIGH + {TOLERANCE!r}))
    found.append((best, bool(inside)))
'''

ABOUT = '''\
    """Inverse geometry by Paul's method: every position that brings the tool to `pose` (4 by 4, in the world) to 1e-9.

    Returns q (k, n), k up to {most}, and (k,) whether all joints are inside their limits. Joints that a singular pose
    leaves undetermined keep their position in `current` (n). Angles lie in (-pi, pi], or whole turns away where that
    brings them inside the limits. No solution: out of reach, no rotation, or not finite.{short}
    """
'''


def inverse_source(model: Inverse, robot: Robot) -> list[str]:
    """Lines of the helpers that the model needs, and of the function."""
    lines: list[str] = []
    for number in sorted({level.type for level in model.levels}):
        lines += ["", *SOLVERS[number].splitlines(), ""]
    lines += ["", *REFINEMENT.splitlines(), "", "", "def inverse_geometry(pose, current):"]
    short = f"\n    {robot.n} joints for six coordinates: only poses that the arm can take have solutions."
    lines += ABOUT.format(most=model.most, short=short if robot.n < 6 else "").splitlines()
    lines += [
        "    matrix = np.asarray(pose, dtype=float).reshape(4, 4)",
        "    pose, current = matrix.ravel().tolist(), np.asarray(current, dtype=float).tolist()",
        "    found = []",
        "    if not np.isfinite(matrix).all():",
        f"        return np.empty((0, {robot.n})), np.empty(0, dtype=bool)",
    ]
    for name, text in model.pose:
        lines += _assigned("    ", name, text)
    indent = "    "
    for level in model.levels:
        own, indent = _level(level, indent)
        lines += own
    lines.append(f"{indent}_keep(matrix, current, [{', '.join(model.joints)}], found)")
    lines += [f"    q = np.array([x for x, _ in found]).reshape(-1, {robot.n})"]
    return [*lines, "    return q, np.array([inside for _, inside in found], dtype=bool)", ""]


def _assigned(indent: str, name: str, text: str) -> list[str]:
    line = f"{indent}{name} = {text}"
    broken = wrapped(f"{indent}    {text}")
    return [line] if len(line) <= 120 else [f"{indent}{name} = (", *broken, f"{indent})"]


def _level(level: Level, indent: str) -> tuple[list[str], str]:
    """Lines of one unknown, and the indentation of what follows."""
    v, scale = level.coefficients, repr(level.scale)
    lines = [f"{indent}# {part}" for part in [level.about]]
    for name, text in level.before:
        lines += _assigned(indent, name, text)
    inner = indent
    match level.type:
        case 1:
            pairs, sizes = ", ".join(v), ", ".join(map(repr, level.sizes[::2]))
            call, looped = f"_solve_1(({pairs}), ({sizes},), {level.now})", False
        case 3:
            call, looped = f"_solve_3({', '.join(v)}, {scale}, {level.now})", False
        case _:
            size = f"({', '.join(map(repr, level.sizes))})" if level.type == 10 else scale
            call, looped = f"_solve_{level.type}({', '.join(v)}, {size}, {level.now})", True
    if looped:
        inner += "    "
        lines += wrapped(f"{indent}for {level.unknown} in {call}:")
    else:
        lines += wrapped(f"{indent}{level.unknown} = {call}")
    return lines + [f"{inner}{name} = {text}" for name, text in level.after], inner
