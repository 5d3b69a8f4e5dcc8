"""Switches, alternatives and tiers: their forms, their values in an instance, their errors, and the printed text."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import lingjing
from lingjing import Mission
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.instance import Instance
from lingjing.testing import compile_file, compile_text, instantiate, run_command
from lingjing.testing.expressions import Call, Expr, Ref, parts

MISSION = """ljs 2
use std.sea {{ lifeboat, person_in_water }}
use std.messages {{ report }}

mission m "M" {{
  goal "Go."
  scene bay {{ datum = sea level at -3.5 m, layout = 0, layout = 3 when layout }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 60 }}
  weather {{ wind = 3 m/s from 220 deg, wind ~ uniform(5 m/s, 8 m/s) from 100 deg when light }}
  mode broadcast in {{ star, broadcast }}
  param victims = 1 in 1..4
  param layout = false
  param light = false
  param evidence = false
  {tier}
  target victim : person_in_water {{
    hidden position ~ subset([(100 m, -900 m), (200 m, -900 m)])
    hidden position ~ sites_along([(0 m, -950 m), (300 m, -800 m), (300 m, -700 m)], clear >= 20 m) when layout
  }}
  asset boat : lifeboat {{
    position = (10 m, -1350 m), speed <= 3 m/s, speed <= 5 m/s when layout and light
    camera front {{ size = 320 by 240, hfov = 60 deg, channels = [rgb], capture = each_tick }}
  }}
  agent skipper as rescuer controls boat {{
    observes boat.*
    observes events when not evidence
  }}
  comms {{ hub = skipper when mode == star }}
  message sighting : report from rescuer to all when evidence
  adjudicate seen(v: victim, r: sighting) when evidence {{ when iou(r.box, truth(v, r.frame).box) >= 0.5 }}
  stage see when evidence {{ done when exists r: seen(victim, r) }}
  stage save {{ done when emitted(rescue, victim) }}
  unlock rescue(v: victim) when not evidence or exists r: seen(v, r)
  success when emitted(rescue, victim) and (not evidence or exists r: seen(victim, r))
  declassify end because "it is over"
  {more}
}}
"""
EVENTS = "events"
TIER = "tier 1 { layout, light, evidence, victims = 2 }"


def text(tier: str = TIER, more: str = "") -> str:
    return MISSION.format(tier=tier, more=more)


def mission(tier: str = TIER, more: str = "") -> Mission:
    compilation = compile_text(text(tier, more))
    assert compilation.mission is not None, compilation.diagnostics
    return compilation.mission


def calls(condition: Expr) -> set[str]:
    return {part.function for part in parts(condition) if isinstance(part, Call)}


def observed(instance: Instance) -> set[str]:
    return {channel.source for channel in instance.agents[0].observes}


def switches(instance: Instance) -> set[str]:
    conditions = (
        instance.success,
        *(rule.condition for rule in instance.rules),
        *(u.condition for u in instance.unlocks),
    )
    return {part.name for each in conditions for part in parts(each) if isinstance(part, Ref) and part.kind == "switch"}


def test_tier_0_is_the_mission_with_its_defaults() -> None:
    plain = instantiate(mission(), seed=4)
    assert (plain.tier, plain.settings) == (0, {"victims": 1.0})
    assert plain.weather.wind_mps == 3.0 and plain.entities[0].position[:2] in ((100.0, -900.0), (200.0, -900.0))
    assert (plain.rules, [stage.name for stage in plain.stages], plain.messages) == ((), ["save"], ())
    assert calls(plain.success) == {"emitted"} and EVENTS in observed(plain)


def test_a_tier_sets_its_params_and_a_run_replaces_single_ones() -> None:
    hard = instantiate(mission(), seed=4, tier=1)
    assert hard.tier == 1 and hard.settings == {"victims": 2.0, "layout": 1.0, "light": 1.0, "evidence": 1.0}
    assert 5.0 <= hard.weather.wind_mps <= 8.0 and hard.weather.wind_from_deg == 100.0
    assert [rule.name for rule in hard.rules] == ["seen"] and [stage.name for stage in hard.stages] == ["see", "save"]
    assert calls(hard.success) == {"emitted", "seen"} and EVENTS not in observed(hard)
    assert {entity.id: entity.properties for entity in hard.entities}["boat"]["speed_mps"] == 5.0
    mixed = instantiate(mission(), seed=4, tier=1, settings={"light": 0.0, "victims": 3.0})
    assert mixed.settings == {"victims": 3.0, "layout": 1.0, "evidence": 1.0}
    assert mixed.weather.wind_mps == 3.0


def test_an_instance_contains_no_switch() -> None:
    assert not switches(instantiate(mission())) and not switches(instantiate(mission(), tier=1))


def test_each_switch_changes_its_own_draws_alone() -> None:
    alone = [instantiate(mission(), seed=7, settings={name: 1.0}) for name in ("layout", "light", "evidence")]
    places = [each.entities[0].position[:2] for each in alone]
    assert places[1] == places[2] == instantiate(mission(), seed=7).entities[0].position[:2] != places[0]


def test_places_along_a_line_lie_on_it_and_clear_of_its_ends() -> None:
    seen = {instantiate(mission(), seed=seed, settings={"layout": 1.0}).entities[0].position[:2] for seed in range(40)}
    assert len(seen) == 40
    for east, north in seen:
        on_first = abs((north + 950.0) - 0.5 * east) < 0.01 and 0.0 <= east <= 300.0
        on_second = abs(east - 300.0) < 0.01 and -800.0 <= north <= -720.0
        assert on_first or on_second


@pytest.mark.parametrize("form", ["ljs", "json"])
def test_text_and_json_of_a_mission_keep_its_tier_and_switches(
    form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, again = tmp_path / "m.ljs", tmp_path / "again.ljs"
    source.write_text(text(more="expect { oracle wins with tier = 1, light = false }"), encoding="utf-8")
    if form == "json":
        document = tmp_path / "m.json"
        assert run_command(["compile", str(source), "-o", str(document)]) == ExitCode.OK
        source = document
    assert run_command(["compile", str(source), "--emit", "ljs", "-o", str(again)]) == ExitCode.OK
    written = again.read_text(encoding="utf-8")
    assert TIER in written and "observes events when not evidence" in written
    first, second = mission(), compile_file(str(again)).mission
    assert second is not None
    for tier in (0, 1):
        assert instantiate(second, seed=2, tier=tier) == instantiate(first, seed=2, tier=tier)


@pytest.mark.parametrize(
    ("tier", "code", "message"),
    [
        ("tier 0 { layout }", "LJ0206", "only tier 1 can be declared"),
        ("tier 2 { layout }", "LJ0206", "only tier 1 can be declared; 2 to 3 are reserved"),
        ("tier 1 { layuot }", "LJ0101", "no param is called `layuot`"),
        ("tier 1 { layout = 1 }", "LJ0201", "a condition is due for `layout`, this is a bare number"),
        ("tier 1 { victims = 9 }", "LJ0206", "9 is outside of the bounds of `victims`"),
        ("tier 1 { victims = true }", "LJ0201", "the value of `victims` is one number"),
        ("tier 1 { layout, layout = false }", "LJ0103", "`layout` is set twice"),
        ("tier 1 { light }\n  tier 1 { layout }", "LJ0103", "`tier 1` is given twice"),
        ("tier 1 { takeoff() }", "", ""),
    ],
)
def test_a_faulty_tier_is_an_error(tier: str, code: str, message: str) -> None:
    compilation = compile_text(text(tier))
    assert compilation.mission is None
    if code:
        assert [(each.code, each.message) for each in compilation.diagnostics] == [(code, message)]


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        (
            "limit positives <= 0 counts claims",
            "LJ0206",
            "a limit of 0 claims admits none, so that no report can count",
        ),
        ("limit p <= 3 counts claims, boat.moveTo", "LJ0110", "claims have a limit of their own for the whole episode"),
        ("param haste = true in [true]", "LJ0201", ""),
        ("expect { oracle wins with tier = 2 }", "LJ0206", "the mission has no such tier"),
    ],
)
def test_a_faulty_limit_param_or_expectation_beside_a_tier_is_an_error(line: str, code: str, message: str) -> None:
    (diagnostic,) = compile_text(text(more=line)).diagnostics
    assert diagnostic.code == code and message in diagnostic.message


def test_a_number_of_a_tier_that_is_too_large_is_one_error() -> None:
    assert len(compile_text(text(tier="tier 1e999 { layout }")).diagnostics) == 1


def test_two_lines_without_a_condition_stay_an_error() -> None:
    twice = text().replace("speed <= 5 m/s when layout and light", "speed <= 5 m/s")
    assert [each.code for each in compile_text(twice).diagnostics] == ["LJ0103"]


CAMERA = "channels = [rgb], capture = each_tick"
OTHERS = """capture = each_tick, channels = [rgb, depth], channels = [rgb] when light
      channels = [semantic] when light and layout"""


@pytest.mark.parametrize(
    ("settings", "channels"),
    [
        ({}, ("rgb", "depth")),
        ({"light": 1.0}, ("rgb",)),
        ({"layout": 1.0}, ("rgb", "depth")),
        ({"light": 1.0, "layout": 1.0}, ("semantic",)),
    ],
)
def test_the_last_channels_of_a_camera_whose_condition_holds_count(
    settings: dict[str, float], channels: tuple[str, ...]
) -> None:
    made = compile_text(text().replace(CAMERA, OTHERS)).mission
    assert made is not None
    (boat,) = (entity for entity in instantiate(made, settings=settings).entities if entity.group == "boat")
    assert [camera.channels for camera in boat.cameras] == [channels]


def test_the_channels_of_a_camera_under_a_condition_are_printed_and_read_again(tmp_path: Path) -> None:
    file, printed = tmp_path / "m.ljs", tmp_path / "printed.ljs"
    file.write_text(text().replace(CAMERA, OTHERS))
    assert run_command(["compile", "--emit", "ljs", str(file), "-o", str(printed)]) == ExitCode.OK
    assert "channels = [semantic] when light and layout" in printed.read_text()
    first, again = (compile_file(str(path)).mission for path in (file, printed))
    assert first is not None and again is not None
    assert [group.cameras for group in first.groups] == [group.cameras for group in again.groups]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("channels = [rgb], capture = each_tick when light", "LJ0307"),
        ("channels = [rgb], channels = [rgbd] when light", "LJ0109"),
        ("channels = [rgb], channels = [depth] when nothing", "LJ0101"),
        ("channels = [rgb], channels = [depth]", "LJ0103"),
        ("channels = [rgb] when light", "LJ0106"),
    ],
)
def test_a_wrong_line_of_a_camera_under_a_condition_is_one_error(line: str, code: str) -> None:
    assert [each.code for each in compile_text(text().replace(CAMERA, line)).diagnostics] == [code]


def test_a_value_that_one_alternative_hides_is_hidden_in_all() -> None:
    open_line = text().replace("hidden position ~ subset", "position ~ subset")
    leak = open_line.replace("observes boat.*\n", "observes boat.*, victim.position\n")
    assert [each.code for each in compile_text(leak).diagnostics] == ["LJ0401"]


@pytest.mark.parametrize(
    ("tier", "message", "hint"),
    [
        (2, "mission 'm' declares no tier 2", "it has the tiers 0, 1; tiers 2 and 3 are reserved for "),
        (9, "there is no tier 9", "tiers are 0 to 3"),
        (-1, "there is no tier -1", "tiers are 0 to 3"),
    ],
)
def test_an_unknown_tier_is_refused(tier: int, message: str, hint: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        instantiate(mission(), tier=tier)
    assert caught.value.hint.startswith(hint)


def test_the_noise_switch_is_reserved_and_the_message_names_an_alternative(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for value in ("true", "1"):
        assert run_command(["run", "ssr", "--set", f"noise={value}", "--policy", "idle"]) == ExitCode.USAGE
        output = capsys.readouterr().err
        assert "the switch `noise` is reserved for tiers 2 and 3" in output and "observes uav.gnss, uav.imu" in output
    with pytest.raises(UsageError, match="`noise` is reserved") as caught:
        instantiate(mission(), settings={"noise": 1.0})
    assert [fault.where for fault in caught.value.faults] == ["settings.noise"]
    declared = text().replace("param light = false", "param light = false\n  param noise = false")
    made = compile_text(declared).mission
    assert made is not None and instantiate(made, settings={"noise": 1.0}).settings["noise"] == 1.0


def test_a_tier_of_a_mission_without_tiers_is_refused_with_a_hint(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["run", "queue", "--tier", "1", "--policy", "idle"]) == ExitCode.USAGE
    assert "mission 'queue' declares no tier 1\nhint: it can be played at tier 0; " in capsys.readouterr().err
    assert run_command(["run", "queue", "--tier", "x"]) == ExitCode.USAGE
    assert "--tier x: there is no such tier\nhint: tiers are 0 to 3" in capsys.readouterr().err


def test_an_error_that_only_a_tier_has_is_found_without_playing_the_tier() -> None:
    wrong = text(more="region far = box((0 m, 0 m), (5 m * victims, 5 m)), grid cells over far { shape = 2 by 2 }")
    assert compile_text(wrong).mission is not None
    narrow = wrong.replace("clear >= 20 m", "clear >= 500 m")
    (diagnostic,) = compile_text(narrow).diagnostics
    assert diagnostic.code == "LJ0507" and diagnostic.message.startswith(
        "with layout = 1, light = 1, evidence = 1, victims = 2, "
    )


def test_the_report_of_a_run_contains_its_tier(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "m.ljs"
    source.write_text(text().replace("ticks <= 60", "ticks <= 14"), encoding="utf-8")
    words = ["run", str(source), "--policy", "idle", "--world", "inline", "--tier", "1", "--set", "light=off"]
    assert run_command([*words, "-o", str(tmp_path / "out"), "--json"]) == ExitCode.OK
    report = json.loads(capsys.readouterr().out)
    assert report["tier"] == 1


def test_a_document_of_a_tier_gives_the_world_of_that_tier(tmp_path: Path) -> None:
    document = tmp_path / "ssr.json"
    words = ["compile", "ssr", "--emit", "reset-scenario", "--tier", "1", "--seed", "3", "-o", str(document)]
    assert run_command(words) == ExitCode.OK
    again, hard = instantiate(str(document), seed=3), instantiate("ssr", seed=3, tier=1)
    assert again.settings == hard.settings and again.settings["claims"] == 1.0
    assert (again.rules, again.limits, again.weather) == (hard.rules, hard.limits, hard.weather)
    places = {entity.id: entity.position[:2] for entity in again.entities}
    assert all(places[entity.id] == pytest.approx(entity.position[:2], abs=0.01) for entity in hard.entities)


@pytest.mark.parametrize("name", ["bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn"])
def test_each_switch_of_the_nine_missions_can_be_set_alone(name: str) -> None:
    compiled = lingjing.compile(name)
    (tier,) = compiled.tiers
    base = instantiate(compiled, seed=1)
    switches = {each.name for each in compiled.parameters if each.is_switch}
    numbers = {"upr": {"leaks", "guidance_steps"}, "cd": {"points"}, "vdn": {"side", "search_ticks"}}.get(name, set())
    assert {setting.name for setting in tier.settings} == switches - {"life"} | numbers
    for name in switches:
        alone = instantiate(compiled, seed=1, settings={name: 1.0})
        assert alone != base and alone.settings[name] == 1.0


def test_a_document_that_places_its_targets_has_the_same_number_in_every_tier(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Tier 1 of `upr` has two leaks, and the document declares the place of one leak."""
    file = Path(lingjing.__file__).parents[1] / "scenarios" / "reset" / "upr-001.json"
    assert run_command(["validate", str(file)]) == ExitCode.OK
    note = "holds 1 in every tier; what tier 1 of mission 'upr' sets for 'leaks' is left out"
    assert note in "".join(capsys.readouterr())
    document = lingjing.compile(file)
    for tier in (0, 1):
        instance = instantiate(document, seed=1, tier=tier)
        assert [entity.id for entity in instance.entities if entity.group == "leak"] == ["leak[1]"]
        assert instance.settings["guidance_steps"] == (30.0 if tier else 20.0)


def test_a_limit_of_claims_that_a_param_sets_to_zero_is_an_error() -> None:
    made = mission(more="param claims = 1 in 0..5\n  limit positives <= claims counts claims")
    with pytest.raises(lingjing.LingjingError, match="a limit of 0 claims"):
        instantiate(made, settings={"claims": 0.0})


def test_a_graph_of_a_tier_shows_its_rules(capsys: pytest.CaptureFixture[str]) -> None:
    shown = []
    for tier in ("0", "1"):
        assert run_command(["graph", "idf", "--tier", tier, "--format", "json"]) == ExitCode.OK
        shown.append(capsys.readouterr().out)
    assert "lamp" not in shown[0] and "lamp" in shown[1]
    assert run_command(["graph", "queue", "--tier", "1"]) == ExitCode.USAGE
    assert "declares no tier 1" in capsys.readouterr().err
