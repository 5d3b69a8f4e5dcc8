"""The road engine: the mission's vehicles, background traffic and queues in one SUMO simulation at 10 Hz."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace

from lingjing.engines.bodies import is_coarse
from lingjing.engines.road.congestion import Congestion, jam_of
from lingjing.engines.road.contact import Contacts
from lingjing.engines.road.driving_conditions import driving_conditions
from lingjing.engines.road.foreign_bodies import ForeignBodies
from lingjing.engines.road.graph import LanePoint, elevations, read_graph
from lingjing.engines.road.kerb import Kerb
from lingjing.engines.road.options import amount
from lingjing.engines.road.routing import edges_in
from lingjing.engines.road.simulation import COARSE_STEP_S, STEP_S, Simulation
from lingjing.engines.road.street_life import Pedestrians, Signals
from lingjing.engines.road.traffic import Occupied, Traffic
from lingjing.engines.road.vehicle import Vehicle
from lingjing.engines.road.verbs import PLANNING, Planner
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Entity
from lingjing.mission.seeding import integer
from lingjing.mission.vocabulary import ARRIVED, CLEARED, COLLIDED
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.stock import booked
from lingjing.scene.city import City
from lingjing.scene.network import with_sidewalks
from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import Tiles
from lingjing.trace.records import BodyState, Command

WARM_UP_S = 10.0
"""Time before time 0 in which background traffic starts while the mission's vehicles stand, seconds (chosen)."""

FARTHEST_ROAD_M = 2000.0
"""Largest distance of a vehicle's declared place from a road, metres (chosen)."""

_ROOM_S = 1.0
"""Time between two checks for vehicles that block others, seconds (chosen)."""

_ROOM_ROUNDS = 3
"""Successive checks after which a blocking vehicle must make room (chosen)."""


