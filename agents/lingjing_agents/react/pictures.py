"""Pictures as a model receives them: JPEG files, whole, in tiles or cut out, and a description of each.

A picture that is sent whole at its own size is the stored JPEG itself, byte for byte. The positions of ground points in
the description are measured where the camera has a depth channel, and computed for a level plane elsewhere.
"""

from __future__ import annotations

import math

import numpy as np

from lingjing.plugins.geometry import focal_px, pixel_to_plane, pixel_to_world
from lingjing.plugins.policy import REFERENCE, Brief, CameraPose, Picture
from lingjing.plugins.scaffold import ImageFile
from lingjing_agents.perception.images import ImageBox, opencv
from lingjing_agents.react.facts import phrases_of, tenths
from lingjing_agents.react.standing import standing

JPEG_QUALITY = 85
WHOLE: ImageBox = (0.0, 0.0, 1.0, 1.0)
_COLUMNS, _ROWS = 7, 5
_COARSE_COLUMNS, _COARSE_ROWS = 3, 3
_DEPTH_COLUMNS, _DEPTH_ROWS = 16, 9
_AHEAD_DEG = 45.0
"""The tilt up to which a camera looks ahead. Chosen."""
_BELOW_HORIZON = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Distances of the rows from the horizon, as shares of a picture's height. Chosen."""
_FLAT_M = 1.0
_HORIZON_M = 5000.0
"""The farthest point of the plane that counts as a place, metres. Chosen: a small error of the pose moves farther
points by hundreds of metres."""


def images(picture: Picture, longest_side: int, tiles: int) -> tuple[ImageFile, ...]:
    """Return the whole picture, its longer side at most `longest_side` pixels, then its `tiles` x `tiles` parts, row by
    row, if `tiles` is more than 1."""
    parts = [WHOLE]
    if tiles > 1:
        steps = [number / tiles for number in range(tiles + 1)]
        parts += [(steps[i], steps[j], steps[i + 1], steps[j + 1]) for j in range(tiles) for i in range(tiles)]
    return tuple(image(picture, part, longest_side) for part in parts)


def image(picture: Picture, part: ImageBox, longest_side: int, *, least_side: int = 0) -> ImageFile:
    """Return a part of a picture. A part smaller than `least_side` is enlarged, so that a model resolves pixels."""
    height, width = picture.rgb.shape[:2]
    if part == WHOLE and picture.jpeg and max(height, width) <= longest_side:
        return ImageFile(picture.frame, part, picture.jpeg, width * height)
    left, right = _span(part[0], part[2], width)
    top, bottom = _span(part[1], part[3], height)
    cut = (left / width, top / height, right / width, bottom / height)
    data, pixels = _jpeg(picture.rgb[top:bottom, left:right], longest_side, least_side)
    return ImageFile(picture.frame, cut, data, pixels)


def in_words(picture: Picture, brief: Brief) -> dict[str, object]:
    """Return the description of a picture: camera, size, field of view, tilt, pose, and the ground in it; its size
    alone for a reference picture."""
    pose = picture.pose
    mount: dict[str, object] = {
        "frame": picture.frame,
        "camera": f"{picture.entity}/{picture.camera}",
        "size_px": [pose.width, pose.height],
        "field_of_view_deg": round(pose.hfov_deg, 1),
    }
    if picture.camera == REFERENCE:
        return {"frame": picture.frame, "reference": True, "size_px": [pose.width, pose.height]}
    return {
        **mount,
        "tick": picture.tick,
        "tilt_deg": round(pose.tilt_deg, 1),
        "roll_deg": round(pose.roll_deg, 1),
        "heading_deg": round(pose.heading_deg, 1),
        "camera_position": tenths(pose.position),
        **_ground(picture, brief),
        **(_standing(picture) if pose.tilt_deg > _AHEAD_DEG else _depths(picture)),
    }


def _standing(picture: Picture) -> dict[str, object]:
    """Return the rectangles around what stands in a picture from above; the table of depths without level ground."""
    seen = standing(picture)
    if seen is None:
        return _depths(picture)
    if not seen.rectangles:
        return {}
    more = {"smaller_ones_left_out": seen.left_out, "posts_east_north_m": seen.posts}
    left_out = {name: value for name, value in more.items() if value}
    rectangles = [list(rectangle) for rectangle in seen.rectangles]
    return {
        "standing": {"ground": round(seen.ground_m, 1) + 0.0, "west_south_east_north_top_m": rectangles, **left_out}
    }


