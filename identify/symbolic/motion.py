"""What a model of dynamics is asked about: the motion of the joints, gravity, and a wrench on the last link."""

from __future__ import annotations

from dataclasses import dataclass

from identify.robot.robot import Robot
from identify.symbolic.chain import Vec
from identify.symbolic.expression import Graph, Scalar


@dataclass(frozen=True)
class Motion:
    """Velocities and accelerations (n,) of the joints, 0g, and a wrench on the last link.

    force and moment (3,) that the last link exerts on its surroundings, in its frame at its origin [2.62].
    """

    dq: list[Scalar]
    ddq: list[Scalar]
    gravity: Vec
    force: Vec = (0, 0, 0)
    moment: Vec = (0, 0, 0)

    @staticmethod
    def of(
        graph: Graph, robot: Robot, *, dq: bool = True, ddq: bool = True, gravity: bool = True, wrench: bool = False
    ) -> Motion:
        """Symbols dq1 …, ddq1 …, and F1 F2 F3, N1 N2 N3 of the wrench; what is switched off is zero."""

        def symbols(prefix: str, count: int, there: bool) -> list[Scalar]:
            return [graph.symbol(f"{prefix}{j + 1}") if there else graph.constant(0) for j in range(count)]

        return Motion(
            symbols("dq", robot.n, dq),
            symbols("ddq", robot.n, ddq),
            tuple(graph.constant(x if gravity else 0.0) for x in robot.gravity),  # type: ignore[arg-type]
            tuple(symbols("F", 3, wrench)),  # type: ignore[arg-type]
            tuple(symbols("N", 3, wrench)),  # type: ignore[arg-type]
        )
