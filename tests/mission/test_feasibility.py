"""Each check of feasibility: just infeasible (with the numbers), exactly feasible (silent), unknown (silent)."""

from __future__ import annotations

import pytest

from lingjing.testing import compile_text
from lingjing.testing.missions import Diagnostic

TYPES = """\
ljs 1
use std.air { quadrotor }
use std.sea { lifeboat, person_in_water }
use std.messages { report, assignment }
asset hound { engine = quadruped, speed = 1 m/s, verb forward(distance: length in 0 m..10 m), verb left(angle: angle) }
asset barge : lifeboat { state cargo = 3 kg }
asset truck {
  engine = road, speed = 10 m/s, hold = 200 kg, state freight = 0 kg
  verb setDestination(x: length, y: length)
}
asset airship { engine = balloon, speed = 1 m/s, verb setDestination(x: length, y: length) }
asset glider { engine = multirotor, cruise = 12 m/s, verb setDestination(x: length, y: length, z: length) }
target buoy { engine = city }
target rock { engine = city, length = 0.48 m, width = 0.64 m, height = 0.6 m }
target order {
  engine = city, state demand = 100 kg
  interaction unload { by = road, within = 50 m, takes = demand, from = freight }
}
target warehouse {
  engine = city, state heap = 10 t
  interaction load { by = road, within = 50 m, gives = freight, up_to = hold, from = heap }
}
mission m "M" {
  goal "G."
  scene map { folder = "m", datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
"""
ANYWHERE = 'map { folder = "m", '
"""A scene of unknown extent."""

SEEN = """
  message detection : report from pilot to all
  adjudicate matched(b: buoy, r: detection) { when iou(r.box, truth(b, r.frame).box) >= 0.5 }
"""
CAMERA = "camera nadir { hfov = 60 deg, size = 640 by 480, channels = [rgb], capture = on_request }"


def diagnostics_of(body: str, ticks: int = 60) -> tuple[Diagnostic, ...]:
    """The diagnostics of a mission with such a body."""
    return compile_text(f"{TYPES}  budget {{ ticks <= {ticks} }}\n{body}\n}}\n").diagnostics


def codes(body: str, ticks: int = 60) -> list[str]:
    """The codes of proofs. Diagnostics of draws that fail by chance are left out."""
    return [item.code for item in diagnostics_of(body, ticks) if item.code.startswith("LJ06")]


def sail(*places: str, asset: str = "lifeboat", controls: bool = True, extra: str = "") -> str:
    """One asset from the origin to within 50 m of each place."""
    goals = "".join(f"  target buoy{k} : buoy {{ position = {place} }}\n" for k, place in enumerate(places))
    success = " and ".join(f"distance_xy(boat, buoy{k}) <= 50 m" for k in range(len(places)))
    control = " controls boat" if controls else ""
    return (
        f"{goals}  asset boat : {asset} {{ position = (0 m, 0 m) {extra} }}\n"
        f"  agent pilot as pilot{control} {{ observes boat.* }}\n  success when {success}"
    )


# 600 s at 1.10 times 3 m/s are 1,980 m; the last 50 m need not be travelled.


def test_travel_time_beyond_the_budget_is_infeasible() -> None:
    (late,) = diagnostics_of(sail("(2031 m, 0 m)"))
    assert late.code == "LJ0601"
    assert "1,981 m at 3.3 m/s at most, margins included, take at least 600.3 s" in late.message
    assert "60 ticks of 10 s = 600 s" in late.message
    assert codes(sail("(2030 m, 0 m)")) == []
    assert codes(sail("(90 km, 0 m)", asset="airship")) == []


def test_travel_to_a_region_is_measured_to_the_nearest_place() -> None:
    region = "  region far = polygon((W m, 0 m), (9000 m, 0 m), (9000 m, 100 m), (W m, 100 m))\n"
    body = sail("(0 m, 0 m)").replace("{ position = (0 m, 0 m) }", "{ hidden position ~ sites(far) }", 1)
    assert codes(region.replace("W", "2031") + body) == ["LJ0601"]
    assert codes(region.replace("W", "2030") + body) == []
    entry = (
        "  asset boat : lifeboat { position = (0 m, 0 m) }\n  agent pilot as pilot controls boat { observes boat.* }\n"
    )
    assert codes(region.replace("W", "1981") + entry + "  success when boat in far") == ["LJ0601"]
    assert codes(region.replace("W", "1980") + entry + "  success when boat in far") == []