def _depths(picture: Picture) -> dict[str, object]:
    """Return the depth of a picture at the middles of equal parts, whole metres, unless it is that of a plane.

    A model receives no depth image. The paper gives its agents depth as an input (lingjing.tex, tab:agents).
    """
    if picture.depth is None:
        return {}
    height, width = picture.depth.shape
    rows = [int((j + 0.5) / _DEPTH_ROWS * height) for j in range(_DEPTH_ROWS)]
    columns = [int((i + 0.5) / _DEPTH_COLUMNS * width) for i in range(_DEPTH_COLUMNS)]
    grid = picture.depth[np.ix_(rows, columns)]
    known = grid[np.isfinite(grid)]
    if not known.size or (known.max() - known.min() <= _FLAT_M and known.size == grid.size):
        return {}
    return {"depth_m": [[round(float(depth)) if np.isfinite(depth) else None for depth in row] for row in grid]}


def _ground(picture: Picture, brief: Brief) -> dict[str, object]:
    """Return the places at a grid of points of the picture: by depth, else on the plane of the water level."""
    columns, rows = _even(_COLUMNS), _even(_ROWS)
    places = _grid(picture, brief, columns, rows)
    heights = [place[2] for row in places for place in row if place is not None]
    if heights and max(heights) - min(heights) <= _FLAT_M:  # a plane: fewer points describe it fully
        columns = _even(_COARSE_COLUMNS)
        rows = _even(_COARSE_ROWS) if picture.pose.tilt_deg > _AHEAD_DEG else _below_horizon(picture.pose)
        places = _grid(picture, brief, columns, rows)
    say = phrases_of(brief)
    known = (
        say("measured")
        if picture.depth is not None
        else say("not measured: those of level ground at {level:g} m", level=brief.water_level_m)
    )
    return {
        **_extent(places),
        "ground": {
            "x": columns,
            "y": rows,
            "east_north_elevation_m": places,
            "heights": known,
        },
    }


def _extent(places: list[list[list[float] | None]]) -> dict[str, object]:
    """Return the width and height of the ground in a picture, metres, if all of its corners show ground."""
    corners = (places[0][0], places[0][-1], places[-1][0])
    if any(corner is None for corner in (*corners, places[-1][-1])):
        return {}
    first, across, down = (corner or [] for corner in corners)
    return {"covers_m": [round(math.dist(first[:2], other[:2])) for other in (across, down)]}


def _even(count: int) -> list[float]:
    """Return shares of a side from 0 to 1, evenly spaced."""
    return [round(index / (count - 1), 3) for index in range(count)]


def _below_horizon(pose: CameraPose) -> list[float]:
    """Return rows of a picture that looks ahead, as shares of its height. Ground far off lies close below the horizon,
    where evenly spaced rows show nothing."""
    horizon = 0.5 - focal_px(pose) * math.tan(math.radians(pose.tilt_deg)) / pose.height
    return [*(round(horizon + step, 3) for step in _BELOW_HORIZON if 0.0 <= horizon + step < 1.0), 1.0]


def _grid(picture: Picture, brief: Brief, columns: list[float], rows: list[float]) -> list[list[list[float] | None]]:
    return [[_place(picture, brief, x, y) for x in columns] for y in rows]


def _place(picture: Picture, brief: Brief, x: float, y: float) -> list[float] | None:
    """Return the place at a point of the picture; None for the sky and points beyond the horizon."""
    pose = picture.pose
    u, v = x * pose.width, y * pose.height
    if picture.depth is not None:
        height, width = picture.depth.shape
        depth = float(picture.depth[min(int(y * height), height - 1), min(int(x * width), width - 1)])
        return None if not np.isfinite(depth) else tenths(pixel_to_world(pose, u, v, depth))
    place = pixel_to_plane(pose, u, v, brief.water_level_m)
    if place is None or math.dist(place[:2], pose.position[:2]) > _HORIZON_M:
        return None
    return tenths(place)


def _span(low: float, high: float, size: int) -> tuple[int, int]:
    """Return the first and the last pixel between two shares of a side, at least one pixel."""
    first = min(max(int(low * size), 0), size - 1)
    return first, min(max(round(high * size), first + 1), size)


def _jpeg(rgb: np.ndarray, longest_side: int, least_side: int) -> tuple[bytes, int]:
    cv2 = opencv()
    height, width = rgb.shape[:2]
    longest = max(height, width)
    wanted = min(max(longest, least_side), longest_side)
    if wanted != longest:
        scale = wanted / longest
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        rgb = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC)
    ok, data = cv2.imencode(".jpg", np.ascontiguousarray(rgb[:, :, ::-1]), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert ok
    return bytes(data), rgb.shape[0] * rgb.shape[1]
