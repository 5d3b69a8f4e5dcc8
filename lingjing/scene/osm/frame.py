"""The part of a map that becomes the city, and its local frame: metres east and north of the centre of that part."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from lingjing.errors import UsageError
from lingjing.mission import geometry2d
from lingjing.mission.frames import from_geodetic
from lingjing.scene.osm.map_data import DegreeBox, MapData, Way
from lingjing.scene.osm.tags import VEHICLES, is_set

LARGEST_M = 60_000.0
"""Longest side of a city, metres (chosen): beyond it one projection no longer fits."""

SMALLEST_M = 5.0
"""Shortest side of a city, metres (chosen)."""

FARTHEST_DEG = 85.0
"""Greatest latitude, degrees (chosen): nearer to a pole, meridians converge so fast that a box in degrees is no
rectangle."""

_PART = "`lingjing scene build MAP --bbox=W,S,E,N`, or `bbox` of `scene map`"
"""The ways to choose a part of a map, for hints."""

WORLD = (-180.0, -90.0, 180.0, 90.0)
"""The part that some programs state for every file, without regard to its content."""

MARGIN_DEG = 0.0006
"""Margin around the outermost buildings if the map states no part, degrees (chosen: about 60 m)."""

REACH_DEG = 0.005
"""Distance from the buildings within which the nearest streets are included, if none runs among them, degrees (chosen:
about 500 m)."""

_Choice = Callable[[Way], bool]


@dataclass(frozen=True, slots=True)
class MapFrame:
    """The chosen part of a map."""

    box: DegreeBox
    """West, south, east, north; degrees."""
    because: str
    """Reason of the choice, for messages."""
    origin: tuple[float, float]
    """Latitude and longitude of the frame's origin, degrees."""
    bounds: tuple[float, float, float, float]
    """West, south, east, north about the origin; metres."""
    notes: tuple[str, ...] = ()
    """Remarks about parts of the map outside of a box that the user did not request."""


def parse_box(text: str) -> DegreeBox:
    """Parse `W,S,E,N` in degrees. Raises `UsageError` if it is malformed or crosses the antimeridian."""
    hint = "give west,south,east,north in degrees: --bbox=121.49,31.22,121.52,31.25"
    try:
        west, south, east, north = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"`{text}` is not a bounding box", hint=hint) from None
    if not (-180.0 <= west <= 180.0 and -180.0 <= east <= 180.0 and -90.0 <= south <= 90.0 and -90.0 <= north <= 90.0):
        raise UsageError(f"the bounding box `{text}` is not on Earth", hint=hint)
    if south >= north:
        raise UsageError(f"the bounding box `{text}` is empty: its south is not below its north", hint=hint)
    if west >= east:
        why = "it is empty" if west == east else "its west is east of its east, so it would cross the antimeridian"
        raise UsageError(f"the bounding box `{text}` cannot be used: {why}", hint=hint)
    return west, south, east, north


def choose(data: MapData, box: DegreeBox | None) -> MapFrame:
    """Choose the frame of a map: the requested box, else the part that the file states, else around its buildings or
    roads.

    Raises `UsageError` if the part crosses the antimeridian, is too large, or has no data.
    """
    if box is not None:
        _check_data(data, box)
        return frame_of(box, "requested")
    if data.box is None:
        return _around(data)
    fault = _fault(data, data.box)
    if fault:
        frame = _around(data)
        remark = f"the file states {fault} ({_text(data.box)}), which was ignored"
        return replace(frame, notes=(*frame.notes, remark))
    frame = frame_of(data.box, "stated in the file")
    return replace(
        frame, notes=_left_outside(data, data.box, frame.because, {"building": _is_built, "road": _is_street})
    )


def _fault(data: MapData, box: DegreeBox) -> str:
    """The fault of a stated part that does not describe the file's content; empty without a fault."""
    west, south, east, north = box
    if west == east or south >= north:
        return "an empty part"
    if (west, south, east, north) == WORLD:
        return "the whole Earth as its part"
    return "" if west > east or any(_holds(box, place) for place in data.nodes.values()) else "a part without data"


def _check_data(data: MapData, box: DegreeBox) -> None:
    if not any(_holds(box, place) for place in data.nodes.values()):
        covers = ",".join(f"{value:.4f}" for value in _bounds(data.nodes.values()))
        raise UsageError(f"the bounding box {_text(box)} lies outside the map", hint=f"it covers {covers} (W,S,E,N)")