def test_wind_and_current_extend_the_reachable_distance() -> None:
    blown = "  weather { wind = 10 m/s from 0 deg, current = 0.5 m/s to 0 deg }\n"
    assert codes(sail("(2600 m, 0 m)")) == ["LJ0601"]
    assert codes(blown + sail("(2600 m, 0 m)")) == []
    assert codes(blown + sail("(2631 m, 0 m)")) == ["LJ0601"]


def test_success_is_infeasible_only_if_every_alternative_is() -> None:
    body = sail("(2031 m, 0 m)", "(10 m, 0 m)")
    assert codes(body) == ["LJ0601"]
    assert codes(body.replace(" and distance", " or distance")) == []
    assert codes(body.replace("success when", "success when not (").replace("buoy1) <= 50 m", "buoy1) <= 50 m)")) == []


# There and back: a - 50 m, then 2 a - 100 m.


def test_a_tour_that_takes_longer_than_the_budget_is_infeasible() -> None:
    (long,) = diagnostics_of(sail("(711 m, 0 m)", "(-711 m, 0 m)"))
    assert long.code == "LJ0602"
    assert "at least 1,983 m, which at 3.3 m/s at most, margins included, takes 600.9 s" in long.message
    assert codes(sail("(710 m, 0 m)", "(-710 m, 0 m)")) == []
    assert codes(sail("(9 km, 0 m)", "(-9 km, 0 m)", asset="airship")) == []


def test_a_tour_that_two_vessels_share_is_feasible() -> None:
    body = """
  target v[1..2] : person_in_water { position = at(i, [(A m, 0 m), (-A m, 0 m)]) }
  asset boat[1..2] : lifeboat { position = at(i, [(0 m, 0 m), (0 m, 9 m)]) }
  agent pilot[i in 1..2] as pilot controls boat[i] { observes boat[i].* }
  unlock rescue(v: v) when true
  success when forall v in v: emitted(rescue, v)"""
    assert codes(body.replace("A", "2030")) == []
    assert codes(body.replace("A", "2031")) == ["LJ0601"]


def test_the_option_apart_bounds_the_tour_of_drawn_places() -> None:
    body = """
  region sea = polygon((0 m, -2000 m), (4000 m, -2000 m), (4000 m, 2000 m), (0 m, 2000 m))
  target v[1..4] : buoy { hidden position ~ sites(sea, apart >= APART m) }
  asset boat : lifeboat { position = (0 m, 0 m) }
  agent pilot as pilot controls boat { observes boat.* }
  success when forall v in v: distance_xy(boat, v) <= 50 m"""
    assert codes(body.replace("APART", "760")) == []  # three legs of 660 m
    assert codes(body.replace("APART", "761")) == ["LJ0602"]
    assert (
        codes(body.replace("distance_xy(boat, v) <= 50 m", "distance_xy(boat, v) <= 150 m").replace("APART", "900"))
        == []
    )


def test_one_tick_is_too_short_for_a_picture_and_a_report() -> None:
    body = """
  target buoy : buoy { position = (0 m, 0 m) }
  asset boat : quadrotor { position = (0 m, 0 m, 0 m), CAMERA }
  agent pilot as pilot controls boat { observes boat.* }
  success when exists r: matched(buoy, r)"""
    on_request, by_itself = (
        body.replace("CAMERA", CAMERA),
        body.replace("CAMERA", CAMERA.replace("on_request", "each_tick")),
    )
    assert codes(SEEN + on_request, ticks=1) == ["LJ0602"]
    assert codes(SEEN + on_request, ticks=2) == []
    assert codes(SEEN + by_itself, ticks=1) == []


