"""Fixtures of the language tests: a small mission without errors, and a mission compiled from its printed text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.testing import compiled, run_command

SMALL = """\
ljs 2
use std.air { quadrotor }
use std.sea { lifeboat, person_in_water }
use std.messages { report, assignment }

mission small "A small mission" {
  goal "Find everybody."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60, policy <= 90 s }
  weather { wind = 4 m/s from 220 deg, visibility = 8 km }
  comms { hub = commander when mode == star, delay = 1 tick, payload <= 4 kB }
  param uavs = 2 in 1..10
  param altitude = 100 m in 40 m..160 m
  mode broadcast in { star, broadcast }
  region search = polygon((0 m, 0 m), (100 m, 0 m), (100 m, 100 m), (0 m, 100 m))
  grid cells over search { shape = 3 by 3, overlap = 20 % }
  target victim[1..3] : person_in_water {
    hidden position ~ sites(search, apart >= 10 m)
  }
  asset uav[1..uavs] : quadrotor {
    position = at(i, [(1 m, 2 m), (3 m, 4 m)], spread 8 m)
    camera nadir { size = 640 by 480, hfov = 84 deg, channels = [rgb] }
    actions { takeoff, forward <= 50 m, takePhoto }
  }
  asset boat : lifeboat { position = (12.4 m, -51.8 m), heading = 30 deg, speed <= 3 m/s }
  agent scout[i in 1..uavs] as searcher controls uav[i] { observes uav[i].*, cells, peers.position }
  agent skipper as rescuer controls boat { observes boat.*, events }
  agent commander as coordinator when mode == star { observes cells }
  authority searcher may command boat when mode == broadcast
  message detection : report from searcher to all
  adjudicate matched(v: victim, r: detection) { when iou(r.box, truth(v, r.frame).box) >= 0.5 }
  unlock rescue(v: victim) when exists r: matched(v, r)
  adjudicate rescued(v: victim) { when emitted(rescue, v) and distance_xy(boat, v) <= 50 m }
  stage detect per v in victim { done when exists r: matched(v, r) }
  stage execute per v in victim { done when rescued(v) }
  relation dependency detect -> execute per v
  success when forall v in victim: rescued(v)
  declassify end because "it ends when all are rescued"
}
"""


@pytest.fixture
def small() -> str:
    """A mission without errors, one declaration a line."""
    return SMALL


@pytest.fixture
def printed_again(tmp_path: Path) -> Callable[[str], tuple[object, object]]:
    """The mission of a text, and the mission of its printed text."""

    def both(text: str) -> tuple[object, object]:
        source, printed = tmp_path / "source.ljs", tmp_path / "printed.ljs"
        source.write_text(text)
        assert run_command(["compile", str(source), "--emit", "ljs", "-o", str(printed)]) == 0
        mission, again = compiled(source), compiled(printed)
        parts = ("parameters", "groups", "rules", "stages", "relations", "constraints", "requirements")
        return tuple(getattr(mission, part) for part in parts), tuple(getattr(again, part) for part in parts)

    return both
