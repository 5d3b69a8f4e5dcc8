"""The built-in engines in the inline world and in world processes: a flight over the bay, pictures, a fork."""

from pathlib import Path

import pytest
from msgspec.structs import replace

import tests.kernel.world_toys as toys
from lingjing.mission.instance import CameraSpec, Entity, InteractionSpec, SceneSpec, Weather
from lingjing.testing import PluginHost, declared
from lingjing.testing.worlds import open_world
from lingjing.trace.records import Command

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

CAMERA = CameraSpec(
    name="nadir",
    view="nadir",
    width=480,
    height=270,
    hfov_deg=84.0,
    channels=("rgb", "depth", "semantic"),
    capture="on_request",
)


def uav(index):
    return declared(
        Entity(
            id=f"uav[{index}]",
            group="uav",
            index=index,
            role="asset",
            type="quadrotor",
            engine="multirotor",
            position=(306.6 + 20.0 * index, -600.0, 1.1),
            properties={"cruise_mps": 12.0, "endurance_s": 2100.0},
            cameras=(CAMERA,),
        )
    )


def boat():
    return declared(
        Entity(
            id="boat",
            group="boat",
            index=1,
            role="asset",
            type="lifeboat",
            engine="vessel",
            position=(12.4, -1351.8, -3.5),
            heading_deg=30.0,
            properties={"speed_mps": 3.0},
        )
    )


def victim():
    return declared(
        Entity(
            id="victim[1]",
            group="victim",
            index=1,
            role="target",
            type="person_in_water",
            engine="city",
            position=(300.0, -850.0, -3.5),
            properties={"drift_mps": 0.1},
            interactions=(InteractionSpec(name="rescue", by="vessel", within_m=50.0, aboard=True),),
        )
    )


@pytest.fixture(scope="module")
def episode():
    scene = SceneSpec(kind="bay", datum_m=-3.5, seed=3)
    weather = Weather(wind_mps=4.0, wind_from_deg=220.0, turbulence=0.2, wave_height_m=0.5, current_mps=0.15)
    bare = toys.instance(uav(1), uav(2), boat(), victim(), tick_s=10.0, sync_s=0.5, engine_s=60.0, capture_s=60.0)
    changed = {name: getattr(bare, name) for name in bare.__struct_fields__} | {"scene": scene, "weather": weather}
    return type(bare)(**changed), PluginHost().scene("bay").build(scene)


def order(tick, resource, verb, **arguments):
    return Command(
        id=f"c{tick}-{resource}", tick=tick, sender="scout", resource=resource, verb=verb, arguments=arguments
    )


def orders(tick):
    if tick == 1:
        return [order(1, "uav[1]", "takeoff"), order(1, "boat", "moveTo", x=200.0, y=-900.0)]
    if tick == 2:
        return [order(2, "uav[1]", "setDestination", x=300.0, y=-850.0, z=80.0), order(2, "uav[2]", "takeoff")]
    return []


def advanced(world, ticks):
    boundaries = [world.step(tick, orders(tick)) for tick in ticks]
    return [replace(b, engines=tuple((s.engine, s.time_s, s.frame) for s in b.engines)) for b in boundaries]


def pictured(world, tick, boundary):
    requests = [toys.CaptureRequest(frame="f", entity="uav[1]", camera="nadir", tick=tick, time_s=tick * 10.0)]
    (frame,) = world.capture(tick, requests, boundary.snapshots[-1].states)
    return frame.info, frame.depth.tobytes(), frame.semantic.tobytes()


def test_both_worlds_and_a_fork_agree_to_the_last_bit_and_pixel(episode):
    instance, city = episode
    worlds = {kind: open_world(kind) for kind in ("process", "inline")}
    ready = {kind: world.reset(instance, city).snapshots for kind, world in worlds.items()}
    assert ready["process"] == ready["inline"]
    played = {kind: advanced(world, (1, 2)) for kind, world in worlds.items()}
    assert played["process"] == played["inline"]
    assert [r.status for r in played["process"][0].admissions] == ["accepted", "accepted"]
    twin = worlds["process"].fork()
    worlds["fork"] = twin
    ends = {kind: advanced(world, (3, 4, 5)) for kind, world in worlds.items()}
    assert ends["fork"] == ends["process"] == ends["inline"]
    flown = ends["fork"][-1].snapshots[-1].states
    assert flown[0].position[2] > 20.0
    assert flown[0].position != ready["inline"][0].states[0].position
    pictures = {kind: pictured(world, 5, ends["fork"][-1]) for kind, world in worlds.items()}
    assert pictures["fork"] == pictures["process"] == pictures["inline"]
    for world in worlds.values():
        world.close()


def test_a_repeated_episode_on_warm_workers_is_identical(episode):
    instance, city = episode
    world = open_world("process")
    runs = []
    for _ in range(2):
        world.reset(instance, city)
        boundaries = advanced(world, (1, 2))
        runs.append((boundaries, pictured(world, 2, boundaries[-1])))
    assert runs[0] == runs[1]
    world.close()


def test_the_world_process_with_real_engines_has_one_thread_and_no_graphics(episode):
    world = open_world("process")
    world.reset(*episode)
    world.step(1, orders(1))
    pid = world._workers.world.pid
    assert len(list(Path(f"/proc/{pid}/task").iterdir())) == 1
    maps = Path(f"/proc/{pid}/maps").read_text()
    assert not [name for name in ("/cv2/", "libEGL", "libGL.", "/moderngl/") if name in maps]
    world.close()