# A battery of 120 s lasts for 240 s at half of the power of hovering: 3,312 m at 1.15 times 12 m/s.


def test_a_flight_longer_than_the_battery_lasts_is_infeasible() -> None:
    endurance = ", endurance = 2 min"
    (weak,) = diagnostics_of(sail("(3363 m, 0 m)", asset="quadrotor", extra=endurance))
    assert weak.code == "LJ0603"
    assert "3,313 m at 13.8 m/s at most are at least 240.07 s of flight, `boat` can fly for 240 s" in weak.message
    assert codes(sail("(3362 m, 0 m)", asset="quadrotor", extra=endurance)) == []
    assert codes(sail("(3363 m, 0 m)", asset="glider")) == []


def test_a_tour_longer_than_the_battery_lasts_is_infeasible() -> None:
    # 3 a - 150 m = 3,312 m
    endurance = ", endurance = 2 min"
    assert codes(sail("(1154 m, 0 m)", "(-1154 m, 0 m)", asset="quadrotor", extra=endurance)) == []
    (weak,) = diagnostics_of(sail("(1155 m, 0 m)", "(-1155 m, 0 m)", asset="quadrotor", extra=endurance))
    assert weak.code == "LJ0603" and "3,315 m, the batteries last for 3,312 m" in weak.message


def cargo(demand: str, orders: int = 1, way: float = 2400, store: str = "warehouse") -> str:
    return f"""
  target depot : {store} {{ position = (0 m, 0 m) }}
  target o[1..{orders}] : order {{ position = ({way + 100} m, 0 m), demand = {demand} }}
  asset van : truck {{ position = (0 m, 0 m) }}
  agent driver as driver controls van {{ observes van.* }}
  success when forall o in o: o.demand <= 0 kg"""


def test_an_order_heavier_than_a_load_is_delivered_in_several_loads() -> None:
    assert codes(cargo("250 kg")) == []
    assert codes(cargo("250 kg, split = false")) == [], "a name that no page gives a meaning has none"


def test_more_loads_than_the_vehicles_can_bring_in_time_are_infeasible() -> None:
    # 600 s at 1.6 times 10 m/s are 9,600 m: two ways there and back of 2,400 m each way, so three loads.
    assert codes(cargo("200 kg", orders=3)) == []
    (many,) = diagnostics_of(cargo("200 kg", orders=3, way=2401))
    assert many.code == "LJ0604"
    assert "3 orders require 600 kg, but 1 vehicles bring 400 kg at most: 2 loads" in many.message
    assert codes(cargo("201 kg", orders=3)) == ["LJ0604"]
    (unsupplied,) = diagnostics_of(cargo("200 kg", orders=9, store="buoy"))
    assert "there is no warehouse, and the vehicles hold 0 kg" in unsupplied.message


def test_properties_that_no_declaration_refers_to_are_ignored() -> None:
    unbounded = TYPES.replace("hold = 200 kg", "hold = 20 t, capacity = 1 kg, payload = 1 kg, stock = 1 kg")
    body = cargo("250 kg", orders=9, way=2401)
    text = f"{unbounded}  budget {{ ticks <= 60 }}\n{body}\n}}\n"
    assert [item.code for item in compile_text(text).diagnostics] == []
    narrow = TYPES.replace("length = 0.48 m, width = 0.64 m, height = 0.6 m", "diameter = 1 m, size = 1 m")
    text = f"{narrow}  budget {{ ticks <= 60 }}\n{SEEN + seeing(8000)}\n}}\n"
    assert [item.code for item in compile_text(text).diagnostics] == []


def test_travel_allows_for_the_displacement_of_targets_onto_roads() -> None:
    far = sail("(2031 m, 0 m)").replace("position = (2031 m, 0 m)", "position = (2031 m, 0 m), on = road")
    assert codes(far) == [] and codes(far.replace("2031", "2090")) == []  # 50 m, and 10 m beside the place
    assert codes(far.replace("2031", "2092")) == ["LJ0601"]


