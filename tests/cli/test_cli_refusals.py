"""What the system refuses ends a command with the right code, names what was refused and says the way out."""

from __future__ import annotations

import errno
import os

import pytest

from lingjing.cli import main as command
from lingjing.errors import ExitCode
from lingjing.refusals import refusal_of


def refused(number: int, name: str | None = None) -> OSError:
    return OSError(number, os.strerror(number), name)


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (refused(errno.ENOSPC, "a"), ExitCode.USAGE, "cannot write `a`: No space left on device"),
        (refused(errno.EACCES), ExitCode.USAGE, "cannot write the output: Permission denied"),
        (refused(errno.EMFILE, "a"), ExitCode.INFRASTRUCTURE, "the system refuses `a`: Too many open files"),
        (refused(errno.ENOMEM), ExitCode.INFRASTRUCTURE, "what is needed: Cannot allocate memory"),
        (refused(errno.EAGAIN), ExitCode.INFRASTRUCTURE, "what is needed: Resource temporarily unavailable"),
        (refused(errno.EIO, "a"), ExitCode.INFRASTRUCTURE, "the system refuses `a`: Input/output error"),
        (MemoryError(), ExitCode.INFRASTRUCTURE, "the system has not enough memory"),
        (RuntimeError("can't start new thread"), ExitCode.INFRASTRUCTURE, "the system starts no more threads"),
    ],
)
def test_a_refusal_is_no_bug(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception, code: int, words: str
) -> None:
    def fails(arguments: list[str]) -> int:
        raise error

    monkeypatch.setattr(command, "_dispatch", fails)
    monkeypatch.setattr(command, "silence_stdout", lambda: None)
    assert command.main(["run", "ssr"]) == code
    errors = capsys.readouterr().err
    assert errors.startswith("error: ")
    assert words in errors
    assert "\nhint: " in errors


@pytest.mark.parametrize("error", [refused(errno.ENOENT, "a"), refused(errno.EBADF), ValueError("a"), RuntimeError()])
def test_anything_else_stays_what_it_is(error: Exception) -> None:
    assert refusal_of(error) is None
