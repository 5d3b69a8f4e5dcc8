"""`CommandLimits`: the bounds to which the numbers of a command are clipped at the position of its resource.

Each bound has one source. The mission declares the range of an argument and the altitude band; the engine's
`kinds.json` has the least values that it admits; `lingjing.scene.flight_floor` has the lowest point to which a flying
body may be sent, which the engine checks too.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.kernel.registry import Registry
from lingjing.mission.instance import ArgumentSpec, Datum, Entity, Instance, Vector, VerbSpec
from lingjing.mission.kinds import admitted, engine_kind
from lingjing.plugins.decisions import altitude_band, argument_bounds
from lingjing.scene.city import City
from lingjing.scene.flight_floor import FlightFloor
from lingjing.scene.terrain import Terrain

_UNBOUNDED = (float("-inf"), float("inf"))


class CommandLimits:
    """The limits of every resource of one instance. Without a city, elevations have no floor."""

    def __init__(self, instance: Instance, city: City | None) -> None:
        terrain = None if city is None else Terrain(city)
        self._floors = {
            entity.id: FlightFloor(terrain, entity, rule)
            for entity in instance.entities
            if terrain is not None and entity.verbs and (rule := engine_kind(entity.engine).floor) is not None
        }

    def clipped(
        self, verb: VerbSpec, arguments: Mapping[str, Datum], entity: Entity, registry: Registry
    ) -> tuple[dict[str, Datum], str]:
        """Return the arguments within their limits, with defaults, and a note on the changes ("" without changes)."""
        values: dict[str, Datum] = {}
        notes: list[str] = []
        for spec in admitted(verb, engine_kind(entity.engine)).arguments:
            value = arguments.get(spec.name)
            if value is None:
                value = spec.default
            if value is None:
                continue
            if isinstance(value, int | float):
                low, high = self._bounds(
                    verb, spec, entity, registry.states[entity.id].position, {**arguments, **values}
                )
                inside = min(max(float(value), low), high)
                if inside != value:
                    notes.append(f"`{spec.name}` {value:g} → {inside:g}")
                value = inside
            values[spec.name] = value
        return values, ", ".join(notes)

    def _bounds(
        self, verb: VerbSpec, spec: ArgumentSpec, entity: Entity, here: Vector, others: Mapping[str, Datum]
    ) -> tuple[float, float]:
        """Return the limits of one argument of a resource at `here`; `others` are the command's other arguments.

        The altitude band and the floor bound only lengths; the speed of a climb does not depend on them.
        """
        kind, (low, high) = engine_kind(entity.engine), argument_bounds(spec, entity.properties)
        if spec.unit != "m":
            return low, high
        lowest, highest = altitude_band(entity.properties) or _UNBOUNDED
        if verb.motion == "down":
            lowest = max(lowest, self._beneath(entity, here))
            return low, max(0.0, min(high, here[2] - lowest))
        if verb.motion == "up":
            high = max(0.0, min(high, highest - here[2]))
            return max(low, min(high, self._beneath(entity, here) - here[2])), high
        if kind.is_above_start(verb.name, spec.name):
            return max(low, lowest - here[2]), min(high, max(low, highest - here[2]))
        if verb.motion == "straight" and spec.name == "z":
            return max(low, self._at(entity, here, others)), high
        return low, high

    def _beneath(self, entity: Entity, here: Vector) -> float:
        floor = self._floors.get(entity.id)
        return _UNBOUNDED[0] if floor is None else floor.beneath(*here)

    def _at(self, entity: Entity, here: Vector, arguments: Mapping[str, Datum]) -> float:
        """Return the lowest elevation at the destination of a command, or at the resource if it names none."""
        floor = self._floors.get(entity.id)
        x, y = arguments.get("x", here[0]), arguments.get("y", here[1])
        if floor is None or not isinstance(x, int | float) or not isinstance(y, int | float):
            return _UNBOUNDED[0]
        return floor.at(x, y)
