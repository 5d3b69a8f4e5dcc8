"""A city as a model of MuJoCo: a ground plane and one static geom for each solid shape."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.scene.city import City
from lingjing.scene.shapes import Capsule, OrientedBox, Shape, prisms, shapes_of
from lingjing.scene.tiles import Tiles

_DEPTH_M = 1.0
"""Depth of the ground below the datum, metres (chosen)."""


def encode(city: City) -> bytes:
    """Return the model as MJCF. Its text `projection` turns positions into WGS84.

    Raises `UsageError` if mujoco is not installed.
    """
    mujoco = _mujoco()
    from lingjing.scene.exports import projection

    spec = mujoco.MjSpec()
    spec.modelname = city.id
    spec.add_text(name="projection", data=projection(city))
    spec.add_text(name="attribution", data=city.attribution or "none")
    spec.worldbody.add_geom(
        name="datum", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 1.0), pos=(0.0, 0.0, city.datum_m)
    )
    for number, shape in enumerate(_shapes(city)):
        _add(mujoco, spec, f"{number}/{shape.thing}", shape)
    spec.compile()
    return str(spec.to_xml()).encode()


def _shapes(city: City) -> Iterator[Shape]:
    for number, land in enumerate(city.lands):
        if land.top_m > city.datum_m:
            yield from prisms(f"land-{number}", land.polygon, (), city.datum_m - _DEPTH_M, land.top_m)
    for tile in Tiles(city):
        yield from shapes_of(tile)


def _add(mujoco: Any, spec: Any, name: str, shape: Shape) -> None:
    if isinstance(shape, OrientedBox):
        turn = (math.cos(0.5 * shape.yaw), 0.0, 0.0, math.sin(0.5 * shape.yaw))
        form = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": shape.half, "pos": shape.centre, "quat": turn}
    elif isinstance(shape, Capsule):
        ends = (*shape.start, *shape.end)
        form = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": (shape.radius_m, 0.0, 0.0), "fromto": ends}
    else:
        # Meshes hold 32-bit floats: far from the origin only coordinates relative to the mesh are exact enough.
        corners = np.asarray(shape.corners)
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        mesh = spec.add_mesh(name=name, uservert=(corners - centre).ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        form = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name, "pos": centre}
    spec.worldbody.add_geom(name=name, **form)


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise UsageError("MJCF needs the package mujoco", hint=install_line("quadruped")) from error
    return mujoco
