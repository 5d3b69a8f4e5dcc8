"""`docs/kinds.md`: each table has exactly the fields of its part of `kinds.json`, and the example is valid."""

from __future__ import annotations

import json
import re
from pathlib import Path

import msgspec
import pytest

from lingjing.mission.kinds_format import (
    EngineKind,
    FlightFloorKind,
    KindsFile,
    SceneKind,
    SceneOption,
    TopSpeed,
    VerbKind,
    joined,
)

PAGE = (Path(__file__).parents[2] / "docs" / "kinds.md").read_text(encoding="utf-8")
PARTS = {
    "A scene": SceneKind,
    "An option": SceneOption,
    "An engine": EngineKind,
    "A verb": VerbKind,
    "A floor": FlightFloorKind,
    "A top speed": TopSpeed,
}


@pytest.mark.parametrize("title", PARTS)
def test_a_table_has_every_field_and_no_other(title: str) -> None:
    (section,) = [part for part in PAGE.split("\n## ")[1:] if part.startswith(f"{title} (")]
    cells = [line.split(" | ")[0] for line in section.splitlines() if line.startswith("| `")]
    assert re.findall(r"`(\w+)`", " ".join(cells)) == list(PARTS[title].__struct_fields__)


def test_the_values_of_a_choice_are_listed() -> None:
    for words in (("own", "given", "none"), ("positions", "region", "range"), ("straight", "route", "step", "turn")):
        assert all(f"`{word}`" in PAGE for word in words)


def test_the_example_is_valid() -> None:
    (text,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    file = msgspec.convert(joined(json.loads(text)), KindsFile)
    assert ([scene.name for scene in file.scenes], [engine.name for engine in file.engines]) == (["canyon"], ["hover"])
