"""The one root exception and the exit codes of the command line.

A user's mistake in a mission is *data* (a `lingjing.mission.diagnostics.Diagnostic`), never an exception. What
raises is a fault at a border: a file that cannot be read, an engine that died, a plug-in that broke its contract.
Every such fault derives from `LingjingError` and knows the exit code that the command line ends with.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple, TypeVar

ReadT = TypeVar("ReadT")
OtherwiseT = TypeVar("OtherwiseT")


class ExitCode(IntEnum):
    """Exit codes of every verb."""

    OK = 0
    MISSION = 1
    USAGE = 2
    INFRASTRUCTURE = 3
    BUG = 70
    INTERRUPTED = 130


class Fault(NamedTuple):
    """One of several things that are wrong with a document or with options: its path, what is wrong, the way out."""

    where: str
    message: str
    hint: str = ""


class LingjingError(Exception):
    """Root of everything this project raises on purpose.

    `str(error)` names the thing at fault; `hint` says what to do about it, which a traceback shows as a note: where an
    error has none of its own, that of the error that it was raised for. `faults` are those of a document or
    of options, if that is what is wrong.
    """

    exit_code = ExitCode.BUG

    def __init__(self, message: str, *, hint: str = "", faults: tuple[Fault, ...] = ()) -> None:
        super().__init__(message)
        self._hint = hint
        self.faults = faults
        if hint:
            self.add_note(f"hint: {hint}")

    @property
    def hint(self) -> str:
        """The way out in a line, "" if there is none."""
        if self._hint or self.__context__ is None:
            return self._hint
        from lingjing.refusals import hint_of  # not above: it imports this module

        behind: BaseException | None = self.__cause__ or self.__context__
        while behind is not None:
            if hint := behind._hint if isinstance(behind, LingjingError) else hint_of(behind):
                return hint
            behind = behind.__cause__ or behind.__context__
        return ""


class UsageError(LingjingError):
    """Wrong arguments, unreadable input, unwritable output."""

    exit_code = ExitCode.USAGE


class MissionError(LingjingError):
    """The mission has errors; the diagnostics, if any, are rendered into the message by who raises."""

    exit_code = ExitCode.MISSION


class PluginError(LingjingError):
    """A plug-in broke its contract; the message names the plug-in and the hook or method."""

    exit_code = ExitCode.USAGE


class ForeignCodeError(UsageError, PluginError):
    """Code that the caller has named, such as a policy, has failed before anything was recorded: it raised, ended its
    process, or did not come to an end in time."""


class InfrastructureError(LingjingError):
    """An engine or a worker process failed: the episode is an infrastructure abort, never a model failure."""

    exit_code = ExitCode.INFRASTRUCTURE


def error_of(code: int, message: str, hint: str = "") -> LingjingError:
    """The error with which another process of ours ended, by its exit code: of no known one, a fault of ours."""
    kinds: dict[int, type[LingjingError]] = {
        kind.exit_code: kind for kind in (UsageError, MissionError, InfrastructureError)
    }
    return kinds.get(code, LingjingError)(message, hint=hint)


class ErrorCollector:
    """The mistakes of one call, collected while the rest is still read, so that all of them are told together."""

    def __init__(self) -> None:
        self.errors: list[LingjingError] = []

    def attempt(self, read: Callable[[], ReadT], otherwise: OtherwiseT) -> ReadT | OtherwiseT:
        """What `read` gives; `otherwise` if it raises `UsageError` or `MissionError`, which is collected."""
        try:
            return read()
        except (UsageError, MissionError) as error:
            self.add(error)
            return otherwise

    def add(self, error: LingjingError) -> None:
        """Collect a mistake that is known already."""
        self.errors.append(error)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Those of all errors."""
        return tuple(fault for error in self.errors for fault in error.faults)

    def check(self) -> None:
        """Raise what was collected, if anything: one error as it is, several as one `UsageError` of a line each (a
        `ForeignCodeError` if all of them are)."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            hints = [error.hint for error in self.errors if "\n" in str(error) and error.hint]
            lines = dict.fromkeys(_with_hint(error) for error in self.errors)
            kind = ForeignCodeError if all(isinstance(one, ForeignCodeError) for one in self.errors) else UsageError
            raise kind("\n".join(lines), hint="; ".join(dict.fromkeys(hints)), faults=self.faults)


def _with_hint(error: LingjingError) -> str:
    """An error's message with its hint, if both are one line."""
    return f"{error}; {error.hint}" if error.hint and "\n" not in str(error) else str(error)
