"""Each limit of a command has one source: the engine admits what the kernel clips to."""

import msgspec
import pytest

import lingjing
from lingjing.engines.fixed_wing.aeroplane import PlaneEngine
from lingjing.engines.multirotor.drone import MultirotorEngine
from lingjing.engines.quadruped.engine import QuadrupedEngine
from lingjing.envs.codec import Codec
from lingjing.kernel.command_limits import CommandLimits
from lingjing.kernel.registry import initial
from lingjing.mission.instance import AgentSpec, ArgumentSpec, Entity, VerbSpec
from lingjing.mission.kinds import builtin_engines
from lingjing.plugins.engine import EngineSpec
from lingjing.scene.city import Building
from lingjing.testing import brief_of, declared
from lingjing.trace.records import Action, Command, Decision

HUGE = (-1e6, -1.0, 0.0, 1e-3, 1e6)
SQUARE = ((90.0, -10.0), (110.0, -10.0), (110.0, 10.0), (90.0, 10.0))
HOUSE = Building(id="house", polygon=SQUARE, base_m=0.0, top_m=40.0)


def argument(name, unit="m"):
    return ArgumentSpec(name=name, unit=unit)


def verbs_of(engine):
    """Return the engine's verbs with arguments that no mission bounds."""
    place = (argument("x"), argument("y"), argument("z"))
    arguments = {
        "takeoff": (argument("altitude"),),
        "setDestination": place if engine != "road" else place[:2],
        **dict.fromkeys(("forward", "backward", "up", "down"), (argument("distance"),)),
        **dict.fromkeys(
            ("left", "right"), (argument("angle", "deg") if engine == "quadruped" else argument("distance"),)
        ),
    }
    kinds = builtin_engines()[engine].verbs
    return tuple(VerbSpec(name=name, arguments=arguments[name], motion=kind.motion) for name, kind in kinds.items())


def body(engine, kind, position, **properties):
    return declared(
        Entity(
            id="body", group="body", index=1, role="asset", type=kind, engine=engine, position=position,
            properties=properties, verbs=verbs_of(engine),
        )
    )  # fmt: skip


def clipped(entity, city, instance, verb, **arguments):
    spec = next(candidate for candidate in entity.verbs if candidate.name == verb)
    return CommandLimits(instance, city).clipped(spec, arguments, entity, initial(instance))[0]


@pytest.fixture
def street(quay):
    return msgspec.structs.replace(quay, buildings=(HOUSE,), solids=())


BAND = {"band_low_m": 0.0, "band_high_m": 120.0}


@pytest.mark.parametrize("size_m", [0.9, 6.0])
@pytest.mark.parametrize("band", [BAND, {}], ids=["band", "no band"])
@pytest.mark.parametrize(
    ("position", "lowest"),
    [((0.0, 0.0, 30.0), 0.9), ((300.0, 0.0, 30.0), -3.5), ((100.0, 0.0, 70.0), 40.0), ((110.2, 0.0, 70.0), 40.0)],
    ids=["quay", "sea", "roof", "edge"],
)
def test_a_large_descent_ends_above_the_surface_below(player, instance_of, street, size_m, band, position, lowest):
    """Regression: `down 100` was clipped to the band's 0 m, which the engine rejected as below the surface."""
    size = {"length_m": size_m, "width_m": size_m, "height_m": size_m / 2.0}
    entity = body("multirotor", "quadrotor", position, cruise_mps=12.0, endurance_s=2100.0, **size, **band)
    instance = instance_of([entity])
    play = player(MultirotorEngine(), instance, street, "multirotor")
    room = clipped(entity, street, instance, "down", distance=1000.0)
    ended = play.until_ended(play.command("body", "down", **room).request)
    assert ended.status == "completed", ended
    play.run(5.0)
    floor = max(lowest, band.get("band_low_m", -100.0) - size_m / 4.0 - 0.1)
    low = play.state.position[2] - size_m / 4.0  # its origin is its middle
    assert floor < low < floor + 1.0 and play.state.status == "hovering"
    assert play.command("body", "forward", distance=1.0).status == "accepted", "it is not held there"


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.9), (0.0, 0.0, 30.0), (300.0, 0.0, -2.0), (100.0, 0.0, 40.2)])
@pytest.mark.parametrize("verb", [spec.name for spec in verbs_of("multirotor")])
@pytest.mark.parametrize("value", HUGE)
def test_a_multirotor_accepts_every_clipped_number(instance_of, street, position, verb, value):
    entity = body("multirotor", "quadrotor", position, cruise_mps=12.0, endurance_s=1e9, **BAND)
    instance = instance_of([entity])
    engine = MultirotorEngine()
    engine.reset(EngineSpec(engine="multirotor", instance=instance, owns=("body",)), street, 1)
    arguments = (
        {"x": 10.0, "y": 0.0, "z": value}
        if verb == "setDestination"
        else {"altitude" if verb == "takeoff" else "distance": value}
    )
    receipt = submitted(engine, verb, clipped(entity, street, instance, verb, **arguments))
    assert receipt.status == "accepted" or receipt.reason in ("airborne", "grounded"), receipt


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize("x", [0.0, 100.0])
def test_an_aeroplane_accepts_every_clipped_elevation(instance_of, street, value, x):
    entity = body(
        "plane", "fixed_wing", (0.0, 0.0, 300.0), endurance_s=1e6, cruise_mps=20.0, band_low_m=10.0, band_high_m=1000.0
    )
    instance = instance_of([entity])
    engine = PlaneEngine()
    engine.reset(EngineSpec(engine="plane", instance=instance, owns=("body",)), street, 1)
    values = clipped(entity, street, instance, "setDestination", x=x, y=0.0, z=value)
    assert submitted(engine, "setDestination", values).status == "accepted", values


