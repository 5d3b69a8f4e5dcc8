"""Engines read only properties and status words that the page of the language documents."""

import re
from pathlib import Path

import pytest

from lingjing.engines.bodies import is_absent
from lingjing.mission.instance import Entity, InteractionSpec
from lingjing.trace.records import BodyState

ROOT = Path(__file__).parents[2]
READ = re.compile(
    r'properties\.get\(\s*"(\w+)"'
    r'|"(\w+)" in (?:entity\.)?properties'
    r'|number(?:_or)?\(\s*"(\w+)"'
    r'|(?:_given|number)\(entity, "(\w+)"'
    r'|bounds\((?:\w+, )*"(\w+)"'
    r'|"(\w+)" (?:not )?in (?:\w+\.)*properties'
)
UNITS = re.compile(r"(_low|_high)?_(m|mps2|mps|s|kg|hz|deg)$")
SCENE_PROPERTIES = {"building"}
"""Properties that only the scene writes, where it anchors an entity."""


def test_every_property_that_an_engine_reads_is_documented():
    page = (ROOT / "docs" / "language.md").read_text("utf-8")
    rows = re.findall(r"^\| ((?:state )?`.*?) \|", page, re.MULTILINE)
    documented = {word for row in rows for word in re.findall(r"`(\w+)`", row)} | {"radius", "arrivals", "departures"}
    assert all(f"`{word}`" in page for word in documented)
    packages = [ROOT / "lingjing" / name for name in ("engines", "plugins", "kernel", "scene", "mission", "analysis")]
    code = "\n".join(path.read_text("utf-8") for package in packages for path in sorted(package.rglob("*.py")))
    read = {next(filter(None, groups)) for groups in READ.findall(code)}
    assert len(read) > 12
    assert {UNITS.sub("", name) for name in read} - SCENE_PROPERTIES - documented == set()


@pytest.mark.parametrize(
    ("name", "status", "aboard", "word", "absent"),
    [
        ("rescue", "", True, "rescued", True),
        ("collect", "safe", True, "safe", True),
        ("collect", "safe", True, "adrift", False),
        ("rescue", "", False, "rescued", False),
        ("rescue", "", False, "dormant", True),
        ("rescue", "", False, "cleared", True),
    ],
)
def test_an_entity_aboard_is_absent_for_every_status_word(name, status, aboard, word, absent):
    done = InteractionSpec(name=name, by="vessel", within_m=50.0, status=status, aboard=aboard)
    target = Entity(
        id="v",
        group="v",
        index=1,
        role="target",
        type="t",
        engine="city",
        position=(0.0, 0.0, 0.0),
        interactions=(done,),
    )
    assert is_absent(BodyState(id="v", position=(0.0, 0.0, 0.0), status=word), target) is absent


def test_a_target_that_only_gives_is_never_served():
    """An open warehouse is not a served warehouse."""
    restock = InteractionSpec(name="restock", by="road", within_m=50.0, gives="load", up_to="payload", status="open")
    deliver = InteractionSpec(name="deliver", by="road", within_m=30.0, takes="demand", source="load", status="settled")
    kind = {"group": "d", "index": 1, "role": "target", "type": "t", "engine": "city", "position": (0.0, 0.0, 0.0)}
    depot, order = Entity(id="d", **kind, interactions=(restock,)), Entity(id="o", **kind, interactions=(deliver,))
    assert not depot.is_served("open")
    assert order.is_served("settled") and not order.is_served("waiting")
