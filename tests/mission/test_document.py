"""mission.json and the schemas."""

import functools
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import msgspec
import pytest

from lingjing.errors import LingjingError, MissionError, UsageError
from lingjing.mission import document
from lingjing.testing import declarations as m

ROOT = Path(__file__).resolve().parents[2]

schemas = functools.cache(document.schemas)
"""The schemas, generated once, because that takes a quarter of a second."""


def test_missions_round_trip(ssr: m.Mission) -> None:
    text = document.encode(ssr)
    again = document.decode(text, "mission.json")
    assert again == ssr
    assert document.encode(again) == text


@pytest.mark.parametrize("name", schemas())
def test_committed_schemas_match_the_code(name: str) -> None:
    committed = (ROOT / "schemas" / name).read_bytes()
    assert committed == schemas()[name], "run `python -m lingjing.mission.document`"


@pytest.mark.parametrize("name", schemas())
def test_schemas_are_valid_json_schemas(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(msgspec.json.decode(schemas()[name]))


def nested(value: object) -> Iterator[dict[str, object]]:
    """Every object in a JSON value."""
    if isinstance(value, dict):
        yield value
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from nested(item)


@pytest.mark.parametrize("name", schemas())
def test_strict_validators_accept_the_schemas(name: str) -> None:
    """Strict validators refuse keywords of OpenAPI, and alternatives that require a field that they do not declare."""
    for part in nested(msgspec.json.decode(schemas()[name])):
        assert "discriminator" not in part
        if isinstance(required := part.get("required"), list):
            assert set(required) <= set(part["properties"])


def test_mission_json_is_valid_and_the_schema_rejects_unknown_and_mistyped_fields(ssr: m.Mission) -> None:
    validator = jsonschema.Draft202012Validator(msgspec.json.decode(schemas()["mission.schema.json"]))
    value = msgspec.json.decode(document.encode(ssr))
    validator.validate(value)
    assert not validator.is_valid({**value, "colour": "red"})
    assert not validator.is_valid({**value, "name": 3})


def test_the_document_has_derived_parts_that_are_never_read_back(ssr: m.Mission) -> None:
    value = msgspec.json.decode(document.encode(ssr))
    assert value["conditions"][0]["at"] == "success"
    assert {node["id"] for node in value["graph"]["nodes"]} >= {
        "role:searcher",
        "verb:boat.moveTo",
        "condition:success",
    }
    before = {key: part for key, part in value.items() if key not in ("conditions", "graph")}
    forged = {**value, "conditions": [], "graph": {**value["graph"], "nodes": [], "edges": []}}
    for each in (before, forged):
        again = document.decode(msgspec.json.encode(each).decode(), "mission.json")
        assert again == ssr
        assert type(again) is m.Mission
        assert document.encode(again) == document.encode(ssr)


def test_a_malformed_derived_part_is_refused_with_its_path(ssr: m.Mission) -> None:
    value = msgspec.json.decode(document.encode(ssr))
    value["conditions"][0]["kind"] = "wish"
    with pytest.raises(MissionError, match=r"conditions\[0\]"):
        document.decode(msgspec.json.encode(value).decode(), "mission.json")


def test_main_writes_the_schemas(tmp_path: Path) -> None:
    document.main([str(tmp_path / "out")])
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == schemas()


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", UsageError, "m.json:1:1: not JSON"),
        ('{\n  "name": }', UsageError, "m.json:2:11: not JSON"),
        ("{} {}", UsageError, "m.json:1:4: not JSON: Extra data"),
        ("[" * 100_000, UsageError, "nested too deeply"),
        ('{"a": ' + "9" * 5000 + "}", UsageError, "thousands of digits"),
        ("{}", MissionError, "'name' is missing"),
        ("[]", MissionError, "an object is due, this is a list"),
        ('{"name": "\\ud800"}', MissionError, "$.name: holds half of a surrogate pair"),
        ('{"name": NaN}', MissionError, "$.name: is NaN"),
    ],
)
def test_unreadable_documents_give_one_error_message(text: str, error: type[LingjingError], words: str) -> None:
    with pytest.raises(error) as caught:
        document.decode(text, "m.json")
    assert words in str(caught.value) and caught.value.hint


def test_a_wrong_field_is_named_by_its_path(ssr: m.Mission) -> None:
    text = document.encode(ssr).replace('"rows": {', '"rows": 3, "was": {', 1)
    with pytest.raises(MissionError, match=r"grids\[0\]\.rows: an object is due"):
        document.decode(text, "m.json")


def test_read_distinguishes_a_mission_from_a_reset_scenario(ssr: m.Mission) -> None:
    templates = {"ssr": ssr}.__getitem__
    assert document.read(document.encode(ssr), "m.json", templates) == (ssr, ())
    listing = (ROOT / "scenarios" / "reset" / "ssr-001.json").read_text(encoding="utf-8")
    mission, notes = document.read(listing, "s.json", templates)
    assert mission.name == "ssr" and notes
    with pytest.raises(MissionError, match="neither 'scenario' nor"):
        document.read('{"format": 3}', "x.json", templates)


@pytest.mark.parametrize(
    ("version", "way"),
    [("1", "compile it again from its .ljs file"), ("3", "install a newer"), ("12", "install a newer")],
)
def test_a_mission_of_another_version_is_refused_with_a_remedy(ssr: m.Mission, version: str, way: str) -> None:
    text = document.encode(ssr).replace(document.FORMAT, f"lingjing-mission/{version}").replace('"goal"', '"aim"')
    with pytest.raises(MissionError) as caught:
        document.decode(text, "old.json")
    expected = f"old.json: format: it is a compiled mission of version {version}, and this program reads version 2"
    assert str(caught.value) == expected
    assert way in caught.value.hint
    assert [fault.where for fault in caught.value.faults] == ["format"]


def test_an_unknown_format_name_is_reported_with_the_expected_name(ssr: m.Mission) -> None:
    text = document.encode(ssr).replace(document.FORMAT, "lingjing-mission/two")
    with pytest.raises(MissionError, match="format: lingjing-mission/2 is due"):
        document.decode(text, "odd.json")
