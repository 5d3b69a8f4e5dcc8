"""`draw_view`: the placed instance of a mission as the camera engine renders it from above, with its bodies' names.

It shows what `lingjing.scene.plan.draw_plan` shows as a plan: assets, targets, hidden ones too, and regions, at the
first boundary of an episode. The air is clear, whatever the mission's visibility and rain.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from math import cos, radians, sin
from pathlib import Path

import msgspec

from lingjing.analysis.played_city import attribution_of
from lingjing.errors import UsageError
from lingjing.kernel.world.engine_group import close_engines, start_engines
from lingjing.kernel.world.selection import CAMERA
from lingjing.kernel.world.sensor import Sensor
from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.scene.camera_geometry import in_image, world_to_pixel
from lingjing.scene.city import City
from lingjing.scene.plan import PlanMarker, PlanRegion, mark, written_figure
from lingjing.trace.records import CameraPose

WIDTH_PX, HEIGHT_PX, HFOV_DEG, TILT_DEG = 1920, 1080, 60.0, 50.0
"""Size, horizontal field of view and tilt below the horizon of the picture (chosen: roofs and walls are both seen)."""
SPACE_M = 5_000.0
"""Bodies above this elevation are left out, metres (chosen: satellites)."""
_NEAREST_M, _GROWTH, _MOST_STEPS = 60.0, 1.1, 120
"""Shortest distance of the eye from the middle, metres; its growth until all bodies are in the picture; most steps
(chosen: 120 steps reach 5,000 km)."""
CLEAR_M = 50_000.0
"""The least visibility of the picture, metres (chosen)."""
_MARGIN = 0.06
"""Free share of the picture at each side (chosen)."""
_DPI = 150
"""Pixels per inch, for the size of the letters (chosen: as the plan's)."""


def draw_view(instance: Instance, city: City, path: Path, *, title: str = "") -> None:
    """Write the picture; the suffix gives the format (`.png`, `.svg`, `.pdf`).

    Raises `UsageError` if nothing is on the ground or the file cannot be written, and `InfrastructureError` if the
    camera cannot work here.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.image import imread

    bodies = [entity for entity in instance.entities if entity.position[2] <= SPACE_M]
    corners = [(x, y, instance.scene.datum_m) for region in instance.regions for x, y in region.polygon]
    pose = pose_over([*(entity.position for entity in bodies), *corners])
    figure = Figure(figsize=(WIDTH_PX / _DPI, HEIGHT_PX / _DPI), dpi=_DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(imread(io.BytesIO(_rendered(instance, city, pose)), "jpg"), extent=(0, WIDTH_PX, 0, HEIGHT_PX))
    axes.set(xlim=(0, WIDTH_PX), ylim=(0, HEIGHT_PX), xticks=[], yticks=[])
    axes.set_axis_off()
    mark(axes, [*_markers(bodies, pose)], [*_regions(instance, pose)])
    note = f"{title} · " * bool(title) + f"{city.id} · {attribution_of(city, instance)}"
    figure.text(
        0.01, 0.012, note, fontsize=8, parse_math=False,
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.75},
    )  # fmt: skip
    written_figure(figure, path, _DPI)


def pose_over(points: Sequence[Vector]) -> CameraPose:
    """The nearest pose, looking north and down, with all points in the picture. Raises `UsageError` without points."""
    if not points:
        raise UsageError("the mission has no body and no region near the ground", hint="draw its plan instead")
    low, high = (tuple(map(end, zip(*points, strict=True))) for end in (min, max))
    middle = tuple((a + b) / 2.0 for a, b in zip(low, high, strict=True))
    away = _NEAREST_M
    pose = _looking_at(middle, away)
    for _ in range(_MOST_STEPS):
        if all(_is_inside(pose, point) for point in points):
            break
        away *= _GROWTH
        pose = _looking_at(middle, away)
    return pose


# -- private


def _looking_at(middle: Sequence[float], away_m: float) -> CameraPose:
    back, up = away_m * cos(radians(TILT_DEG)), away_m * sin(radians(TILT_DEG))
    return CameraPose(
        position=(middle[0], middle[1] - back, middle[2] + up), heading_deg=0.0, tilt_deg=TILT_DEG,
        hfov_deg=HFOV_DEG, width=WIDTH_PX, height=HEIGHT_PX,
    )  # fmt: skip


def _is_inside(pose: CameraPose, point: Vector) -> bool:
    pixel = world_to_pixel(pose, point)
    if pixel is None:
        return False
    return _MARGIN <= pixel[0] / pose.width <= 1.0 - _MARGIN and _MARGIN <= pixel[1] / pose.height <= 1.0 - _MARGIN


def _rendered(instance: Instance, city: City, pose: CameraPose) -> bytes:
    """The JPEG bytes of the picture from a free pose, with every entity at its first place."""
    air = instance.weather
    air = msgspec.structs.replace(air, visibility_m=max(air.visibility_m, CLEAR_M), rain=0.0)
    engines = start_engines(PluginHost(), (CAMERA,))
    try:
        sensor = Sensor(CAMERA, engines[CAMERA])
        sensor.reset(msgspec.structs.replace(instance, weather=air), city)
        request = CaptureRequest(
            frame="view", entity=instance.entities[0].id, camera="view", tick=0, time_s=0.0, pose=pose
        )
        picture = sensor.picture(request)
        assert picture is not None, "the built-in camera draws each picture"
        return picture.jpeg
    finally:
        close_engines(engines)


def _markers(bodies: Sequence[Entity], pose: CameraPose) -> list[PlanMarker]:
    """The bodies at their pixels, upwards from the lower left corner."""
    pixels = [(entity, world_to_pixel(pose, entity.position)) for entity in bodies]
    return [
        PlanMarker(entity.id, pixel[0], HEIGHT_PX - pixel[1], entity.role, "position" in entity.hidden)
        for entity, pixel in pixels
        if pixel is not None and in_image(pose, *pixel[:2])
    ]


def _regions(instance: Instance, pose: CameraPose) -> list[PlanRegion]:
    """The regions that lie before the eye, as outlines in pixels."""
    drawn = []
    for region in instance.regions:
        pixels = [world_to_pixel(pose, (x, y, instance.scene.datum_m)) for x, y in region.polygon]
        outline = tuple((pixel[0], HEIGHT_PX - pixel[1]) for pixel in pixels if pixel is not None)
        if outline and len(outline) == len(pixels):
            drawn.append(PlanRegion(region.name, outline, region.hidden))
    return drawn
