"""resetScenario documents out, and the way back."""

import json
from pathlib import Path

import jsonschema
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from lingjing.errors import MissionError
from lingjing.mission import document
from lingjing.mission.reset.emit import emit, with_template
from lingjing.mission.reset.reading import instantiate_document
from lingjing.testing import declarations as m
from lingjing.testing import instantiate

ROOT = Path(__file__).resolve().parents[2]
LISTING = (ROOT / "scenarios" / "reset" / "ssr-001.json").read_text(encoding="utf-8")
JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def read(ssr: m.Mission, text: str) -> m.Mission:
    return instantiate_document(text, "s.json", {"ssr": ssr}.__getitem__)[0]


def test_a_document_is_written_back_unchanged(ssr: m.Mission) -> None:
    out = emit(read(ssr, LISTING))
    assert out.replace('\n    "lingjing": {"mission": "ssr"},', "", 1) == LISTING
    assert emit(read(ssr, out)) == out
    assert instantiate(read(ssr, out), seed=4) == instantiate(read(ssr, LISTING), seed=4)


def test_a_plain_document_has_no_lingjing_object(ssr: m.Mission) -> None:
    assert emit(read(ssr, LISTING), plain=True) == LISTING
    text = emit(ssr, seed=3, plain=True)
    assert "lingjing" not in json.loads(text)["scenario"]
    assert instantiate(read(ssr, text), seed=3).entities == instantiate(ssr, seed=3).entities
    unknown = replace(ssr, groups=tuple(replace(g, type="flotsam") if g.name == "victim" else g for g in ssr.groups))
    with pytest.raises(MissionError, match="can hold the places of 'victim'"):
        emit(unknown, plain=True)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{}", '{"lingjing": {"mission": "ssr"}}'),
        ('{"a":1}', '{"lingjing": {"mission": "ssr"},"a":1}'),
        ('{"scenario":{"a":1}}', '{"scenario":{"lingjing": {"mission": "ssr"},"a":1}}'),
        (
            '{"b": "\\"scenario\\": {", "scenario" : { }}',
            '{"b": "\\"scenario\\": {", "scenario" : { "lingjing": {"mission": "ssr"} }}',
        ),
        ('{"scenario": {"lingjing": {"mission": "tea"}}}', '{"scenario": {"lingjing": {"mission": "tea"}}}'),
    ],
)
def test_the_template_is_added_to_the_scenario(text: str, expected: str) -> None:
    assert with_template(text, "ssr") == expected


@given(st.dictionaries(st.text(), JSON, max_size=5), st.sampled_from([None, 2, "\t"]), st.booleans())
def test_unknown_fields_survive(fields: dict[str, object], indent: int | str | None, ascii_only: bool) -> None:
    fields.pop("lingjing", None)
    whole = {**fields, "scenario": fields}
    text = json.dumps(whole, indent=indent, ensure_ascii=ascii_only)
    assert json.loads(with_template(text, "ssr")) == {**whole, "scenario": {"lingjing": {"mission": "ssr"}, **fields}}


@given(st.integers(0, 2**31), st.sampled_from(["star", "broadcast"]), st.integers(1, 6), st.integers(1, 6))
def test_an_emitted_template_is_read_as_the_same_instance(
    ssr: m.Mission, seed: int, mode: str, uavs: int, victims: int
) -> None:
    settings = {"uavs": uavs, "victims": victims, "altitude": 120}
    text = emit(ssr, seed=seed, mode=mode, settings=settings)
    again = read(ssr, text)
    assert instantiate(again, seed=seed) == instantiate(ssr, seed=seed, mode=mode, settings=settings)
    assert emit(again) == text


def test_an_emitted_document_is_valid_and_has_the_papers_keys(ssr: m.Mission) -> None:
    whole = json.loads(emit(ssr, seed=3))
    jsonschema.validate(whole, msgspec.json.decode(document.schemas()["reset-scenario.schema.json"]))
    paper = json.loads(LISTING)
    assert paper.keys() <= whole.keys()
    assert paper["scenario"].keys() <= whole["scenario"].keys()
    assert paper["scenario"]["equipmentList"].keys() == whole["scenario"]["equipmentList"].keys()
    task, emitted = paper["scenario"]["taskMatrix"][0], whole["scenario"]["taskMatrix"][0]
    assert task.keys() == emitted.keys() and task["initial_state"].keys() == emitted["initial_state"].keys()
