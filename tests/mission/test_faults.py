"""Errors of a `mission.json`, all reported in one run."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import lingjing
from lingjing.errors import MissionError, UsageError
from lingjing.mission import document
from lingjing.mission.faults import schema_faults

WHOLE = document.encode(lingjing.compile("ssr"))


def test_every_fault_is_reported_with_its_path() -> None:
    value = json.loads(WHOLE)
    value["name"] = 3
    value["groups"][0]["count"] = "three"
    value["rules"][0]["condition"] = {"node": "Binry"}
    value["rules"][1]["condition"]["left"] = {"node": "Number", "unit": "m"}
    value["stages"][0]["domian"] = "victim"
    value["agnts"] = []
    del value["goal"]
    with pytest.raises(MissionError) as caught:
        document.decode(json.dumps(value), "m.json")
    assert [
        (fault.where, fault.message, fault.hint)
        for fault in caught.value.faults
        if fault.where != "rules[0].condition.node"
    ] == [
        ("name", "a text is due, this is the number 3", ""),
        ("groups[0].count", "an object is due, this is the text 'three'", ""),
        ("rules[1].condition.left", "'value' is missing", "add the field"),
        ("stages[0]", "there is no field 'domian'", "did you mean 'domain'?"),
        ("", "'goal' is missing", "add the field"),
        ("", "there is no field 'agnts'", "did you mean 'agents'?"),
    ]
    (tag,) = [fault for fault in caught.value.faults if fault.where == "rules[0].condition.node"]
    assert tag.message.endswith("this is the text 'Binry'") and tag.hint == "did you mean 'Binary'?"
    assert str(caught.value).splitlines()[0] == "m.json: name: a text is due, this is the number 3"


def test_a_valid_mission_has_no_fault_and_decoding_does_not_import_jsonschema() -> None:
    assert schema_faults(json.loads(WHOLE), document.MissionDocument) == ()
    script = (
        "import sys; from lingjing.mission import document; "
        "document.decode(sys.stdin.read(), 'm.json'); assert 'jsonschema' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], input=WHOLE, text=True, check=True)


def test_a_document_that_is_nested_too_deeply_is_refused() -> None:
    value = json.loads(WHOLE)
    deep = '{"node": "Unary", "operator": "not", "operand": ' * 3000 + '{"node": "Flag", "value": true}' + "}" * 3000
    text = json.dumps({**value, "success": 3}).replace('"success": 3', f'"success": {deep}')
    with pytest.raises(UsageError, match="nested too deeply to be a mission"):
        document.decode(text, "m.json")
