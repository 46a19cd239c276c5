"""From a result back to a robot: the description that was fitted, with the links and drives that were identified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.estimation.identification import Identification
from identify.estimation.settings import Settings
from identify.regressor.columns import COUPLED, MORE, JointColumns
from identify.regressor.friction import ASYMMETRIC, sliding_laws
from identify.regressor.regressor import Regressor
from identify.robot.robot import Drive, Link, Robot
from identify.robot.transforms import make_link
from identify.robot.writing import not_carried, written


def with_standard(robot: Robot, standard: np.ndarray, extra: Mapping[str, float]) -> Robot:
    """The robot with links and actuator inertias from standard parameters (11 n,) and friction from `extra`.

    extra: values of the columns Fv, Fs and offset by name; one that is missing, as the data can't tell it from
    others, counts as zero.
    """
    joints = []
    for j, (joint, values) in enumerate(zip(robot.joints, standard.reshape(-1, 11), strict=True), 1):
        xx, xy, xz, yy, yz, zz, *first, mass, actuator = (float(x) for x in values)
        com = np.array(first) / mass
        about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        link = make_link(mass, com, about_origin - mass * (com @ com * np.eye(3) - np.outer(com, com)))
        viscous, coulomb, offset = (float(extra.get(f"{letters}{j}", 0.0)) for letters in ("Fv", "Fs", "off"))
        joints.append(replace(joint, link=link, drive=Drive(actuator, viscous, coulomb, offset)))
    return replace(robot, joints=tuple(joints))


def plain_friction(
    regressor: Regressor, extra: Mapping[str, float], settings: Settings, speeds: np.ndarray
) -> dict[str, float]:
    """`extra` with viscous and Coulomb friction alone, which is all that a robot's description has room for.

    Those nearest to all forms of it together, in least squares over speeds up to `speeds` (arms,) of each joint and
    coupled motor in both directions, under the mean load; none of them negative. Without further forms, `extra` as it
    is.
    """
    from scipy.optimize import nnls

    if not regressor.forms or regressor.extra is None:
        return dict(extra)
    columns = regressor.extra.columns
    kept = {name: value for name, value in extra.items() if name in JointColumns.of(regressor.robot).names}
    laws = sliding_laws(settings.sign, regressor.constants.stribeck_velocity)
    arms = [column for column in columns if column.kind in ("Fs", "Fsm")]
    shared = [column for column in columns if column.kind == "Fvm"]
    for column, top in zip(arms, speeds, strict=True):
        motor, v = bool(column.ratios), np.linspace(0.0, max(top, 1e-3), 201)[1:]
        viscous = f"{'Fvm' if motor else 'Fv'}{column.index + 1}"
        # What coupled motors put on a joint is theirs.
        slope = extra[viscous] - sum(extra[c.name] * c.ratios[column.index] ** 2 for c in shared if not motor)
        whole = extra[column.name] * settings.sign(v) + slope * v
        for form in regressor.forms:
            if form != ASYMMETRIC and motor < len(MORE[form]):
                whole += extra.get(f"{MORE[form][motor]}{column.index + 1}", 0.0) * laws[form](v)
        kept[column.name], kept[viscous] = nnls(np.column_stack([np.ones_like(v), v]), whole)[0]
    for column in shared:
        for i, ratio in enumerate(column.ratios, 1):
            kept[f"Fv{i}"] += kept[column.name] * ratio**2
    return {name: float(value) for name, value in kept.items()}


def identified_robot(result: Identification) -> Robot:
    """The robot of a result, its links and drives the physically consistent ones; its note says where they are from.

    InputError where the result holds none.
    """
    physical = result.record.get("physical")
    if not isinstance(physical, dict) or "drives" not in physical:
        why = result.record.get("physical_reason") or "it was made before they were"
        raise InputError(f"the result holds no standard parameters that physics allows ({why}); fit again")
    joints = []
    for joint, link, drive in zip(result.robot.joints, physical["links"], physical["drives"], strict=True):
        body = Link(link["mass"], tuple(link["com"]), tuple(link["inertia"]))
        values = {key: float(drive[key]) for key in ("inertia", "viscous", "coulomb", "offset")}
        joints.append(replace(joint, link=body, drive=Drive(**values)))
    transmission = result.robot.transmission
    if transmission and physical["transmission"]:
        found = {row["name"]: float(row["value"]) for row in physical["transmission"]}
        motors = (Drive(*(found.get(f"{kind}{k}", 0.0) for kind in COUPLED)) for k in range(1, result.robot.n + 1))
        transmission = replace(transmission, motors=tuple(motors))
    said = f" The description that was fitted says: {result.robot.note}" if result.robot.note else ""
    note = provenance(result.record) + said
    return replace(result.robot, joints=tuple(joints), transmission=transmission, note=note)


def link_table(robot: Robot) -> list[dict[str, Any]]:
    """Of each link: name of its joint, mass [kg], com (3,) [m] and inertia (6,) about it [kg·m²] in R_j, the principal
    moments (3,) [kg·m²], rising, and triangle_margin, the sum of the smaller two less the largest [kg·m²]."""
    rows = []
    for joint in robot.joints:
        link = joint.link
        moments = link.principal_moments
        rows.append(
            {
                "name": joint.name,
                "mass": link.mass,
                "com": list(link.com),
                "inertia": list(link.inertia),
                "principal_moments": moments.tolist(),
                "triangle_margin": float(moments[0] + moments[1] - moments[2]),
            }
        )
    return rows


def provenance(record: Mapping[str, Any]) -> str:
    """Where the identified numbers come from, and what they are not."""
    logs = [log for log in record["logs"] if log["role"] == "train"]
    kind = "simulated" if record["simulated"] else "measured"
    named = ", ".join(f"{log['path']} (sha256 {log['sha256']})" for log in logs)
    bodies = record["physical"]["pull"]["bodies"]
    taken = "neutral bodies" if set(bodies) == {"neutral"} else "the links of the description"
    return (
        f"Masses, centres of mass, inertias and friction are identified from {kind} motion: {named}; identify "
        f"{record['versions']['identify']}, {record['model']} model. They are not CAD values: what the motion can't "
        f"tell, as how a mass splits between links, comes from {taken}."
    )


def exported(result: Identification, form: str) -> tuple[str, tuple[str, ...]]:
    """Text of the identified robot as TOML, URDF or MJCF, and what the format does not carry, one sentence each."""
    robot = identified_robot(result)
    lost = (*not_carried(robot, form), *_friction_lost(result.settings))
    return written(robot, form, lost), lost


def _friction_lost(settings: Settings) -> tuple[str, ...]:
    """What of the friction that was fitted no robot file has a place for."""
    lost = []
    if settings.friction:
        *first, last = (form.replace("_", " ") for form in settings.friction)
        forms = f"{', '.join(first)} and {last}" if first else last
        lost.append(
            f"{forms} friction: viscous and Coulomb friction are those nearest to all of it together, in both "
            "directions and up to the speeds of the training logs"
        )
    if settings.coulomb_velocity is not None:
        lost.append(
            "the passage of Coulomb friction through rest, in the fit straight up to "
            f"{settings.coulomb_velocity:g} rad/s or m/s: a file's is dry"
        )
    return tuple(lost)
