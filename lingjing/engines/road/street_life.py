"""Pedestrians and visible traffic lights: the scene's options `pedestrians` and `signals`.

Pedestrians are SUMO's own: they walk on sidewalks, wait at lights and cross on crossings, where drivers give way. A
pedestrian near the end of its way gets a new destination, so people do not appear or vanish in view. Signals are bodies
without a size that show the state of SUMO's traffic lights at the stop lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from lingjing.engines.road.simulation import Simulation, SumoError
from lingjing.mission.seeding import Stream
from lingjing.scene.camera_geometry import bearing_deg, heading_vector
from lingjing.scene.outlines import compass
from lingjing.trace.records import BodyState

_SPEEDS_MPS = (0.95, 1.15, 1.34, 1.53, 1.75)
"""Walking speeds, m/s: five quantiles of the normal distribution with mean 1.34 and deviation 0.26 (Weidmann,
Transporttechnik der Fussgaenger, 1993)."""

_TRIES = 30
"""Draws of a start or destination before a pedestrian is left out (chosen)."""

_ROUND_S = 1.0
"""Time in which every pedestrian is checked once, seconds (chosen)."""

_ASIDE_M = 0.8
"""Distance of a signal from the edge of the rightmost lane, metres (chosen)."""

Floor = Callable[[float, float, float], float]
"""Function that returns the elevation of the ground or slab at (east, north) below an elevation, metres."""

_COLOURS = (("Gg", "signal_green"), ("yY", "signal_amber"))
"""SUMO's letters of a signal, and the kind of body that shows them; any other letter shows red."""


@dataclass(slots=True)
class _Walker:
    """A pedestrian of the background traffic."""

    id: str
    """Id in the simulation."""
    last: str
    """Edge at which its way ends."""


class Pedestrians:
    """The pedestrians of an episode, drawn from one random stream."""

    def __init__(self, sim: Simulation, seed: int, floor: Floor) -> None:
        self._sim = sim
        self._floor = floor
        self._stream = Stream(seed, "road/pedestrians")
        self._walkers: list[_Walker] = []
        self._turn = 0
        self._round = round(_ROUND_S / sim.step_s)
        self._sidewalks = _sidewalks(sim)
        for number, speed in enumerate(_SPEEDS_MPS):
            sim.vehicletype.copy("DEFAULT_PEDTYPE", f"walker/{number}")
            sim.vehicletype.setMaxSpeed(f"walker/{number}", speed)

    def populate(self, count: int) -> None:
        """Place up to `count` pedestrians at random places of the sidewalks."""
        for number in range(count if len(self._sidewalks) > 1 else 0):
            self._add(f"walker/{number + 1}", number % len(_SPEEDS_MPS))

    def step(self) -> None:
        """Give new destinations to those near the end of their way, a share of them in each step."""
        for walker in self._walkers[self._turn :: self._round]:
            try:
                if self._sim.person.getRemainingStages(walker.id) <= 1:
                    self._send_on(walker)
            except SumoError:  # SUMO has not inserted it yet
                continue
        self._turn = (self._turn + 1) % self._round

    def states(self, ahead_s: float) -> Iterator[BodyState]:
        """Return the states of all pedestrians, `ahead_s` after the last step."""
        people, there = self._sim.person, frozenset(self._sim.person.getIDList())
        for walker in self._walkers:
            if walker.id in there:
                x, y, z = people.getPosition3D(walker.id)
                speed, heading = people.getSpeed(walker.id), compass(people.getAngle(walker.id))
                east, north = (speed * part for part in heading_vector(heading))
                x, y = x + east * ahead_s, y + north * ahead_s
                yield BodyState(
                    id=walker.id,
                    position=(x, y, self._floor(x, y, z + 0.5)),
                    velocity=(east, north, 0.0),
                    heading_deg=heading,
                    status="walking" if speed > 0.0 else "standing",
                    kind="person",
                )

    def _add(self, name: str, kind: int) -> None:
        start = self._sidewalks[self._stream.below(len(self._sidewalks))]
        walker = _Walker(name, start)
        at_m = self._stream.unit() * max(self._sim.lane.getLength(f"{start}_0") - 1.0, 0.0)
        self._sim.person.add(name, start, at_m, typeID=f"walker/{kind}")
        if self._send_on(walker):
            self._walkers.append(walker)
        else:
            self._sim.person.remove(name)

    def _send_on(self, walker: _Walker) -> bool:
        """Append a way to another sidewalk; return False if there is none."""
        for _ in range(_TRIES):
            goal = self._sidewalks[self._stream.below(len(self._sidewalks))]
            if goal == walker.last:
                continue
            way = self._sim.simulation.findIntermodalRoute(walker.last, goal)
            if way and all(stage.edges for stage in way):
                for stage in way:
                    self._sim.person.appendStage(walker.id, stage)
                walker.last = goal
                return True
        return False