def test_demand_above_the_stock_of_the_warehouse_is_infeasible() -> None:
    assert codes(cargo("5 t", orders=2, way=0)) == []
    assert codes(cargo("5.1 t", orders=2, way=0)) == ["LJ0604"]


def seeing(
    band: float, what: str = "rock", actions: str = "setDestination, takePhoto", capture: str = "on_request"
) -> str:
    return f"""
  target buoy : {what} {{ position = (0 m, 0 m, 0 m) }}
  asset uav : quadrotor {{
    position = (0 m, 0 m, 0 m), band = {band} m..9000 m
    {CAMERA.replace("on_request", capture)}
    actions {{ {actions} }}
  }}
  agent pilot as pilot controls uav {{ observes uav.* }}
  success when exists r: matched(buoy, r)"""


def test_a_target_that_is_too_small_in_pictures_is_infeasible() -> None:
    # f = 554.26 px; the corner, 400 px off the axis, adds (400 / f)^2 = 0.5208; a body of 1 m with its top 1 m up.
    height = 554.256 * 1.520833 / 2 + 1.5
    assert codes(SEEN + seeing(height - 0.1)) == []
    (small,) = diagnostics_of(SEEN + seeing(height + 0.1))
    assert small.code == "LJ0608"
    assert "1 m seen by `uav.nadir` (640 by 480 px, 60 deg)" in small.message
    assert "2 px are needed" in small.message
    assert codes(SEEN + seeing(8000, what="buoy")) == []


def test_a_report_is_infeasible_if_no_asset_can_take_pictures() -> None:
    assert codes(SEEN + seeing(20)) == []
    assert codes(SEEN + seeing(20, actions="setDestination")) == ["LJ0609"]
    assert codes(SEEN + seeing(20, actions="setDestination", capture="each_tick")) == []
    blind = "\n".join(line for line in seeing(20).splitlines() if "camera" not in line)
    (none,) = diagnostics_of(SEEN + blind)
    assert none.code == "LJ0609" and "no asset of this mission has a camera" in none.message


def test_a_report_is_infeasible_if_no_agent_can_send_the_message() -> None:
    watcher = "  agent watcher as watcher { observes uav.* }\n"
    idle = "  agent boss as boss when mode == star { observes uav.* }\n"
    comms = "  mode broadcast in { star, broadcast }\n  comms { hub = pilot when mode == star }\n"
    assert codes(comms + SEEN.replace("from pilot", "from boss") + seeing(20) + "\n" + idle) == ["LJ0605"]
    assert codes(SEEN.replace("from pilot", "from watcher") + seeing(20) + "\n" + watcher) == []
    guarded = SEEN.replace("from pilot to all", "from pilot to all when mode == star")
    (closed,) = diagnostics_of(comms + guarded + seeing(20))
    assert closed.code == "LJ0605" and closed.message.startswith("in broadcast mode, ")


def test_an_assignment_needs_a_controlling_agent_or_an_assignment_message() -> None:
    assigned = sail("(0 m, 0 m)").replace("distance_xy(boat, buoy0) <= 50 m", "assigned(boat, buoy0)")
    assert codes(assigned) == []
    idle = assigned.replace(" controls boat", "")
    assert codes(idle) == ["LJ0607"]
    assert codes("  message order : assignment from pilot to all\n" + idle) == []


def test_an_asset_without_a_controlling_agent_does_not_move() -> None:
    (idle,) = diagnostics_of(sail("(51 m, 0 m)", controls=False))
    assert idle.code == "LJ0607" and "1 m too far away" in idle.message
    assert codes(sail("(50 m, 0 m)", controls=False)) == []
    assert codes(sail("(9 km, 0 m)", controls=False, asset="truck")) == []


