"""SARIF output: valid by the published schema of SARIF 2.1.0, with places, related places and fixes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from lingjing.errors import ExitCode
from lingjing.testing import run_command

SCHEMA = json.loads((Path(__file__).parent / "data" / "sarif-2.1.0.schema.json").read_text())
"""The OASIS schema of SARIF 2.1.0 (rtm.5), without its descriptions."""


def log_of(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    run_command(["validate", "--output-format", "sarif", *arguments])
    log: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.Draft4Validator(SCHEMA).validate(log)
    return log


def test_a_file_with_errors_has_results_with_places_and_fixes(
    tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a b.ljs"
    file.write_text(small.replace("  asset boat", "  asset baot").replace("visibility = 8 km", "visibilty = 8 km"))
    (run,) = log_of([str(file)], capsys)["runs"]
    assert [rule["id"] for rule in run["tool"]["driver"]["rules"]] == ["LJ0101", "LJ0108"]
    first, second = run["results"]
    assert (first["ruleId"], second["ruleId"]) == ("LJ0108", "LJ0101")
    place = first["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == f"file://{tmp_path}/a%20b.ljs"
    assert (place["region"]["startLine"], place["region"]["startColumn"]) == (11, 40)
    (replacement,) = first["fixes"][0]["artifactChanges"][0]["replacements"]
    assert replacement["insertedContent"]["text"] == "visibility"
    assert len(second["relatedLocations"]) == 4


def test_a_good_file_has_no_results_and_a_faulty_document_has_results(
    tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    good, wrong = tmp_path / "good.ljs", tmp_path / "wrong.json"
    good.write_text(small)
    wrong.write_text('{"format": "lingjing-mission/2"}')
    assert log_of([str(good)], capsys)["runs"][0]["results"] == []
    missing = log_of([str(good), str(wrong)], capsys)["runs"][0]["results"]
    assert len(missing) > 1
    assert {result["ruleId"] for result in missing} == {"LJ0009"}
    assert run_command(["validate", "--output-format", "sarif", str(wrong)]) == ExitCode.MISSION
