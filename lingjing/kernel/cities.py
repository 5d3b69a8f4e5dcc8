"""The city of an instance, and the instance with its entities placed in that city."""

from __future__ import annotations

import hashlib

import msgspec
from msgspec.structs import replace

from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City

MAP = "map"
"""The kind of scene that is read from a file."""

MOST_PLACES = 8
"""Placed instances held at a time; the one that was held first goes first."""

_places: dict[bytes, tuple[Instance, City]] = {}


class CityBuilder:
    """Builds the cities of successive episodes. The last one is kept, since most episodes share it."""

    def __init__(self, host: PluginHost) -> None:
        self._host = host
        self._last: tuple[SceneSpec, City] | None = None

    def place(self, instance: Instance, *, imported: bool = False, hold: bool = False) -> tuple[Instance, City]:
        """The instance with its entities on roads, roofs and ground of its city, and the city.

        Those of an `imported` document may be moved farther than a mission allows. Raises `UsageError` for a scene that
        nobody offers, `PluginError` for one that cannot be built, `MissionError` where something has no place.

        With `hold` the result is kept for this process and for those that will be forked from it, but not on a map,
        whose file may change.
        """
        key = _key(instance, imported=imported) if hold or _places else b""
        if key in _places:
            placed, city = _places[key]
            return replace(placed, engine_options=instance.engine_options), city
        city = self._city(instance.scene)
        placed = anchor(instance, city, imported=imported)
        if hold and instance.scene.kind != MAP:
            _places[key] = placed, city
            while len(_places) > MOST_PLACES:
                del _places[next(iter(_places))]
        return placed, city

    def _city(self, spec: SceneSpec) -> City:
        if self._last is None or self._last[0] != spec:
            self._last = spec, build_city(spec, self._host)
        return self._last[1]


def _key(instance: Instance, *, imported: bool) -> bytes:
    """What decides where things stand: all but the options of engines."""
    return hashlib.sha256(msgspec.msgpack.encode((replace(instance, engine_options={}), imported))).digest()
