"""Coarse motion: near full motion in time, place and energy, with the same refusals and ends; repeatable."""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec
import pytest

from lingjing.errors import UsageError
from lingjing.mission.instance import Clock, Instance, SceneSpec, Weather
from lingjing.plugins.engine import Engine, EngineSpec
from lingjing.scene.city import City
from lingjing.testing import PluginHost, bare_instance
from lingjing.trace.records import Command
from tests.engines.test_road_engine import grid, vehicle

BREEZE = Weather(wind_mps=6.0, wind_from_deg=220.0, turbulence=0.1, current_mps=0.3, current_to_deg=60.0)


def engine_of(name: str) -> Engine:
    return PluginHost().engine(name).factory()


def with_motion(instance: Instance, engine: str, motion: str) -> Instance:
    return msgspec.structs.replace(instance, engine_options={engine: {"motion": motion}})


def test_coarse_multirotor_motion_matches_full_motion_in_time_place_and_energy(player, instance_of, uav, open_sea):  # type: ignore[no-untyped-def]
    ends = {}
    for motion in ("full", "coarse"):
        instance = with_motion(instance_of([uav(position=(0.0, 0.0, 2.0))], BREEZE, 0.5), "multirotor", motion)
        play = player(engine_of("multirotor"), instance, open_sea, "multirotor", 1)
        receipt = play.command("uav[1]", "setDestination", x=250.0, y=-120.0, z=60.0)
        ended = play.until_ended(receipt.request, 120.0)
        assert ended.status == "completed"
        assert math.dist(play.state.position, (250.0, -120.0, 60.0)) < 2.0
        used = 1.0 - play.state.resources["battery"]
        play.run(60.0)
        assert play.state.status == "hovering"
        assert math.dist(play.state.position, (250.0, -120.0, 60.0)) < 2.0
        ends[motion] = (ended.time_s, used)
    assert ends["coarse"][0] == pytest.approx(ends["full"][0], rel=0.05)
    assert ends["coarse"][1] == pytest.approx(ends["full"][1], rel=0.1)


def test_coarse_multirotor_motion_collides_with_a_tower_and_rejects_a_place_under_water(player, instance_of, uav, quay):  # type: ignore[no-untyped-def]
    for goal, what in (((200.0, 0.0, 30.0), "tower"), ((-200.0, 0.0, -20.0), "water")):
        instance = with_motion(instance_of([uav(position=(0.0, 0.0, 30.0))], None, 0.5), "multirotor", "coarse")
        play = player(engine_of("multirotor"), instance, quay, "multirotor", 1)
        receipt = play.command("uav[1]", "setDestination", **dict(zip("xyz", goal, strict=True)))
        if receipt.status == "rejected":
            assert what == "water"  # a destination under the floor of flights is refused as with full motion
            continue
        assert play.until_ended(receipt.request, 120.0).status != "completed"
        assert [event.entities[1] for event in play.events if event.kind == "collided"] == [what]


def test_coarse_vessel_motion_matches_full_motion_in_time_and_place(player, instance_of, boat, open_sea):  # type: ignore[no-untyped-def]
    times = {}
    for motion in ("full", "coarse"):
        instance = with_motion(instance_of([boat()], BREEZE, 0.5), "vessel", motion)
        play = player(engine_of("vessel"), instance, open_sea, "vessel")
        receipt = play.command("boat", "moveTo", x=100.0, y=150.0)
        ended = play.until_ended(receipt.request, 200.0)
        assert ended.status == "completed"
        play.run(100.0)
        assert math.dist(play.state.position[:2], (100.0, 150.0)) < 8.0
        times[motion] = ended.time_s
    assert times["coarse"] == pytest.approx(times["full"], rel=0.05)


def test_coarse_targets_drift_as_far_as_in_full_motion(player, instance_of, victim, open_sea):  # type: ignore[no-untyped-def]
    places = {}
    for motion in ("full", "coarse"):
        play = player(
            engine_of("city"), with_motion(instance_of([victim()], BREEZE, 0.5), "city", motion), open_sea, "city"
        )
        start = play.state.position
        play.run(300.0)
        places[motion] = math.dist(play.state.position[:2], start[:2])
    assert places["full"] > 10.0
    assert places["coarse"] == pytest.approx(places["full"], rel=0.3)  # another draw of the wander


def driven(motion: str, traffic: float) -> tuple[float, int]:
    """Return when a car has driven 300 m along a street, and the number of background movers that are shown."""
    city: City = grid()
    instance = bare_instance(
        [vehicle()], clock=Clock(tick_s=10.0, sync_s=0.5), scene=SceneSpec(kind="grid", options={"traffic": traffic})
    )
    engine = engine_of("road")
    try:
        spec = EngineSpec(engine="road", instance=with_motion(instance, "road", motion), owns=("van",))
        engine.reset(spec, city, 3)
        start = engine.advance(0.5, ()).states[0].position
        shown, step = 0, 1
        engine.submit(
            (
                Command(
                    id="c1-1", tick=1, sender="driver", resource="van", verb="forward", arguments={"distance": 300.0}
                ),
            )
        )
        while step < 240:
            step += 1
            boundary = engine.advance(0.5 * step, ())
            shown = max(shown, len(boundary.ambient))
            if any(receipt.status == "completed" for receipt in boundary.receipts):
                break
        assert math.dist(start, boundary.states[0].position) == pytest.approx(300.0, abs=5.0)
        return boundary.time_s, shown
    finally:
        engine.close()


def test_a_coarse_car_drives_as_long_as_in_full_motion_and_shows_no_traffic() -> None:
    full, coarse = driven("full", 20.0), driven("coarse", 20.0)
    assert coarse[0] == pytest.approx(full[0], rel=0.15)
    assert full[1] > 10
    assert coarse[1] == 0


@pytest.mark.parametrize("engine", ["multirotor", "vessel", "city", "road"])
def test_an_unknown_motion_is_a_usage_error(engine: str, uav: Callable[..., object], instance_of, open_sea) -> None:  # type: ignore[no-untyped-def]
    instance = with_motion(instance_of([uav()]), engine, "fast")
    spec = EngineSpec(engine=engine, instance=instance, owns=())
    city = grid() if engine == "road" else open_sea
    with pytest.raises(UsageError, match=r"(?s)option `motion`.*full"):
        engine_of(engine).reset(spec, city, 1)


def test_coarse_road_motion_is_repeatable() -> None:
    assert driven("coarse", 20.0) == driven("coarse", 20.0)
