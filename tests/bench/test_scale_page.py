"""Tests of the page on scale: its sums match its table, and its bounds match the shipped suite."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lingjing
from lingjing.bench.suite import find_suite
from lingjing.testing import PluginHost
from tests.bench.suite_kit import SuiteEpisode, estimates, read_plan

PAGE = (Path(lingjing.__file__).parents[1] / "docs" / "scale.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(\w+)` (\w+) \| (\d+) \| (\d+) \| (\d+) \| ([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)


def test_the_sums_of_the_page_match_its_table() -> None:
    decisions, pictures, cpu, megabytes = (sum(float(row[at]) for row in ROWS) for at in (3, 4, 5, 6))
    assert f"| all | | {decisions:,.0f} | {pictures:.0f} | {cpu:.1f} | {megabytes:.1f} |" in PAGE
    hours = 14_400 * cpu / len(ROWS) / 3600
    assert f"= {hours:.0f} CPU hours, and {14.4 * megabytes / len(ROWS):.0f} GB of traces" in PAGE
    assert f"{decisions:,.0f} × 100 = {decisions * 100:,.0f} a model" in PAGE
    assert f"are {decisions / cpu:.0f} a second" in PAGE
    assert f"| simulation alone | {hours / 8:.1f} h | {hours / 64:.1f} h |" in PAGE
    assert f"| {decisions / cpu * 8:.0f} | 590 | 59,000 |" in PAGE and 585 < decisions / cpu * 64 < 595


def test_the_columns_and_the_upper_bound_match_the_shipped_suite() -> None:
    plan = read_plan(find_suite("main"), PluginHost())
    columns = {(cell.column.mission, cell.column.mode) for cell in plan.cells}
    assert {(row[0], row[1]) for row in ROWS} == columns
    episodes = [SuiteEpisode(cell, seed) for cell in plan.cells if cell.player.name == "GPT-5.5" for seed in range(100)]
    (estimate,) = estimates(episodes, plan.missions, (), PluginHost())
    assert estimate.most.calls == pytest.approx(406_000)
