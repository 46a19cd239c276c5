"""The Jacobian in other forms: of the tool in its own axes, and as a product of three simple matrices [2.30]."""

from __future__ import annotations

from identify.robot.robot import Robot
from identify.symbolic.geometry import exact_matrix, letters, serial
from identify.symbolic.jacobian import TOO_LONG, checked_frame, shorter, symbolic_matrix, three_matrices
from identify.symbolic.model import Result, SymbolicModel
from identify.symbolic.trigonometry import algebra


def symbolic_tool_jacobian(robot: Robot) -> SymbolicModel:
    """Velocity of the tool's origin, then angular velocity, in the axes of the tool: entries J11 … J6n."""
    space = algebra(serial(robot))
    matrix, tool = symbolic_matrix(robot, robot.n, None, space), exact_matrix(robot.tool)
    back, p = tool[:3, :3].T, tool[:3, 3]
    columns = []
    for k in range(robot.n):
        velocity, turning = matrix[:3, k], matrix[3:, k]
        column = [*(back * (velocity + turning.cross(p))), *(back * turning)]
        columns.append([space.to_joint_variables(shorter(space, e)) for e in column])
    note = "Jacobian of the tool in its own axes: rows velocity of its origin, then angular velocity"
    entries = {_name(robot, i, k): columns[k][i] for i in range(6) for k in range(robot.n)}
    inputs = tuple(f"q{j + 1}" for j in range(robot.n))
    return SymbolicModel(robot.name, "jacobian", entries, inputs, letters(robot), (note,))


def symbolic_decomposed_jacobian(robot: Robot, frame: int = 0) -> SymbolicModel:
    """ˢJ_n, s = frame, as results turn (3, 3), lever (3,) and J (6, n): the intermediate frame with the fewest terms.

    ˢJ_n = [turn 0; 0 turn] [I −lever^; 0 I] J, with ^ the matrix of the cross product.
    """
    space, n = algebra(serial(robot)), robot.n
    checked_frame(robot, frame)

    def cost(place: tuple[int, int]) -> tuple[int, int]:
        core = symbolic_matrix(robot, *place, space)
        return sum(e != 0 for e in core), sum(int(e.count_ops()) for e in core)

    # With axes at any angle no choice is simple, and trying them takes long.
    long = cost((n // 2, n))[1] > TOO_LONG
    i, j = min(((i, j) for i in ([n // 2] if long else range(n + 1)) for j in sorted({i, n})), key=cost)
    parts = three_matrices(robot, frame, i, j)
    turn = {f"turn{r + 1}{c + 1}": parts.turn[r, c] for r in range(3) for c in range(3)}
    shift = parts.shift
    lever = {"lever1": shift[1, 5], "lever2": shift[2, 3], "lever3": shift[0, 4]}
    core = {_name(robot, r, k): parts.core[r, k] for r in range(6) for k in range(n)}
    notes = (
        f"Jacobian of R{n} in the axes of R{frame} = [turn 0; 0 turn] [I -lever^; 0 I] J [2.30]; lever^ v = lever x v",
        f"turn: R{i} in R{frame}; lever: from O{j} to O{n} in R{i}; J: of link {n} at O{j} in R{i}, of the same rank",
    )
    results = (Result("turn", tuple(turn), 3), Result("lever", tuple(lever)), Result("J", tuple(core), n))
    inputs = tuple(f"q{k + 1}" for k in range(n))
    return SymbolicModel(robot.name, "jacobian", turn | lever | core, inputs, letters(robot), notes, (), results)


def _name(robot: Robot, i: int, k: int) -> str:
    return f"J{i + 1}{k + 1}" if robot.n < 10 else f"J{i + 1}_{k + 1}"
