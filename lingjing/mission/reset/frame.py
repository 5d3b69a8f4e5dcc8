"""Where a `resetScenario` lies: the scene's origin in degrees, and the height in the document that counts as 0.

Both stand in the `lingjing` object (`origin`, `datum_m`), else they are worked out, with a note, where the document
lies elsewhere than its template: the origin from its degrees, the datum from the lowest thing on the ground.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence

import msgspec

from lingjing.mission import frames
from lingjing.mission.instance_entities import FARTHEST_M
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import Found
from lingjing.mission.reset.shapes import LISTS, Coordinates

FAR_M = 20_000.0
"""A scene is a few kilometres wide: what lies farther off is noted, and degrees farther off give the origin."""

NEAR_M = 10.0
"""Where all that a document places by centimetres lies within this of the origin, they may be metres or degrees."""

LOW_M = -100.0
GROUND_HIGH_M, HIDDEN_HIGH_M, FLYING_HIGH_M = 80.0, 450.0, 3_000.0
"""Heights over a scene's datum lie between these: of what walks, drives or floats (a bridge's deck is 80 m high), of
hidden places (a building is 400 m high) and of what flies. Beyond, they were measured from somewhere else."""

ON_THE_GROUND = ("quadruped", "road", "vessel")


class DocumentFrame(msgspec.Struct, frozen=True):
    """The origin's latitude and longitude in degrees, and what is taken off heights, metres."""

    origin: tuple[float, float]
    datum_m: float = 0.0

    def place(self, data: Coordinates) -> tuple[float, ...] | None:
        """East, north and, if given, elevation in metres; None without coordinates.

        Centimetres win over degrees; a height is read with either, of two the one of the same kind counts.
        """
        above = None if data.z is None else frames.from_unreal(0.0, 0.0, data.z)[2]
        if data.x is not None and data.y is not None:
            east, north, _ = frames.from_unreal(data.x, data.y, 0.0)
            height = data.alt if above is None else above
        elif data.lon is not None and data.lat is not None:
            east, north = frames.from_geodetic(data.lat, data.lon, self.origin)
            east, north = round(east, 4), round(north, 4)
            height = above if data.alt is None else data.alt
        else:
            return None
        return (east, north) if height is None else (east, north, self._over_datum(height))

    def _over_datum(self, height: float) -> float:
        return round(height - self.datum_m, 4) if self.datum_m else height


def frame_of(parsed: Parsed, found: Sequence[Found], origin: tuple[float, float]) -> DocumentFrame:
    """The frame of a document whose template has its origin at `origin`."""
    given = parsed.scenario.lingjing
    on_ground, hidden, flying = _places(parsed, found)
    every = [*hidden, *on_ground, *flying]
    frame = DocumentFrame(origin)
    if given is not None and given.origin is not None:
        if not (-90.0 <= given.origin[0] <= 90.0 and -180.0 <= given.origin[1] <= 180.0):
            where = f"{parsed.at('lingjing')}.origin"
            parsed.report(where, "is no latitude and longitude", "write degrees: [39.83, 109.94]")
        else:
            frame = DocumentFrame(given.origin)
    elif (worked_out := _origin(every, origin)) is not None:
        parsed.notes.append(
            f"{parsed.path}: the scene's origin is taken to be at {worked_out[0]:g}, {worked_out[1]:g}, where the "
            'document\'s degrees lie; "lingjing": {"origin": [latitude, longitude]} would say'
        )
        frame = DocumentFrame(worked_out)
    if given is not None and given.datum_m is not None:
        return DocumentFrame(frame.origin, given.datum_m)
    if (crowded := _crowded(every)) is not None:
        parsed.notes.append(
            f"{parsed.path}: all X and Y lie within {crowded:.2g} m of the origin, as centimetres; "
            "are they metres or degrees?"
        )
    heights = _heights(frame, [*on_ground, *hidden]) or _heights(frame, flying)
    high_m = (
        GROUND_HIGH_M if _heights(frame, on_ground) else HIDDEN_HIGH_M if _heights(frame, hidden) else FLYING_HIGH_M
    )
    if not heights or LOW_M <= min(heights) <= high_m or abs(min(heights)) > FARTHEST_M:
        return frame
    parsed.notes.append(
        f"{parsed.path}: heights begin at {min(heights):g} m, which is taken for the ground; "
        '"lingjing": {"datum_m": metres} would say'
    )
    return DocumentFrame(frame.origin, min(heights))


def _places(parsed: Parsed, found: Iterable[Found]) -> tuple[list[Coordinates], list[Coordinates], list[Coordinates]]:
    """The coordinates of what moves on the ground or the water, of hidden places and corners, and of what flies."""
    hidden: list[Coordinates] = [target.place for one in found for target in one.targets]
    hidden += parsed.task.initial_state.rescue_range
    on_ground: list[Coordinates] = []
    flying: list[Coordinates] = []
    for one in LISTS:
        if one.engine != "satellite":
            rows = getattr(parsed.scenario.equipment_list, one.attribute)
            (on_ground if one.engine in ON_THE_GROUND else flying).extend(row.data for row in rows)
    return on_ground, hidden, flying


def _crowded(places: Sequence[Coordinates]) -> float | None:
    """How far from the origin the farthest of several places lies, metres, where that is hardly anywhere."""
    given = [abs(one) / 100.0 for data in places for one in (data.x, data.y) if one is not None]
    farthest = max(given, default=0.0)
    return farthest if len(given) > 2 and 0.0 < farthest < NEAR_M else None


def _heights(frame: DocumentFrame, places: Iterable[Coordinates]) -> list[float]:
    found = (frame.place(data) for data in places)
    return [place[2] for place in found if place is not None and len(place) == 3]


def _origin(places: Sequence[Coordinates], origin: tuple[float, float]) -> tuple[float, float] | None:
    """Where the origin must be for the document's degrees to lie in the scene; None where the template's will do.

    A place with both spellings ties them together; else the middle of all degrees is the middle of the scene.
    """
    plain = [
        (data.lat, data.lon)
        for data in places
        if data.lat is not None and data.lon is not None and (data.x is None or data.y is None)
    ]
    far = [pair for pair in plain if max(map(abs, frames.from_geodetic(*pair, origin))) > FAR_M]
    if not plain or len(far) < len(plain):  # one that lies far off is noted, all of them are another place
        return None
    for data in places:
        if None not in (data.x, data.y, data.lat, data.lon):
            east, north, _ = frames.from_unreal(data.x or 0.0, data.y or 0.0, 0.0)
            there = frames.to_geodetic(-east, -north, (data.lat or 0.0, data.lon or 0.0))
            return round(there[0], 7), round(there[1], 7)
    if len(plain) < len(places):  # the others are in the template's centimetres
        return None
    return round(statistics.fmean(p[0] for p in plain), 7), round(statistics.fmean(p[1] for p in plain), 7)
