"""The types that an entity's type extends: through the mission, its JSON, its text and the instance."""

from __future__ import annotations

import json

import pytest

from lingjing.dsl.printing.printer import round_trip_losses, to_ljs
from lingjing.mission import document
from lingjing.testing import compile_text, instantiate
from lingjing.testing import declarations as model

TYPES = """ljs 1
use std.air { quadrotor }
use std.ground { car, delivery_van }
asset racer : quadrotor { cruise = 20 m/s }
asset lead_racer : racer { endurance = 10 min }
asset taxi : car { payload = 300 kg }
"""
MISSION = """mission race "Race" {
  goal "Wait."
  scene residential
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 10 }
  weather { wind = 1 m/s from 0 deg }
  mode single
  asset lead : lead_racer { position = (0 m, 0 m, 1 m), actions { stop } }
  asset cab : taxi { position = (0 m, 0 m) }
  asset vans[1..2] : delivery_van { position = (0 m, 0 m) }
  asset plain : quadrotor { position = (0 m, 0 m, 2 m) }
  agent boss as boss controls lead, cab { observes lead.* }
  adjudicate waited() { when now > 2 s }
  success when waited()
}
"""
BASES = {"lead": ("racer", "quadrotor"), "cab": ("car",), "vans[2]": ("car",), "plain": ()}


@pytest.fixture(scope="module")
def race() -> model.Mission:
    compilation = compile_text(TYPES + MISSION)
    assert compilation.mission is not None, compilation.diagnostics
    return compilation.mission


def test_an_entity_lists_the_types_that_its_type_extends(race: model.Mission) -> None:
    entities = {entity.id: entity.bases for entity in instantiate(race, seed=1).entities}
    assert {name: entities[name] for name in BASES} == BASES


def test_the_json_keeps_the_bases(race: model.Mission) -> None:
    again = document.decode(document.encode(race), "race.json")
    assert {group.name: group.bases for group in again.groups}["lead"] == ("racer", "quadrotor")
    assert again == race


def test_a_document_without_bases_is_read(race: model.Mission) -> None:
    tree = json.loads(document.encode(race))
    for group in tree["groups"]:
        del group["bases"]
    again = document.decode(json.dumps(tree), "race.json")
    assert [group.bases for group in again.groups] == [(), (), (), ()]


def test_the_text_extends_the_same_types(race: model.Mission) -> None:
    text = to_ljs(race)
    assert "asset racer : quadrotor {" in text and "asset lead_racer : racer {" in text
    assert "asset taxi : car {" in text and "delivery_van" in text.split("asset", 1)[0]
    assert round_trip_losses(race, text) == ()
