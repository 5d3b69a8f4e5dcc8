"""The compiled sea rescue in all its forms: mission.json, instances, the paper's Listing, and back to a mission."""

import json
from pathlib import Path

import jsonschema
import msgspec
import pytest

from lingjing.mission import document
from lingjing.mission.instance import Instance
from lingjing.mission.reset.emit import emit
from lingjing.mission.reset.reading import instantiate_document
from lingjing.testing import compile_file, instantiate
from lingjing.testing import declarations as m

ROOT = Path(__file__).resolve().parents[2]
LISTING = (ROOT / "scenarios" / "reset" / "ssr-001.json").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def compiled() -> m.Mission:
    compilation = compile_file(str(ROOT / "scenarios" / "ssr.ljs"))
    assert compilation.mission is not None, compilation.diagnostics
    return compilation.mission


def places(instance: Instance) -> dict[str, tuple[float, float, float]]:
    return {entity.id: entity.position for entity in instance.entities}


def test_mission_json_is_stable_and_valid(compiled: m.Mission) -> None:
    text = document.encode(compiled)
    assert document.decode(text, "m.json") == compiled
    assert document.encode(document.decode(text, "m.json")) == text
    schema = msgspec.json.decode(document.schemas()["mission.schema.json"])
    assert jsonschema.Draft202012Validator(schema).is_valid(json.loads(text))


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_instances_of_the_file_and_of_the_graph_built_by_hand_share_their_draws(
    compiled: m.Mission, ssr: m.Mission, mode: str
) -> None:
    from_file, by_hand = instantiate(compiled, seed=7, mode=mode), instantiate(ssr, seed=7, mode=mode)
    assert places(from_file) == places(by_hand) and from_file.cells == by_hand.cells
    assert from_file.weather.wave_height_m == by_hand.weather.wave_height_m
    assert [(a.id, a.commands) for a in from_file.agents] == [(a.id, a.commands) for a in by_hand.agents]
    assert msgspec.json.decode(msgspec.json.encode(from_file), type=Instance) == from_file


def test_the_instance_has_the_properties_that_engines_need(compiled: m.Mission) -> None:
    by_id = {entity.id: entity for entity in instantiate(compiled).entities}
    assert {"band_low_m", "band_high_m", "cruise_mps", "endurance_s"} <= by_id["uav[1]"].properties.keys()
    (rescue,) = by_id["victim[1]"].interactions
    assert (rescue.name, rescue.by, rescue.within_m, rescue.aboard) == ("rescue", "vessel", 50.0, True)
    assert by_id["boat"].properties["speed_mps"] == 3.0
    assert {verb.name for verb in by_id["uav[1]"].verbs} >= {"takeoff", "setDestination", "takePhoto"}
    assert by_id["victim[1]"].hidden == ("position",)


def test_the_listing_is_read_with_the_compiled_template(compiled: m.Mission) -> None:
    mission, notes = instantiate_document(LISTING, "ssr-001.json", {"ssr": compiled}.__getitem__)
    assert len(notes) == 1
    assert places(instantiate(mission, seed=3)) == {
        "victim[1]": (319.2, -963.2, -3.5),
        "uav[1]": (306.6, -620.2, 1.12),
        "uav[2]": (310.0, -590.1, 1.12),
        "uav[3]": (278.7, -590.1, 1.12),
        "boat": (12.4, -1351.8, -3.5),
    }
    assert emit(mission).replace('\n    "lingjing": {"mission": "ssr"},', "", 1) == LISTING


@pytest.mark.parametrize("seed", range(5))
def test_a_written_document_gives_the_instance_of_its_template(compiled: m.Mission, seed: int) -> None:
    again, _ = instantiate_document(emit(compiled, seed=seed), "x.json", {"ssr": compiled}.__getitem__)
    assert instantiate(again, seed=seed) == instantiate(compiled, seed=seed)
