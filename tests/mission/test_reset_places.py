"""resetScenario documents as others write them: odd spellings, frames, nulls and numbers, read or refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lingjing.dsl.loading.load import templates_beside
from lingjing.errors import LingjingError
from lingjing.mission.document import decode, encode, read
from lingjing.mission.instantiate import instantiate
from lingjing.mission.reset.emit import emit

RESET = Path(__file__).resolve().parents[2] / "scenarios" / "reset"
TEMPLATES = templates_beside(Path("nowhere"))
Edit = Callable[[dict[str, Any], dict[str, Any], list[Any]], object]
"""Of the document, its first task's initial state and its drones."""


def edited(edit: Edit, name: str = "ssr") -> str:
    whole = json.loads((RESET / f"{name}-001.json").read_text(encoding="utf-8"))
    scenario = whole["scenario"]
    edit(whole, scenario["taskMatrix"][0]["initial_state"], scenario["equipmentList"]["droneEntityList"])
    return json.dumps(whole, ensure_ascii=False)


AT = "$.scenario.equipmentList.droneEntityList"
STATE = "$.scenario.taskMatrix[0].initial_state"
READ: list[tuple[Edit, tuple[str, ...]]] = [
    (lambda w, s, d: (d[0].update(name="无人机一号", equipmentCode="无人机-①"), s.update(weather="晴")), ()),
    (lambda w, s, d: w["scenario"].update(collaborationType="星型"), ("'星型' is the mode that is played",)),
    (lambda w, s, d: (d[0].update(heading=None), s.update(weather=None)), ()),
    (
        lambda w, s, d: d[0].update(data={"longitude": 121.5, "Latitude": 31.0, "altitude": 3}),
        (f"{AT}[].data: 'longitude', 'Latitude', 'altitude' read as lon, lat, alt",),
    ),
    (lambda w, s, d: [x.update(data={"lng": 121.5, "lat": 31.0}) for x in d], (f"{AT}[].data: 'lng' read as lon",)),
    (
        lambda w, s, d: s.update(rescuePersonPosition=[{"position": {"经度": 121.501, "纬度": 30.991}}]),
        (f"{STATE}.rescuePersonPosition[].position: '经度', '纬度' read as lon, lat",),
    ),
    (
        lambda w, s, d: d[0].update(data={"lon": 121.5, "lat": 31.3}),
        (f"{AT}[0].data: lies 33 km from the scene's origin at 31, 121.5",),
    ),
    (
        lambda w, s, d: d[0].update(raw=10, heading=20, yaw=30),
        ("heading, raw, yaw disagree; heading counts",),
    ),
    (
        lambda w, s, d: d[0].update(data={"x": 30660.0, "y": 62020.0, "z": 112.0}),
        (f"{AT}[].data: 'x', 'y', 'z' read as X, Y, Z, Unreal's centimetres",),
    ),
    (lambda w, s, d: d[1].update(equipmentCode="UAV-MA-001"), ("stands more than once: 'UAV-MA-001'",)),
    (
        lambda w, s, d: (w.update(foo=[1]), s["rescuePersonPosition"][0].update(血型="A")),
        ("$: 'foo' not understood and kept", "'血型' not understood and kept"),
    ),
    (lambda w, s, d: s.update(rescue_person_position=s.pop("rescuePersonPosition")), ()),
    (lambda w, s, d: s.update(uav_count=99), ("uav_count says 99, the list has 3",)),
    (lambda w, s, d: w["scenario"]["equipmentList"].update(planeEntityList=[], satelliteEntityList=None), ()),
    (lambda w, s, d: w["scenario"]["taskMatrix"].append({"goal": "two"}), ("the first of 2 rows is played",)),
    (lambda w, s, d: s["rescuePersonPosition"][0].update(X=90000.0, Y=90000.0), ("lies outside of rescueRange",)),
]


@pytest.mark.parametrize(("edit", "notes"), READ)
def test_what_is_read_is_noted_and_comes_back_the_same(edit: Edit, notes: tuple[str, ...]) -> None:
    text = edited(edit)
    mission, noted = read(text, "d.json", TEMPLATES)
    said = "\n".join(noted[1:])
    assert noted[0].startswith("template 'ssr': recognised by ")
    assert len(noted) == 1 + len(notes) and all(note in said for note in notes), said
    assert decode(encode(mission), "m.json") == mission
    first = instantiate(mission, seed=5)
    again, _ = read(emit(mission), "e.json", TEMPLATES)
    assert [(e.id, e.position) for e in instantiate(again, seed=5).entities] == [
        (e.id, e.position) for e in first.entities
    ]
    assert emit(again) == emit(mission)


REFUSED: list[tuple[Edit, str]] = [
    (lambda w, s, d: d[0].update(data={"X": 1.0}), f"{AT}[0].data: has no place"),
    (lambda w, s, d: d[0]["data"].update(X="30660.0"), f"{AT}[0].data.X: a number is due, this is the text '30660.0'"),
    (lambda w, s, d: d[0]["data"].update(X=1e300), f"{AT}[0].data: lies at (1e+298, -620.2, 1.12) m, beyond the scene"),
    (lambda w, s, d: d[0]["data"].update(X=10**400), "data.X: a number is due, this is a number out of range"),
    (lambda w, s, d: s.update(rescueRange=s["rescueRange"][:2]), "rescueRange: the outline has 2 different corners"),
]


@pytest.mark.parametrize(("edit", "words"), REFUSED)
def test_what_is_refused_names_the_path_and_the_reason(edit: Edit, words: str) -> None:
    with pytest.raises(LingjingError) as caught:
        read(edited(edit), "d.json", TEMPLATES)
    assert words in str(caught.value) and caught.value.hint
