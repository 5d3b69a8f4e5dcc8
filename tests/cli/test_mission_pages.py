"""Tests of the generated pages in `docs/missions`: one per shipped mission, complete, small and up to date."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lingjing
from lingjing.dsl.pages.judging import judging

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "missions"
MISSIONS = sorted((ROOT / "scenarios").glob("*.ljs"))


@pytest.mark.parametrize("file", MISSIONS, ids=lambda file: file.stem)
def test_every_mission_has_a_page_with_its_rules_and_radii(file: Path) -> None:
    text = (PAGES / f"{file.stem}.md").read_text(encoding="utf-8")
    mission = lingjing.compile(file)
    assert text.startswith(f"# {mission.title}\n"), "run `make missions`"
    for row in judging(mission):
        assert f"| {row[0]} | {row[1]} | {row[2]} |" in text, f"{row[0]}: run `make missions`"
    for name in re.findall(r"\]\(([^)]+\.(?:png|jpg|svg))\)", text):
        assert (PAGES / name).is_file(), name
    assert f"({file.stem}-map.png)" in text and f"({file.stem}-graph.svg)" in text


def test_the_index_links_to_every_page_and_every_picture_is_used() -> None:
    index = (PAGES / "README.md").read_text(encoding="utf-8")
    assert all(f"({file.stem}.md)" in index for file in MISSIONS)
    pages = [path.read_text(encoding="utf-8") for path in PAGES.glob("*.md")]
    for picture in (path for path in PAGES.iterdir() if path.suffix != ".md"):
        assert any(f"({picture.name})" in page for page in pages), picture.name
    assert sum(path.stat().st_size for path in PAGES.iterdir()) < 4_000_000
