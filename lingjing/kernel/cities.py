"""The city of an instance, and the instance with its entities placed in that city."""

from __future__ import annotations

from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City


class CityBuilder:
    """Builds the cities of successive episodes. The last one is kept, since most episodes share it."""

    def __init__(self, host: PluginHost) -> None:
        self._host = host
        self._last: tuple[SceneSpec, City] | None = None

    def place(self, instance: Instance, *, imported: bool = False) -> tuple[Instance, City]:
        """The instance with its entities on roads, roofs and ground of its city, and the city.

        Those of an `imported` document may be moved farther than a mission allows. Raises `UsageError` for a scene that
        nobody offers, `PluginError` for one that cannot be built, `MissionError` where something has no place.
        """
        city = self._city(instance.scene)
        return anchor(instance, city, imported=imported), city

    def _city(self, spec: SceneSpec) -> City:
        if self._last is None or self._last[0] != spec:
            self._last = spec, build_city(spec, self._host)
        return self._last[1]
