"""Each construct beyond the first subset, in the small mission: its lowered form, and its errors."""

from __future__ import annotations

import math

import pytest

from lingjing import Mission
from lingjing.mission.instance import Instance, StateSpec
from lingjing.testing import compile_text, instantiate
from lingjing.testing import expressions as ex


def added(small: str, *lines: str, use: str = "") -> Mission:
    """The small mission with more statements at its end; must be without errors."""
    text = small.replace("  success when", "\n".join(f"  {line}" for line in lines) + "\n  success when")
    compilation = compile_text(text.replace("use std.air", f"{use}\nuse std.air") if use else text)
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    return compilation.mission


def made(small: str, *lines: str, mode: str = "broadcast", use: str = "") -> Instance:
    return instantiate(added(small, *lines, use=use), mode=mode)


def in_town(small: str) -> str:
    """The small mission where there are roads."""
    return small.replace("scene bay {", "scene coastal {")


def fault(small: str, *lines: str) -> tuple[str, str]:
    """Code and message of the only error that these statements cause."""
    text = small.replace("  success when", "\n".join(f"  {line}" for line in lines) + "\n  success when")
    (diagnostic,) = compile_text(text).diagnostics
    return diagnostic.code, diagnostic.message


# -- events


def test_events_change_the_weather_and_the_targets_that_are_present(small: str) -> None:
    instance = made(
        small,
        "event squall at 20 tick { weather { visibility = 1 km } }",
        "event late   at 35 s    { appear victim[3] }",
        "event gone   at ~ uniform(30 tick, 40 tick) when mode == broadcast { vanish victim[1] }",
    )
    assert [(event.name, event.appear, event.vanish) for event in instance.events] == [
        ("late", ("victim[3]",), ()),
        ("squall", (), ()),
        ("gone", (), ("victim[1]",)),
    ]
    assert [event.tick for event in instance.events[:2]] == [4, 20]
    assert 30 <= instance.events[2].tick <= 40
    squall = instance.events[1].weather
    assert squall is not None and (squall.visibility_m, squall.wind_mps) == (1000.0, 4.0)
    assert [entity.dormant for entity in instance.entities if entity.group == "victim"] == [False, False, True]
    assert len(made(small, "event gone at 3 tick when mode == star { vanish victim[1] }").events) == 0


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("event e at 12 { vanish victim[1] }", "LJ0202"),
        ("event e at 12 m { vanish victim[1] }", "LJ0203"),
        ("event e at -1 tick { vanish victim[1] }", "LJ0206"),
        ("event e at 1 tick { vanish boat }", "LJ0201"),
        ("event e at 1 tick { appear nobody }", "LJ0101"),
        ("event e at 1 tick { }", "LJ0106"),
        ("event e at ~ victim[1] { vanish victim[1] }", "LJ0301"),
        ('event e at 1 tick { goal "no" }', "LJ0107"),
    ],
)
def test_a_faulty_event_gives_its_code(small: str, line: str, code: str) -> None:
    assert fault(small, line)[0] == code


# -- limits, permits, constraints, inspections


def test_a_limit_counts_commands_and_messages(small: str) -> None:
    instance = made(small, "limit moves <= 2 * uavs counts uav.*, boat.moveTo, detection")
    (limit,) = instance.limits
    assert (limit.name, limit.most, limit.stage) == ("moves", 4, "")
    assert [(item.kind, item.resource, item.name) for item in limit.counts] == [
        ("command", "uav[1]", ""),
        ("command", "uav[2]", ""),
        ("command", "boat", "moveTo"),
        ("message", "", "detection"),
    ]


def test_a_stage_has_limits_of_its_own(small: str) -> None:
    text = small.replace(
        "{ done when rescued(v) }", "{ done when rescued(v), ticks <= 40, weight = 2\n limit tries <= 3 counts boat.* }"
    ).replace("declassify end", "declassify end, execute, tries")
    mission = compile_text(text).mission
    assert mission is not None
    instance = instantiate(mission)
    stage = instance.stages[1]
    assert (stage.ticks, stage.weight) == (ex.Number(40.0), ex.Number(2.0))
    assert [(limit.name, limit.stage) for limit in instance.limits] == [("tries", "execute")]


