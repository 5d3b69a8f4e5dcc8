"""The road engine on a small grid of streets: vehicles of the mission, traffic, queues and foreign bodies."""

import hashlib
import itertools
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import msgspec
import pytest
import shapely
import shapely.affinity

from lingjing.engines.road.engine import RoadEngine
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import (
    Clock,
    Datum,
    Entity,
    EventSpec,
    Instance,
    SceneSpec,
    StateSpec,
    VerbSpec,
)
from lingjing.plugins.conformance import check_engine
from lingjing.plugins.engine import Boundary, EnginePlugin, EngineSpec
from lingjing.scene.city import City, Lane, Road
from lingjing.scene.network import StreetEdge, StreetNode, build_network
from lingjing.scene.sizes import SIZES, Size
from lingjing.testing import bare_instance, declared
from lingjing.trace.records import BodyState, Command, Receipt, Route, TaskEvent

SPAN_M = 200.0
SIDE = 5
VERBS = ("setDestination", "forward", "left", "right", "stop")
Mirrors = Callable[[float], Sequence[BodyState]]


def grid(lanes: int = 1, control: str = "priority") -> City:
    """Return streets every 200 m from (0, 0) to (800, 800), in both directions."""
    nodes = [
        StreetNode(id=f"{column}{row}", east=column * SPAN_M, north=row * SPAN_M, control=control)
        for column in range(SIDE)
        for row in range(SIDE)
    ]
    edges = []
    for column in range(SIDE):
        for row in range(SIDE):
            for other in ((column + 1, row), (column, row + 1)):
                if max(other) < SIDE:
                    pair = (f"{column}{row}", f"{other[0]}{other[1]}")
                    edges += [
                        StreetEdge(id="-".join(ends), start=ends[0], end=ends[1], lanes=lanes)
                        for ends in (pair, pair[::-1])
                    ]
    network = build_network(nodes, edges)
    reach = (SIDE - 1) * SPAN_M
    return City(
        id="grid", origin=(31.0, 121.5), bounds=(0.0, 0.0, reach, reach), network=network.path, sha256=network.sha256
    )


def vehicle(
    name: str = "van",
    kind: str = "car",
    position: tuple[float, float] = (100.0, -1.65),
    heading_deg: float = 90.0,
    **properties: Datum,
) -> Entity:
    return declared(
        Entity(
            id=name,
            group=name,
            index=1,
            role="asset",
            type=kind,
            bases=() if kind == "car" else ("car",),
            engine="road",
            position=(*position, 0.0),
            heading_deg=heading_deg,
            properties={"speed_mps": 13.9, "load_kg": 0.0, "payload_kg": 400.0, **properties},
            verbs=tuple(VerbSpec(name=verb) for verb in VERBS),
            state=(StateSpec(name="load", unit="kg"),),
        )
    )


def jam(name: str = "jam", position: tuple[float, float] = (500.0, 0.0), dormant: bool = False) -> Entity:
    return Entity(
        id=name,
        group=name,
        index=1,
        role="target",
        type="congestion",
        engine="city",
        position=(*position, 0.0),
        properties={"blocks": True, "radius_m": 20.0},
        dormant=dormant,
    )


def other(name: str, kind: str, engine: str) -> Entity:
    """Return an entity of another engine; its mirrors give its position."""
    return declared(
        Entity(id=name, group=name, index=1, role="asset", type=kind, engine=engine, position=(0.0, 0.0, 0.0))
    )


def mission(
    entities: Sequence[Entity], traffic: int = 0, sync_s: float = 0.5, events: tuple[EventSpec, ...] = ()
) -> Instance:
    scene = SceneSpec(kind="grid", options={"traffic": float(traffic)})
    return bare_instance(entities, scene=scene, clock=Clock(tick_s=10.0, sync_s=sync_s), events=events)


def no_mirrors(time_s: float) -> Sequence[BodyState]:
    return ()


class Play:
    """Drives one engine by macro-steps and keeps its boundaries."""

    def __init__(self, instance: Instance, city: City, seed: int = 1) -> None:
        self.engine = RoadEngine()
        self.sync_s = instance.clock.sync_s
        owned = tuple(entity.id for entity in instance.entities if entity.engine == "road")
        self.boundary: Boundary = self.engine.reset(
            EngineSpec(engine="road", instance=instance, owns=owned), city, seed
        )
        self.history: list[Boundary] = [self.boundary]
        self.receipts: list[Receipt] = []
        self.events: list[TaskEvent] = []
        self.routes: list[Route] = []
        self.steps = 0

    @property
    def time_s(self) -> float:
        return self.steps * self.sync_s

    def command(self, verb: str, resource: str = "van", origin: str = "agent", **arguments: Datum) -> Receipt:
        command = Command(
            id=f"c{self.steps}-{verb}",
            tick=0,
            sender="test",
            resource=resource,
            verb=verb,
            arguments=arguments,
            origin=origin,  # type: ignore[arg-type]
        )
        (receipt,) = self.engine.submit((command,))
        return receipt

    def step(self, mirrors: Mirrors = no_mirrors) -> Boundary:
        seen = mirrors(self.time_s)
        self.steps += 1
        self.boundary = self.engine.advance(self.time_s, seen)
        self.history.append(self.boundary)
        self.receipts += self.boundary.receipts
        self.events += self.boundary.events
        self.routes += self.boundary.routes
        return self.boundary

    def run(self, seconds: float, mirrors: Mirrors = no_mirrors) -> Boundary:
        for _ in range(round(seconds / self.sync_s)):
            self.step(mirrors)
        return self.boundary

    def until_ended(self, request: str, limit_s: float = 200.0, mirrors: Mirrors = no_mirrors) -> Receipt:
        while self.time_s < limit_s:
            for receipt in self.step(mirrors).receipts:
                if receipt.request == request and receipt.status != "running":
                    return receipt
        raise AssertionError(f"{request} did not end within {limit_s} s: {self.boundary.states}")

    @property
    def state(self) -> BodyState:
        return self.boundary.states[0]

    def digest(self) -> str:
        return hashlib.sha256(msgspec.msgpack.encode(self.history)).hexdigest()


