"""Tests of the page on studies: its commands parse, its suite is valid, and its table matches the missions."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import lingjing
from lingjing.bench.columns import columns
from lingjing.cli import bench
from lingjing.cli.arguments import parse_pairs, parse_settings
from lingjing.testing import PluginHost, run_command, shipped_missions
from tests.bench.suite_kit import TABLES, SuiteRun, find_suite, read_plan, shipped_suites

PAGE = (Path(lingjing.__file__).parents[1] / "docs" / "studies.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(\w+)` \| (.*?) \| `(--set .*?)` \|$", PAGE, flags=re.MULTILINE)


def test_the_commands_of_the_page_are_valid(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    played: list[int] = []
    monkeypatch.setattr(SuiteRun, "play", lambda self, episodes: played.append(len(episodes)))
    (block,) = re.findall(r"^```console\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    for line in block.splitlines():
        assert run_command(shlex.split(line)[1:]) == 0
    assert played == [100 * len(columns(shipped_missions())), 2 * 2 * 20, 4 * 5]


def test_the_suite_of_the_page_is_valid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"^```toml\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    (tmp_path / "altitude.toml").write_text(block)
    assert run_command(["bench", str(tmp_path / "altitude.toml"), "--check"]) == 0
    assert "2 entrants in 2 columns, 20 seeds: 80 episodes" in capsys.readouterr().err


def test_the_page_lists_every_suite_with_its_size() -> None:
    sizes = dict(re.findall(r"^\| `([\w-]+)` \| .* \| ([\d,]+) \|$", PAGE, flags=re.MULTILINE))
    plans = {name: read_plan(find_suite(name), PluginHost()) for name in shipped_suites()}
    assert sizes == {name: f"{len(plan.cells) * len(plan.suite.seeds):,}" for name, plan in plans.items()}


def test_the_page_lists_every_table() -> None:
    named = re.findall(r"^\| `(\w+)` \| [^|]+ \|$", PAGE, flags=re.MULTILINE)
    assert tuple(named) == tuple(TABLES) == bench.KINDS


@pytest.mark.parametrize(("name", "values", "by_hand"), ROWS, ids=[row[0] for row in ROWS])
def test_the_table_of_sweeps_matches_the_missions(name: str, values: str, by_hand: str) -> None:
    mission = lingjing.compile(name)
    pairs = parse_pairs("--set", [word for word in shlex.split(by_hand) if word != "--set"])
    set_by_hand = parse_settings(pairs, mission)
    swept = columns([path for path in shipped_missions() if path.stem == name], sweeps=True)
    declared = {key for column in swept for key in column.settings}
    assert set(set_by_hand) == declared
    for key, value in set_by_hand.items():
        assert value in {column.settings[key] for column in swept if key in column.settings}


def test_the_table_lists_every_mission_with_sweeps() -> None:
    assert {row[0] for row in ROWS} == {path.stem for path in shipped_missions() if lingjing.compile(str(path)).sweeps}
