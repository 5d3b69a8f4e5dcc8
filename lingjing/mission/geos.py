"""The outline of a buffer from the library GEOS that shapely brings, without shapely itself.

Importing shapely imports numpy, which takes as long as all the rest of a cold `lingjing validate`. Calls and parameters
are those of `shapely.buffer`, and so are the coordinates, to the last bit. Where the library is not found beside
shapely, or the result is not one plain outline, the caller uses shapely.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import ctypes

    from lingjing.mission.geometry2d import Vector2

_POLYGON = 3
"""Number of the type of a polygon in GEOS."""
_ROUND, _FLAT = 1, 2
"""Numbers of the styles of caps and joins in GEOS."""
_MITRE_LIMIT = 5.0
"""Shapely's default; round joins do not read it."""
_POINTERS = ("GEOS_init_r", "GEOSBufferParams_create_r", "GEOSCoordSeq_copyFromBuffer_r", "GEOSGeom_createLineString_r",
             "GEOSGeom_createLinearRing_r", "GEOSGeom_createPolygon_r", "GEOSBufferWithParams_r",
             "GEOSGetExteriorRing_r", "GEOSGeom_getCoordSeq_r")  # fmt: skip
"""Functions of GEOS that return a pointer."""


def buffer_outline(points: Sequence[Vector2], distance: float, *, closed: bool, segments: int) -> list[Vector2] | None:
    """The outline of `shapely.buffer`, closed by its first point, of a line with flat caps or of a polygon.

    `segments`: those of a quarter of a round corner. None if shapely is loaded already, if its library is not found, or
    if the result has several pieces or holes.
    """
    plain = all(math.isfinite(value) for point in points for value in point)
    geos = _library() if plain and "shapely" not in sys.modules else None
    if geos is None or len(points) < (3 if closed else 2):
        return None
    import ctypes

    context = ctypes.c_void_p(geos.GEOS_init_r())
    shape = params = grown = ctypes.c_void_p()
    try:
        shape = _shape(geos, context, [*points, points[0]] if closed and points[0] != points[-1] else points, closed)
        if shape.value is None:
            return None
        params = ctypes.c_void_p(geos.GEOSBufferParams_create_r(context))
        geos.GEOSBufferParams_setQuadrantSegments_r(context, params, segments)
        geos.GEOSBufferParams_setEndCapStyle_r(context, params, _ROUND if closed else _FLAT)
        geos.GEOSBufferParams_setJoinStyle_r(context, params, _ROUND)
        geos.GEOSBufferParams_setMitreLimit_r(context, params, ctypes.c_double(_MITRE_LIMIT))
        grown = ctypes.c_void_p(geos.GEOSBufferWithParams_r(context, shape, params, ctypes.c_double(distance)))
        return _outline(geos, context, grown) if grown.value is not None else None
    finally:
        for geometry in (shape, grown):
            if geometry.value is not None:
                geos.GEOSGeom_destroy_r(context, geometry)
        if params.value is not None:
            geos.GEOSBufferParams_destroy_r(context, params)
        geos.GEOS_finish_r(context)


# -- private


@cache
def _library() -> Any:
    """The library beside the installed shapely, by ctypes; None if it is not there, or if there are several: the one
    that shapely loads is not known then."""
    from importlib.util import find_spec

    spec = find_spec("shapely")
    if spec is None or spec.origin is None:
        return None
    folder = os.path.join(os.path.dirname(os.path.dirname(spec.origin)), "shapely.libs")  # noqa: PTH118, PTH120
    try:
        import ctypes

        (name,) = (name for name in os.listdir(folder) if name.startswith("libgeos_c"))  # noqa: PTH208
        geos = ctypes.CDLL(os.path.join(folder, name))  # noqa: PTH118
        for function in _POINTERS:
            getattr(geos, function).restype = ctypes.c_void_p
    except (ImportError, OSError, ValueError, AttributeError):
        return None
    return geos


def _shape(geos: Any, context: ctypes.c_void_p, points: Sequence[Vector2], closed: bool) -> ctypes.c_void_p:
    import ctypes

    values = [value for point in points for value in point]
    buffer = (ctypes.c_double * len(values))(*values)
    sequence = ctypes.c_void_p(geos.GEOSCoordSeq_copyFromBuffer_r(context, buffer, len(points), 0, 0))
    if not closed:
        return ctypes.c_void_p(geos.GEOSGeom_createLineString_r(context, sequence))
    ring = ctypes.c_void_p(geos.GEOSGeom_createLinearRing_r(context, sequence))
    if ring.value is None:
        return ring
    return ctypes.c_void_p(geos.GEOSGeom_createPolygon_r(context, ring, None, 0))


def _outline(geos: Any, context: ctypes.c_void_p, shape: ctypes.c_void_p) -> list[Vector2] | None:
    import ctypes

    if geos.GEOSGeomTypeId_r(context, shape) != _POLYGON or geos.GEOSGetNumInteriorRings_r(context, shape):
        return None
    ring = ctypes.c_void_p(geos.GEOSGetExteriorRing_r(context, shape))
    sequence = ctypes.c_void_p(geos.GEOSGeom_getCoordSeq_r(context, ring))
    size = ctypes.c_uint()
    geos.GEOSCoordSeq_getSize_r(context, sequence, ctypes.byref(size))
    if not size.value:
        return None
    buffer = (ctypes.c_double * (2 * size.value))()
    geos.GEOSCoordSeq_copyToBuffer_r(context, sequence, buffer, 0, 0)
    return list(zip(buffer[::2], buffer[1::2], strict=True))