def test_a_limit_below_the_required_messages_is_infeasible() -> None:
    body = """
  target buoy[1..3] : buoy { position = (0 m, 0 m) }
  asset uav : quadrotor { position = (0 m, 0 m, 0 m), CAMERA }
  agent pilot as pilot controls uav { observes uav.* }
  success when forall b in buoy: exists r: matched(b, r)""".replace("CAMERA", CAMERA)
    assert codes("  limit talk <= 3 counts detection\n" + SEEN + body) == []
    (few,) = diagnostics_of("  limit talk <= 2 counts detection\n" + SEEN + body)
    assert few.code == "LJ0610" and "at least 3 messages (3 `detection`), and `talk` allows 2" in few.message
    loose = SEEN.replace("iou(r.box, truth(b, r.frame).box) >= 0.5", "r.confidence > 0")
    assert codes("  limit talk <= 1 counts detection\n" + loose + body) == []


def test_a_limit_below_the_required_commands_is_infeasible() -> None:
    # A step of 10 m carries at most 10 m * 1.25 + 2 m; ten of them are 145 m.
    moves = "  limit moves <= N counts boat.forward, boat.left\n"
    body = sail("(195 m, 0 m)", asset="hound")
    assert codes(moves.replace("N", "10") + body) == []
    (few,) = diagnostics_of(moves.replace("N", "9") + body)
    assert few.code == "LJ0610"
    assert "145 m, which at 14.5 m a command at most takes 10 commands, and `moves` allows 9" in few.message
    assert codes(moves.replace("N", "1").replace("boat.forward, ", "") + body) == []


def test_a_stage_budget_shorter_than_the_travel_time_is_infeasible() -> None:
    body = sail("(380 m, 0 m)") + "\n  stage go { done when distance_xy(boat, buoy0) <= 50 m, ticks <= N }"
    assert codes(body.replace("N", "10")) == []
    (late,) = diagnostics_of(body.replace("N", "9"))
    assert late.code == "LJ0601" and "the budget of stage `go` is 9 ticks of 10 s = 90 s" in late.message
    later = body.replace("N", "9") + "\n  stage wait { done when boat.speed > 0 m/s }\n  relation dependency wait -> go"
    assert codes(later.replace("boat.speed > 0 m/s", "distance_xy(boat, buoy0) <= 400 m")) == []


def test_an_unlock_that_depends_on_itself_is_infeasible() -> None:
    body = """
  target v : person_in_water { position = (0 m, 0 m) }
  asset boat : lifeboat { position = (0 m, 0 m) }
  agent pilot as pilot controls boat { observes boat.* }
  adjudicate rescued(v: v) { when emitted(rescue, v) }
  unlock rescue(v: v) when WHEN
  success when rescued(v)"""
    assert codes(body.replace("WHEN", "rescued(v)")) == ["LJ0606"]
    assert codes(body.replace("WHEN", "distance_xy(boat, v) <= 10 m and rescued(v)")) == ["LJ0606"]
    assert codes(body.replace("WHEN", "distance_xy(boat, v) <= 10 m or rescued(v)")) == []


def test_more_places_than_fit_into_a_region_are_infeasible() -> None:
    # Groemer: 2/sqrt(3) * 100^2 / 50^2 + 400 / 100 + 1 = 9.6
    body = """
  region yard = box((0 m, 0 m), (100 m, 100 m))
  target v[1..N] : buoy { hidden position ~ sites(yard, apart >= 50 m) }
  asset boat : lifeboat { position = (0 m, 0 m) }
  agent pilot as pilot controls boat { observes boat.* }
  success when exists v in v: distance_xy(boat, v) <= 50 m"""
    assert codes(body.replace("N", "9")) == []
    (full,) = (item for item in diagnostics_of(body.replace("N", "10")) if item.code.startswith("LJ06"))
    assert full.code == "LJ0611" and "at most 9 can" in full.message


def test_exists_over_an_empty_group_is_infeasible() -> None:
    modes = "  mode broadcast in { star, broadcast }\n  comms { hub = pilot when mode == star }\n"
    body = modes + sail("(0 m, 0 m)").replace("buoy0 : buoy {", "b[1..2] : buoy when mode == star {")
    exists = body.replace("distance_xy(boat, buoy0) <= 50 m", "exists b in b: distance_xy(boat, b) <= 50 m")
    (none,) = diagnostics_of(exists)
    assert none.code == "LJ0612" and none.message == "in broadcast mode, there is no `b` in this mission"
    assert codes(exists.replace("exists b", "forall b")) == []
    assert codes(exists.replace(" when mode == star {", " {")) == []


