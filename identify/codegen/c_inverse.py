"""Inverse geometry in C99: solvers of the equations' types, the branches as nested loops, the last refinement."""

from __future__ import annotations

import math

from identify.codegen.inverse import Inverse, Level
from identify.codegen.text import wrapped
from identify.robot.robot import Robot
from identify.symbolic.inverse_geometry import EDGE, SAME, TOLERANCE, UNDETERMINED

SOLVERS = {
    1: f"""\
/* Type 1, X r = Y: by least squares of several such equations; keeps `now` where every X vanishes. */
static double solve_1(const double v[], const double size[], int equations, double now)
{{
    double xx = 0.0, xy = 0.0;
    int undetermined = 1;
    for (int k = 0; k < equations; ++k) {{
        const double x = v[2 * k];
        xx += x * x;
        xy += x * v[2 * k + 1];
        if (!(fabs(x) <= {UNDETERMINED!r} * size[k])) undetermined = 0;
    }}
    return undetermined || xx == 0.0 ? now : xy / xx;
}}
""",
    2: f"""\
/* Type 2, X sin + Y cos = Z: the number of solutions; keeps `now` where X and Y vanish. */
static int solve_2(double x, double y, double z, double size, double now, double found[2])
{{
    const double square = x * x + y * y;
    const double under = square - z * z;
    if (sqrt(square) <= {UNDETERMINED!r} * size) {{
        found[0] = now;
        return fabs(z) <= {UNDETERMINED!r} * size;
    }}
    /* Rounding at the edge of the workspace is no reason to find nothing. */
    if (!(under >= -{EDGE!r} * square)) return 0;
    if (under <= 0.0) {{
        found[0] = atan2(x * z, y * z);
        return 1;
    }}
    {{
        const double root = sqrt(under);
        found[0] = atan2(x * z + y * root, y * z - x * root);
        found[1] = atan2(x * z - y * root, y * z + x * root);
    }}
    return 2;
}}
""",
    3: f"""\
/* Type 3, X1 sin + Y1 cos = Z1 and X2 sin + Y2 cos = Z2; keeps `now` where the two are one. */
static double solve_3(double x1, double y1, double z1, double x2, double y2, double z2, double size, double now)
{{
    const double det = x1 * y2 - x2 * y1;
    const double sense = det > 0.0 ? 1.0 : -1.0;
    if (fabs(det) <= {UNDETERMINED!r} * size) return now;
    return atan2(sense * (z1 * y2 - z2 * y1), sense * (x1 * z2 - x2 * z1));
}}
""",
    10: f"""\
/* Type 10, A r^2 + B r + C = 0: the number of solutions; keeps `now` where A, B and C vanish. */
static int solve_10(double a, double b, double c, const double size[3], double now, double found[2])
{{
    const double under = b * b - 4.0 * a * c;
    double half;
    int count = 0;
    if (fabs(a) <= {UNDETERMINED!r} * size[0] && fabs(b) <= {UNDETERMINED!r} * size[1]) {{
        found[0] = now;
        return fabs(c) <= {UNDETERMINED!r} * size[2];
    }}
    if (!(under >= -{EDGE!r} * b * b)) return 0;
    half = -0.5 * (b + (b < 0.0 ? -1.0 : 1.0) * sqrt(under > 0.0 ? under : 0.0));
    if (half != 0.0) found[count++] = c / half;
    if (a != 0.0) found[count++] = half / a;
    return count;
}}
""",
}

