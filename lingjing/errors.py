"""The root exception and the exit codes of the command line.

A user's mistake in a mission is *data* (a `lingjing.mission.diagnostics.Diagnostic`), never an exception. Exceptions
report faults at a border: an unreadable file, a dead engine, a plug-in that violates its contract. All derive from
`LingjingError` and have the exit code of the command line.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeVar

from lingjing.system_hints import hint_of_system

if TYPE_CHECKING:
    from lingjing.mission.diagnostics import Diagnostic

ReadT = TypeVar("ReadT")
OtherwiseT = TypeVar("OtherwiseT")


class ExitCode(IntEnum):
    """Exit codes of every command."""

    OK = 0
    """The command ran."""
    MISSION = 1
    """The mission has errors."""
    USAGE = 2
    """Wrong arguments, unreadable input or unwritable output."""
    INFRASTRUCTURE = 3
    """An engine, a process or a service failed."""
    UNDECIDED = 4
    """A test has not played enough episodes for a verdict."""
    BUG = 70
    """An error of this program."""
    INTERRUPTED = 130
    """The user interrupted the command."""


class Fault(NamedTuple):
    """One of several faults of a document or of options."""

    where: str
    """The path of the value."""
    message: str
    """The fault."""
    hint: str = ""
    """An action that solves the problem; "" if unknown."""


class LingjingError(Exception):
    """Root of all exceptions that this project raises on purpose.

    `str(error)` names the faulty thing. `hint` is what the reader can do, in one line; a traceback shows it as a note.
    An error without a hint may have a cause with one: `hint_of` returns it. `faults` are the single faults of a
    document or of options.

    >>> try:
    ...     lingjing.read("runs/fist/trace.mcap")
    ... except lingjing.LingjingError as error:
    ...     print(type(error).__name__, int(error.exit_code), error)
    UsageError 2 cannot read the trace runs/fist/trace.mcap: No such file or directory
    """

    exit_code = ExitCode.BUG

    def __init__(self, message: str, *, hint: str = "", faults: tuple[Fault, ...] = ()) -> None:
        super().__init__(message)
        self.hint = hint
        self.faults = faults
        if hint:
            self.add_note(f"hint: {hint}")


class UsageError(LingjingError):
    """Wrong arguments, unreadable input, unwritable output.

    >>> try:
    ...     lingjing.run("first.ljs", mode="brodcast")
    ... except lingjing.UsageError as error:
    ...     print(error)
    mission 'first' has no mode 'brodcast'
    """

    exit_code = ExitCode.USAGE


class MissionError(LingjingError):
    """The mission has errors. The message contains the rendered diagnostics, if there are any, as the command line
    prints them; `diagnostics` holds them as data.

    >>> try:
    ...     lingjing.compile("wrong.ljs")
    ... except lingjing.MissionError as error:
    ...     for diagnostic in error.diagnostics:
    ...         print(diagnostic.code, diagnostic.span.line, diagnostic.message)
    LJ0101 32 no asset type is called `lifebot`
    """

    exit_code = ExitCode.MISSION

    def __init__(
        self,
        message: str,
        *,
        hint: str = "",
        faults: tuple[Fault, ...] = (),
        diagnostics: tuple[Diagnostic, ...] = (),
    ) -> None:
        super().__init__(message, hint=hint, faults=faults)
        self.diagnostics = diagnostics
        """The diagnostics of the mission's text; empty for an error that is found later."""


class PluginError(LingjingError):
    """A plug-in violated its contract. The message names the plug-in and the hook or method.

    >>> def make(*arguments):
    ...     return None
    >>> try:
    ...     lingjing.run("first.ljs", policy=make)
    ... except lingjing.PluginError as error:
    ...     print(error)
    the policy of `scout[1]` failed in `reset`: AttributeError: 'NoneType' object has no attribute 'reset'
    """

    exit_code = ExitCode.USAGE


class ForeignCodeError(UsageError, PluginError):
    """Code named by the caller, such as a policy, failed before anything was recorded: it raised, ended its process or
    did not end in time.
    """