@pytest.mark.parametrize("verb", ["forward", "left", "right"])
def test_a_robot_dog_accepts_every_clipped_number(instance_of, quay, verb):
    entity = body("quadruped", "robot_dog", (0.0, 0.0, 0.9))
    instance = instance_of([entity])
    engine = QuadrupedEngine()
    engine.reset(EngineSpec(engine="quadruped", instance=instance, owns=("body",)), quay, 1)
    for value in HUGE[:-1]:
        values = clipped(entity, quay, instance, verb, **{"distance" if verb == "forward" else "angle": value})
        receipt = submitted(engine, verb, values)
        assert receipt.reason in ("", "busy"), (value, receipt)


def submitted(engine, verb, arguments):
    command = Command(id=f"c-{verb}", tick=0, sender="test", resource="body", verb=verb, arguments=arguments)
    (receipt,) = engine.submit((command,))
    return receipt


def test_takeoff_altitudes_are_relative_to_the_start_and_the_band_is_an_elevation(instance_of, street):
    """From a roof at 40 m, in a band of 20 to 120 m, a takeoff may climb by 1 to 80 m."""
    entity = body("multirotor", "quadrotor", (100.0, 0.0, 40.2), band_low_m=20.0, band_high_m=120.0)
    instance = instance_of([entity])
    assert clipped(entity, street, instance, "takeoff", altitude=5.0) == {"altitude": 5.0}
    assert clipped(entity, street, instance, "takeoff", altitude=400.0) == {"altitude": pytest.approx(79.8)}
    assert clipped(entity, street, instance, "takeoff", altitude=-400.0) == {"altitude": 1.0}


def test_declared_speeds_are_clipped_to_the_speed_range_of_the_engine():
    """Proofs bound a body's speed by what its engine flies, and not by a declared speed that it does not hold."""
    plane, dog = (builtin_engines()[name].top_speed for name in ("plane", "quadruped"))
    assert [plane.held(mps) for mps in (20.0, 45.0, 300.0)] == [33.0, 45.0, 60.0]
    assert [dog.held(mps) for mps in (0.5, 9.0)] == [0.5, 1.7]


@pytest.mark.parametrize(("engine", "kind"), [("road", "car"), ("multirotor", "quadrotor"), ("quadruped", "robot_dog")])
def test_briefs_state_the_minimum_values_that_the_engine_accepts(instance_of, street, engine, kind):
    """Regression: a prompt had 0 m for a car's `forward`, of which the engine accepts at least 0.1 m."""
    verbs = tuple(
        msgspec.structs.replace(verb, arguments=tuple(
            msgspec.structs.replace(spec, minimum=0.0, maximum=500.0) for spec in verb.arguments if spec.unit == "m"
        ))
        for verb in verbs_of(engine)
    )  # fmt: skip
    entity = msgspec.structs.replace(body(engine, kind, (0.0, 0.0, 30.0), **BAND), verbs=verbs)
    instance = instance_of([entity])
    agent = AgentSpec(
        id="pilot", name="pilot", index=1, role="pilot", controls=("body",), commands=("body",), observes=()
    )
    instance = msgspec.structs.replace(instance, agents=(agent,))
    (resource,) = brief_of(instance, agent.id, city=street).resources
    codec = Codec(instance, agent, 300.0, 0)
    for verb in resource.verbs:
        for spec in verb.arguments:
            if spec.unit == "m" and spec.name not in ("x", "y", "z"):
                least = max(0.0, builtin_engines()[engine].verbs[verb.name].least.get(spec.name, 0.0))
                assert codec._argument(verb, spec, entity, -1.0) == spec.minimum == least
                if verb.motion != "up":
                    assert clipped(entity, street, instance, verb.name, **{spec.name: -1.0})[spec.name] == least


MISSION = """ljs 1
use std.air { quadrotor }
use std.weather { clear }
mission drop "Come down" {
  goal "Come down to the ground."
  scene residential { extent = 400 m, blocks = 2 by 2 }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 6 }
  weather clear
  mode broadcast
  asset uav : quadrotor { position = (0 m, 0 m, 30 m) }
  agent pilot as pilot controls uav {
    observes uav.*, events
    prompt "Come down."
  }
  success when uav.position.elevation <= 1.5 m
}
"""


class Down:
    """A policy that commands `down`."""

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        return Decision(command=Action(verb="down", arguments={"distance": 500.0}))


def test_an_agent_that_commands_a_large_descent_reaches_the_ground(tmp_path):
    file = tmp_path / "drop.ljs"
    file.write_text(MISSION)
    report = lingjing.run(file, policy=Down, world="inline", overview=False, out=tmp_path / "out")
    assert report.success, (report.reason, report.warnings)
