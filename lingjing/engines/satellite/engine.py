"""The satellite engine: all satellites of an episode behind the engine contract."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

from lingjing.engines.satellite.earth import Horizon
from lingjing.engines.satellite.orbit import DAY_S, JulianDate, Orbit, from_lines, instant
from lingjing.engines.satellite.passes import PassSearch, passing
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.vocabulary import PHOTO
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.requests import Refusal
from lingjing.scene.city import City
from lingjing.scene.outlines import compass
from lingjing.trace.records import BodyState, Command

DEFAULT_EPOCH = "2026-03-20T12:00:00Z"
"""Simulation time 0 if no other epoch is declared (chosen)."""

SWATH_M = 20_000.0
"""Swath of an entity without the property `swath_m`, metres (chosen)."""

SatelliteStatus = Literal["in_view", "out_of_view", "below_horizon"]
"""The status words of a satellite; `kinds.json` lists them for the checker."""


class SatelliteEngine(FleetEngine):
    """The engine of all satellites.

    Positions are exact at every boundary. Begin and end of passes are detected at whole seconds. The engine draws no
    random numbers, so the seed is not used.
    """

    step_s = 1.0

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Read the elements of each satellite, or make an orbit that passes over the scene."""
        owned = spec.owned()
        orbits = {entity.id: _declared_orbit(entity) for entity in owned}
        start = _start(spec.instance, owned, [orbit for orbit in orbits.values() if orbit is not None])
        origin = Horizon.at(*city.origin)
        region = origin.shifted(*_aim(spec.instance))
        whole = spec.instance.budget.ticks * spec.instance.clock.tick_s
        without_elements = [entity.id for entity in owned if orbits[entity.id] is None]
        self._watches: dict[str, PassSearch] = {}
        for entity in owned:
            orbit = orbits[entity.id]
            if orbit is None:
                share = (without_elements.index(entity.id) + 1) / (len(without_elements) + 1)
                orbit = passing(entity.id, start, origin, city.origin[0], share * whole)
            swath_km = entity.number_or("swath_m", SWATH_M) / 1000.0
            self._watches[entity.id] = PassSearch(orbit, start, origin, region, swath_km)
        self._in_view = {name: watch.sees(watch.view(0.0)) for name, watch in self._watches.items()}

    def start(self, command: Command) -> None:
        """Accept a picture, which the camera engine takes. Raises `Refusal` with `not_in_view` or `unknown_verb`."""
        watch = self._watches[command.resource]
        if command.verb != PHOTO:
            raise Refusal("unknown_verb", f"a satellite has no verb `{command.verb}`")
        now = self.clock.time_s
        view = watch.view(now)
        if not watch.sees(view):
            wait = watch.next_pass_s(now)
            when = f"for the next {DAY_S / 3600.0:.0f} h" if wait >= DAY_S else f"for another {wait:.0f} s"
            raise Refusal("not_in_view", f"`{command.resource}` does not see the region {when}")

    def step(self) -> None:
        """Detect passes that begin and end. A requested picture completes within the step."""
        now = self.clock.now_s
        for name, watch in self._watches.items():
            self.requests.complete(name, now)
            sees = watch.sees(watch.view(now))
            if sees != self._in_view[name]:
                self._in_view[name] = sees
                self.emit("in_view" if sees else "out_of_view", name)

    def states(self) -> Iterable[BodyState]:
        """Return the present states of all satellites."""
        return (self._state(name, watch) for name, watch in self._watches.items())

    def close(self) -> None:
        """Drop the orbits."""
        self._watches = {}

    def _state(self, name: str, watch: PassSearch) -> BodyState:
        time_s = self.clock.time_s
        view = watch.view(time_s)
        east, north, up = view.region
        risen = view.elevation_deg > 0.0
        course = math.atan2(-east, -north) if risen else math.atan2(view.velocity[0], view.velocity[1])
        status: SatelliteStatus = "in_view" if watch.sees(view) else "out_of_view" if risen else "below_horizon"
        x, y, z = (1000.0 * part for part in view.position)
        vx, vy, vz = (1000.0 * part for part in view.velocity)
        return BodyState(
            id=name,
            position=(x, y, z),
            velocity=(vx, vy, vz),
            heading_deg=compass(math.degrees(course)),
            pitch_deg=-view.elevation_deg if risen else 0.0,
            status=status,
            resources={
                "elevation_deg": view.elevation_deg,
                "range_m": 1000.0 * math.hypot(east, north, up),
                "next_pass_s": watch.next_pass_s(time_s),
            },
        )


def _declared_orbit(entity: Entity) -> Orbit | None:
    """Return the orbit of an entity's elements; None if it has none."""
    lines = [str(entity.properties.get(name) or "") for name in ("tle1", "tle2")]
    return from_lines(entity.id, *lines) if any(lines) else None


def _start(instance: Instance, owned: Iterable[Entity], orbits: Iterable[Orbit]) -> JulianDate:
    """Return the instant of simulation time 0; the package's docstring lists the candidates."""
    for text in (instance.scene.options.get("epoch"), *(entity.properties.get("epoch") for entity in owned)):
        if text:
            return instant(str(text))
    epochs = [orbit.epoch for orbit in orbits]
    return max(epochs, key=lambda epoch: epoch.day + epoch.fraction, default=instant(DEFAULT_EPOCH))


def _aim(instance: Instance) -> tuple[float, float]:
    """Return the middle of the mission's public regions, (east, north) metres; the origin if there are none."""
    points = [point for region in instance.regions if not region.hidden for point in region.polygon]
    if not points:
        return 0.0, 0.0
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return 0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys))
