"""Declared states exist on every asset, also if its engine does not report them."""

import msgspec
import pytest

import lingjing
from lingjing import read as read_trace
from lingjing.kernel.world.stocks import Stocks
from lingjing.mission.instance import StateSpec
from lingjing.testing import compile_text
from lingjing.testing import rescue as kit
from lingjing.trace.records import BodyState

BUS = """\
ljs 1
use std.ground { car }
asset coach : car {
  state riders = 0
  state fuel = 4 kg
  state weight = 0 kg
  state load = 0.3 kg
  seats = 3
  hold = 100 kg
}
target stop {
  engine = city
  state people = 4
  state parcels = 4 kg
  state crate = 40 kg
  interaction board { by = road, within = 400 m, gives = riders, up_to = seats, from = people }
  interaction drain { by = road, within = 400 m, takes = crate, from = fuel }
  interaction unload { by = road, within = 400 m, takes = parcels, from = load }
  interaction stow { by = road, within = 400 m, gives = weight, up_to = hold }
}
mission bus "A bus stop" {
  goal "Fetch everybody."
  scene residential { extent = 300 m, blocks = 2 by 2 }
  clock { tick = 2 s, sync = 500 ms }
  budget { ticks <= 3 }
  target corner : stop { position = (50 m, 50 m) }
  asset bus : coach { position = (0 m, 0 m) }
  agent driver as driver controls bus { observes bus.*, corner.* }
  unlock board(s: corner) when now >= 0 s
  unlock drain(s: corner) when now >= 0 s
  unlock unload(s: corner) when now >= 0 s
  unlock stow(s: corner) when now >= 0 s
  success when bus.riders >= 3 and corner.people <= 1 and bus.fuel <= 0 kg and bus.weight >= 100 kg and bus.load <= 0 kg
}
"""


def body(name, **resources):
    return BodyState(id=name, position=(0.0, 0.0, 0.0), resources=resources)


@pytest.mark.parametrize("engine", ["road", "plane", "satellite", "vessel", "somebody_elses"])
def test_states_that_an_engine_does_not_report_are_kept(engine):
    properties = {"water_kg": 5.0, "riders": 2.0, "load_kg": 8.0, "colour": "white"}
    named = (("water", "kg"), ("riders", ""), ("load", "kg"), ("colour", ""))
    state = tuple(StateSpec(name=name, unit=unit) for name, unit in named)
    asset = msgspec.structs.replace(kit.entity("cart", 0.0, 0.0, properties=properties, state=state), engine=engine)
    depot = kit.entity("depot", 0.0, 0.0, role="target")
    stocks = Stocks(msgspec.structs.replace(kit.instance(), entities=(asset, depot)))
    accounts = {"water@cart": 3.0, "water@other": 9.0, "load@cart": -8.0}
    states = {"cart": body("cart", battery=0.5, load_kg=1.0), "depot": body("depot", **accounts)}
    (kept,) = stocks.kept(states).values()
    assert kept.resources == {"battery": 0.5, "load_kg": 1.0, "water": 8.0, "riders": 2.0}
    whole = {"cart": body("cart", water=1.0, riders=1.0, load=1.0), "depot": states["depot"]}
    assert stocks.kept(whole) == {}


def test_a_target_keeps_the_states_that_its_engine_does_not_report():
    target = kit.entity(
        "well", 0.0, 0.0, role="target", properties={"water_kg": 5.0}, state=(StateSpec(name="water", unit="kg"),)
    )
    stocks = Stocks(msgspec.structs.replace(kit.instance(), entities=(target,)))
    assert stocks.kept({"well": body("well")})["well"].resources == {"water": 5.0}
    assert stocks.kept({"well": body("well", water=1.0)}) == {}


def test_a_road_vehicle_keeps_its_declared_states_until_interactions_change_them(tmp_path):
    mission = compile_text(BUS).mission
    assert mission is not None
    result = lingjing.run(mission, policy="random", out=tmp_path / "run", world="inline", overview=False)
    trace = read_trace(result.trace)
    first, last = ({state.id: state.resources for state in trace.boundaries[k].snapshots[-1].states} for k in (0, -1))
    names = ("riders", "fuel", "weight", "load_kg")
    assert [first["bus"][name] for name in names] == [0.0, 4.0, 0.0, 0.3]
    assert [last["bus"][name] for name in names] == [3.0, 0.0, 100.0, 0.0]
    assert first["corner"] == {"people": 4.0, "parcels": 4.0, "crate": 40.0}
    assert last["corner"]["parcels"] == pytest.approx(3.7)
    assert (result.reason, result.ticks) == ("success", 1)


def test_an_interaction_by_a_role_plays_like_one_by_the_engine_of_its_bodies(tmp_path):
    played = [
        lingjing.run(compile_text(text).mission, policy="random", out=tmp_path / name, world="inline", overview=False)
        for name, text in (("engine", BUS), ("role", BUS.replace("by = road", "by = driver")))
    ]
    assert [(outcome.reason, outcome.ticks) for outcome in played] == [("success", 1)] * 2


def test_an_interaction_that_nothing_unlocks_is_allowed_from_the_start(tmp_path):
    free = "".join(line for line in BUS.splitlines(keepends=True) if "unlock stow" not in line and "board(" not in line)
    played, barred = (
        lingjing.run(compile_text(text).mission, policy="random", out=tmp_path / name, world="inline", overview=False)
        for name, text in (
            ("free", free),
            (
                "barred",
                BUS.replace("stow(s: corner) when now >= 0 s", "stow(s: corner) when bus.position.elevation > 99 m"),
            ),
        )
    )
    assert (played.reason, played.ticks) == ("success", 1)
    assert barred.reason == "budget"
