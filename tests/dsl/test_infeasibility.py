"""Every code of a proof has an example that fixes its line, its column and the numbers in its message."""

from __future__ import annotations

import pytest

from lingjing.dsl.diagnostics.codes import CODES
from lingjing.testing import compile_text

BLIND = "constraint hard blind per u in uav { always not photographed(u) }"
# code, replaced text of the small mission, its replacement, line, column, a part of the message
CASES = [
    ("LJ0601", "-51.8 m", "-2951.8 m", 34, 14, "2,901.8 m at 3.5 m/s at most, margins included, take at least 829 s"),
    ("LJ0601", "ticks <= 60", "ticks <= 2", 34, 14, "the budget is 2 ticks of 10 s = 20 s"),
    ("LJ0602", "ticks <= 60", "ticks <= 1", 38, 3, "takes at least 2 ticks, the budget is 1 tick"),
    ("LJ0605", "report from searcher", "report from coordinator", 33, 10, "in broadcast mode, no agent can send"),
    ("LJ0606", "exists r: matched(v, r)\n  adj", "rescued(v)\n  adj", 33, 10, "that for `rescued(victim[1])` again"),
    ("LJ0607", "emitted(rescue, v)", "emitted(rescue, v) and assigned(uav[1], v)", 34, 14, "no agent can assign"),
    ("LJ0608", "    camera", "    band = 2 km..3 km\n    camera", 33, 14, "1.007 px at most, 2 px are needed"),
    ("LJ0609", ", takePhoto }", " }", 32, 14, "`takePhoto` is not among its actions"),
    ("LJ0610", "  unlock", "  limit talk <= 2 counts detection\n  unlock", 33, 9, "and `talk` allows 2"),
    ("LJ0611", "apart >= 10 m", "apart >= 200 m", 18, 10, "3 places at least 200 m apart cannot fit into 1 ha"),
    ("LJ0612", "forall v in victim: rescued(v)", "count(rescued(v) for v in victim) >= 4", 38, 3, "there are 3"),
    ("LJ0612", "forall v in victim: rescued(v)", "rescued(victim[1]) and 1 > 2", 38, 3, "`1 > 2` never holds"),
    ("LJ0612", "forall v in victim: rescued(v)", "now < 0 s", 38, 3, "`now < 0 s` never holds"),
    ("LJ0612", "forall v in victim: rescued(v)", "not (uavs <= 10)", 38, 3, "`not uavs <= 10` never holds"),
    ("LJ0613", "  success", "  event g at 60 tick { appear victim[1] }\n  success", 18, 10, "appears at 600 s"),
    ("LJ0614", "  success", f"  {BLIND}\n  success", 32, 14, "a hard constraint forbids what it needs of `phot"),
]  # fmt: skip
FAR = """\
ljs 1
use std.air { quadrotor }
mission far "A far place" {
  goal "Fly over the rock."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  asset uav : quadrotor { position = (0 m, 0 m, 1 m), endurance = 2 min, actions { takeoff, setDestination } }
  agent pilot as pilot controls uav { observes uav.* }
  success when distance_xy(uav, (5 km, 0 m)) <= 25 m
}
"""
CARGO = """\
ljs 1
asset truck {
  engine = road, speed = 10 m/s, payload = 200 kg, state load = 0 kg
  verb setDestination(x: length, y: length)
}
target warehouse { engine = city, interaction load { by = road, within = 50 m, gives = load, up_to = payload } }
target order {
  engine = city, state demand = 100 kg
  interaction unload { by = road, within = 50 m, takes = demand, from = load }
}
mission cargo "One heavy order" {
  goal "Bring it."
  scene logistics { extent = 1500 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  target depot : warehouse { position = (0 m, 0 m) }
  target heavy : order { position = (500 m, 0 m), demand = 50 t }
  asset van : truck { position = (0 m, 0 m), actions { setDestination } }
  agent driver as driver controls van { observes van.* }
  success when heavy.demand <= 0 kg
}
"""


@pytest.mark.parametrize(("code", "old", "new", "line", "column", "part"), CASES, ids=lambda value: str(value)[:24])
def test_an_infeasible_mission_gives_its_code_line_column_and_numbers(
    small: str, code: str, old: str, new: str, line: int, column: int, part: str
) -> None:
    moved = small.replace("-51.8 m", "-151.8 m") if "= 20 s" in part else small
    assert moved.count(old) >= 1
    compilation = compile_text(moved.replace(old, new, 1))
    (diagnostic,) = compilation.diagnostics
    assert (diagnostic.code, diagnostic.span.line, diagnostic.span.column) == (code, line, column)
    assert part in diagnostic.message
    assert diagnostic.severity == "error" and compilation.mission is None


def test_a_proof_for_a_mode_other_than_the_default_is_a_warning(small: str) -> None:
    def severity(text: str) -> tuple[str, ...]:
        return tuple(item.severity for item in compile_text(text).diagnostics)

    closed = small.replace(
        "message detection : report from searcher to all",
        "message detection : report from searcher to all when mode == MODE",
    )
    assert severity(closed.replace("MODE", "star")) == ("error",)
    assert severity(closed.replace("MODE", "broadcast")) == ("warning",)


def test_stages_that_wait_for_each_other_are_a_warning(small: str) -> None:
    text = small.replace("per v\n  success", "per v\n  relation dependency execute -> detect\n  success")
    (diagnostic,) = compile_text(text).diagnostics
    assert (diagnostic.code, diagnostic.severity) == ("LJ0606", "warning")
    assert "these stages wait for each other: `detect` -> `execute` -> `detect`" in diagnostic.message


@pytest.mark.parametrize(
    ("text", "code", "line", "part"),
    [(FAR, "LJ0603", 10, "360 s of flight, `uav` can fly for 240 s"), (CARGO, "LJ0604", 20, "50,000 kg")],
)
def test_infeasible_flight_and_cargo_missions_give_their_codes(text: str, code: str, line: int, part: str) -> None:
    (diagnostic,) = compile_text(text).diagnostics
    assert (diagnostic.code, diagnostic.span.line) == (code, line)
    assert part in diagnostic.message


def test_corrected_flight_and_cargo_missions_have_no_errors() -> None:
    assert compile_text(FAR.replace("2 min", "10 min")).diagnostics == ()
    assert compile_text(CARGO.replace("50 t", "250 kg")).diagnostics == ()


def test_every_code_of_a_proof_has_an_example() -> None:
    assert {case[0] for case in CASES} | {"LJ0603", "LJ0604", "LJ0615"} == {
        code for code in CODES if code.startswith("LJ06")
    }


def test_related_places_are_the_budget_the_vehicle_and_the_goal(small: str) -> None:
    (diagnostic,) = compile_text(small.replace("-51.8 m", "-2951.8 m")).diagnostics
    assert [(item.span.line, item.message) for item in diagnostic.related] == [
        (10, "the budget"), (26, "the vehicle"), (18, "the destination")
    ]  # fmt: skip


def test_nothing_is_proved_of_a_mission_with_other_errors(small: str) -> None:
    broken = small.replace("-51.8 m", "-2951.8 m").replace("hfov = 84 deg", "hfov = 84 m")
    assert [item.code for item in compile_text(broken).diagnostics] == ["LJ0203"]
