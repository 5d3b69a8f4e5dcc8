"""Completion of commands in bash, zsh and fish: each script is run by its shell, where that is installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from lingjing.testing import run_command

CASES = (
    ("lingjing ver", "verify"),
    ("lingjing run ss", "ssr"),
    ("lingjing run mi", "mine.ljs"),
    ("lingjing run ssr --policy heu", "heuristic"),
    ("lingjing run ssr --policy mi", "mine.py"),
    ("lingjing run ssr --mode broad", "broadcast"),
    ("lingjing run ssr --calls rec", "record"),
    ("lingjing bench main-l", "main-lite"),
    ("lingjing bench main --entr", "--entrants"),
    ("lingjing bench play main-l", "main-lite"),
    ("lingjing explain LJ0101", "LJ0101"),
    ("lingjing new mis", "mission"),
)
"""Commands up to the cursor, and a word that completes them."""

BASH = """
source ./script
complete_line() {
  COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
  _shtab_lingjing lingjing "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
  echo "${COMPREPLY[*]}"
}
"""

ZSH = """
zmodload zsh/zpty
zpty shell zsh -f -i
zpty -w shell 'PS1=; fpath=($PWD $fpath); autoload -Uz compinit; compinit -u -D; bindkey "^I" complete-word
  print-line() { print -r -- "LINE $BUFFER END"; BUFFER= }; zle -N print-line; bindkey "^X" print-line; print REA""DY'
zpty -r shell out '*READY*'
complete_line() {
  zpty -n -w shell "$*"$'\\t\\x18'
  zpty -r shell out '*LINE* END*'
  print -r -- "${${out##*LINE }%% END*}"
}
"""
"""zsh completes at a terminal alone. Here a shell at a pseudo-terminal gets a line, the tabulator, and ^X, which prints
the line as it is then.
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine.ljs").touch()
    (tmp_path / "mine.py").touch()
    return tmp_path


def script(shell: str, path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["completion", shell]) == 0
    path.write_text(capsys.readouterr().out, encoding="utf-8")


def run(shell: str, program: str, folder: Path, *options: str) -> list[str]:
    path = shutil.which(shell)
    if path is None:
        pytest.skip(f"{shell} is not installed")
    environment = {"HOME": str(folder), "PATH": "/usr/bin:/bin", "TERM": "dumb", "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        [path, *options, "-c", program], cwd=folder, env=environment, capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stderr.lower(), done.stderr
    return done.stdout.splitlines()


def test_bash_completes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script("bash", folder / "script", capsys)
    lines = run("bash", BASH + "\n".join(f"complete_line {line}" for line, _ in CASES), folder, "--norc")
    assert [line for line, (_, word) in zip(lines, CASES, strict=True) if word not in line.split()] == []


def test_fish_completes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script("fish", folder / "script", capsys)
    commands = [f'echo (complete -C "{line}" | string split -f 1 \\t)' for line, _ in CASES]
    lines = run("fish", "source ./script\n" + "\n".join(commands), folder)
    assert [line for line, (_, word) in zip(lines, CASES, strict=True) if word not in line.split()] == []


def test_zsh_completes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script("zsh", folder / "_lingjing", capsys)
    lines = run("zsh", ZSH + "\n".join(f"complete_line {line}" for line, _ in CASES), folder, "-f")
    assert [line for line, (_, word) in zip(lines, CASES, strict=True) if word not in line.split()] == []


def test_an_unknown_shell_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run_command(["completion", "fishh"])
    assert ended.value.code == 2
    assert "did you mean fish?" in capsys.readouterr().err
