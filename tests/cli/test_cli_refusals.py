"""Errors of the system: the command exits with the right code, names the rejected item and gives a way out."""

from __future__ import annotations

import errno
import os

import pytest

from lingjing.cli import main as command
from lingjing.dsl.source import text
from lingjing.errors import ExitCode, UsageError, hint_of
from lingjing.refusals import refusal_of


def refused(number: int, name: str | None = None) -> OSError:
    return OSError(number, os.strerror(number), name)


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (refused(errno.ENOSPC, "a"), ExitCode.USAGE, "cannot write `a`: No space left on device"),
        (refused(errno.EACCES), ExitCode.USAGE, "cannot write the output: Permission denied"),
        (refused(errno.EACCES, "a"), ExitCode.USAGE, "the system refuses `a`: Permission denied"),
        (refused(errno.EMFILE, "a"), ExitCode.INFRASTRUCTURE, "the system refuses `a`: Too many open files"),
        (refused(errno.ENOMEM), ExitCode.INFRASTRUCTURE, "what is needed: Cannot allocate memory"),
        (refused(errno.EAGAIN), ExitCode.INFRASTRUCTURE, "what is needed: Resource temporarily unavailable"),
        (refused(errno.EIO, "a"), ExitCode.INFRASTRUCTURE, "the system refuses `a`: Input/output error"),
        (
            FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']"),
            ExitCode.USAGE,
            "no folder for temporary files can be written",
        ),
        (MemoryError(), ExitCode.INFRASTRUCTURE, "the system does not have enough memory"),
        (RuntimeError("can't start new thread"), ExitCode.INFRASTRUCTURE, "the system cannot start more threads"),
    ],
)
def test_a_refusal_of_the_system_gives_its_exit_code_a_message_and_a_hint(
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
def test_other_errors_are_no_refusals_of_the_system(error: Exception) -> None:
    assert refusal_of(error) is None


@pytest.mark.parametrize(
    ("number", "hint"),
    [
        (errno.EIO, "check the disk"),
        (errno.EMFILE, "ulimit -n"),
        (errno.EACCES, "ls -ld"),
        (errno.ENOSPC, "make room"),
        (errno.ENOENT, ""),
    ],
)
def test_an_error_without_a_hint_takes_the_hint_of_the_refusal_that_caused_it(number: int, hint: str) -> None:
    with pytest.raises(UsageError) as raised:
        try:
            raise refused(number, "a")
        except OSError as error:
            raise UsageError("`a` cannot be read") from (error if number == errno.EIO else None)
    assert (hint in hint_of(raised.value)) if hint else (hint_of(raised.value) == "")


def test_the_hint_of_a_refusal_is_found_through_a_chain_of_causes() -> None:
    with pytest.raises(UsageError) as raised:
        try:
            try:
                raise refused(errno.EMFILE)
            except OSError as error:
                raise ValueError("no memory") from error
        except ValueError as error:
            raise UsageError("a request cannot be sent") from error
    assert "ulimit -n" in hint_of(raised.value)
    assert raised.value.hint == ""


def test_an_error_keeps_its_own_hint() -> None:
    with pytest.raises(UsageError) as raised:
        try:
            raise refused(errno.EIO)
        except OSError as error:
            raise UsageError("`a` cannot be read", hint="name another") from error
    assert hint_of(raised.value) == raised.value.hint == "name another"


def test_a_mission_that_cannot_be_read_from_the_disk_gives_a_hint(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuses(file: object, path: str) -> bytes:
        raise refused(errno.EIO)

    monkeypatch.setattr(text, "_bounded", refuses)
    assert command.main(["validate", "scenarios/ssr.ljs"]) == ExitCode.USAGE
    assert "`scenarios/ssr.ljs` cannot be read: Input/output error\nhint: check the disk" in capsys.readouterr().err