@dataclass(frozen=True, slots=True)
class _Signal:
    """The signal of one approach to a junction."""

    id: str
    """Id of its body."""
    light: str
    """Id of the traffic light."""
    links: tuple[int, ...]
    """Indices of the approach's links in the state of the light."""
    position: tuple[float, float, float]
    """Foot of its pole, metres."""
    heading_deg: float
    """Direction in which it shines: against the traffic."""


class Signals:
    """The signals at the stop lines of all junctions with traffic lights."""

    def __init__(self, sim: Simulation, floor: Floor) -> None:
        self._sim = sim
        self._signals = tuple(_signals(sim, floor))

    def states(self) -> Iterator[BodyState]:
        """Return the signals as bodies; the kind is the colour."""
        letters = {light: self._sim.trafficlight.getRedYellowGreenState(light) for light in self._lights()}
        for signal in self._signals:
            shown = {letters[signal.light][link] for link in signal.links}
            kind = next((kind for marks, kind in _COLOURS if shown & set(marks)), "signal_red")
            yield BodyState(id=signal.id, position=signal.position, heading_deg=signal.heading_deg, kind=kind)

    def _lights(self) -> frozenset[str]:
        return frozenset(signal.light for signal in self._signals)


def _sidewalks(sim: Simulation) -> tuple[str, ...]:
    """Return the edges with a sidewalk as their rightmost lane, in the network's order."""
    lanes = (name for name in sim.lane.getIDList() if not name.startswith(":") and name.endswith("_0"))
    return tuple(sim.lane.getEdgeID(name) for name in lanes if tuple(sim.lane.getAllowed(name)) == ("pedestrian",))


def _signals(sim: Simulation, floor: Floor) -> Iterator[_Signal]:
    for light in sim.trafficlight.getIDList():
        approaches: dict[str, list[int]] = {}
        lanes: dict[str, str] = {}
        for number, links in enumerate(sim.trafficlight.getControlledLinks(light)):
            for lane, _, _ in links:
                if not lane.startswith(":"):  # a crossing's signal is for pedestrians
                    edge = sim.lane.getEdgeID(lane)
                    approaches.setdefault(edge, []).append(number)
                    lanes[edge] = min(lanes.get(edge, lane), lane)
        for edge, links in approaches.items():
            yield _at_stop_line(sim, floor, light, lanes[edge], tuple(links))


def _at_stop_line(sim: Simulation, floor: Floor, light: str, lane: str, links: tuple[int, ...]) -> _Signal:
    before, end = sim.lane.getShape(lane)[-2:]
    heading = bearing_deg(before, end)
    aside = sim.lane.getWidth(lane) / 2.0 + _ASIDE_M
    right = math.radians(heading + 90.0)
    x, y = end[0] + aside * math.sin(right), end[1] + aside * math.cos(right)
    index = int(lane.rpartition("_")[2])
    up = sim.simulation.convert3D(sim.lane.getEdgeID(lane), sim.lane.getLength(lane), index)[2]
    return _Signal(f"signal/{light}/{links[0]}", light, links, (x, y, floor(x, y, up + 0.5)), compass(heading + 180.0))
