"""MuJoCo's compiler on a reduced MJCF text, meshes left out."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from identify.errors import RobotError


@dataclass(frozen=True)
class Compiled:
    """MuJoCo's model, the bodies whose inertia the file does not give, and the names of those that meshes give it."""

    model: Any
    unknown: frozenset[int]
    from_meshes: tuple[str, ...]


@contextmanager
def quiet() -> Iterator[None]:
    """MuJoCo without its warnings, which it would leave in a log in the working folder."""
    import mujoco

    mujoco.set_mju_user_warning(lambda message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(None)


def compile_mjcf(text: str, source: str) -> Compiled:
    """The compiled model; RobotError with what MuJoCo says against it."""
    import mujoco

    try:
        with quiet():
            spec = mujoco.MjSpec.from_string(text)
            unknown, from_meshes = _without_meshes(spec)
            model = spec.compile()
            places = [body.id for body in unknown]
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        # Its line numbers are those of the reduced text.
        told = re.sub(r",? line \d+", "", " ".join(str(error).split()))
        raise RobotError(f"{source}: MuJoCo can't compile it: {told[:300]}") from None
    return Compiled(model, frozenset(places), tuple(from_meshes))


def _without_meshes(spec: Any) -> tuple[list[Any], list[str]]:
    """Take the meshes out of a specification. Bodies that then have no inertia get one to please the compiler: they
    are returned, and the names of those whose inertia the meshes would have given."""
    import mujoco

    mode = spec.compiler.inertiafromgeom
    always, never = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE, mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    read_shapes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)
    low, high = spec.compiler.inertiagrouprange
    unknown, from_meshes = [], []
    for body in list(spec.bodies)[1:]:
        mesh_mass = mass = False
        for geom in list(body.geoms):
            weighs = low <= geom.group <= high and (geom.density > 0 if math.isnan(geom.mass) else geom.mass > 0)
            if geom.type in read_shapes or geom.meshname or geom.hfieldname:
                mesh_mass |= weighs
                spec.delete(geom)
            else:
                mass |= weighs
                geom.material = ""
        for site in body.sites:
            site.material = ""
        if body.explicitinertial and mode != always:
            continue
        if mode == always:
            body.explicitinertial = False
        if mass and not mesh_mass and mode != never:
            continue
        unknown.append(body)
        if mesh_mass and mode != never:
            from_meshes.append(body.name)
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]
    for geom in list(spec.worldbody.geoms):
        spec.delete(geom)
    for site in spec.worldbody.sites:
        site.material = ""
    if mode == always:
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    if unknown:
        spec.compiler.settotalmass = -1.0
    return unknown, from_meshes