def frame_of(box: DegreeBox, because: str) -> MapFrame:
    """The frame about a box's centre. Raises `UsageError` if it is too large or small for a city, or near a pole."""
    west, south, east, north = box
    if max(abs(south), abs(north)) > FARTHEST_DEG:
        raise UsageError(
            f"the map reaches to {max(south, north, key=abs):.4f} degrees of latitude ({because}); beyond "
            f"{FARTHEST_DEG:g} one frame does not fit",
            hint=f"choose a part farther from the pole: {_PART}",
        )
    if east <= west or east - west > 180.0:
        raise UsageError(
            "the map lies on both sides of the antimeridian (180 degrees), where one frame does not fit",
            hint=f"choose one side: {_PART}",
        )
    origin = (south + north) / 2.0, (west + east) / 2.0
    rim = [from_geodetic(lat, lon, origin) for lat in (south, origin[0], north) for lon in (west, origin[1], east)]
    bounds = geometry2d.bounds(rim)
    wide, high = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if max(wide, high) > LARGEST_M:
        raise UsageError(
            f"{wide / 1000:.0f} by {high / 1000:.0f} km ({because}) is more than a city of {LARGEST_M / 1000:.0f} km",
            hint=f"choose a part of it: {_PART}",
        )
    if min(wide, high) < SMALLEST_M:
        raise UsageError(
            f"the map is {wide:.1f} by {high:.1f} m ({because}): too small for a city",
            hint=f"choose a larger part: {_PART}",
        )
    west_m, south_m, east_m, north_m = (round(value, 3) for value in bounds)
    return MapFrame(box, because, origin, (west_m, south_m, east_m, north_m))


# -- private


def _around(data: MapData) -> MapFrame:
    """The frame around buildings, roads or all data.

    The outermost nodes decide only in the last case: extracts keep whole ways, so a river may extend 50 km.
    """
    built, driven = _places(data, "building"), _places(data, "highway")
    if len(built) > 2:
        return _among(data, _grown(_bounds(built)))
    if len(driven) > 2:
        return frame_of(_grown(_bounds(driven)), "around its roads")
    return frame_of(_grown(_bounds(data.nodes.values())), "around all its data")


def _among(data: MapData, box: DegreeBox) -> MapFrame:
    """The frame around buildings, enlarged to the streets near them if none runs among them. Notes name what is
    outside.
    """
    roads = [way for way in data.ways if _is_street(way)]
    frame = frame_of(box, "around its buildings")
    if roads and all(_is_outside(data, road, box) for road in roads):
        reach = _grown(box, REACH_DEG)
        near = [place for road in roads for place in _nodes(data, road) if _holds(reach, place)]
        if near:
            west, south, east, north = _grown(_bounds(near))
            box = min(box[0], west), min(box[1], south), max(box[2], east), max(box[3], north)
            frame = frame_of(box, "around its buildings and the streets near them")
    return replace(frame, notes=_left_outside(data, box, frame.because, {"road": _is_street}))


def _left_outside(data: MapData, box: DegreeBox, because: str, kinds: Mapping[str, _Choice]) -> tuple[str, ...]:
    """A note about objects wholly outside of a part, with the box that would include them; empty without any."""
    counts, corners = [], [(box[1], box[0]), (box[3], box[2])]
    for kind, chosen in kinds.items():
        lines = [_nodes(data, way) for way in data.ways if chosen(way) and _is_outside(data, way, box)]
        lines = [line for line in lines if line]
        corners += [place for line in lines for place in line]
        if lines:
            counts.append(f"{len(lines)} {kind}" + ("s" if len(lines) > 1 else ""))
    if not counts:
        return ()
    lie = "lies" if counts[0].startswith("1 ") and len(counts) == 1 else "lie"
    remark, wide = f"{' and '.join(counts)} {lie} outside the part {because}", _grown(_bounds(corners))
    try:
        frame_of(wide, because)
    except UsageError:
        return (f"{remark}, too far away to be built with it",)
    return (f"{remark}; the box with all is --bbox={','.join(f'{value:.4f}' for value in wide)}",)


def _is_street(way: Way) -> bool:
    return way.tags.get("highway") in VEHICLES


def _is_built(way: Way) -> bool:
    return is_set(way.tags, "building")


def _places(data: MapData, key: str) -> list[tuple[float, float]]:
    refs = {ref for way in data.ways if key in way.tags for ref in way.nodes}
    return [data.nodes[ref] for ref in sorted(refs) if ref in data.nodes]


def _nodes(data: MapData, way: Way) -> list[tuple[float, float]]:
    return [data.nodes[ref] for ref in way.nodes if ref in data.nodes]


def _is_outside(data: MapData, way: Way, box: DegreeBox) -> bool:
    return not any(_holds(box, place) for place in _nodes(data, way))


def _holds(box: DegreeBox, place: tuple[float, float]) -> bool:
    return box[0] <= place[1] <= box[2] and box[1] <= place[0] <= box[3]


def _grown(box: DegreeBox, by: float = MARGIN_DEG) -> DegreeBox:
    west, south, east, north = box
    return west - by, south - by, east + by, north + by


def _bounds(places: Iterable[tuple[float, float]]) -> DegreeBox:
    latitudes, longitudes = zip(*places, strict=True)
    return min(longitudes), min(latitudes), max(longitudes), max(latitudes)


def _text(box: DegreeBox) -> str:
    return ",".join(f"{value:g}" for value in box)