@pytest.fixture(scope="module")
def city() -> City:
    return grid()


@pytest.fixture
def play() -> Iterator[Callable[..., Play]]:
    plays: list[Play] = []

    def start(entities: Sequence[Entity], city: City, seed: int = 1, **settings: object) -> Play:
        for old in plays:
            old.engine.close()
        plays.append(Play(mission(entities, **settings), city, seed))  # type: ignore[arg-type]
        return plays[-1]

    yield start
    for old in plays:
        old.engine.close()


Start = Callable[..., Play]


def where(state: BodyState) -> tuple[float, float]:
    return state.position[0], state.position[1]


# -- standing


def test_vehicles_start_at_their_declared_positions(play: Start, city: City) -> None:
    played = play([vehicle(), vehicle("truck", "fire_truck", (201.65, 310.0), 0.0)], city)
    van, truck = played.boundary.states
    assert math.dist(where(van), (100.0, -1.65)) < 0.01
    assert math.dist(where(truck), (201.65, 310.0)) < 0.01
    assert (van.heading_deg, truck.heading_deg) == (90.0, 0.0)
    assert van.status == "parked"
    assert van.resources == {"load_kg": 0.0, "speed_mps": 0.0, "odometer_m": 0.0}
    played.run(10.0)
    assert math.dist(where(played.state), (100.0, -1.65)) < 0.01


def test_a_vehicle_off_the_road_is_placed_on_the_lane_of_its_heading(play: Start, city: City) -> None:
    west = play([vehicle(position=(300.0, 6.0), heading_deg=270.0)], city).state
    assert where(west) == pytest.approx((300.0, 1.65), abs=0.05)
    east = play([vehicle(position=(300.0, 6.0), heading_deg=90.0)], city).state
    assert where(east) == pytest.approx((300.0, -1.65), abs=0.05)


def test_two_vehicles_do_not_stand_in_one_place(play: Start, city: City) -> None:
    played = play([vehicle("a"), vehicle("b"), vehicle("c")], city)
    places = sorted(where(state)[0] for state in played.boundary.states)
    assert all(after - before >= 4.5 for before, after in itertools.pairwise(places))
    played.run(5.0)
    assert not played.events


# -- verbs


