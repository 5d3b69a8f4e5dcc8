"""Requests in progress: admission, progress and the end of long commands, with their receipts.

An engine admits a command with `admit` or `answer` (the receipt of `submit`). It reports the rest with `run`,
`complete` and `fail`. Their receipts wait here until `drain` hands them to the boundary. A resource has one pending
request; only `stop` replaces it, and the replaced request ends as `rejected: preempted`.
"""

from __future__ import annotations

from collections.abc import Callable

from lingjing.mission.kinds import least_value
from lingjing.mission.kinds_format import EngineKind
from lingjing.mission.values import is_finite
from lingjing.mission.vocabulary import STOP
from lingjing.trace.records import Command, Receipt


class Refusal(Exception):  # noqa: N818 - a refusal is an answer and not an error
    """Raised while a command is examined, with a stable reason code and a sentence for readers."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(detail)
        self.reason = reason
        self.detail = detail


def number(command: Command, name: str) -> float:
    """Return a finite numeric argument. Raises `Refusal(bad_argument)`."""
    value = optional_number(command, name)
    if value is None:
        raise Refusal("bad_argument", f"`{command.verb}` needs `{name}`")
    return value


def optional_number(command: Command, name: str) -> float | None:
    """Return a finite numeric argument, or None if it is absent. Raises `Refusal(bad_argument)`."""
    value = command.arguments.get(name)
    if value is None:
        return None
    if not is_finite(value):
        raise Refusal("bad_argument", f"`{name}` of `{command.verb}` must be a finite number, not {value!r}")
    return float(value)


def number_at_least(command: Command, name: str, kind: EngineKind) -> float:
    """Return a finite numeric argument that is at least the `least` of its verb in the engine's kind.

    Raises `Refusal(bad_argument)`.
    """
    value, least = number(command, name), least_value(kind, command.verb, name)
    if value < least:
        raise Refusal("bad_argument", f"`{name}` of `{command.verb}` must be at least {least:g}, not {value:g}")
    return value


class Requests:
    """The pending requests of one engine, by resource, and the receipts that are not handed over yet."""

    def __init__(self, engine: str) -> None:
        self._engine = engine
        self._pending: dict[str, Command] = {}
        self._reported: dict[str, float] = {}
        self._outbox: list[Receipt] = []

    def pending(self, resource: str) -> Command | None:
        """Return the pending request of a resource; None without one."""
        return self._pending.get(resource)

    def admit(self, command: Command, time_s: float, examine: Callable[[Command], None]) -> Receipt:
        """Examine a command and open it: `examine` starts it or raises `Refusal`. Returns its admission receipt."""
        try:
            self._check_busy(command)
            examine(command)
        except Refusal as refusal:
            return command.receipt(self._engine, "rejected", time_s, refusal.reason, refusal.detail)
        if command.resource in self._pending:
            self.fail(command.resource, time_s, "preempted", f"`{command.verb}` {command.id} took over")
        self._pending[command.resource] = command
        return command.receipt(self._engine, "accepted", time_s)

    def answer(self, command: Command, time_s: float, examine: Callable[[Command], None]) -> Receipt:
        """Examine a command that is completed at once, beside a pending request. Returns its admission receipt."""
        try:
            examine(command)
        except Refusal as refusal:
            return command.receipt(self._engine, "rejected", time_s, refusal.reason, refusal.detail)
        self._outbox.append(command.receipt(self._engine, "completed", time_s, progress=1.0))
        return command.receipt(self._engine, "accepted", time_s)

    def run(self, resource: str, time_s: float, progress: float) -> None:
        """Report progress (0..1, never falling) of the pending request, if there is one."""
        command = self._pending.get(resource)
        if command is None:
            return
        reached = max(min(progress, 1.0), self._reported.get(resource, 0.0))
        self._reported[resource] = reached
        self._outbox.append(command.receipt(self._engine, "running", time_s, progress=reached))

    def complete(self, resource: str, time_s: float) -> None:
        """Complete the pending request."""
        command = self._close(resource)
        if command is not None:
            self._outbox.append(command.receipt(self._engine, "completed", time_s, progress=1.0))

    def fail(self, resource: str, time_s: float, reason: str, detail: str) -> None:
        """End the pending request as rejected."""
        command = self._close(resource)
        if command is not None:
            self._outbox.append(command.receipt(self._engine, "rejected", time_s, reason, detail))

    def drain(self) -> tuple[Receipt, ...]:
        """Hand over the receipts since the last call, in the order they arose."""
        receipts = tuple(self._outbox)
        self._outbox.clear()
        return receipts

    def _check_busy(self, command: Command) -> None:
        held = self._pending.get(command.resource)
        if held is not None and command.verb != STOP:
            raise Refusal("busy", f"`{command.resource}` is still busy with `{held.verb}` {held.id}; `stop` ends it")

    def _close(self, resource: str) -> Command | None:
        self._reported.pop(resource, None)
        return self._pending.pop(resource, None)


__all__ = ["STOP", "Refusal", "Requests", "number", "number_at_least", "optional_number"]