REFINEMENT = """\
/* (6) displacement and small rotation from the tool at q to the pose, and the largest entry of their difference. */
static double pose_error(const double q[@n], const double pose[16], double error[6])
{
    double reached[16], largest = 0.0;
    @prefix_direct_geometry(q, reached);
    for (int k = 0; k < 12; ++k) {
        const double d = fabs(pose[k] - reached[k]);
        if (!(d <= largest)) largest = d;
    }
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        error[i] = pose[4 * i + 3] - reached[4 * i + 3];
        error[3 + i] = 0.0;
        for (int c = 0; c < 3; ++c)
            error[3 + i] += 0.5 * (reached[4 * j + c] * pose[4 * k + c] - reached[4 * k + c] * pose[4 * j + c]);
    }
    return largest;
}

/* q one damped least-squares step nearer to the pose; 0 where there is none. */
static int step_towards(double q[@n], const double error[6])
{
    double jacobian[6 * @n], a[@n][@n], x[@n];
    @prefix_jacobian(q, jacobian);
    for (int i = 0; i < @n; ++i) {
        x[i] = 0.0;
        for (int c = 0; c < 6; ++c) x[i] += jacobian[@n * c + i] * error[c];
        for (int j = 0; j < @n; ++j) {
            a[i][j] = i == j ? 1e-14 : 0.0;
            for (int c = 0; c < 6; ++c) a[i][j] += jacobian[@n * c + i] * jacobian[@n * c + j];
        }
    }
    /* Elimination without pivots: the matrix is symmetric and positive definite. */
    for (int k = 0; k < @n; ++k) {
        if (!(a[k][k] > 0.0)) return 0;
        for (int i = k + 1; i < @n; ++i) {
            const double factor = a[i][k] / a[k][k];
            for (int j = k; j < @n; ++j) a[i][j] -= factor * a[k][j];
            x[i] -= factor * x[k];
        }
    }
    for (int k = @n - 1; k >= 0; --k) {
        for (int j = k + 1; j < @n; ++j) x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
        q[k] += x[k];
    }
    return 1;
}

/* a - b, angles brought into [-pi, pi]. */
static double apart(int joint, double a, double b)
{
    return revolute[joint] ? remainder(a - b, TWO_PI) : a - b;
}

/* The angle with the whole turns that bring it inside its limits, nearest to `now`; else in (-pi, pi]. */
static double turned(int joint, double angle, double now)
{
    static const double turns[5] = {0.0, -1.0, 1.0, -2.0, 2.0};
    const double low = @prefix_position_low[joint], high = @prefix_position_high[joint];
    const int most = low > -HUGE_VAL && high < HUGE_VAL ? 5 : 1;
    double best = HUGE_VAL, chosen;
    angle = remainder(angle, TWO_PI);
    if (angle <= -0.5 * TWO_PI) angle += TWO_PI;
    chosen = angle;
    for (int k = 0; k < most; ++k) {
        const double moved = angle + TWO_PI * turns[k], away = fabs(moved - now);
        if (moved >= low - @tolerance && moved <= high + @tolerance && away < best - @tolerance) {
            best = away;
            chosen = moved;
        }
    }
    return chosen;
}

/* Appends a branch to the solutions, refined, if it reaches the pose and is new: their number. */
static int kept(const double pose[16], const double current[@n], const double branch[@n],
                double q[][@n], int inside_limits[], int count)
{
    double best[@n], moved[@n], error[6], next[6], size;
    int inside = 1;
    for (int j = 0; j < @n; ++j) best[j] = branch[j];
    size = pose_error(best, pose, error);
    /* Near singular poses the formulas amplify rounding errors: Newton steps take them off. */
    for (int step = 0; step < 3 && size > 1e-13 && size < 1e-3; ++step) {
        double smaller;
        for (int j = 0; j < @n; ++j) moved[j] = best[j];
        if (!step_towards(moved, error)) break;
        smaller = pose_error(moved, pose, next);
        if (!(smaller < size)) break;
        size = smaller;
        for (int j = 0; j < @n; ++j) best[j] = moved[j];
        for (int c = 0; c < 6; ++c) error[c] = next[c];
    }
    if (!(size <= @tolerance)) return count;
    for (int k = 0; k < count; ++k) {
        int same = 1;
        for (int j = 0; j < @n; ++j)
            if (!(fabs(apart(j, best[j], q[k][j])) < @same)) same = 0;
        if (same) return count;
    }
    for (int j = 0; j < @n; ++j) {
        const double value = revolute[j] ? turned(j, best[j], current[j]) : best[j];
        q[count][j] = value;
        if (!(value >= @prefix_position_low[j] - @tolerance && value <= @prefix_position_high[j] + @tolerance))
            inside = 0;
    }
    inside_limits[count] = inside;
    return count + 1;
}
"""


