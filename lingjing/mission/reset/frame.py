"""The frame of a `resetScenario`: the unit of its lengths, the scene's origin in degrees, the height that counts as 0.

All are given in the `lingjing` object (`unit`, `origin`, `datum_m`). Otherwise they are inferred, with a note, if the
document's area differs from its template's: the origin from its degrees, the datum from the lowest entity on the
ground. `lingjing.mission.reset.unit` decides the unit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from lingjing.errors import Fault
from lingjing.mission import frames
from lingjing.mission.instance_entities import FARTHEST_M
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import HiddenEntries
from lingjing.mission.reset.shapes import LISTS, Coordinates
from lingjing.mission.reset.unit import (
    CENTIMETRE_M,
    CROWDED_M,
    METRE_M,
    WIDEST_M,
    bodies_of,
    note_system,
    stated_fault,
    unit_of,
)

FAR_M = 20_000.0
"""Distance from the origin beyond which a place is noted, and beyond which degrees define the origin, metres (chosen):
a scene is a few kilometres wide."""


_NULL_ISLAND_DEG = 0.1
"""Degrees nearer to 0, 0 than this are relative to X = Y = 0 (chosen): no mission lies in the Gulf of Guinea."""

LOW_M = -100.0
"""Smallest plausible height above a scene's datum, metres (chosen). A height outside of these bounds has another
reference."""
GROUND_HIGH_M = 80.0
"""Largest plausible height of entities on the ground or water, metres (chosen: a bridge's deck is at 80 m at most)."""
HIDDEN_HIGH_M = 450.0
"""Largest plausible height of hidden places, metres (chosen: a building is at most 400 m high)."""
_ROTOR_HIGH_M = 1_000.0
"""Largest plausible height if only multirotors fly, metres (chosen)."""
_FLYING_HIGH_M = 3_000.0
"""Largest plausible height of other aircraft, metres (chosen)."""

ON_THE_GROUND = ("quadruped", "road", "vessel")
"""Engines of entities on the ground or water."""
FLYING = ("multirotor", "plane")
"""Engines of aircraft."""


class DocumentFrame(msgspec.Struct, frozen=True):
    """The conversion of a document's coordinates to metres."""

    origin: tuple[float, float]
    """Latitude and longitude of X = Y = 0, degrees."""
    datum_m: float = 0.0
    """Subtracted from heights, metres."""
    alt_datum_m: float | None = None
    """Subtracted from heights in `alt` if these have another reference than `Z`, metres."""
    unit_m: float = CENTIMETRE_M
    """Unit of X, Y and Z, metres."""
    planar: bool = False
    """True if `lon` and `lat` hold X and Y in metres."""
    untied: bool = False
    """True if some places are in degrees that cannot be related to the X and Y of the others. This is reported."""

    def place(self, data: Coordinates) -> tuple[float, ...] | None:
        """East, north and, if given, elevation in metres; None without coordinates.

        X and Y have precedence over degrees. A height is read with either; of two heights, that of the same kind is
        used.
        """
        above = None if data.z is None else self.lengths(0.0, 0.0, data.z)[2] - self.datum_m
        alt_datum_m = self.datum_m if self.alt_datum_m is None else self.alt_datum_m
        alt = None if data.alt is None else data.alt - alt_datum_m
        if data.x is not None and data.y is not None:
            east, north, _ = self.lengths(data.x, data.y, 0.0)
            height = alt if above is None else above
        elif data.lon is not None and data.lat is not None:
            east, north = self._from_degrees(data.lon, data.lat)
            height = above if alt is None else alt
        else:
            return None
        if height is None:
            return east, north
        return east, north, round(height, 4) if self.datum_m or self.alt_datum_m else height

    def lengths(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """X, Y and Z as east, north and elevation, metres."""
        return (x, 0.0 - y, z) if self.unit_m == METRE_M else frames.from_unreal(x, y, z)

    def _from_degrees(self, lon: float, lat: float) -> tuple[float, float]:
        if self.planar:
            return lon, -lat
        east, north = frames.from_geodetic(lat, lon, self.origin)
        return round(east, 4), round(north, 4)


def frame_of(parsed: Parsed, hidden_entries: Sequence[HiddenEntries], origin: tuple[float, float]) -> DocumentFrame:
    """The frame of a document; `origin` is that of its template."""
    on_ground, hidden, flying = _places(parsed, hidden_entries)
    every = [*hidden, *on_ground, *flying]
    if (fault := stated_fault(parsed, every)) is not None:
        parsed.faults.append(fault)
    unit_m = unit_of(parsed, every)
    note_system(parsed)
    planar = unit_m == METRE_M and _are_planar(parsed, every)
    frame = DocumentFrame(origin, unit_m=unit_m, planar=planar)
    frame = _with_origin(parsed, every, frame)
    if unit_m == CENTIMETRE_M and not any("may be centimetres or metres" in each.message for each in parsed.faults):
        _note_crowded(parsed, every)
    extra = parsed.scenario.lingjing
    if extra is not None and extra.datum_m is not None:
        return msgspec.structs.replace(frame, datum_m=extra.datum_m)
    return _with_datum(parsed, frame, on_ground, hidden, flying)


# -- the origin ------------------------------------------------------------------------------------------------------


def _with_origin(parsed: Parsed, every: Sequence[Coordinates], frame: DocumentFrame) -> DocumentFrame:
    """The frame with the origin that the document states or that its degrees imply, if any."""
    extra = parsed.scenario.lingjing
    if extra is not None and extra.origin is not None:
        if -90.0 <= extra.origin[0] <= 90.0 and -180.0 <= extra.origin[1] <= 180.0:
            return msgspec.structs.replace(frame, origin=extra.origin)
        where = f"{parsed.at('lingjing')}.origin"
        parsed.report(where, "is no latitude and longitude", "write degrees: [39.83, 109.94]")
        return frame
    if frame.planar:
        return frame
    worked_out = _origin(every, frame)
    if worked_out is None:
        fault = _untied(parsed, every, frame.origin)
        if fault is None or parsed.faults:  # replaced invalid places may be the only cause
            _note_tie(parsed, every, frame)
            return frame
        parsed.faults.append(fault)
        return msgspec.structs.replace(frame, untied=True)
    parsed.notes.append(
        f"{parsed.path}: the scene's origin is assumed to be at {worked_out[0]:g}, {worked_out[1]:g}, where the "
        'document\'s degrees lie; "lingjing": {"origin": [latitude, longitude]} would state it'
    )
    return msgspec.structs.replace(frame, origin=worked_out)


def _note_tie(parsed: Parsed, every: Sequence[Coordinates], frame: DocumentFrame) -> None:
    """Note that some places are in degrees and some in X and Y, which the template's origin relates."""
    pairs = _degrees(every)
    if pairs and len(pairs) < len(every):
        latitude, longitude = frame.origin
        parsed.notes.append(
            f"{parsed.path}: X = Y = 0 is assumed to be at the template's {latitude:g}, {longitude:g}, near the "
            'document\'s degrees; "lingjing": {"origin": [latitude, longitude]} would state it'
        )


def untied_fault(parsed: Parsed, hidden_entries: Sequence[HiddenEntries], origin: tuple[float, float]) -> Fault | None:
    """The fault of a document with degrees that cannot be related to the X and Y of its other places, or None."""
    every = [data for group in _places(parsed, hidden_entries) for data in group]
    frame = DocumentFrame(origin)
    extra = parsed.scenario.lingjing
    tied = (extra is not None and extra.origin is not None) or _origin(every, frame) is not None
    return None if tied else _untied(parsed, every, origin)


def _are_planar(parsed: Parsed, places: Sequence[Coordinates]) -> bool:
    """True if `lon` and `lat` hold metres: together with X and Y in metres, as degrees they would not be in one scene.
    Adds a note."""
    pairs = _degrees(places)
    if len(pairs) < 2 or len(pairs) == len(places):
        return False
    middle = _middle(pairs)
    wide = max(max(map(abs, frames.from_geodetic(*pair, middle))) for pair in pairs)
    if 2.0 * wide <= WIDEST_M:
        return False
    parsed.notes.append(
        f"{parsed.path}: lon and lat are read as X and Y in metres: as degrees they lie {2.0 * wide / 1000:.0f} km "
        'apart; "lingjing": {"origin": [latitude, longitude]} would state that they are degrees'
    )
    return True


def _degrees(places: Iterable[Coordinates]) -> list[tuple[float, float]]:
    """Latitude and longitude of the places without X and Y."""
    return [
        (data.lat, data.lon)
        for data in places
        if data.lat is not None and data.lon is not None and (data.x is None or data.y is None)
    ]


def _middle(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The middle of the range of latitudes and longitudes."""
    latitudes, longitudes = zip(*pairs, strict=True)
    return (
        round((min(latitudes) + max(latitudes)) / 2.0, 7),
        round((min(longitudes) + max(longitudes)) / 2.0, 7),
    )


def _origin(places: Sequence[Coordinates], frame: DocumentFrame) -> tuple[float, float] | None:
    """The origin that puts the document's degrees into the scene; None if the template's origin does.

    A place with both spellings relates them. Otherwise the middle of all degrees is the middle of the scene.
    """
    pairs = _degrees(places)
    far = [pair for pair in pairs if max(map(abs, frames.from_geodetic(*pair, frame.origin))) > FAR_M]
    if not pairs or len(far) < len(pairs):  # single far places are noted; only if all are far, the scene is elsewhere
        return None
    for data in places:
        if None not in (data.x, data.y, data.lat, data.lon):
            east, north, _ = frame.lengths(data.x or 0.0, data.y or 0.0, 0.0)
            there = frames.to_geodetic(-east, -north, (data.lat or 0.0, data.lon or 0.0))
            return round(there[0], 7), round(there[1], 7)
    if len(pairs) == len(places):
        return _middle(pairs)
    # The others are lengths from X = Y = 0. Its degrees are unknown, unless all degrees are relative to it.
    return (0.0, 0.0) if all(max(map(abs, pair)) < _NULL_ISLAND_DEG for pair in pairs) else None


def _untied(parsed: Parsed, places: Sequence[Coordinates], origin: tuple[float, float]) -> Fault | None:
    """The fault of a document with some places in lengths and some in degrees far away from them, or None."""
    pairs = _degrees(places)
    if not pairs or len(pairs) == len(places):
        return None
    if min(max(map(abs, frames.from_geodetic(*pair, origin))) for pair in pairs) <= FAR_M:
        return None
    named = {id(body.data): body.path for body in bodies_of(parsed)}
    lengths = next((named.get(id(data), parsed.state_path) for data in places if data.x is not None), parsed.path)
    degrees = next((named.get(id(data), parsed.state_path) for data in places if data.x is None), parsed.path)
    return Fault(
        degrees,
        f"is in degrees and {lengths} in X and Y, and nothing relates the two",
        '"lingjing": {"origin": [latitude, longitude]} of X = Y = 0 does, or one place that has both',
    )


# -- heights ---------------------------------------------------------------------------------------------------------


def _with_datum(
    parsed: Parsed,
    frame: DocumentFrame,
    on_ground: Sequence[Coordinates],
    hidden: Sequence[Coordinates],
    flying: Sequence[Coordinates],
) -> DocumentFrame:
    """The frame with the height that is used as ground level, if heights cannot be above the scene's datum."""
    every = [*on_ground, *hidden, *flying]
    by_alt = [data for data in every if data.x is None or data.y is None]
    by_z = [data for data in every if data.x is not None and data.y is not None]
    lows = [min(heights) for group in (by_z, by_alt) if (heights := _heights(frame, group))]
    if len(lows) == 2 and abs(lows[0] - lows[1]) > HIDDEN_HIGH_M:
        parsed.notes.append(
            f"{parsed.path}: heights of Z begin at {lows[0]:g} m and those of alt at {lows[1]:g} m, which are both "
            'used as ground level; "lingjing": {"datum_m": metres} would state it'
        )
        return msgspec.structs.replace(frame, datum_m=lows[0], alt_datum_m=lows[1])
    heights = _heights(frame, [*on_ground, *hidden]) or _heights(frame, flying)
    highest_m = _FLYING_HIGH_M if parsed.scenario.equipment_list.plane_entity_list else _ROTOR_HIGH_M
    high_m = GROUND_HIGH_M if _heights(frame, on_ground) else HIDDEN_HIGH_M if _heights(frame, hidden) else highest_m
    if not heights or LOW_M <= min(heights) <= high_m or abs(min(heights)) > FARTHEST_M:
        return frame
    parsed.notes.append(
        f"{parsed.path}: heights begin at {min(heights):g} m, which is used as ground level; "
        '"lingjing": {"datum_m": metres} would state it'
    )
    return msgspec.structs.replace(frame, datum_m=min(heights))


def _places(
    parsed: Parsed, hidden_entries: Iterable[HiddenEntries]
) -> tuple[list[Coordinates], list[Coordinates], list[Coordinates]]:
    """The coordinates of entities on the ground or water, of hidden places and corners, and of aircraft."""
    hidden: list[Coordinates] = [target.place for field in hidden_entries for target in field.targets]
    hidden += parsed.task.initial_state.rescue_range
    on_ground: list[Coordinates] = []
    flying: list[Coordinates] = []
    for entity_list in LISTS:
        if entity_list.engine != "satellite":
            rows = getattr(parsed.scenario.equipment_list, entity_list.attribute)
            (on_ground if entity_list.engine in ON_THE_GROUND else flying).extend(row.data for row in rows)
    return on_ground, hidden, flying


def _note_crowded(parsed: Parsed, places: Sequence[Coordinates]) -> None:
    """Note that all X and Y, as centimetres, are so near to the origin that they may have another unit."""
    metres = [abs(value) / 100.0 for data in places for value in (data.x, data.y) if value is not None]
    farthest = max(metres, default=0.0)
    if len(metres) > 2 and 0.0 < farthest < CROWDED_M:
        parsed.notes.append(
            f"{parsed.path}: all X and Y lie within {farthest:.2g} m of the origin, as centimetres; "
            "are they metres or degrees?"
        )


def _heights(frame: DocumentFrame, places: Iterable[Coordinates]) -> list[float]:
    placed = (frame.place(data) for data in places)
    return [place[2] for place in placed if place is not None and len(place) == 3]
