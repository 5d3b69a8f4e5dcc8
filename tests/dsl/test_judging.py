"""The table of adjudication: every rule and every interaction of a target, with the radii of the paper."""

from pathlib import Path

import pytest

import lingjing
from lingjing.dsl.pages.judging import HEADS, judging
from lingjing.dsl.pages.page import page, table

ROOT = Path(__file__).parents[2]
MISSIONS = sorted((ROOT / "scenarios").glob("*.ljs"))


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_every_rule_and_unlock_has_a_row(file: Path) -> None:
    mission = lingjing.compile(file)
    rows = list(judging(mission))
    assert all(len(row) == len(HEADS) for row in rows)
    first = [row[0] for row in rows]
    for rule in mission.rules:
        assert (rule.when is not None) != any(name.startswith(f"**{rule.name}**") for name in first)
    for unlock in mission.unlocks:
        row = next(row for row in rows if row[0].startswith(f"{unlock.interaction} ("))
        assert row[3].startswith(("allowed when ", "allowed from the start"))
        assert "`now`" not in row[3]


@pytest.mark.parametrize(
    ("mission", "event", "by", "bounds"),
    [
        ("ufr", "**matched** (fire, detection)", "a report", "IoU ≥ 0.5"),
        ("ufr", "**located** (fire, detection)", "the kernel", "≤ 25 m"),
        ("ufr", "extinguish (fire)", "the `road` engine", "≤ 30 m"),
        ("idf", "extinguish (fire)", "the `quadruped` engine", "≤ 2 m"),
        ("vdn", "arrive (home)", "the `quadruped` engine", "≤ 30 m"),
        ("cd", "restock (depot)", "the `road` engine", "≤ 50 m"),
        ("ssr", "rescue (victim)", "the `vessel` engine", "≤ 50 m"),
        ("ld", "**delivered** (house)", "the kernel", "≤ 15 m"),
        ("cr", "**check** (route)", "the kernel", "≤ 25 m"),
    ],
)
def test_the_bounds_are_those_of_the_paper(mission: str, event: str, by: str, bounds: str) -> None:
    rows = {row[0]: row for row in judging(lingjing.compile(ROOT / "scenarios" / f"{mission}.ljs"))}
    assert rows[event][1:3] == (by, bounds)


def test_a_page_begins_with_the_given_sections() -> None:
    mission = lingjing.compile(ROOT / "scenarios" / "ufr.ljs")
    lead = [("First", ["one", "two"]), ("Empty", []), ("Counts", table(("a", "b"), [("1|2", "x")]))]
    text = page(mission, lead=lead, graph_picture="g.svg")
    assert text.index("## First\n\none\ntwo") < text.index("## Counts") < text.index("## At a glance")
    assert "## Empty" not in text and "1\\|2" in text
    assert "(g.svg)" in text and "```mermaid" not in text
