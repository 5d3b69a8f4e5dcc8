"""A street with people: pedestrians, cyclists, visible traffic lights, reported collisions, as options of a scene."""

import math
from collections.abc import Callable, Iterator

import msgspec
import pytest
from pytest import approx

from lingjing.engines.vessel.engine import VesselEngine
from lingjing.mission.instance import SceneSpec, Weather
from lingjing.scene.city import City, Land
from lingjing.trace.records import BodyState
from tests.engines.camera_town import WHY_NOT, CameraEngine, instance, look, ready
from tests.engines.test_road_engine import Play, grid, mission, vehicle

COLOURS = {"signal_red", "signal_amber", "signal_green"}


@pytest.fixture(scope="module")
def city() -> City:
    return grid(lanes=2, control="traffic_light")


@pytest.fixture
def street(city: City) -> Iterator[Callable[..., Play]]:
    plays: list[Play] = []

    def start(seed: int = 1, **options: float) -> Play:
        for old in plays:
            old.engine.close()
        scene = SceneSpec(kind="grid", options=dict(options))
        plays.append(Play(msgspec.structs.replace(mission([vehicle()]), scene=scene), city, seed))
        return plays[-1]

    yield start
    for old in plays:
        old.engine.close()


def of_kind(played: Play, *kinds: str) -> dict[str, BodyState]:
    return {body.id: body for body in played.step().ambient if body.kind in kinds}


def test_pedestrians_walk_on_sidewalks_and_cross_streets(street: Callable[..., Play]) -> None:
    played = street(pedestrians=40.0)
    crossed, seen = set(), []
    for _ in range(240):
        people = of_kind(played, "person")
        seen.append(len(people))
        for body in people.values():
            assert math.hypot(*body.velocity[:2]) < 2.0
            east, north = (value % 200.0 for value in body.position[:2])
            off = [min(value, 200.0 - value) for value in (east, north)]
            if min(off) < 6.0:  # on a carriageway, which is 6.6 m wide on each side
                crossed.add(body.id)
                assert max(off) < 20.0, f"{body} is on a carriageway far from a crossing"
    assert min(seen[2:]) == max(seen) == 40 and len(crossed) >= 3


def test_the_same_seed_gives_the_same_people(street: Callable[..., Play]) -> None:
    def run(seed: int) -> str:
        played = street(seed, pedestrians=10.0, cyclists=5.0, signals=1.0)
        played.run(20.0)
        return played.digest()

    assert run(1) == run(1) != run(2)


def test_cyclists_ride_slower_than_cars(street: Callable[..., Play]) -> None:
    played = street(cyclists=20.0)
    played.run(30.0)
    speeds = [math.hypot(*body.velocity[:2]) for _ in range(20) for body in of_kind(played, "bicycle").values()]
    assert len(speeds) == 20 * 20 and 3.0 < max(speeds) <= 5.6


def test_cars_wait_for_the_red_signal_that_is_shown(street: Callable[..., Play]) -> None:
    """The van drives east along y = 200 through several lights; it never passes a stop line on red."""
    played = street(signals=1.0, traffic=40.0)
    changes: dict[str, set[str]] = {}
    passed = 0
    before: dict[str, BodyState] = {}
    red_before: set[str] = set()
    for _ in range(240):
        bodies = {body.id: body for body in played.step().ambient}
        signals = {name: body for name, body in bodies.items() if body.kind in COLOURS}
        for name, body in signals.items():
            changes.setdefault(name, set()).add(body.kind)
        red = {name for name, body in signals.items() if body.kind == "signal_red"}
        for name, body in bodies.items():
            old = before.get(name)
            if body.kind in COLOURS or old is None or math.hypot(*body.velocity[:2]) < 2.0:
                continue
            for light in red & red_before:
                pole = signals[light]
                angle = math.radians(pole.heading_deg + 180.0)  # the direction of the traffic
                along = [
                    (b.position[0] - pole.position[0]) * math.sin(angle)
                    + (b.position[1] - pole.position[1]) * math.cos(angle)
                    for b in (old, body)
                ]
                left = (pole.position[0] - body.position[0]) * math.cos(angle) - (
                    pole.position[1] - body.position[1]
                ) * math.sin(angle)
                front = 6.1  # half of the longest vehicle
                if along[0] + front < 0.0 < along[1] - front and 0.0 < left < 7.0:
                    passed += 1
        before, red_before = bodies, red
    assert passed == 0
    assert len(changes) >= 20 and sum(len(colours) == 3 for colours in changes.values()) >= 10


def test_vehicles_keep_their_lanes_on_a_network_with_sidewalks(street: Callable[..., Play]) -> None:
    plain, walked = street().state.position, street(pedestrians=1.0).state.position
    assert plain == approx(walked, abs=0.05)
    played = street(pedestrians=20.0)
    receipt = played.command("setDestination", x=640.0, y=412.0)
    assert played.until_ended(receipt.request, 300.0).status == "completed"


def test_without_options_the_street_has_no_people_and_no_signals(street: Callable[..., Play]) -> None:
    played = street()
    played.run(5.0)
    assert all(not boundary.ambient for boundary in played.history)


def test_a_boat_driven_ashore_collides_only_if_the_scene_enables_collisions(
    player, instance_of, boat, open_sea
) -> None:
    shore = Land(polygon=((-50.0, 40.0), (50.0, 40.0), (50.0, 200.0), (-50.0, 200.0)), top_m=2.0)
    gale = Weather(wind_mps=40.0, wind_from_deg=180.0)

    def kinds(**options: float) -> list[tuple[str, str]]:
        made = instance_of([boat(position=(0.0, 20.0, open_sea.waters[0].level_m))], gale, 0.5)
        made = msgspec.structs.replace(made, scene=SceneSpec(kind="x", options=dict(options)))
        city = msgspec.structs.replace(open_sea, lands=(shore,))
        play = player(VesselEngine(), made, city, "vessel")
        play.run(200.0)
        return [(event.kind, event.entities[1]) for event in play.events]

    assert kinds() == []
    assert kinds(collisions=1.0) == [("collided", "shore")]


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_the_camera_shows_the_colour_of_a_signal() -> None:
    camera = CameraEngine()
    try:
        ready(camera, instance())
        shares = {}
        for kind in sorted(COLOURS):
            pole = BodyState(id="signal/1", kind=kind, position=(-282.0, 0.0, 0.0), heading_deg=270.0)
            frame = look(camera, (-290.0, 0.0, 2.5), "front", 90.0, mirrors=(pole,))
            red, green = frame.rgb[..., 0].astype(int), frame.rgb[..., 1].astype(int)
            shares[kind] = (int(((red > 150) & (green < 90)).sum()), int(((green > 130) & (red < 90)).sum()))
        assert shares["signal_red"][0] > 10 * max(shares["signal_green"][0], 1)
        assert shares["signal_green"][1] > 10 * max(shares["signal_red"][1], 1)
    finally:
        camera.close()
