"""Names that are not valid text, removed folders, and deeply nested files: each gives one error with a way out."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import lingjing
from lingjing.errors import UsageError
from lingjing.testing import mission_file
from tools.python_forks import run_python

LINGJING = (sys.executable, "-m", "lingjing.cli.main")
NOT_TEXT = b"s\xffr"


def run_in(folder: str | bytes, *arguments: str | bytes) -> tuple[int, str]:
    """Return exit code and standard error of a command in a folder."""
    done = run_python([*LINGJING, *arguments], cwd=folder, timeout=600)
    return done.returncode, done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> bytes:
    """A folder with a mission and a suite with names that are not UTF-8."""
    inside = os.fsencode(tmp_path)
    shutil.copy(mission_file("ssr"), os.path.join(inside, NOT_TEXT + b".ljs"))
    shutil.copy(Path(__file__).parents[2].joinpath("suites", "main.toml"), os.path.join(inside, NOT_TEXT + b".toml"))
    return inside


@pytest.mark.parametrize(
    "arguments",
    [
        (b"validate", NOT_TEXT + b".ljs"),
        (b"validate", NOT_TEXT + b".ljs", b"--json"),
        (b"compile", NOT_TEXT + b".ljs"),
        (b"fmt", NOT_TEXT + b".ljs"),
        (b"graph", NOT_TEXT + b".ljs"),
        (b"docs", NOT_TEXT + b".ljs"),
        (b"run", NOT_TEXT + b".ljs"),
        (b"run", b"ssr", b"-o", NOT_TEXT),
        (b"run", b"ssr", b"--policy", b"./" + NOT_TEXT + b".py:P"),
        (b"bench", NOT_TEXT + b".toml"),
        (b"view", NOT_TEXT + b".mcap"),
        (b"new", b"mission", NOT_TEXT),
    ],
)
def test_a_name_that_is_not_text_is_refused_by_every_verb(folder: bytes, arguments: tuple[bytes, ...]) -> None:
    before = sorted(os.listdir(folder))
    code, errors = run_in(folder, *arguments)
    assert code == 2, errors
    assert errors.startswith("error: the argument `") and "s\\xffr" in errors, errors
    assert "hint: rename the file or the folder" in errors
    assert sorted(os.listdir(folder)) == before


def test_the_python_api_refuses_a_name_that_is_not_text(folder: bytes) -> None:
    with pytest.raises(UsageError, match=r"the file `.*s\\xffr\.ljs` is not text in UTF-8"):
        lingjing.compile(os.fsdecode(os.path.join(folder, NOT_TEXT + b".ljs")))


@pytest.mark.parametrize("verb", [("validate", "ssr"), ("run", "ssr"), ("bench", "main"), ("compile", "ssr")])
def test_a_working_folder_that_is_not_text_is_refused(tmp_path: Path, verb: tuple[str, ...]) -> None:
    place = os.path.join(os.fsencode(tmp_path), b"w\xfe")
    os.mkdir(place)
    code, errors = run_in(place, *verb)
    assert (code, errors.splitlines()[0].endswith("w\\xfe` is not text in UTF-8")) == (2, True), errors
    assert os.listdir(place) == []


@pytest.mark.parametrize("verb", [("run", "ssr", "--seeds", "0-1", "-j", "2"), ("compile", "ssr", "-o", "x.json")])
def test_a_working_folder_that_was_removed_is_named(tmp_path: Path, verb: tuple[str, ...]) -> None:
    removed = tmp_path / "removed"
    removed.mkdir()
    line = ["sh", "-c", 'rmdir "$PWD"; exec "$@"', "sh", *LINGJING, *verb]
    done = subprocess.run(line, cwd=removed, capture_output=True, text=True, timeout=600)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: the working folder cannot be used: No such file or directory\nhint: ")


@pytest.mark.slow
def test_environment_variables_that_are_not_text_reach_policies_in_parallel_processes(tmp_path: Path) -> None:
    shutil.copy(Path(__file__).with_name("boats.ljs"), tmp_path / "m.ljs")
    (tmp_path / "p.py").write_text(
        "import os\nfrom lingjing.plugins.policy import Decision\n"
        "class P:\n"
        "    async def reset(self, brief): assert os.environb[b'NOT_TEXT'] == b'\\xff\\xfe'\n"
        "    async def act(self, observation, inbox): return Decision()\n"
    )
    line = [*LINGJING, "run", "m.ljs", "--policy", "./p.py:P", "--seeds", "0-1", "-j", "2", "--no-overview"]
    variables = {**os.environb, b"NOT_TEXT": b"\xff\xfe"}
    done = subprocess.run(line, cwd=tmp_path, env=variables, capture_output=True, text=True, timeout=1500)
    assert done.returncode == 0, done.stderr
    assert "policy answers were replaced" not in done.stderr, done.stderr
    assert "AssertionError" not in done.stderr


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("suite = " + "[" * 100_000, "` is not a suite: its values are nested too deeply"),
        ("suite = " + "{a = " * 100_000, "` is not a suite: its values are nested too deeply"),
        ("suite = " + "9" * 5000, "` is not TOML: Exceeds the limit"),
        ("#" * (4 * 2**20 + 1), "` is not a suite: it is longer than 4 MB"),
    ],
)
def test_a_suite_file_that_is_too_long_or_too_deeply_nested_is_refused(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "s.toml").write_text(text)
    code, errors = run_in(str(tmp_path), "bench", "s.toml")
    assert code == 2, errors[-500:]
    assert errors.startswith(f"error: `s.toml{problem}"), errors[:500]
    assert os.listdir(tmp_path) == ["s.toml"]
