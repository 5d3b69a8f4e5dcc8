"""The whole mission of `scenarios/ssr.ljs` against a golden file: `pytest tests/dsl --update` rewrites it."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lingjing import Mission
from lingjing.testing import compile_file, run_command
from lingjing.testing import expressions as ex

ROOT = Path(__file__).parents[2]
GOLDEN = Path(__file__).with_name("golden") / "ssr.mission.json"


@pytest.fixture(scope="module")
def ssr() -> Mission:
    compilation = compile_file(str(ROOT / "scenarios" / "ssr.ljs"))
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    return compilation.mission


def test_the_compiled_ssr_is_the_golden_document(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["compile", str(ROOT / "scenarios" / "ssr.ljs")]) == 0
    document = msgspec.json.decode(capsys.readouterr().out)
    document["origin"]["sha256"] = ""
    text = msgspec.json.format(msgspec.json.encode(document), indent=1).decode() + "\n"
    if request.config.getoption("--update", default=False):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")


def test_the_golden_mission_reads_back_equal(ssr: Mission) -> None:
    assert msgspec.json.decode(msgspec.json.encode(ssr), type=Mission) == ssr


def test_properties_of_types_are_merged_into_the_groups(ssr: Mission) -> None:
    victim = next(group for group in ssr.groups if group.name == "victim")
    properties = {prop.name: prop for prop in victim.properties}
    assert victim.engine == "city"
    assert properties["position"].hidden and properties["position"].relation == "~"
    assert isinstance(properties["position"].value, ex.Draw)
    assert properties["drift_mps"].value == ex.Number(0.1, "m/s") and not properties["drift_mps"].inherited
    (rescue,) = victim.interactions
    assert (rescue.name, rescue.by, rescue.within) == ("rescue", "vessel", ex.Number(50.0, "m"))


def test_units_are_lowered_to_si(ssr: Mission) -> None:
    weather = {prop.name: prop.value for prop in ssr.weather}
    assert weather["wind_mps"] == ex.Number(4.0, "m/s")
    assert weather["wind_from_deg"] == ex.Number(220.0, "deg")
    assert weather["current_to_deg"] == ex.Number(60.0, "deg")
    assert weather["visibility_m"] == ex.Number(8000.0, "km")
    assert ssr.clock.sync == ex.Number(0.5, "ms")
    assert ssr.comms.payload == ex.Number(4000.0, "kB")
    assert {p.name: p.default for p in ssr.parameters}["overlap"] == ex.Number(0.2, "%")


def test_actions_pick_verbs_and_bound_their_first_argument(ssr: Mission) -> None:
    uav = next(group for group in ssr.groups if group.name == "uav")
    verbs = {verb.name: verb for verb in uav.verbs}
    assert list(verbs)[:3] == ["takeoff", "setDestination", "forward"]
    assert verbs["forward"].arguments[0].maximum == ex.Number(50.0, "m")
    assert verbs["stop"].arguments == ()


def test_domains_are_inferred_and_matching_rules_are_marked(ssr: Mission) -> None:
    rules = {rule.name: rule for rule in ssr.rules}
    assert [rules[name].matching for name in ("matched", "reported", "rescued")] == [True, False, False]
    stage = next(stage for stage in ssr.stages if stage.name == "detect")
    assert isinstance(stage.condition, ex.Quantified) and stage.condition.domain == "detection"
    assert isinstance(stage.condition.body, ex.Call) and stage.condition.body.rule


def test_compiling_twice_gives_equal_missions(ssr: Mission) -> None:
    assert compile_file(str(ROOT / "scenarios" / "ssr.ljs")).mission == ssr
