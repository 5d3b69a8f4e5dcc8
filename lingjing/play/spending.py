"""Limits of the money and the tokens that a run spends on chat models, over all its episodes and processes.

Before a request its highest possible cost is reserved; the rest of the limit must cover it. So the limits hold for
every answer of a service. An attempt that may or may not be billed counts in full. A ledger keeps the count in a file,
a small JSON document under a lock. It outlives the processes, so a resumed run continues the count.
"""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError, UsageError
from lingjing.plugins.calls import SpendingLimitError
from lingjing.trace.calls import CallRequest, CallResult


class Amount(msgspec.Struct):
    """US dollars and tokens."""

    usd: float = 0.0
    """US dollars."""
    tokens: int = 0
    """Tokens of requests and answers."""

    def add(self, other: Amount, sign: int = 1) -> None:
        """Add `sign` times the other amount."""
        self.usd += sign * other.usd
        self.tokens += sign * other.tokens


class SpendingAccount(msgspec.Struct):
    """The spent amount, and the amounts that processes have reserved."""

    spent: Amount = msgspec.field(default_factory=Amount)
    """The amount of all finished requests."""
    held: dict[str, Amount] = {}
    """The reserved amount of each process, by its name (`_process`)."""


class SpendingLimits:
    """The limits of one run, and the count against them. Any thread may call it.

    `max_cost` is in US dollars; None is no limit. `ledger` is a new or existing file; without one this process counts
    alone.
    """

    def __init__(self, max_cost: float | None, max_tokens: int | None, ledger: Path | None = None) -> None:
        self._most = (max_cost, max_tokens)
        self._ledger = ledger
        self._account = SpendingAccount()
        self._lock = threading.Lock()

    @property
    def money_is_capped(self) -> bool:
        """True if money is limited: every call then needs a price."""
        return self._most[0] is not None

    @property
    def counts(self) -> bool:
        """True if a limit or a ledger needs the count."""
        return self._ledger is not None or self._most != (None, None)

    def reserve(self, request: CallRequest) -> None:
        """Reserve the highest cost of a request. Raises `SpendingLimitError` if it exceeds the rest of a limit."""
        if not self.counts:
            return
        bound = Amount(request.most_usd or 0.0, request.most_tokens)
        max_cost, max_tokens = self._most
        with self._counting() as account:
            used = Amount(account.spent.usd, account.spent.tokens)
            for held in account.held.values():
                used.add(held)
            if max_cost is not None and used.usd + bound.usd > max_cost:
                raise SpendingLimitError(
                    f"money: the limit of ${max_cost:g} does not cover another call: ${used.usd:.4f} are spent or set "
                    f"aside, and another call may cost ${bound.usd:.4f}",
                    hint="raise --max-cost, or shorten what the model is sent",
                )
            if max_tokens is not None and used.tokens + bound.tokens > max_tokens:
                raise SpendingLimitError(
                    f"tokens: the limit of {max_tokens} does not cover another call: {used.tokens} are spent or set "
                    f"aside, and another call may take {bound.tokens}",
                    hint="raise --max-tokens, or shorten what the model is sent",
                )
            account.held.setdefault(_process(os.getpid()), Amount()).add(bound)

    def settle(self, request: CallRequest, result: CallResult) -> None:
        """Replace the reserved amount of a request by its real cost."""
        if not self.counts:
            return
        known = request.most_usd if result.cost_usd is None and not result.failure else result.cost_usd
        tokens = result.prompt_tokens + result.completion_tokens
        with self._counting() as account:
            process = _process(os.getpid())
            held = account.held.setdefault(process, Amount())
            held.add(Amount(request.most_usd or 0.0, request.most_tokens), -1)
            if held.tokens <= 0:
                del account.held[process]
            account.spent.add(Amount((known or 0.0) + result.unknown_usd, tokens))

    def spent(self) -> Amount:
        """Return the amount spent so far by all processes that share the ledger."""
        with self._counting() as account:
            return account.spent

    @contextmanager
    def _counting(self) -> Iterator[SpendingAccount]:
        """Yield the account for one change, under the lock."""
        with self._lock:
            if self._ledger is None:
                yield self._account
                return
            with _locked(self._ledger) as file:
                account = _read(file, self._ledger)
                for process in [name for name in account.held if not _is_alive(name)]:
                    account.spent.add(account.held.pop(process))  # its requests may have been billed
                yield account
                _write(file, msgspec.json.encode(account), self._ledger)


class CountedCalls:
    """`ModelCalls` outside of an episode: the cost is counted against limits, and nothing is recorded."""

    replaying = False
    broker = None

    def __init__(self, limits: SpendingLimits) -> None:
        self._limits = limits

    @property
    def capped(self) -> bool:
        """True if the cost is limited."""
        return self._limits.money_is_capped

    def begin(self, request: CallRequest) -> None:
        """Reserve the greatest cost of the request."""
        self._limits.reserve(request)

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Replace the reservation by the actual cost."""
        self._limits.settle(request, result)


@contextmanager
def _locked(path: Path) -> Iterator[int]:
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise InfrastructureError(f"cannot open the ledger `{path}`: {error.strerror}") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield file
    finally:
        os.close(file)  # and the lock with it


def _read(file: int, path: Path) -> SpendingAccount:
    data = os.pread(file, os.fstat(file).st_size, 0)
    try:
        return from_json(data, SpendingAccount) if data else SpendingAccount()
    except msgspec.DecodeError as error:
        raise UsageError(f"`{path}` is not a ledger: {error}", hint="name another or a new file") from error


def _write(file: int, data: bytes, path: Path) -> None:
    """Write the document in place, filled up with spaces to its old length.

    A reader then never finds the end of a longer old document behind a shorter new one.
    """
    try:
        os.pwrite(file, data.ljust(os.fstat(file).st_size), 0)
    except OSError as error:
        raise InfrastructureError(f"cannot write the ledger `{path}`: {error.strerror}") from error


@cache
def _process(pid: int) -> str:
    """Return the name of a process: its machine, its id and its start."""
    return f"{os.uname().nodename}:{pid}:{_started(pid)}"


def _is_alive(process: str) -> bool:
    """Return True if the process still runs. A process of another machine counts as alive."""
    node, pid, started = process.rsplit(":", 2)
    return node != os.uname().nodename or (pid.isdigit() and _started(int(pid)) == started)


def _started(pid: int) -> str:
    """Return the start of a process in clock ticks since boot; "" if it has ended. With the id it is unique."""
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]
    return ""


__all__ = ["Amount", "SpendingAccount", "SpendingLimits"]
