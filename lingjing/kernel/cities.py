"""The city of an instance, and the instance with its entities placed in that city."""

from __future__ import annotations

import hashlib

import msgspec
from msgspec.structs import replace

from lingjing.errors import UsageError
from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.scene.own_models import with_own_models

MAP_SCENE = "map"
"""The kind of scene that is read from a file."""

MOST_PLACES = 8
"""Largest number of placed instances in the cache; the oldest entry is evicted. Chosen."""

ON_ROADS = ("traffic", "pedestrians", "cyclists", "signals")
"""Options of a scene for which the road engine plays."""

_placed: dict[bytes, tuple[Instance, City]] = {}


class CityBuilder:
    """Builds the cities of successive episodes. It keeps the last one, since successive episodes usually share it."""

    def __init__(self, host: PluginHost) -> None:
        self._host = host
        self._last: tuple[SceneSpec, City] | None = None

    def place(self, instance: Instance, *, imported: bool = False, hold: bool = False) -> tuple[Instance, City]:
        """Return the instance with its entities on roads, roofs and ground of its city, and the city.

        Entities of an `imported` document may be moved farther than a mission allows. With `hold` the result is cached
        for this process and its forks, except for scenes on a map: its file may change.

        Raises `UsageError` for a scene that no plug-in offers or a model that cannot be read, `PluginError` if the
        scene cannot be built, `MissionError` if an entity has no place.
        """
        instance = with_own_models(instance)
        key = _key(instance, imported=imported) if hold or _placed else b""
        if key in _placed:
            placed, city = _placed[key]
            return replace(placed, engine_options=instance.engine_options), city
        city = self._city(instance.scene)
        _check_roads(instance, city)
        placed = anchor(instance, city, imported=imported)
        if hold and instance.scene.kind != MAP_SCENE:
            _placed[key] = placed, city
            while len(_placed) > MOST_PLACES:
                del _placed[next(iter(_placed))]
        return placed, city

    def _city(self, spec: SceneSpec) -> City:
        if self._last is None or self._last[0] != spec:
            self._last = spec, build_city(spec, self._host)
        return self._last[1]


def _check_roads(instance: Instance, city: City) -> None:
    """Raise `UsageError` if the scene wants something on the roads of a map that has none."""
    options = instance.scene.options
    wanted = [f"`{name}`" for name in ON_ROADS if options.get(name)]
    if instance.scene.kind == MAP_SCENE and wanted and not city.network:
        raise UsageError(
            f"the scene `{city.id}` has no roads for {', '.join(wanted)}",
            hint="remove it, or choose a map with streets",
        )


def _key(instance: Instance, *, imported: bool) -> bytes:
    """Return the hash of all that determines the placement: the instance without the engines' options."""
    return hashlib.sha256(msgspec.msgpack.encode((replace(instance, engine_options={}), imported))).digest()