def test_a_permit_applies_to_one_verb_or_to_each_member_of_a_group(small: str) -> None:
    (permit,) = made(
        small,
        "permit boat.moveTo when exists r: matched(victim[1], r)",
        'declassify boat.moveTo because "it waits for a report"',
    ).permits
    assert (permit.resource, permit.verb) == ("boat", "moveTo")
    assert [p.resource for p in made(small, "permit uav when now > 60 s").permits] == ["uav[1]", "uav[2]"]


def test_a_constraint_is_hard_or_soft_with_a_penalty(small: str) -> None:
    instance = made(
        small,
        "constraint hard fence per u in uav { always u in search }",
        "constraint soft low per u in uav { always u.position.elevation >= altitude - 20 m, penalty = 10 % }",
    )
    assert [(c.kind, c.variable, c.domain, c.penalty) for c in instance.constraints] == [
        ("hard", "u", "uav", None),
        ("soft", "u", "uav", ex.Number(0.1)),
    ]


def test_an_inspection_has_its_asset_inspectors_distance_order_and_message(small: str) -> None:
    use = "use std.ground { car }"
    lines = (
        "asset van : car { position = (5 m, 5 m) }",
        "inspection check of van by uav { within = 25 m, replan = detection }",
        "limit again <= 3 counts detection",
        "permit van.setDestination when inspected(check) and clear(check) and replans(check) <= 3 and used(again) < 3",
        'declassify van.setDestination because "the van waits until its route is clear"',
    )
    (inspection,) = made(in_town(small), *lines, use=use).inspections
    assert (inspection.asset, inspection.by, inspection.within_m, inspection.order, inspection.replan) == (
        "van", ("uav[1]", "uav[2]"), 25.0, "strict", "detection",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("limit m <= 3.5 counts uav.*", "LJ0206"),
        ("limit m <= 3 counts uav.fly", "LJ0113"),
        ("limit m <= 3 counts victim.*", "LJ0114"),
        ("limit m <= 3 s counts uav.*", "LJ0203"),
        ("permit boat.moveTo when 3", "LJ0201"),
        ("permit victim when true", "LJ0114"),
        ("constraint firm f { always true }", "LJ0109"),
        ("constraint hard f { when true }", "LJ0110"),
        ("constraint hard f { }", "LJ0106"),
        ("constraint hard f { always true, penalty = 0.5 }", "LJ0110"),
        ("inspection i of uav by boat { within = 3 m }", "LJ0201"),
        ("inspection i of boat by uav { order = any }", "LJ0106"),
        ("inspection i of boat by uav { within = 3 m, replan = nothing }", "LJ0101"),
        ("adjudicate a() { when inspected(nothing) }", "LJ0101"),
        ("adjudicate a() { when used(3) > 1 }", "LJ0201"),
    ],
)
def test_a_faulty_limit_permit_constraint_or_inspection_gives_its_code(small: str, line: str, code: str) -> None:
    assert fault(small, line)[0] == code


# -- numbers in rules


def test_aggregates_in_rules_are_lowered_to_expressions(small: str) -> None:
    use = "use std.logistics { delivery_point }"
    mission = added(
        in_town(small),
        "target order[1..3] : delivery_point {",
        "position ~ sites(search), state demand = at(i, [250 kg], rest = 100 kg) }",
        "adjudicate done_all() {",
        "when sum(o.demand for o in order) <= 0 kg and count(rescued(v) for v in victim) >= 2 }",
        "adjudicate near() { when max(distance_xy(boat, v) for v in victim) <= 5 m or abs(min(1, 2)) > 3 }",
        use=use,
    )
    rule = next(rule for rule in mission.rules if rule.name == "done_all")
    assert isinstance(rule.condition, ex.Binary) and isinstance(rule.condition.left, ex.Binary)
    assert rule.condition.left.left == ex.Aggregate("sum", "o", "order", ex.Attr(ex.Ref("o", "local"), "demand_kg"))
    instance = instantiate(mission)
    orders = [entity for entity in instance.entities if entity.group == "order"]
    assert [order.properties["demand_kg"] for order in orders] == [250.0, 100.0, 100.0]
    assert {order.state for order in orders} == {(StateSpec(name="demand", unit="kg"),)}


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("adjudicate a() { when sum(rescued(v) for v in victim) > 1 }", "LJ0201"),
        ("adjudicate a() { when count(v for v in victim) > 1 }", "LJ0201"),
        ("adjudicate a() { when count(rescued(v) for v in nobody) > 1 }", "LJ0101"),
        ("adjudicate a() { when sum(3) > 1 }", "LJ0306"),
        ("adjudicate a() { when iou(v for v in victim) > 1 }", "LJ0306"),
        ("param n = count(rescued(v) for v in victim)", "LJ0304"),
        ("region r = (search for v in victim)", "LJ0012"),
        ("param later = now", "LJ0304"),
    ],
)
def test_a_faulty_aggregate_gives_its_code(small: str, line: str, code: str) -> None:
    text = small.replace("  success when", f"  {line}\n  success when")
    assert compile_text(text).diagnostics[0].code == code