def inverse_signature(model: Inverse, n: int, prefix: str) -> str:
    """Head of the C function, without a semicolon."""
    return (
        f"int {prefix}_inverse_geometry(const double pose[16], const double current[{n}], "
        f"double q[{model.most}][{n}], int inside_limits[{model.most}])"
    )


def inverse_source(model: Inverse, robot: Robot, prefix: str) -> list[str]:
    """Lines of the static helpers that the model needs, and of the function."""
    n = robot.n
    revolute = ", ".join(str(int(joint.revolute)) for joint in robot.joints)
    lines = [
        f"static const double TWO_PI = {2 * math.pi!r};",
        f"static const int revolute[{n}] = {{{revolute}}};",
        "",
    ]
    for number in sorted({level.type for level in model.levels}):
        lines += [*SOLVERS[number].splitlines(), ""]
    texts = {"@prefix": prefix, "@n": str(n), "@tolerance": repr(TOLERANCE), "@same": repr(SAME)}
    helpers = REFINEMENT
    for mark, text in texts.items():
        helpers = helpers.replace(mark, text)
    lines += [*helpers.splitlines(), "", *wrapped(inverse_signature(model, n, prefix)), "{", "    int count = 0;"]
    for name, text in model.pose:
        lines += wrapped(f"    const double {name} = {text};")
    indent = "    "
    for level in model.levels:
        own, inner = _level(level, indent)
        lines += own
        indent = inner
    lines.append(f"{indent}const double branch[{n}] = {{{', '.join(model.joints)}}};")
    lines.append(f"{indent}count = kept(pose, current, branch, q, inside_limits, count);")
    while len(indent) > 4:
        indent = indent[:-4]
        lines.append(f"{indent}}}")
    return [*lines, "    return count;", "}", ""]


def _level(level: Level, indent: str) -> tuple[list[str], str]:
    """Lines of one unknown, and the indentation of what follows."""
    label, v, now = level.label, level.coefficients, level.now
    lines = wrapped(f"{indent}/* {level.about}. */")
    code = [f"const double {name} = {text};" for name, text in level.before]
    inner = indent
    match level.type:
        case 1:
            sizes = ", ".join(repr(x) for x in level.sizes[::2])
            code += [
                f"const double v_{label}[{len(v)}] = {{{', '.join(v)}}};",
                f"static const double size_{label}[{len(v) // 2}] = {{{sizes}}};",
                f"const double {level.unknown} = solve_1(v_{label}, size_{label}, {len(v) // 2}, {now});",
            ]
        case 3:
            code.append(f"const double {level.unknown} = solve_3({', '.join(v)}, {level.scale!r}, {now});")
        case 2 | 10:
            code.append(f"double found_{label}[2];")
            size = repr(level.scale)
            if level.type == 10:
                code.append(f"static const double size_{label}[3] = {{{', '.join(map(repr, level.sizes))}}};")
                size = f"size_{label}"
            arguments = ", ".join([*v, size, now, f"found_{label}"])
            code.append(f"const int count_{label} = solve_{level.type}({arguments});")
            code.append(f"for (int k_{label} = 0; k_{label} < count_{label}; ++k_{label}) {{")
            inner += "    "
    lines += [line for text in code for line in wrapped(indent + text)]
    if inner != indent:
        lines.append(f"{inner}const double {level.unknown} = found_{label}[k_{label}];")
    lines += [f"{inner}const double {name} = {text};" for name, text in level.after]
    return lines, inner
