"""How near a motion comes to a robot's limits, to itself and to the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.experiment.clearance import Clearance
from identify.experiment.fourier import one_period
from identify.experiment.limits import working_limits
from identify.experiment.trajectory import Trajectory
from identify.regressor.regressor import Regressor


@dataclass(frozen=True)
class Margins:
    """use: worst share of the robot's own limits of each kind over a period, 0 where there is none; tightest: joint and
    kind of the largest. gaps: smallest distance [m] between "links" and to the "floor", negative where they overlap;
    empty where shapes or floor are not known. nearest: between which. reach of the arm [m]."""

    use: dict[str, float]
    tightest: str
    gaps: dict[str, float]
    nearest: str
    reach: float

    @property
    def within(self) -> bool:
        """Whether every limit holds and nothing touches."""
        return self.worst <= 1.0

    @property
    def worst(self) -> float:
        """The largest share; an overlap counts as 1 and its share of the reach."""
        overlap = -min(self.gaps.values(), default=0.0)
        return max(*self.use.values(), 1 + overlap / self.reach if overlap > 0 else 0.0)


def margins(regressor: Regressor, clearance: Clearance | None, trajectory: Trajectory, samples: int) -> Margins:
    """Of one period, looked at on a grid; effort is what the description's parameters need."""
    robot, limits = regressor.robot, working_limits(regressor.robot)
    motion = one_period(trajectory, samples)
    q, dq, ddq = (signal.T for signal in motion)
    effort = regressor.inverse_dynamics(q, dq, ddq, regressor.parameters)
    own = [joint.limits for joint in robot.joints]
    below = np.where([np.isfinite(limit.position[0]) for limit in own], (limits.middle - q) / limits.half, 0.0)
    above = np.where([np.isfinite(limit.position[1]) for limit in own], (q - limits.middle) / limits.half, 0.0)
    shares = {
        "position": np.maximum(below, above),
        "velocity": np.abs(dq) / [limit.velocity for limit in own],
        "acceleration": np.abs(ddq) / [limit.acceleration for limit in own],
        "effort": np.abs(effort) / [limit.effort for limit in own],
    }
    worst = {kind: float(np.max(share)) for kind, share in shares.items()}
    kind = max(worst, key=lambda kind: worst[kind])
    joint = int(np.argmax(shares[kind].max(axis=0)))
    tightest = f"{robot.joint_names[joint]}'s {kind}" if worst[kind] > 0 else ""
    if clearance is None:
        return Margins(worst, tightest, {}, "", 1.0)
    least = clearance.gaps(motion[0]).min(axis=1)
    split = len(clearance.pairs)
    gaps = {name: float(part.min()) for name, part in (("links", least[:split]), ("floor", least[split:])) if len(part)}
    return Margins(worst, tightest, gaps, clearance.names[int(np.argmin(least))], clearance.reach)