class RoadEngine(FleetEngine):
    """The engine of all road vehicles of an episode."""

    at_once = PLANNING

    def __init__(self) -> None:
        self._sim: Simulation | None = None

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Load the network, place all vehicles and let the traffic start.

        Raises `InfrastructureError` if the scene has no roads or a vehicle's place is too far from them.
        """
        self.close()
        owned = spec.owned()
        if not city.network:
            raise InfrastructureError(
                f"the scene `{city.id}` has no roads for {', '.join(spec.owns) or 'traffic'}",
                hint="choose a scene with streets, such as `residential`, `commercial` or `map`",
            )
        instance = spec.instance
        self._coarse = is_coarse(spec)
        self.step_s = COARSE_STEP_S if self._coarse else STEP_S
        walking = amount(instance, "pedestrians")
        network = with_sidewalks(city.network).path if walking else city.network
        sim = self._sim = Simulation(network, integer(seed, "road/simulation", bits=31), self.step_s)
        graph = read_graph(sim)
        self._schedule = spec.schedule
        kerb = Kerb(sim, graph, Tiles(city))
        self._vehicles = {entity.id: Vehicle(entity, sim, graph, kerb) for entity in owned}
        lowest, highest = elevations(sim, graph)
        sim.level = lowest == highest
        foreign = [entity for entity in instance.entities if entity.id not in spec.owns]
        self._foreign = ForeignBodies(sim, graph, foreign, highest)
        self._contacts = Contacts(sim, self._collided, background=amount(instance, "collisions") > 0)
        blockers = (entity for entity in instance.entities if entity.blocked_m is not None)
        self._congestion = Congestion(sim, graph, tuple(jam_of(entity, seed) for entity in blockers))
        self._planner = Planner(sim, graph, self.publish)
        self._outlines = {region.name: region.polygon for region in instance.regions}
        self._closed_regions: tuple[str, ...] = ()
        self._graph = graph
        self._cleared: set[str] = set()
        self._blocking_rounds: dict[str, int] = {}
        self._looked_s = self._shown_s = 0.0
        occupied = Occupied()
        for entity in owned:
            self._put(entity, occupied)
        count = amount(instance, "traffic")
        self._pedestrians = Pedestrians(sim, seed, Terrain(city).support) if walking else None
        self._signals = Signals(sim, Terrain(city).support) if amount(instance, "signals") else None
        self._traffic = Traffic(sim, graph, seed)
        for jam in self._congestion.jams:
            if self._schedule.present(jam.id, 0.0):
                self._congestion.appear(jam, occupied)
        self._update_weather(0.0)
        self._traffic.populate(count, occupied)
        self._traffic.populate_cyclists(amount(instance, "cyclists"), occupied)
        if self._pedestrians is not None:
            self._pedestrians.populate(walking)
        self._traffic.set_blocked(self._congestion.blocked)
        if count:  # bodies that stand on a road must be there before the traffic starts
            present = (entity for entity in foreign if self._schedule.present(entity.id, 0.0))
            self._foreign.look([self._standing(entity) for entity in present], 0.0)
        for _ in range(round(WARM_UP_S / self.step_s) if count or walking else 3):
            self._foreign.step(0.0)
            sim.step()
            self._step_background()

    def close(self) -> None:
        """End the simulation."""
        if self._sim is not None:
            self._sim.close()
            self._sim = None

    def start(self, command: Command) -> None:
        """Begin a command; raises `Refusal` if it cannot be carried out."""
        self._update_closures(self.clock.time_s)
        self._planner.start(self._vehicles[command.resource], command, self.clock.time_s)

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Take over the mirrors: bodies of other engines, goods on board, and cleared targets."""
        self._foreign.look(mirrors, self.clock.time_s)
        self._looked_s = self.clock.time_s
        self._cleared = {state.id for state in mirrors if state.status == CLEARED}
        book = booked(mirrors)
        for vehicle in self._vehicles.values():
            vehicle.stock.read(book)
            vehicle.update_load()
        self._update_weather(self.clock.time_s)
        self._update_jams(self.clock.time_s)
        self._update_closures(self.clock.time_s)

    def step(self) -> None:
        """Advance the simulation by one step."""
        assert self._sim is not None
        now = self.clock.now_s
        self._update_jams(now - self.step_s)
        self._foreign.step(now)
        if self.clock.done % round(_ROOM_S / self.step_s) == 0:
            self._make_room()
        for vehicle in self._vehicles.values():
            vehicle.prepare()
        self._sim.step()
        self._step_background()
        self._contacts.step(self._vehicles, self._foreign.bodies.values(), now - self._looked_s, now)
        standing = {vehicle.id for vehicle in self._vehicles.values() if vehicle.task is None}
        for vehicle in self._vehicles.values():
            self._report(vehicle, standing, now)

    def states(self) -> Iterable[BodyState]:
        """Return the states of the mission's vehicles."""
        ahead = self.clock.remainder_s
        return [vehicle.state(ahead) for vehicle in self._vehicles.values()]

    def ambient(self) -> Iterable[BodyState]:
        """Return the states of background traffic, then those of the queues, of pedestrians and of signals.

        With coarse motion they drive but are not shown: no camera draws them, and reading them takes most of the time.
        """
        if self._coarse:
            return ()
        ahead, after = self.clock.remainder_s, self.clock.time_s - self._shown_s
        self._shown_s = self.clock.time_s
        assert self._sim is not None
        there = frozenset(self._sim.vehicle.getIDList())
        people = self._pedestrians.states(ahead) if self._pedestrians is not None else ()
        signals = self._signals.states() if self._signals is not None else ()
        return [*self._traffic.states(there, ahead, after), *self._congestion.states(there, ahead), *people, *signals]

    def progress(self) -> Mapping[str, float]:
        """Return the share of each vehicle's task that is done, by remaining route, distance or speed."""
        shares = ((vehicle.id, vehicle.progress()) for vehicle in self._vehicles.values())
        return {name: max(0.0, share) for name, share in shares if share is not None}

    def _step_background(self) -> None:
        """Give new destinations to background vehicles and pedestrians after a step of the simulation."""
        self._traffic.step()
        if self._pedestrians is not None:
            self._pedestrians.step()

    def _report(self, vehicle: Vehicle, standing: Container[str], now_s: float) -> None:
        outcome = vehicle.step(standing)
        if outcome == "":
            return
        self.requests.complete(vehicle.id, now_s)
        if outcome == "arrived":
            self.emit(ARRIVED, vehicle.id, odometer_m=vehicle.odometer_m)

    def _standing(self, entity: Entity) -> BodyState:
        """Return the state of another engine's entity before its first mirror."""
        return BodyState(id=entity.id, position=entity.position, heading_deg=entity.heading_deg)

    def _put(self, entity: Entity, occupied: Occupied) -> None:
        x, y, _ = entity.position
        vehicle = self._vehicles[entity.id]
        place = self._graph.nearest(x, y, entity.heading_deg, FARTHEST_ROAD_M)
        if place is None:
            raise InfrastructureError(
                f"`{entity.id}` stands at ({x:.0f}, {y:.0f}), more than {FARTHEST_ROAD_M:g} m away from every road",
                hint="move it onto the map's roads, or let `on = road` find one",
            )
        place = _free_place(place, vehicle.size.length_m, occupied)
        vehicle.place(place)

    def _update_weather(self, time_s: float) -> None:
        """Let all drivers take over the weather, which changes at decision boundaries."""
        conditions = driving_conditions(self._schedule.weather(time_s))
        self._traffic.drive_in(conditions)
        for vehicle in self._vehicles.values():
            vehicle.drive_in(conditions)

    def _update_jams(self, time_s: float) -> None:
        for jam in self._congestion.jams:
            wanted = jam.id not in self._cleared and self._schedule.present(jam.id, time_s)
            if wanted != jam.blocking:
                (self._congestion.appear if wanted else self._congestion.clear)(jam)
                self._traffic.set_blocked(self._congestion.blocked | self._planner.closed)

    def _update_closures(self, time_s: float) -> None:
        """Close and open the roads of regions. A vehicle with a closed way takes another one, or halts."""
        regions = self._schedule.closed(time_s)
        if regions == self._closed_regions:
            return
        self._closed_regions = regions
        closed = (edges_in(self._graph, self._outlines[region]) for region in regions)
        self._planner.closed = frozenset().union(*closed)
        self._traffic.set_blocked(self._congestion.blocked | self._planner.closed)
        for vehicle in self._vehicles.values():
            if not self._planner.evade(vehicle, time_s):
                vehicle.halt()
                self.requests.fail(vehicle.id, time_s, "road_closed", f"the way of `{vehicle.id}` is closed")

    def _make_room(self) -> None:
        """Let vehicles make room.

        A vehicle without a task makes room if another vehicle has waited for it in each of the last checks. A vehicle
        that arrived and found no parking place makes room at once.
        """
        held = {vehicle.held_by for vehicle in self._vehicles.values()}
        for vehicle in self._vehicles.values():
            idle = vehicle.task is None and not vehicle.is_aside
            waiting = idle and (vehicle.id in held or vehicle.blocked_follower() != "")
            self._blocking_rounds[vehicle.id] = self._blocking_rounds.get(vehicle.id, 0) + 1 if waiting else 0
            blocks_others = self._blocking_rounds[vehicle.id] >= _ROOM_ROUNDS
            if vehicle.is_stranded or blocks_others:
                vehicle.make_room(blocks_others=blocks_others)

    def _collided(self, mover: str, other: str, speed_mps: float) -> None:
        self.emit(COLLIDED, mover, other, speed_mps=speed_mps)


def _free_place(place: LanePoint, length_m: float, occupied: Occupied) -> LanePoint:
    """Return the place itself, or the nearest free one along its lane if it is occupied."""
    lane = place.lane
    for number in range(200):
        offset = (number + 1) // 2 * (1.0 if number % 2 else -1.0)
        at = place.at_m + offset
        if 0.0 <= at <= lane.length_m and occupied.take(lane.id, at + length_m / 2.0, length_m, gap_m=0.5):
            return place if number == 0 else replace(place, at_m=at)
    occupied.add(lane.id, place.at_m + length_m / 2.0, length_m)
    return place
