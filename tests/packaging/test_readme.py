"""The README is true: its excerpt, its commands, its code and its error message."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections import Counter
from pathlib import Path

import pytest

import lingjing.cli.main as door
from benchmarks import validity
from lingjing.decoding import converted
from tools.python_forks import run_python

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
POLICIES = ("oracle", "heuristic")
SSR = (ROOT / "scenarios" / "ssr.ljs").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


def test_the_readme_is_short() -> None:
    assert len(README.split()) < 500


def test_the_lines_of_the_excerpt_are_in_the_mission() -> None:
    (excerpt,) = blocks("ljs")
    lines = set(SSR.splitlines())
    assert [line for line in excerpt.splitlines() if line not in lines] == []


def test_the_table_counts_the_stored_episodes() -> None:
    record = validity.stored_record()
    if record is not None:
        assert validity.readme_with(README, record) == README, "write it: python -m benchmarks.validity --write"
        return
    stored = json.loads((ROOT / "benchmarks" / "digests.json").read_text(encoding="utf-8"))
    played: Counter[tuple[str, str]] = Counter()
    won: Counter[tuple[str, str]] = Counter()
    for name, episode in stored.items():
        column, policy, _ = name.split()
        played[column, policy] += 1
        won[column, policy] += episode["reason"] == "success"
    rows = [
        f"|{column}|" + "|".join(f"{won[column, policy]}/{played[column, policy]}" for policy in POLICIES) + "|"
        for column in sorted({column for column, _ in played})
    ]
    assert "\n".join(rows) in README, "write into the README:\n" + "\n".join(rows)


def test_the_table_of_both_tiers_fits() -> None:
    """The table of a whole record takes the place of the present one, with twelve columns and at most as many words."""
    columns = sorted(re.findall(r"^\|(\w+-\w+)\|", README, flags=re.MULTILINE))
    cells = [
        {"study": f"reference-tier{tier}", "column": column, "tier": tier, "entrant": policy, "sees": sees,
         "planned": 100, "seeds": "0-99", "won": "0-41"}
        for column in columns for tier in (0, 1) for policy, sees in (("oracle", "truth"), ("heuristic", "pictures"))
    ]  # fmt: skip
    studies = [{"study": f"reference-tier{tier}"} for tier in (0, 1)]
    record = converted({"program": "p", "studies": studies, "cells": cells}, validity.ValidityRecord)
    changed = validity.readme_with(README, record)
    assert len(columns) == 12 and changed.count("|42/100|42/100|42/100|42/100|") == 12
    assert len(changed.split()) < 500
    assert "no model has played yet" in changed and validity.readme_with(changed, record) == changed


def test_the_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"`?\bmake (\w+)", README))
    assert targets >= {"demo", "test", "bench", "study"}
    for target in targets - {"and"}:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_the_commands_are_valid(monkeypatch: pytest.MonkeyPatch) -> None:
    commands = [
        shlex.split(command)[1:]
        for block in blocks("sh")
        for line in block.splitlines()
        for command in line.split("&&")
        if command.strip().startswith("lingjing")
    ]
    real = door.import_module
    seen: list[str] = []

    def import_module(name: str):
        module = real(name)
        if hasattr(module, "handler"):  # else it is one that is loaded beside a verb
            monkeypatch.setattr(module, "handler", lambda args: seen.append(args.verb) or 0)
        return module

    monkeypatch.setattr(door, "import_module", import_module)
    assert [door.main(command) for command in commands] == [0] * len(commands)
    assert seen == ["run", "run", "new", "run", "new", "run", "run", "bench"]


def test_the_error_message_is_that_of_the_program(tmp_path: Path) -> None:
    (shown,) = blocks("console")
    command, _, output = shown.partition("\n")
    assert command == "$ lingjing validate ssr.ljs"
    wrong = SSR.replace("drift = 0.1 m/s", "drift = 0.1 m").replace("~ sites(search", "~ sites(serch", 1)
    (tmp_path / "ssr.ljs").write_text(wrong, encoding="utf-8")
    done = run_python([sys.executable, "-m", "lingjing.cli.main", "validate", "ssr.ljs"], cwd=tmp_path)  # fmt: skip
    assert done.returncode == 1
    assert (done.stdout + done.stderr).strip() == output.strip()


@pytest.mark.slow
def test_the_python_code_runs(tmp_path: Path) -> None:
    (code,) = blocks("python")
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "ssr.ljs").write_text(SSR.replace("ticks <= 60", "ticks <= 12"), encoding="utf-8")
    done = run_python([sys.executable, "-c", code], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    success, targets, trace = done.stdout.split()
    assert success in {"True", "False"}
    assert 0 <= int(targets) <= 3
    assert (tmp_path / trace).is_file()
