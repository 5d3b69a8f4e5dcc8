"""The page of a mission contains every declaration, for every shipped mission."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing.dsl.pages.page import page
from lingjing.testing import compile_text
from lingjing.testing import declarations as model
from lingjing.testing import expressions as ex

ROOT = Path(__file__).parents[2]
MISSIONS = sorted((ROOT / "scenarios").glob("*.ljs"))


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_every_declared_name_is_on_the_page(file: Path) -> None:
    mission = lingjing.compile(file)
    text = page(mission)
    assert text.startswith(f"# {mission.title}\n")
    parts = (
        *mission.parameters, *mission.regions, *mission.grids, *mission.groups, *mission.agents, *mission.messages,
        *mission.rules, *mission.stages, *mission.limits, *mission.constraints, *mission.inspections, *mission.events,
        *mission.sweeps,
    )  # fmt: skip
    for part in parts:
        assert re.search(rf"\b{re.escape(part.name)}\b", text), part.name
    for sentence in mission.goal.splitlines():
        assert f"> {sentence}".rstrip() in text
    assert "```mermaid\n" in text
    assert text.count("```") % 2 == 0
    assert page(mission) == text


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_hidden_values_and_reveals_are_listed(file: Path) -> None:
    mission = lingjing.compile(file)
    text = page(mission)
    section = text.partition("## Hidden values\n")[2].partition("\n## ")[0]
    for group in mission.groups:
        if any(prop.hidden for prop in group.properties):
            assert f"- `{group.name}`: `" in section
    assert section.count("is shown to") == len(mission.reveals)
    assert bool(mission.reveals) != ("No agent receives any of these values" in section) or not section


def test_noticeable_consequences_of_hidden_values_are_listed(small: str) -> None:
    heading = "Consequences of hidden values, or of correct reports, that agents can notice:"
    plain = compile_text(small).mission
    assert plain is not None
    assert '- the episode ends on success: "it ends when all are rescued"\n' in page(plain).partition(heading)[2]
    binding = """  permit boat.moveTo when exists r: matched(victim[1], r)
  permit uav[1].forward when distance_xy(uav[1], boat) <= 900 m
  constraint hard apart { always distance_xy(boat, victim[1]) >= 1 m }
  constraint soft near { always distance_xy(boat, victim[1]) <= 900 m, penalty = 10 % }
  declassify boat.moveTo, apart, execute, calls because "a test"
  success"""
    bound = small.replace("  success", binding).replace(
        "{ done when rescued(v) }", "{ done when rescued(v), ticks <= 40\n limit calls <= 30 counts detection }"
    )
    mission = compile_text(bound).mission
    assert mission is not None
    listed = page(mission).partition(heading)[2].partition("\n## ")[0].strip().splitlines()
    assert listed == [
        '- the episode ends on success: "it ends when all are rescued"',
        '- receipts show whether `boat.moveTo` is permitted: "a test"',
        '- the episode ends when `apart` is broken: "a test"',
        '- the episode ends when stage `execute` is late: "a test"',
        '- receipts show that `calls` counts while stage `execute` runs: "a test"',
    ]


def test_rules_are_described_in_words() -> None:
    text = page(lingjing.compile(ROOT / "scenarios" / "ssr.ljs"))
    sentence = "the overlap of `r.box` with the true box of `v` in `r.frame` is at least `0.5`"
    assert sentence in text
    assert "an engine has performed `rescue` on `v` and the horizontal distance from `boat` to `v` is at most" in text
    assert "Won when for every victim `v`, *rescued* holds for `v`." in text


def test_a_mission_with_little_has_few_sections() -> None:
    mission = lingjing.compile(ROOT / "scenarios" / "ssr.ljs")
    bare = msgspec.structs.replace(
        mission, relations=(), stages=(), parameters=(), messages=(), comms=model.Comms(), rules=(),
        unlocks=(), success=ex.Flag(True), title="A | B",
    )  # fmt: skip
    text = page(bare)
    assert "**rescue** of `victim` is allowed from the start." in text
    text = page(msgspec.structs.replace(bare, groups=tuple(group for group in bare.groups if group.role == "asset")))
    assert "## Stages" not in text and "## Messages" not in text and "## Adjudication" not in text
