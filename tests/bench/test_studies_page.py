"""The page on studies: its commands are understood, and its table names what the missions declare."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import lingjing
from lingjing.bench import study
from lingjing.bench.columns import columns, shipped
from lingjing.cli.arguments import parse_pairs, parse_settings
from lingjing.dsl.loading.load import load_mission

PAGE = (Path(lingjing.__file__).parents[1] / "docs" / "studies.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(\w+)` \| (.*?) \| `(.*?)` \|$", PAGE, flags=re.MULTILINE)


def test_its_commands_are_understood(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    played: list[int] = []
    monkeypatch.setattr(study, "play", lambda results, episodes, jobs, **how: played.append(len(episodes)))
    (block,) = re.findall(r"^```console\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    for line in block.splitlines():
        assert study.main(shlex.split(line)[3:]) == 0
    assert played == [100 * len(columns(shipped())), 2 * 2 * 20, 4 * 5]


@pytest.mark.parametrize(("name", "values", "by_hand"), ROWS, ids=[row[0] for row in ROWS])
def test_its_table_is_what_missions_declare(name: str, values: str, by_hand: str) -> None:
    mission = load_mission(name)
    pairs = parse_pairs("--set", [word for word in shlex.split(by_hand) if word != "--set"])
    set_by_hand = parse_settings(pairs, mission)
    swept = columns([path for path in shipped() if path.stem == name], sweeps=True)
    declared = {key for column in swept for key in column.settings}
    assert set(set_by_hand) == declared
    for key, value in set_by_hand.items():
        assert value in {column.settings[key] for column in swept if key in column.settings}


def test_no_sweep_is_left_out() -> None:
    assert {row[0] for row in ROWS} == {path.stem for path in shipped() if load_mission(str(path)).sweeps}
