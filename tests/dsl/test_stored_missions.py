"""Missions that were written for `ljs 1` still compile: stored copies of the shipped ones of the first release."""

from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing.dsl.upgrade import upgrade_source
from lingjing.testing import compile_file, compile_text, instantiate
from lingjing.testing.declarations import Origin
from lingjing.testing.missions import SourceText

STORED = sorted((Path(__file__).parent / "data" / "ljs-1").glob("*.ljs"))


def test_there_are_stored_missions() -> None:
    assert len(STORED) >= 10


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_mission_compiles_and_gives_an_instance(path: Path) -> None:
    mission = lingjing.compile(str(path))
    assert instantiate(mission, seed=1).entities


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_mission_has_at_most_the_warning_of_its_version(path: Path) -> None:
    hidden = any(prop.hidden for group in lingjing.compile(str(path)).groups for prop in group.properties)
    assert [item.code for item in compile_file(str(path)).diagnostics] == (["LJ0405"] if hidden else [])


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_an_upgrade_keeps_the_mission_and_adds_its_declassifications(path: Path) -> None:
    upgraded = upgrade_source(SourceText(path.read_text(), str(path)))
    assert upgraded.text is not None and upgraded.text.startswith("ljs 2\n")
    again = compile_text(upgraded.text)
    assert again.mission is not None and again.diagnostics == ()
    before, after = (msgspec.structs.replace(m, origin=Origin()) for m in (lingjing.compile(str(path)), again.mission))
    assert before == after
    assert upgrade_source(SourceText(upgraded.text)).text == upgraded.text, "a second upgrade changes nothing"


def test_a_faulty_file_is_not_upgraded_and_a_file_with_only_types_is_upgraded() -> None:
    broken = upgrade_source(SourceText('ljs 1\nmission m "M" { goal 3 }\n'))
    assert broken.text is None and broken.diagnostics
    types = "ljs 1\nasset a { engine = vessel, speed = 3 m/s }\n"
    assert upgrade_source(SourceText(types)).text == types.replace("ljs 1", "ljs 2")


def test_a_declaration_that_is_written_already_is_not_written_again() -> None:
    text = (Path(__file__).parent / "data" / "ljs-1" / "upr.ljs").read_text()
    line = '  declassify end because "as in ljs 1"\n'
    begun = text.replace("  success when", f"{line}  success when", 1)
    upgraded = upgrade_source(SourceText(begun)).text
    assert upgraded is not None and upgraded.count("declassify end") == 1
    assert 'declassify dog.forward because "as in ljs 1"' in upgraded