# -- regions, draws


def test_regions_are_computed_from_lines_regions_roads_and_entities(small: str) -> None:
    instance = made(
        small,
        "region line  = buffer([(0 m, 0 m), (100 m, 0 m)], 10 m)",
        "region wide  = buffer(search, 5 m)",
        "region both  = union(search, box((90 m, 50 m), (200 m, 60 m)))",
        'region bund  = along(road("Zhongshan East 1st Road"), 20 m)',
        "region berth = circle(boat, 30 m)",
        "region near  = circle(victim[1], 30 m)",
    )
    regions = {region.name: region for region in instance.regions}
    line, both, wide = (regions[name].polygon for name in ("line", "both", "wide"))
    assert sorted(line) == [(0, -10), (0, 10), (100, -10), (100, 10)]
    assert len(both) == 8 and {(0, 0), (0, 100), (100, 0), (100, 100), (200, 50), (200, 60)} < set(both)
    assert [bound(axis) for axis in zip(*wide, strict=True) for bound in (min, max)] == [-5, 105, -5, 105]
    assert regions["bund"].polygon == () and regions["bund"].on_map is not None
    assert regions["near"].hidden and not regions["berth"].hidden
    assert len(regions["berth"].polygon) == 64
    assert all(math.dist(corner, (12.4, -51.8)) == pytest.approx(30, rel=0.01) for corner in regions["berth"].polygon)


def test_subset_draws_without_repeats_and_apart(small: str) -> None:
    text = small.replace(
        "~ sites(search, apart >= 10 m)", "~ subset([(1 m, 1 m), (2 m, 1 m), (50 m, 1 m), (90 m, 1 m)], apart >= 20 m)"
    )
    mission = compile_text(text).mission
    assert mission is not None
    for seed in range(10):
        places = sorted(e.position[0] for e in instantiate(mission, seed=seed).entities if e.role == "target")
        assert len(places) == 3 and places[1:] == [50.0, 90.0]


# -- sweeps


def test_a_sweep_has_its_parameters_values_and_condition(small: str) -> None:
    mission = added(
        small,
        "sweep team over uavs in 1..3, altitude in [60 m, 100 m] when mode == star",
    )
    (sweep,) = mission.sweeps
    assert sweep.parameters == ("uavs", "altitude")
    assert sweep.values == (
        (ex.Number(1.0), ex.Number(2.0), ex.Number(3.0)),
        (ex.Number(60.0, "m"), ex.Number(100.0, "m")),
    )
    assert sweep.when is not None


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("sweep s over nothing in [1]", "LJ0101"),
        ("sweep s over uavs in [1 m]", "LJ0203"),
        ("sweep s over uavs in [1, 99]", "LJ0206"),
        ("sweep s over uavs in 3", "LJ0201"),
        ("sweep s over uavs in []", "LJ0206"),
        ("sweep s over uavs in [1], uavs in [2]", "LJ0103"),
        ("sweep s over altitude in 40 m..10040 m", "LJ0503"),
    ],
)
def test_a_faulty_sweep_gives_its_code(small: str, line: str, code: str) -> None:
    assert fault(small, line)[0] == code


# -- agents and their prompts


