"""Results of one arm to hold against each other: as it was, recorded again, worn, and with something on a link."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from exact_logs import arm, exact_log

from identify.estimation.identification import Identification
from identify.robot.robot import Robot
from identify.workflow import fit

NOISE = 0.02
WORN, WEAR = 2, 1.2
"""The joint that wears, from 1, and what its Coulomb friction grows by."""

HEAVIER = 1.3
"""What the inertia of the last link grows by."""

TEST = 2
"""Seed of the motion that all are tested on."""


def worn() -> Robot:
    joints = list(arm(1).joints)
    joint = joints[WORN - 1]
    joints[WORN - 1] = replace(joint, drive=replace(joint.drive, coulomb=WEAR * joint.drive.coulomb))
    return replace(arm(1), joints=tuple(joints))


def heavier() -> Robot:
    *others, last = arm(1).joints
    link = replace(last.link, mass=HEAVIER * last.link.mass, inertia=tuple(HEAVIER * x for x in last.link.inertia))
    return replace(arm(1), joints=(*others, replace(last, link=link)))


PLANTS = {"before": arm, "again": lambda: arm(1), "worn": worn, "heavier": heavier}


@lru_cache(maxsize=8)
def result(plant: str, seed: int, friction: str = "plain", estimator: str | None = None) -> Identification:
    """A fit of the arm's own description to a log of one of PLANTS; seed: of motion and noise. Nobody may change it."""
    log = exact_log(PLANTS[plant](), seed, noise=NOISE, source=f"{plant}.mcap")
    unseen = exact_log(arm(1), TEST, noise=NOISE, source="unseen.mcap")
    return fit(log, arm(1), test=[unseen], friction=friction, estimator=estimator)