def test_set_destination_arrives_and_stays(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    receipt = played.command("setDestination", x=640.0, y=412.0)
    assert receipt.status == "accepted", receipt
    played.run(20.0)
    assert played.state.status == "driving"
    assert played.state.velocity[0] == pytest.approx(13.9, abs=0.1)
    shares = [receipt.progress for receipt in played.receipts]
    assert len(shares) == 2 and 0.05 < shares[0] < shares[1] < 0.6
    ended = played.until_ended(receipt.request)
    assert ended.status == "completed"
    assert [event.kind for event in played.events] == ["arrived"]
    assert math.dist(where(played.state), (640.0, 401.65)) < 3.0 or math.dist(where(played.state), (640.0, 398.35)) < 3
    played.run(3.0)
    rest = where(played.state)
    assert played.state.status == "arrived"
    played.run(30.0)
    assert where(played.state) == rest
    assert played.state.resources["odometer_m"] == pytest.approx(played.routes[0].length_m, abs=8.0)


def test_a_destination_just_behind_a_vehicle_is_reached_by_a_detour(play: Start, city: City) -> None:
    played = play([vehicle(position=(300.0, -1.65))], city)
    receipt = played.command("setDestination", x=285.0, y=-1.65)
    assert receipt.status == "accepted"
    assert played.until_ended(receipt.request).status == "completed"
    assert math.dist(where(played.state), (285.0, -1.65)) < 3.0
    assert played.state.resources["odometer_m"] > 700.0


def test_a_destination_at_the_position_of_the_vehicle_is_an_arrival(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    receipt = played.command("setDestination", x=101.0, y=-1.65)
    assert played.until_ended(receipt.request, 30.0).status == "completed"
    assert math.dist(where(played.state), (100.0, -1.65)) < 4.0


def test_forward_goes_by_the_odometer_across_junctions(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    receipt = played.command("forward", distance=350.0)
    assert played.until_ended(receipt.request).status == "completed"
    assert played.state.resources["odometer_m"] == pytest.approx(350.0, abs=0.6)
    assert where(played.state) == pytest.approx((450.0, -1.65), abs=1.0)
    rest = where(played.state)
    played.run(10.0)
    assert math.dist(where(played.state), rest) < 0.2
    again = played.command("forward", distance=20.0)
    assert played.until_ended(again.request).status == "completed"
    assert played.state.resources["odometer_m"] == pytest.approx(370.0, abs=1.2)


@pytest.mark.parametrize(("verb", "heading", "axis"), [("left", 0.0, 1), ("right", 180.0, 1)])
def test_turns_happen_at_the_next_junction(play: Start, city: City, verb: str, heading: float, axis: int) -> None:
    played = play([vehicle(position=(300.0, 398.35))], city)
    receipt = played.command(verb)
    assert receipt.status == "accepted"
    assert played.until_ended(receipt.request).status == "completed"
    assert played.state.heading_deg == pytest.approx(heading, abs=2.0)
    assert played.state.resources["speed_mps"] < 0.1
    assert 10.0 < abs(where(played.state)[axis] - 400.0) < 45.0


def test_an_impossible_turn_is_rejected_with_the_possible_turns(play: Start, city: City) -> None:
    receipt = play([vehicle()], city).command("right")  # on the southern rim, eastwards
    assert (receipt.status, receipt.reason) == ("rejected", "no_turn")
    assert "left and straight on" in receipt.detail or "straight on and left" in receipt.detail


def test_stop_brakes_comfortably_and_preempts(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    drive = played.command("setDestination", x=700.0, y=0.0)
    played.run(15.0)
    stop = played.command("stop")
    assert stop.status == "accepted"
    before = played.state
    assert played.until_ended(stop.request).status == "completed"
    assert [(r.status, r.reason) for r in played.receipts if r.request == drive.request][-1] == (
        "rejected",
        "preempted",
    )
    braking = where(played.state)[0] - where(before)[0]
    assert 40.0 < braking < 60.0  # 13.9² / (2 · 2 m/s²) = 48 m
    assert played.state.status == "parked"
    rest = where(played.state)
    played.run(5.0)
    assert where(played.state) == rest
    again = played.command("setDestination", x=700.0, y=0.0)
    assert played.until_ended(again.request).status == "completed"


@pytest.mark.parametrize(
    ("verb", "arguments", "reason"),
    [
        ("setDestination", {"x": math.nan, "y": 0.0}, "bad_argument"),
        ("setDestination", {"x": 10.0}, "bad_argument"),
        ("setDestination", {"x": 5000.0, "y": 0.0}, "unreachable"),
        ("forward", {"distance": math.inf}, "bad_argument"),
        ("forward", {"distance": -5.0}, "bad_argument"),
        ("route", {"x": 10.0, "y": 10.0}, "no_authority"),
        ("fly", {}, "unknown_verb"),
    ],
)
def test_impossible_commands_are_refused_with_a_reason(
    play: Start, city: City, verb: str, arguments: dict[str, float], reason: str
) -> None:
    receipt = play([vehicle()], city).command(verb, **arguments)
    assert (receipt.status, receipt.reason) == ("rejected", reason)
    assert receipt.detail


@pytest.mark.parametrize("distance", [0.1, 0.5, 3.0])
def test_a_short_forward_covers_its_distance_and_keeps_its_lane(play: Start, distance: float) -> None:
    """Regression: 0.1 m counted as covered at once, and the car slid 3.3 m sideways into another lane meanwhile."""
    played = play([vehicle()], grid(lanes=2))
    before = where(played.state)
    receipt = played.command("forward", distance=distance)
    assert played.until_ended(receipt.request).status == "completed"
    played.run(5.0)
    east, north = (b - a for a, b in zip(before, where(played.state), strict=True))
    assert east == pytest.approx(distance, abs=min(0.3, distance / 2.0))
    assert abs(north) < 0.1


def test_forward_beyond_the_end_of_the_road_is_rejected(play: Start, city: City) -> None:
    played = play([vehicle(position=(201.65, 700.0), heading_deg=0.0)], city)
    receipt = played.command("forward", distance=300.0)
    assert (receipt.status, receipt.reason) == ("rejected", "unreachable")
    assert "ends 89 m ahead" in receipt.detail, receipt.detail


# -- routes


def test_a_route_is_published_with_its_waypoints_and_followed(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    receipt = played.command("route", origin="kernel", x=600.0, y=400.0)
    boundary = played.step()
    assert [(r.request, r.status) for r in boundary.receipts] == [(receipt.request, "completed")]
    (route,) = boundary.routes
    assert (route.entity, route.number, route.request) == ("van", 1, receipt.request)
    assert 860.0 < route.length_m < 920.0
    assert 4 <= len(route.waypoints) <= 5, route.waypoints
    assert math.dist(route.waypoints[-1][:2], (600.0, 400.0)) < 10.0
    points = [(100.0, -1.65, 0.0), *route.waypoints]
    for before, after in itertools.pairwise(points):
        assert math.dist(before, after) <= 221.0
    for x, y, z in route.waypoints:  # on a street of the grid
        assert min(abs(x % 200.0), 200.0 - x % 200.0, abs(y % 200.0), 200.0 - y % 200.0) < 8.0
        assert z == 0.0
    assert where(played.state) == pytest.approx((100.0, -1.65), abs=0.01)
    drive = played.command("setDestination", x=602.0, y=401.0)
    assert played.until_ended(drive.request).status == "completed"
    assert len(played.routes) == 1
    for waypoint in route.waypoints:
        assert min(math.dist(where(b.states[0]), waypoint[:2]) for b in played.history) < 9.0


def test_replan_leads_around_the_place_named(play: Start, city: City) -> None:
    played = play([vehicle(), jam(position=(500.0, 0.0))], city)
    assert played.command("replan", origin="kernel", x=500.0, y=0.0).reason == "no_route"
    played.command("route", origin="kernel", x=700.0, y=0.0)
    played.step()
    straight = played.routes[0]
    assert min(math.dist(point[:2], (500.0, 0.0)) for point in straight.waypoints) < 120.0
    assert played.command("replan", origin="kernel", x=500.0, y=0.0).status == "accepted"
    played.step()
    around = played.routes[1]
    assert around.number == 2
    assert around.length_m == pytest.approx(straight.length_m + 400.0, abs=40.0)
    assert any(point[1] > 190.0 for point in around.waypoints)
    drive = played.command("setDestination", x=700.0, y=0.0)
    assert played.until_ended(drive.request).status == "completed"
    assert min(math.dist(where(b.states[0]), (500.0, 0.0)) for b in played.history) > 90.0


def test_replan_while_driving_changes_the_path(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    drive = played.command("setDestination", x=700.0, y=0.0)
    played.run(8.0)
    assert played.command("replan", origin="kernel", x=500.0, y=0.0).status == "accepted"
    assert played.until_ended(drive.request).status == "completed"
    assert max(where(b.states[0])[1] for b in played.history) > 190.0


def test_replan_reads_the_named_place_and_no_hidden_jam(play: Start, city: City) -> None:
    def around(named: tuple[float, float], *jams: Entity) -> list[tuple[float, ...]]:
        played = play([vehicle(), *jams], city)
        played.command("route", origin="kernel", x=700.0, y=0.0)
        played.command("replan", origin="kernel", x=named[0], y=named[1])
        played.step()
        return [point for route in played.routes for point in route.waypoints]

    near = (500.0, 18.0)  # 18 m beside the road: within twice the radius of the jam, and off its middle
    assert around(near, jam(position=(500.0, 0.0))) == around(near)
    beside = (200.0, 36.0)  # a crossing street: the jam lies 36 m away, within twice its radius
    assert around(beside, jam(position=(200.0, 0.0))) == around(beside)


def test_replan_with_no_way_left_is_unreachable(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    played.command("route", origin="kernel", x=700.0, y=0.0)
    receipt = played.command("replan", origin="kernel", x=700.0, y=0.0)
    assert (receipt.status, receipt.reason) == ("rejected", "unreachable")
    assert "around" in receipt.detail


# -- congestion and traffic


def test_congestion_blocks_appears_and_clears(play: Start, city: City) -> None:
    events = (EventSpec(name="jam", tick=1, appear=("jam",)), EventSpec(name="clear", tick=8, vanish=("jam",)))
    played = play([vehicle(), jam(dormant=True)], city, events=events)
    assert not played.boundary.ambient
    played.run(10.5)
    queue = [body for body in played.boundary.ambient if math.dist(where(body), (500.0, 0.0)) < 70.0]
    assert 8 <= len(queue) <= 20, len(queue)
    assert all(math.hypot(*body.velocity) < 0.1 and body.kind in ("car", "delivery_van", "truck") for body in queue)
    gaps = sorted(where(body)[0] for body in queue if where(body)[1] < 0.0)
    assert all(after - before > 4.5 for before, after in itertools.pairwise(gaps))
    drive = played.command("setDestination", x=700.0, y=0.0)
    played.run(60.0)
    assert played.state.status == "waiting"
    assert 400.0 < where(played.state)[0] < 480.0
    assert played.until_ended(drive.request).status == "completed"
    assert not any(event.kind == "collided" for event in played.events)


def test_a_cleared_target_blocks_no_longer(play: Start, city: City) -> None:
    played = play([vehicle(), jam()], city)
    assert len(played.boundary.ambient) >= 8
    cleared = BodyState(id="jam", position=(500.0, 0.0, 0.0), status="cleared")
    played.run(60.0, lambda _: (cleared,))
    assert not [body for body in played.boundary.ambient if math.dist(where(body), (500.0, 0.0)) < 70.0]


def test_traffic_keeps_its_number_and_moves(play: Start, city: City) -> None:
    played = play([vehicle()], city, traffic=40)
    first = {body.id: body for body in played.boundary.ambient}
    assert len(first) == 40
    assert sum(math.hypot(*body.velocity) > 1.0 for body in first.values()) > 20
    played.run(120.0)
    last = {body.id: body for body in played.boundary.ambient}
    assert sorted(last) == sorted(first)
    moved = [math.dist(where(first[name]), where(last[name])) for name in first]
    assert sum(distance > 50.0 for distance in moved) > 30
    assert len({body.kind for body in last.values()}) >= 3
    assert where(played.state) in (pytest.approx((100.0, -1.65)), pytest.approx((100.0, -4.2)))  # made room or not


def test_a_vehicle_gets_no_new_route_that_it_would_leave_before_its_next_decision(play: Start) -> None:
    """It drives on for 0.3 s as it had decided before, past the short street `bc` and its fork. SUMO 1.28 crashed with
    a vehicle beside its route in a roundabout of Lujiazui.
    """
    places = {"a": (0.0, 0.0), "b": (300.0, 0.0), "c": (304.0, 0.0), "d": (600.0, 120.0), "e": (600.0, -120.0)}
    nodes = [StreetNode(id=name, east=east, north=north, control="priority") for name, (east, north) in places.items()]
    edges = [StreetEdge(id=pair, start=pair[0], end=pair[1]) for pair in ("ab", "bc", "cd", "ce", "da", "ea")]
    network = build_network(nodes, edges)
    fork = City(id="fork", origin=(31.0, 121.5), bounds=(0.0, -120.0, 600.0, 120.0), network=network.path,
                sha256=network.sha256)  # fmt: skip
    played = play([vehicle(position=(500.0, 80.0))], fork, traffic=30, sync_s=0.1)
    traffic, sim = played.engine._traffic, played.engine._sim
    tried = {True: 0, False: 0}
    while min(tried.values()) < 3 and played.time_s < 120.0:
        played.step()
        for mover in traffic._movers:
            lane, route = sim.vehicle.getLaneID(mover.id), sim.vehicle.getRoute(mover.id)
            ahead = route[sim.vehicle.getRouteIndex(mover.id) :]
            if ahead[:2] != ("ab", "bc") or len(ahead) < 3 or lane == "bc_0":
                continue
            left_m = sim.lane.getLength(lane) - sim.vehicle.getLanePosition(mover.id) + sim.lane.getLength("bc_0")
            is_near = left_m < 0.4 * (sim.vehicle.getSpeed(mover.id) + 0.2 * sim.vehicle.getAccel(mover.id))
            if tried[is_near] < 3:
                tried[is_near] += 1
                other = "ce" if ahead[2] == "cd" else "cd"
                assert traffic._reroute(mover, partial(sim.vehicle.changeTarget, mover.id, other)) != is_near
                now = sim.vehicle.getRoute(mover.id)[sim.vehicle.getRouteIndex(mover.id) :]
                assert now == (ahead if is_near else ("ab", "bc", other))
                assert mover.edges == len(sim.vehicle.getRoute(mover.id))
    assert min(tried.values()) == 3, tried


def trip(play: Start, city: City, asset: Entity, traffic: int = 0) -> float:
    played = play([asset], city, traffic=traffic, seed=4)
    receipt = played.command("setDestination", x=700.0, y=798.0)
    played.until_ended(receipt.request, 900.0)
    return played.time_s


def test_blue_lights_are_faster_in_the_same_traffic(play: Start) -> None:
    lights = grid(lanes=2, control="traffic_light")
    plain = trip(play, lights, vehicle(kind="fire_truck", position=(100.0, -4.95)), 60)
    blue = trip(play, lights, vehicle(kind="fire_truck", position=(100.0, -4.95), blue_light=True), 60)
    assert blue < 0.9 * plain


def test_a_loaded_vehicle_is_slower(play: Start, city: City) -> None:
    empty = trip(play, city, vehicle(kind="delivery_van"))
    loaded = trip(play, city, vehicle(kind="delivery_van", load_kg=400.0))
    assert loaded > 1.08 * empty


def test_the_load_follows_the_accounts_of_other_engines(play: Start, city: City) -> None:
    played = play([vehicle(load_kg=150.0), other("shop", "delivery_point", "city")], city)
    shop = BodyState(id="shop", position=(0.0, 0.0, 0.0), resources={"load_kg@van": -100.0, "load_kg@bus": 7.0})
    played.step(lambda _: (shop,))
    assert played.state.resources["load_kg"] == 50.0


def test_lane_changes_are_continuous_motion(play: Start) -> None:
    played = play([vehicle(position=(20.0, -4.95))], grid(lanes=2), traffic=60, sync_s=0.1)
    played.command("setDestination", x=400.0, y=798.0)
    last: dict[str, BodyState] = {}
    lanes: set[tuple[str, float]] = set()
    for _ in range(400):
        boundary = played.step()
        for body in (*boundary.states, *boundary.ambient):
            before = last.get(body.id, body)
            angle = math.radians(body.heading_deg)
            east, north = body.position[0] - before.position[0], body.position[1] - before.position[1]
            if body.heading_deg == before.heading_deg:
                assert abs(east * math.cos(angle) - north * math.sin(angle)) < 0.3, (before, body)
            last[body.id] = body
            if body.heading_deg == 90.0:
                lanes.add((body.id, round(body.position[1] % 200.0 / 3.3) * 3.3))
    assert len(lanes) > len({name for name, _ in lanes})  # at least one vehicle has changed lanes


# -- standing in the way


def test_a_vehicle_that_blocks_others_makes_room(play: Start, city: City) -> None:
    played = play([vehicle("van", position=(60.0, -1.65)), vehicle("first", position=(100.0, -1.65))], city)
    drive = played.command("setDestination", x=350.0, y=-1.65)
    assert played.until_ended(drive.request, 90.0).status == "completed"
    first = played.boundary.states[1]
    assert where(first) == pytest.approx((100.0, -1.65 - 2.55), abs=0.01)
    assert first.status == "parked"
    sides = [where(boundary.states[1])[1] for boundary in played.history]
    assert all(before - after <= 0.66 for before, after in itertools.pairwise(sides))
    assert not any(event.kind == "collided" for event in played.events)
    again = played.command("setDestination", "first", x=550.0, y=-1.65)
    played.run(6.0)
    assert where(played.boundary.states[1])[1] == pytest.approx(-1.65, abs=0.05)
    assert played.until_ended(again.request, 300.0).status == "completed"


def test_several_vehicles_arrive_at_one_destination(play: Start, city: City) -> None:
    names = ("a", "b", "c")
    vans = [vehicle(name, "delivery_van", (100.0 - 10.0 * number, -1.65)) for number, name in enumerate(names)]
    played = play(vans, city)
    for name in names:
        assert played.command("setDestination", name, x=350.0, y=-1.65).status == "accepted"
    played.run(60.0)
    assert [event.entities[0] for event in played.events if event.kind == "arrived"] == ["a", "b", "c"]
    assert all(math.dist(where(state), (350.0, -1.65)) < 30.0 for state in played.boundary.states)
    assert not any(event.kind == "collided" for event in played.events)


def corners(state: BodyState, size: Size) -> shapely.Polygon:
    """Return the outline of a vehicle that heads east or west."""
    (x, y), length, width = where(state), size.length_m / 2.0, size.width_m / 2.0
    return shapely.box(x - length, y - width, x + length, y + width)


def test_an_arrived_vehicle_leaves_the_lane(play: Start, city: City) -> None:
    first = vehicle("first", "truck", position=(100.0, -1.65))
    played = play([first, vehicle("second", "bus", position=(60.0, -1.65))], city)
    played.until_ended(played.command("setDestination", "first", x=300.0, y=-1.65).request)
    ended = played.until_ended(played.command("setDestination", "second", x=350.0, y=-1.65).request)
    passed = [boundary for boundary in played.history if 270.0 < where(boundary.states[1])[0] < 330.0]
    assert ended.status == "completed"
    assert passed and all(boundary.states[1].resources["speed_mps"] > 5.0 for boundary in passed)
    for boundary in passed:
        parked, passing = boundary.states
        assert not corners(parked, SIZES["truck"]).intersects(corners(passing, SIZES["bus"]))
    assert where(played.boundary.states[0])[1] + SIZES["truck"].width_m / 2.0 == pytest.approx(-3.3)


@pytest.mark.parametrize("leaves", ["first", "second"])
def test_two_vehicles_at_one_destination_can_leave_in_either_order(play: Start, city: City, leaves: str) -> None:
    vans = [vehicle(name, "delivery_van", (x, -1.65)) for name, x in (("first", 100.0), ("second", 90.0))]
    played = play(vans, city)
    requests = [played.command("setDestination", van.id, x=350.0, y=-1.65).request for van in vans]
    for request in requests[::-1]:
        played.until_ended(request)
    played.run(5.0)
    first, second = (corners(state, SIZES["delivery_van"]) for state in played.boundary.states)
    assert first.distance(second) >= 2.5
    away = played.command("setDestination", leaves, x=750.0, y=-1.65).request
    assert played.until_ended(away).status == "completed"
    assert not any(event.kind == "collided" for event in played.events)


def test_a_vehicle_stopped_beside_a_parked_one_does_not_block_it(play: Start, city: City) -> None:
    played = play([vehicle("first"), vehicle("second", position=(60.0, -1.65))], city)
    played.until_ended(played.command("setDestination", "first", x=300.0, y=-1.65).request)
    played.command("setDestination", "second", x=700.0, y=-1.65)
    while where(played.boundary.states[1])[0] < 252.0:
        played.step()
    played.until_ended(played.command("stop", "second").request)
    assert abs(where(played.boundary.states[1])[0] - 300.0) < 9.0
    away = played.command("setDestination", "first", x=500.0, y=-1.65).request
    assert played.until_ended(away).status == "completed"
    assert where(played.boundary.states[1])[1] == pytest.approx(-4.2, abs=0.01)
    assert not any(event.kind == "collided" for event in played.events)


def test_a_vehicle_that_pulls_out_waits_for_traffic_around_the_corner(play: Start, city: City) -> None:
    played = play([vehicle("first"), vehicle("second", position=(120.0, -1.65))], city)
    played.until_ended(played.command("setDestination", "first", x=215.0, y=-1.65).request)
    played.command("setDestination", "second", x=700.0, y=-1.65)
    while where(played.boundary.states[1])[0] < 180.0:
        played.step()
    played.command("setDestination", "first", x=500.0, y=-1.65)
    speeds = []
    while where(played.boundary.states[0])[0] < 300.0:
        speeds.append(played.step().states[1].resources["speed_mps"])
    assert all(before - after < 1.5 for before, after in itertools.pairwise(speeds)), speeds
    assert where(played.boundary.states[1])[0] > where(played.boundary.states[0])[0]


def test_a_vehicle_parked_at_its_destination_stays(play: Start, city: City) -> None:
    played = play([vehicle()], city)
    played.until_ended(played.command("setDestination", x=350.0, y=-1.65).request)
    there, odometer = where(played.state), played.state.resources["odometer_m"]
    for x in (350.0, 343.0):
        again = played.command("setDestination", x=x, y=-1.65)
        assert played.until_ended(again.request).status == "completed"
    assert [event.kind for event in played.events] == ["arrived"] * 3
    played.run(3.0)
    assert where(played.state) == pytest.approx((there[0], -4.2), abs=0.01)
    assert played.state.resources["odometer_m"] == odometer


def test_a_vehicle_on_a_bridge_does_not_pull_over(play: Start, city: City) -> None:
    lane = Lane(id="10-20_0", shape=((200.0, -1.65, 0.0), (400.0, -1.65, 0.0)), width_m=3.3)
    bridge = msgspec.structs.replace(city, roads=(Road(id="10-20", lanes=(lane,), bridge=True),))
    played = play([vehicle("van", position=(20.0, -1.65)), vehicle("late", position=(10.0, -1.65))], bridge)
    played.until_ended(played.command("setDestination", x=350.0, y=-1.65).request)
    played.run(5.0)
    assert where(played.state) == pytest.approx((350.0, -1.65), abs=0.1)
    behind = played.command("setDestination", "late", x=700.0, y=-1.65).request
    assert played.until_ended(behind).status == "completed"


# -- other bodies


def test_a_car_brakes_for_a_dog_and_drives_on(play: Start, city: City) -> None:
    played = play([vehicle(), other("dog", "robot_dog", "quadruped")], city, sync_s=0.1)
    drive = played.command("setDestination", x=350.0, y=-1.65)

    def dog(time_s: float) -> Sequence[BodyState]:
        """Return the path of a dog that walks onto the car's lane, stands there for 20 s, and walks off."""
        y = (
            max(-12.0 + 1.5 * time_s, -12.0)
            if time_s < 7.0
            else -1.5
            if time_s < 27.0
            else -1.5 - 1.5 * (time_s - 27.0)
        )
        moving = 1.5 if time_s < 7.0 else 0.0 if time_s < 27.0 else -1.5
        return (BodyState(id="dog", position=(170.0, y, 0.3), velocity=(0.0, moving, 0.0)),)

    played.run(24.0, dog)
    assert played.state.status == "waiting"
    gap = 170.0 - where(played.state)[0] - 2.25
    assert 0.5 < gap < 12.0, gap
    assert played.until_ended(drive.request, mirrors=dog).status == "completed"
    assert not any(event.kind == "collided" for event in played.events)


@pytest.mark.parametrize("reaches_s", [8.0, 10.5, 11.0, 11.5, 12.5])
def test_a_car_brakes_in_time_for_a_dog_that_crosses_without_stopping(
    play: Start, city: City, reaches_s: float
) -> None:
    played = play([vehicle(position=(20.0, -1.65)), other("dog", "robot_dog", "quadruped")], city, sync_s=0.5)
    drive = played.command("setDestination", x=350.0, y=-1.65)

    def dog(time_s: float) -> Sequence[BodyState]:
        y = -1.65 + 1.5 * (time_s - reaches_s)
        return (BodyState(id="dog", position=(120.0, y, 0.3), velocity=(0.0, 1.5, 0.0)),)

    assert played.until_ended(drive.request, mirrors=dog).status == "completed"
    assert not any(event.kind == "collided" for event in played.events)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (2, 3))])
@pytest.mark.parametrize(("y", "both"), [(-3.7, True), (-3.3, True), (-6.2, False)], ids=["near", "on", "edge"])
def test_background_traffic_touches_no_dog_beside_a_lane_line(play: Start, y: float, both: bool, seed: int) -> None:
    """Regression: cars that changed lanes for a dog 0.4 m from a line were still partly in its lane.

    At x = 300 m two lanes lead to the east, with lines at -6.6, -3.3 and 0 m.
    """
    there = msgspec.structs.replace(other("dog", "robot_dog", "quadruped"), position=(300.0, y, 0.3))
    played = play([there], grid(lanes=2), seed=seed, traffic=250)
    dog = BodyState(id="dog", position=there.position)
    body = shapely.box(300.0 - 0.16, y - 0.35, 300.0 + 0.16, y + 0.35)
    passed = set()
    for _ in range(80):
        for car in played.step(lambda _: (dog,)).ambient:
            if abs(car.position[0] - 300.0) < 20.0 and -8.0 < car.position[1] < 0.0:
                assert outline(car).distance(body) > 0.1, car
                passed |= {car.id} if car.position[0] > 303.0 else set()
    assert bool(passed) != both, "only the lane that it touches is blocked"


def outline(car: BodyState) -> shapely.Polygon:
    size, angle = SIZES[car.kind], math.radians(90.0 - car.heading_deg)
    box = shapely.box(-size.length_m / 2.0, -size.width_m / 2.0, size.length_m / 2.0, size.width_m / 2.0)
    turned = shapely.affinity.rotate(box, angle, origin=(0.0, 0.0), use_radians=True)
    return shapely.affinity.translate(turned, *car.position[:2])


def test_a_car_stops_behind_a_parked_truck_of_another_engine(play: Start, city: City) -> None:
    played = play([vehicle(), other("lorry", "truck", "elsewhere")], city, sync_s=0.5)
    lorry = BodyState(id="lorry", position=(170.0, -1.65, 0.0), heading_deg=90.0)
    played.command("setDestination", x=350.0, y=-1.65)
    played.run(60.0, lambda _: (lorry,))
    assert played.state.status == "waiting"
    assert where(played.state)[0] + 2.25 < 170.0 - 4.5
    assert not any(event.kind == "collided" for event in played.events)


def test_aircraft_and_vessels_are_no_obstacles(play: Start, city: City) -> None:
    others = [other("uav", "quadrotor", "multirotor"), other("boat", "lifeboat", "vessel")]
    played = play([vehicle(), *others], city)
    uav = BodyState(id="uav", position=(170.0, -1.65, 20.0))
    boat = BodyState(id="boat", position=(180.0, -1.65, 0.0))
    drive = played.command("setDestination", x=350.0, y=-1.65)
    ended = played.until_ended(drive.request, mirrors=lambda _: (uav, boat))
    assert ended.time_s < 35.0


def test_a_car_that_hits_a_dog_reports_one_collision(play: Start, city: City) -> None:
    played = play([vehicle(), other("dog", "robot_dog", "quadruped")], city, sync_s=0.1)
    played.command("setDestination", x=350.0, y=-1.65)

    def dog(time_s: float) -> Sequence[BodyState]:
        """Return the path of a dog that jumps in front of the car at speed."""
        x = where(played.state)[0]
        jumped = x > 160.0
        return (BodyState(id="dog", position=(166.0, -1.65 if jumped else -20.0, 0.3)),)

    played.run(30.0, dog)
    hits = [event for event in played.events if event.kind == "collided"]
    assert [event.entities for event in hits] == [("van", "dog")]
    assert hits[0].values["speed_mps"] > 5.0


# -- forks, seeds, processes


def busy(city: City, seed: int = 3) -> Play:
    played = Play(mission([vehicle(), jam(position=(600.0, 500.0))], traffic=30), city, seed)
    played.command("setDestination", x=640.0, y=412.0)
    return played


def test_a_fork_goes_on_bit_exactly(city: City) -> None:
    played = busy(city)
    played.run(15.0)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            played.run(15.0)
            os.write(write, played.digest().encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        forked = pipe.read()
    os.waitpid(child, 0)
    played.run(15.0)
    played.engine.close()
    assert forked == played.digest()


def run_busy(seed: int = 3) -> str:
    played = busy(grid(), seed)
    played.run(20.0)
    played.engine.close()
    return played.digest()


PROGRAM = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("road_world", sys.argv[1])
module = importlib.util.module_from_spec(spec)
sys.modules["road_world"] = module
spec.loader.exec_module(module)
print(module.run_busy())
"""


def test_new_processes_and_restarts_give_equal_digests() -> None:
    here = run_busy()
    assert run_busy() == here
    assert run_busy(seed=4) != here
    environment = {**os.environ, "PYTHONHASHSEED": "77"}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, __file__], capture_output=True, text=True, check=True, env=environment, cwd="/"
    )
    assert run.stdout.strip() == here


def test_a_second_simulation_in_a_process_is_refused(play: Start, city: City) -> None:
    first = play([vehicle()], city)
    with pytest.raises(InfrastructureError, match="second traffic simulation"):
        Play(mission([vehicle()]), city)
    first.step()
    first.engine.close()
    second = play([vehicle()], city)
    assert second.step().states[0].id == "van"


def test_a_city_without_a_road_network_is_an_infrastructure_error(city: City) -> None:
    with pytest.raises(InfrastructureError, match="has no roads for van"):
        Play(mission([vehicle()]), msgspec.structs.replace(city, network=""))
    with pytest.raises(InfrastructureError, match="does not exist"):
        Play(mission([vehicle()]), msgspec.structs.replace(city, network="/nowhere.net.xml"))


def test_many_resets_leave_memory_flat(city: City) -> None:
    def resident() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    engine, instance = RoadEngine(), mission([vehicle()], traffic=10)
    spec = EngineSpec(engine="road", instance=instance, owns=("van",))

    def reset(times: int) -> None:
        for _ in range(times):
            engine.reset(spec, city, 1)
            engine.advance(1.0, ())

    reset(10)
    before = resident()
    reset(40)
    engine.close()
    assert resident() - before < 8.0


def test_the_engine_conforms(city: City) -> None:
    plugin = EnginePlugin(name="road", factory=RoadEngine)
    instance = mission([vehicle(), vehicle("truck", "fire_truck", (300.0, 398.35), blue_light=True)], traffic=10)
    commands = [
        Command(
            id="c0-1", tick=0, sender="a", resource="van", verb="setDestination", arguments={"x": 640.0, "y": 400.0}
        ),
        Command(id="c0-2", tick=0, sender="b", resource="truck", verb="left"),
    ]
    mirror = BodyState(id="dog", position=(180.0, 3.0, 0.3), velocity=(0.1, 0.0, 0.0), kind="robot_dog")
    check_engine(plugin, instance, city, commands, mirrors=[mirror])