def test_authority_can_be_shared_and_an_agent_can_have_its_own_budget(small: str) -> None:
    instance = made(
        small,
        "authority searcher, coordinator may command boat",
        "agent helper as extra { observes boat.*, uav[1].nadir\n budget { tokens <= 5000 tokens, messages <= 40 } }",
        mode="star",
    )
    commands = {agent.id: agent.commands for agent in instance.agents}
    assert "boat" in commands["commander"] and "boat" in commands["scout[1]"]
    helper = next(agent for agent in instance.agents if agent.id == "helper")
    assert helper.budget is not None and (helper.budget.tokens, helper.budget.messages) == (5000, 40)
    assert helper.observes[1].fields == ("nadir",)


def test_the_mode_single_is_for_one_agent(small: str) -> None:
    text = small.replace("mode broadcast in { star, broadcast }", "mode single")
    assert "LJ0504" in {item.code for item in compile_text(text).diagnostics}


def test_an_instance_has_the_declared_message_bus_and_budget(small: str) -> None:
    text = small.replace("payload <= 4 kB }", "payload <= 4 kB, range <= 2 km, loss = 5 %, receipts = all }").replace(
        "policy <= 90 s }", "policy <= 90 s, tokens <= 1000 tokens, money <= 2 USD, messages <= 9 }"
    )
    compilation = compile_text(text)
    assert compilation.mission is not None
    instance = instantiate(compilation.mission)
    assert (instance.comms.range_m, instance.comms.loss, instance.comms.receipts) == (2000.0, 0.05, "all")
    assert (instance.budget.tokens, instance.budget.money_usd, instance.budget.messages) == (1000, 2.0, 9)


def test_prompts_are_filled(small: str) -> None:
    text = small.replace(
        "controls boat { observes boat.*, events }",
        'controls boat { observes boat.*, events\n prompt """\n    Steer {boat} at {boat.position}.\n'
        '      {{"mode": "{mode}"}} {uavs} {altitude} {uav} {cells}\n    """ }',
    )
    compilation = compile_text(text)
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    skipper = next(a for a in instantiate(compilation.mission, settings={"altitude": 60}).agents if a.id == "skipper")
    assert skipper.prompt == 'Steer boat at (12.4, -51.8).\n  {"mode": "broadcast"} 2 60 m uav[1], uav[2] cells'


@pytest.mark.parametrize(
    ("hole", "code"),
    [
        ("{boot}", "LJ0101"),
        ("{boat.sail}", "LJ0102"),
        ("{boat + 1}", "LJ0121"),
        ("{uav[k]}", "LJ0101"),
        ("{}", "LJ0121"),
    ],
)
def test_a_faulty_hole_in_a_text_gives_its_code(small: str, hole: str, code: str) -> None:
    assert [item.code for item in compile_text(small.replace("everybody", hole)).diagnostics] == [code]


def test_index_variables_fill_prompts_of_groups(small: str) -> None:
    text = small.replace("peers.position }", 'peers.position\n prompt "You are {i} of {uavs}: {uav[i]}." }')
    mission = compile_text(text).mission
    assert mission is not None
    prompts = [agent.prompt for agent in instantiate(mission).agents if agent.role == "searcher"]
    assert prompts == ["You are 1 of 2: uav[1].", "You are 2 of 2: uav[2]."]


# -- types, presets, actions


def test_types_and_presets_extend_others() -> None:
    text = """\
ljs 1
use std.air { quadrotor }
use std.sensors { nadir_hd }
use std.weather { storm }
asset heavy : quadrotor { payload = 5 kg, endurance = 20 min, verb drop() }
camera wide { view = nadir, size = 640 by 480, hfov = 120 deg, channels = [rgb] }
weather gale { wind = 20 m/s from 10 deg }
mission m "M" {
  goal "Fly."
  scene bay
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 9 }
  weather storm { visibility = 1 km }
  mode single
  asset uav : heavy {
    position = (0 m, 0 m)
    camera nadir : nadir_hd { capture = each_tick }
    camera down : wide
    actions { forward = 10 m in 5 m..25 m, up in 1 m..5 m, stop, drop }
  }
  agent pilot as pilot controls uav { observes uav.* }
  success when uav.position.elevation > 9 m
}
"""
    compilation = compile_text(text)
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    instance = instantiate(compilation.mission)
    uav = instance.entities[0]
    assert (uav.engine, uav.properties["payload_kg"], uav.properties["endurance_s"]) == ("multirotor", 5.0, 1200.0)
    assert [(c.name, c.width, c.capture) for c in uav.cameras] == [
        ("nadir", 1920, "each_tick"),
        ("down", 640, "on_request"),
    ]
    forward, up = uav.verbs[0].arguments[0], uav.verbs[1].arguments[0]
    assert (forward.minimum, forward.maximum, forward.default) == (5.0, 25.0, 10.0)
    assert (up.minimum, up.maximum, up.default) == (1.0, 5.0, None)
    assert (instance.weather.wind_mps, instance.weather.visibility_m) == (14.0, 1000.0)
    assert instance.mode == "single"


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("forward <= 50 m", "forward in 5 m..999 m", "LJ0206"),
        ("forward <= 50 m", "forward = 90 m in 5 m..50 m", "LJ0206"),
        ("forward <= 50 m", "forward in 5 deg..9 deg", "LJ0203"),
        ("weather { wind", "weather stromy { wind", "LJ0101"),
        ("camera nadir {", "camera nadir : nadir_uhd {", "LJ0101"),
    ],
)
def test_a_faulty_action_or_preset_gives_its_code(small: str, old: str, new: str, code: str) -> None:
    assert [item.code for item in compile_text(small.replace(old, new)).diagnostics] == [code]


