"""How far an arm stays from itself and from the floor: its links as capsules between the origins of their frames.

Distances are exact, as are their derivatives: closest points of segments in closed form (Ericson 2005, 5.1.9), which
move with the joints like any point of a link (virtual work).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identify.experiment.limits import WorkingLimits, working_limits
from identify.robot.robot import Robot
from identify.symbolic.geometry import frames

RADIUS = 0.08
"""Radius of a link that the description gives none, as a share of the arm's reach."""

POSES = 256
"""Random poses that tell which parts always touch, and which never move."""

TINY = 1e-9
"""Lengths [m] this small are none."""

ALWAYS = 2 / 3
"""Share of the poses from which two links that touch count as built so."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """Links of a serial arm as capsules along a line of points, and what must not meet.

    The points are the base's foot, O_1 … O_n and the arm's tip, those left out that lie on the one before. points
    (m,): their numbers among these n + 2; segment s runs from point s to point s + 1. radius (m − 1,) [m]; carrier
    (m − 1,): index of each segment's joint, −1 for the base. foot (3,) in the world, tip (3,) in R_n [m]. pairs: of
    segments whose distance counts; floor: height of the floor in the world [m], None where it is not known; over: those
    of the points that move above it. reach [m]: length of the line above O_1.
    """

    robot: Robot
    foot: np.ndarray
    tip: np.ndarray
    points: tuple[int, ...]
    radius: np.ndarray
    carrier: tuple[int, ...]
    reach: float
    floor: float | None
    pairs: tuple[tuple[int, int], ...] = ()
    over: tuple[int, ...] = ()

    @staticmethod
    def of(robot: Robot) -> Clearance | None:
        """The capsules of a serial arm; None for a tree, and where there is nothing to keep apart.

        A link's radius is the description's, else RADIUS of the reach. The last link ends at the tool point, or where
        none is described, as far beyond its centre of mass as this is from O_n. Without a floor in the description, it
        is the world's plane z = 0 where O_1 stands above that. Neighbouring links count as built to touch, and so do
        links that overlap in two thirds of random poses, or lie as often below a floor that no description gives.
        """
        if any(joint.parent != j - 1 for j, joint in enumerate(robot.joints)):
            return None
        q = _poses(working_limits(robot))
        line = Clearance._line(robot, q)
        if line is None:
            return None
        last = len(line.radius)
        pairs = tuple((i, k) for i in range(last) for k in range(i + 2, last))
        over = tuple(range(1, len(line.points))) if line.floor is not None else ()
        every = replace(line, pairs=pairs, over=over)
        gaps = every.gaps(q)
        counted = np.ptp(gaps, axis=1) > TINY
        guessed = np.arange(len(gaps)) < (len(pairs) if robot.floor is not None else len(gaps))
        counted &= ~guessed | (np.mean(gaps < 0, axis=1) <= ALWAYS)
        found = replace(
            line,
            pairs=tuple(pair for pair, kept in zip(pairs, counted, strict=False) if kept),
            over=tuple(at for at, kept in zip(over, counted[len(pairs) :], strict=True) if kept),
        )
        return found if found.rows else None

    @staticmethod
    def _line(robot: Robot, q: np.ndarray) -> Clearance | None:
        """Points and segments alone, and the floor."""
        n, last = robot.n, robot.joints[-1].link
        tool = np.array(robot.tool)[:3, 3]
        tip = tool if np.linalg.norm(tool) > TINY else 2 * np.array(last.com) * (last.mass > 0)
        every = Clearance(robot, np.zeros(3), tip, tuple(range(n + 2)), np.zeros(n + 1), (), 0.0, None)
        place = every.places(q)
        length = np.linalg.norm(np.diff(place, axis=0), axis=2).max(axis=1)
        reach = float(length[1:].sum())
        if reach <= TINY:
            return None
        floor = robot.floor
        if floor is None and place[1, 0, 2] > TINY:
            floor = 0.0
        top = place[1, 0]
        foot = np.array(robot.base)[:3, 3] if floor is None else np.array([top[0], top[1], min(floor, top[2])])
        length[0] = np.linalg.norm(top - foot)
        points = (0, *(at + 1 for at in range(n + 1) if length[at] > TINY))
        carrier = tuple(at - 2 for at in points[1:])
        given = [robot.joints[max(at, 0)].radius for at in carrier]
        radius = np.array([RADIUS * reach if one is None else one for one in given])
        return Clearance(robot, foot, tip, points, radius, carrier, reach, floor)

    @property
    def rows(self) -> int:
        """How many gaps there are: of pairs of segments, then of points above the floor."""
        return len(self.pairs) + len(self.over)

    @property
    def names(self) -> tuple[str, ...]:
        """(rows,) what each gap lies between."""
        joints = self.robot.joint_names
        link = ["the base" if at < 0 else f"{joints[at]}'s link" for at in self.carrier]
        return (
            *(f"{link[k]} and {link[i]}" for i, k in self.pairs),
            *(f"{link[at - 1]} and the floor" for at in self.over),
        )

    @cached_property
    def _thick(self) -> np.ndarray:
        """(rows,) sums of radii [m]; at a point the larger of its segments' radii, plus the floor's height."""
        pairs = [self.radius[i] + self.radius[k] for i, k in self.pairs]
        ends = [max(self.radius[at - 1 : at + 1]) + (self.floor or 0.0) for at in self.over]
        return np.array(pairs + ends)

    def along(self, q: np.ndarray) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
        """At positions q (n, N): shortest distances between surfaces (rows, N) [m], negative where they overlap, and a
        function of adjoint (rows, N) that gives the derivatives (n, N) of Σ adjoint·distances with respect to q."""
        world = self._world(q)
        place = self._places(world)
        distance, toward, s, t = _closest(*_ends(place, self.pairs))
        gaps = np.concatenate([distance, place[list(self.over), :, 2]]) - self._thick[:, None]

        def pull_back(adjoint: np.ndarray) -> np.ndarray:
            pull = adjoint[: len(self.pairs), :, None] * toward
            force = np.zeros((self.robot.n + 2, *place.shape[1:]))
            for row, (i, k) in enumerate(self.pairs):
                for at, share in ((i, 1 - s[row]), (i + 1, s[row]), (k, t[row] - 1), (k + 1, -t[row])):
                    force[self.points[at]] += share[:, None] * pull[row]
            for row, at in enumerate(self.over, len(self.pairs)):
                force[self.points[at], :, 2] += adjoint[row]
            return self._virtual_work(world, force)

        return gaps, pull_back

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """(rows, N) shortest distances between surfaces [m] at positions q (n, N)."""
        return self.along(q)[0]

    def places(self, q: np.ndarray) -> np.ndarray:
        """(m, N, 3) the points in the world [m]."""
        return self._places(self._world(q))

    def _world(self, q: np.ndarray) -> np.ndarray:
        """(N, n, 4, 4) frames in the world."""
        return np.array(self.robot.base) @ frames(self.robot, q.T)

    def _places(self, world: np.ndarray) -> np.ndarray:
        every = np.empty((world.shape[1] + 2, len(world), 3))
        every[0] = self.foot
        every[1:-1] = world[:, :, :3, 3].transpose(1, 0, 2)
        every[-1] = every[-2] + world[:, -1, :3, :3] @ self.tip
        return every[list(self.points)]

    def _virtual_work(self, world: np.ndarray, force: np.ndarray) -> np.ndarray:
        """(n, N) what forces (n + 2, N, 3) on all points do per unit of each joint's motion."""
        origin, axis = (world[:, :, :3, at].transpose(1, 0, 2) for at in (3, 2))
        tip = origin[-1] + world[:, -1, :3, :3] @ self.tip
        points, force = np.concatenate([origin, tip[None]]), force[1:]
        # A joint moves its own origin and all points beyond.
        total = np.cumsum(force[::-1], axis=0)[::-1][:-1]
        moment = np.cumsum(np.cross(points, force)[::-1], axis=0)[::-1][:-1]
        turns = np.array([joint.revolute for joint in self.robot.joints])[:, None, None]
        return np.sum(axis * np.where(turns, moment - np.cross(origin, total), total), axis=2)