AbortCause = Literal[
    "",
    "service",
    "episode-process",
    "episode-server",
    "fork-server",
    "trace",
    "world-process",
    "camera-process",
    "call-record",
    "memory",
]
"""The thing that was lost in an abort that a policy can cause, by its service or by processes and files on its machine.

`service`: the policy's own service. `episode-process`: the process of the episode. `episode-server`: the process that
it was forked from. `fork-server`: the process that starts others. `trace`: the episode's file. `world-process`,
`camera-process`: the process of the engines or of the camera. `call-record`: the file of the model calls. `memory`: the
memory, or a descriptor, for the pictures of the policies. "": anything else, such as an error of an engine.
"""


class InfrastructureError(LingjingError):
    """An engine or a worker process failed. The episode is an infrastructure abort, never a failure of a model.

    >>> lingjing.InfrastructureError("the engine `sea` ended", engine="sea").exit_code.name
    'INFRASTRUCTURE'
    """

    exit_code = ExitCode.INFRASTRUCTURE

    def __init__(
        self,
        message: str,
        *,
        hint: str = "",
        faults: tuple[Fault, ...] = (),
        cause: AbortCause = "",
        engine: str = "",
    ) -> None:
        super().__init__(message, hint=hint, faults=faults)
        self.cause: AbortCause = cause
        self.engine = engine
        """The engine that failed, which the message names; "" if none did."""


def error_of(code: int, message: str, hint: str = "", cause: AbortCause = "") -> LingjingError:
    """Return the error with which another process of ours ended, by its exit code; an unknown code is a bug of ours.

    `cause` is that of an `InfrastructureError`.
    """
    if code == ExitCode.INFRASTRUCTURE:
        return InfrastructureError(message, hint=hint, cause=cause)
    kinds: dict[int, type[LingjingError]] = {kind.exit_code: kind for kind in (UsageError, MissionError)}
    return kinds.get(code, LingjingError)(message, hint=hint)


def hint_of(error: BaseException) -> str:
    """Return the hint of an error, or else of the nearest error behind it with one; "" if none has one."""
    behind: BaseException | None = error
    seen: set[int] = set()  # causes may form a circle
    while behind is not None and id(behind) not in seen:
        seen.add(id(behind))
        if hint := behind.hint if isinstance(behind, LingjingError) else hint_of_system(behind):
            return hint
        behind = behind.__cause__ or behind.__context__
    return ""


class ErrorCollector:
    """Collects the errors of one call while the rest is still read, so that they are reported together."""

    def __init__(self) -> None:
        self.errors: list[LingjingError] = []

    def attempt(self, read: Callable[[], ReadT], otherwise: OtherwiseT) -> ReadT | OtherwiseT:
        """Return the result of `read`, or `otherwise` if it raises `UsageError` or `MissionError`, which is
        collected.
        """
        try:
            return read()
        except (UsageError, MissionError) as error:
            self.add(error)
            return otherwise

    def add(self, error: LingjingError) -> None:
        """Collect an error."""
        self.errors.append(error)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults of all errors."""
        return tuple(fault for error in self.errors for fault in error.faults)

    def check(self) -> None:
        """Raise the collected errors, if any: a single one unchanged, several as one `UsageError` with a line each.

        It is a `ForeignCodeError` if all of them are.
        """
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            hints = [hint for error in self.errors if "\n" in str(error) and (hint := hint_of(error))]
            lines = dict.fromkeys(_with_hint(error) for error in self.errors)
            is_foreign = all(isinstance(error, ForeignCodeError) for error in self.errors)
            kind = ForeignCodeError if is_foreign else UsageError
            raise kind("\n".join(lines), hint="; ".join(dict.fromkeys(hints)), faults=self.faults)


def _with_hint(error: LingjingError) -> str:
    """Return an error's message with its hint, if the message is one line."""
    hint = hint_of(error)
    return f"{error}; {hint}" if hint and "\n" not in str(error) else str(error)