# -- hidden values at the new places


@pytest.mark.parametrize(
    ("line", "way"),
    [
        ("limit m <= distance_xy(victim[1], boat) / 1 m counts uav.*", "the limit `m`"),
        ("event e at distance_xy(victim[1], boat) / 1 m * 1 s { vanish victim[1] }", "the time of the event `e`"),
        ("event e at 1 tick { weather { visibility = distance_xy(victim[1], boat) } }", "`visibility` of `weather`"),
        ("sweep s over altitude in [distance_xy(victim[1], boat)]", "the sweep over `altitude`"),
        ("inspection c of boat by uav { within = distance_xy(victim[1], boat) }", "`within` of the inspection `c`"),
        ("region near = circle(victim[1], 9 m)\n  grid g over near { shape = 2 by 2 }\n agent a as b { observes g }",
         "the observation `g`"),
        ('region near = circle(victim[1], 9 m)\n  agent spy as spy { prompt "{near}" }', "the prompt's text"),
        ('agent spy as spy { prompt "{victim[2].position}" }', "the prompt's text"),
        ("stage s { done when true, ticks <= distance_xy(victim[1], boat) / 1 m }", "`ticks` of the stage `s`"),
        ("constraint soft c { always true, penalty = distance_xy(victim[1], boat) / 9 km }", "`penalty`"),
        ("agent spy as spy { budget { messages <= distance_xy(victim[1], boat) / 1 m } }", "`messages`"),
    ],
)  # fmt: skip
def test_a_hidden_value_that_a_construct_uses_is_a_leak(small: str, line: str, way: str) -> None:
    text = small.replace("  success when", f"  {line}\n  success when")
    diagnostics = [item for item in compile_text(text).diagnostics if item.code == "LJ0401"]
    assert diagnostics and all(item.code == "LJ0401" for item in compile_text(text).diagnostics)
    assert any(way in item.message and "victim.position" in item.message for item in diagnostics)


def test_the_instance_lists_the_revealed_entities_and_their_role(small: str) -> None:
    (reveal,) = made(small, "reveal image(victim[2]) to searcher").reveals
    assert (reveal.entities, reveal.role) == (("victim[2]",), "searcher")


def test_a_mission_can_have_assets_of_all_six_engines(small: str) -> None:
    line1 = "1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991"
    line2 = "2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482"
    use = "use std.air { fixed_wing }\nuse std.ground { car, robot_dog }\nuse std.orbit { satellite }"
    instance = made(
        in_town(small),
        "asset wing : fixed_wing { position = (0 m, 0 m, 300 m) }",
        "asset dog  : robot_dog  { position = (0 m, 0 m) }",
        "asset cab  : car        { position = (9 m, 0 m) }",
        f'asset eye  : satellite  {{ tle1 = "{line1}", tle2 = "{line2}" }}',
        use=use,
    )
    engines = {entity.engine for entity in instance.entities if entity.role == "asset"}
    assert engines == {"multirotor", "plane", "quadruped", "road", "vessel", "satellite"}
    eye = next(entity for entity in instance.entities if entity.id == "eye")
    assert eye.properties["tle1"] == line1 and eye.position[2] == 550_000.0
