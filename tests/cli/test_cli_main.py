"""Tests of the entry point: help, version, exit codes, messages."""

from __future__ import annotations

import os
import subprocess
import sys
import types
from pathlib import Path

import pytest

from lingjing.cli import main as entry_point
from lingjing.errors import InfrastructureError, MissionError, UsageError
from lingjing.testing import mission_file, run_command

HEAVY = (
    "mujoco", "libsumo", "jsbsim", "litellm", "mcap", "gymnasium", "pydantic", "jsonschema",
    "pluggy", "rich", "numpy", "cv2", "moderngl", "matplotlib", "scipy",
)  # fmt: skip


def cli(*arguments: str, cwd: Path | None = None, **extra: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lingjing.cli.main", *arguments]
    environment = {"PATH": "/usr/bin:/bin", "HOME": "/nonexistent", **extra}
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=900, check=False)


def raising(error: BaseException) -> types.ModuleType:
    """A verb module with a handler that raises `error`."""
    module = types.ModuleType("lingjing_test_verb")

    def handler(args: object) -> int:
        raise error

    module.add_options = lambda parser: None  # type: ignore[attr-defined]
    module.handler = handler  # type: ignore[attr-defined]
    return module


@pytest.fixture
def run_verb(monkeypatch: pytest.MonkeyPatch):
    def arrange(error: BaseException) -> int:
        monkeypatch.setattr(entry_point, "import_module", lambda name: raising(error))
        return entry_point.main(["run"])

    return arrange


def test_version_is_printed_alone() -> None:
    done = cli("--version")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("lingjing 0.")


def test_a_command_without_a_verb_prints_the_verbs_and_is_a_usage_error() -> None:
    done = cli()
    assert done.returncode == 2
    assert done.stdout == ""
    for verb in entry_point.VERBS:
        assert f"    {verb.name} " in done.stderr


def test_help_of_every_verb_exits_with_code_0(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in entry_point.VERBS:
        with pytest.raises(SystemExit) as end:
            run_command([verb.name, "--help"])
        assert end.value.code == 0
        assert f"lingjing {verb.name}" in capsys.readouterr().out


def test_an_unknown_verb_is_a_usage_error() -> None:
    done = cli("fly")
    assert done.returncode == 2
    assert "fly" in done.stderr


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (UsageError("no such thing", hint="try another"), 2, "error: no such thing\nhint: try another\n"),
        (MissionError("wrong mission"), 1, "error: wrong mission\n"),
        (InfrastructureError("engine `vessel` died"), 3, "error: engine `vessel` died\n"),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (
            PermissionError(13, "Permission denied", "/there"),
            2,
            "error: the system refuses `/there`: Permission denied\n",
        ),
    ],
)
def test_errors_become_a_message_and_a_code(run_verb, capsys, error, code, message) -> None:
    assert run_verb(error) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(message)
    assert "Traceback" not in printed.err


def test_a_bug_gives_one_line_to_report(run_verb, capsys, monkeypatch) -> None:
    monkeypatch.delenv("LINGJING_TRACEBACK", raising=False)
    assert run_verb(ZeroDivisionError("oops")) == 70
    errors = capsys.readouterr().err
    assert "ZeroDivisionError: oops" in errors
    assert "test_cli_main.py:" in errors
    assert "report" in errors
    assert "Traceback" not in errors


def test_an_environment_variable_turns_the_traceback_on(run_verb, capsys, monkeypatch) -> None:
    monkeypatch.setenv("LINGJING_TRACEBACK", "1")
    assert run_verb(ZeroDivisionError("oops")) == 70
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [("run", "--help"), ("plugins",), ("--version",)])
def test_a_closed_output_pipe_gives_no_message(arguments: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", *arguments],
        env={**os.environ, "PYTHONUNBUFFERED": ""}, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=900,
        check=False,
    )  # fmt: skip
    os.close(writer)
    assert (done.returncode, done.stderr) == (entry_point.BROKEN_PIPE, "")


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, lingjing; print(sorted(set(sys.argv[1:]) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code, *HEAVY], capture_output=True, text=True, check=True, timeout=900)
    assert done.stdout.strip() == "[]"


def test_validate_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom lingjing.cli.main import main\n"
        "code = main(['validate', sys.argv[1]])\n"
        "print(code, sorted(set(sys.argv[2:]) & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code, str(mission_file("ssr")), *HEAVY]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=900)
    assert done.stdout.splitlines()[-1] == "0 []", done.stdout + done.stderr
