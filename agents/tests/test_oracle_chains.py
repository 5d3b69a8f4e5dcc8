"""Chains of interactions for the same bodies, and targets at which a body must stay."""

from __future__ import annotations

from pathlib import Path

from lingjing_agents.oracle.privileged_state import InstanceIndex

from lingjing.testing import instantiate, play

CHAIN = """ljs 2
use std.sea { lifeboat }
target buoy { engine = city, look = none, shape = none
  interaction service { by = vessel, within = 40 m, lasting = 10 s, told = all } }
target wreck { engine = city, look = none, shape = none
  interaction tow { by = vessel, within = 40 m, told = all } }
mission chain "Chain" {
  goal "Service the buoy, then tow the wreck."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 30 }
  target b : buoy { position = (60 m, -1260 m) }
  target w : wreck { position = (10 m, -1300 m) }
  asset boat : lifeboat { position = (10 m, -1350 m) }
  agent skipper as skipper controls boat { observes boat.*, b.position, w.position, events }
  unlock tow(x: w) when emitted(service, b)
  success when emitted(service, b) and emitted(tow, w)
}
"""


def test_the_index_holds_the_earlier_task_that_unlocks_a_task() -> None:
    index = InstanceIndex(instantiate(CHAIN))
    assert index.earlier == {("service", "b"): (), ("tow", "w"): (("service", "b"),)}


def test_a_boat_first_does_the_task_that_unlocks_the_other(tmp_path: Path) -> None:
    assert play(CHAIN, tmp_path, policy="oracle", seed=1).report.success


def test_aircraft_stay_at_a_target_until_its_interaction_is_done(tmp_path: Path) -> None:
    masts = """ljs 2
use std.air { quadrotor }
target mast { engine = city, on = ground, look = none, shape = none
  interaction scan { by = multirotor, within = 40 m, lasting = 40 s, told = all } }
mission masts "Masts" {
  goal "Scan both masts."
  scene industrial { extent = 300 m, blocks = 1 by 1, height = 4 m..8 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 25 }
  target mast[1..2] : mast { position = at(i, [(60 m, 20 m), (-60 m, -20 m)]) }
  asset uav : quadrotor { position = (0 m, 6 m, 0.3 m), band = 0 m..40 m
    actions { takeoff, setDestination, stop } }
  agent pilot as pilot controls uav { observes uav.*, mast.position, events }
  success when forall m in mast: emitted(scan, m)
}
"""
    assert play(masts, tmp_path, policy="oracle", seed=1).report.success