SAIL = sail("(380 m, 0 m)")


def test_an_unneeded_stage_is_infeasible_only_if_it_fails_before_success() -> None:
    bonus = "\n  target far : buoy { position = (90 km, 0 m) }\n  stage bonus { done when distance_xy(boat, far) <= 9 m"
    assert codes(SAIL + bonus + " }") == []
    assert codes(SAIL + bonus + ", ticks <= 10 }") == []  # success may come first
    assert codes(SAIL + bonus + ", ticks <= 9 }") == ["LJ0601"]  # the stage is late before success can hold


def test_an_unlock_may_be_circular_if_success_does_not_need_the_interaction() -> None:
    body = """
  target v : person_in_water { position = (0 m, 0 m) }
  target w : buoy { position = (300 m, 0 m) }
  asset boat : lifeboat { position = (0 m, 0 m) }
  agent pilot as pilot controls boat { observes boat.* }
  unlock rescue(v: v) when emitted(rescue, v)
  success when distance_xy(boat, w) <= 50 m"""
    assert codes(body) == []
    assert codes(body.replace("success when ", "success when emitted(rescue, v) and ")) == ["LJ0606"]


WINS_ITSELF = [
    "now >= 0 s",
    "true",
    "not emitted(rescue, v)",
    "v.drift <= 1 m/s and boat.cargo >= 3 kg",
    "count(distance_xy(boat, w) <= 350 m for w in v) >= 1",
    "forall m in detection: m.confidence > 2",
    "near()",
]
PERHAPS = [
    "now >= 1 s",
    "boat.speed >= 0 m/s",
    "distance_xy(boat, v) <= 200 m",
    "emitted(rescue, v) or distance_xy(boat, v) <= 9 m",
    "exists m in detection: m.confidence > 0",
    "not near()",
    "now > 0 s",
]


@pytest.mark.parametrize("condition", WINS_ITSELF + PERHAPS)
def test_a_success_condition_that_holds_at_the_start_is_reported(condition: str) -> None:
    body = f"""
  target v : person_in_water {{ position = (300 m, 0 m) }}
  asset boat : barge {{ position = (0 m, 0 m) }}
  agent pilot as pilot controls boat {{ observes boat.* }}
  message detection : report from pilot to all
  adjudicate near() {{ when distance_xy(boat, v) <= 301 m }}
  unlock rescue(v: v) when now >= 0 s
  success when {condition}"""
    text = f"{TYPES.replace(ANYWHERE, 'bay { ')}  budget {{ ticks <= 60 }}\n{body}\n}}\n"
    diagnostics = [(diagnostic.code, diagnostic.severity) for diagnostic in compile_text(text).diagnostics]
    assert diagnostics == ([("LJ0510", "warning")] if condition in WINS_ITSELF else [])


def test_a_state_that_no_interaction_raises_keeps_its_value() -> None:
    body = """
  asset boat : barge { position = (0 m, 0 m) }
  agent pilot as pilot controls boat { observes boat.* }
  success when boat.cargo >= CARGO kg and now > 5 s"""
    assert codes(body.replace("CARGO", "3")) == []
    assert codes(body.replace("CARGO", "4")) == ["LJ0612"]
    filled = "  target quay : buoy { interaction fill { by = vessel, within = 9 m, gives = cargo, up_to = hold } }\n"
    assert codes(filled.replace("{ inter", "{ position = (0 m, 9 m), inter") + body.replace("CARGO", "4")) == []


def test_an_unlock_may_wait_for_an_interaction_of_a_group_without_an_unlock() -> None:
    body = """
  target v : person_in_water { position = (0 m, 0 m) }
  target w : person_in_water { position = (300 m, 0 m) }
  asset boat : lifeboat { position = (0 m, 0 m) }
  agent pilot as pilot controls boat { observes boat.* }
  unlock rescue(v: v) when emitted(rescue, w)
  success when emitted(rescue, v)"""
    assert codes(body) == []