def _ends(place: np.ndarray, pairs: Sequence[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Start and end of the first and of the second segment of each pair, (pairs, N, 3) each; place (m, N, 3)."""
    first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
    return place[first], place[first + 1], place[second], place[second + 1]


def _poses(limits: WorkingLimits) -> np.ndarray:
    """(n, POSES) seeded random poses inside the limits."""
    generator = np.random.Generator(np.random.PCG64(0))
    return limits.low[:, None] + 2 * limits.half[:, None] * generator.random((len(limits.low), POSES))


def _closest(
    a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of segments a0–a1 and b0–b1, (k, N, 3) each: distance (k, N), unit vector (k, N, 3) from the closest point of the
    second to that of the first, and where these lie, as shares s and t (k, N) of the way from start to end."""
    along, across, apart = a1 - a0, b1 - b0, a0 - b0

    def dot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.einsum("kni,kni->kn", x, y)

    a, e, b = dot(along, along), dot(across, across), dot(along, across)
    c, f = dot(along, apart), dot(across, apart)
    squares = a * e - b * b
    a, e = np.maximum(a, TINY**2), np.maximum(e, TINY**2)
    skew = squares > TINY * a * e
    s = np.clip(np.where(skew, b * f - c * e, 0.0) / np.where(skew, squares, 1.0), 0.0, 1.0)
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    # Where t was cut off, the nearest point of the first segment is another; elsewhere this is s again.
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    way = apart + s[:, :, None] * along - t[:, :, None] * across
    distance = np.sqrt(dot(way, way))
    return distance, way / np.maximum(distance, TINY)[:, :, None], s, t
