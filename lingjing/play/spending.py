"""Money and tokens that a run may spend on chat models, counted over all its episodes and processes.

Before a question is asked the most that it can cost is set aside; what is left must cover it. So the limits hold
whatever a service answers, but for attempts of which nobody knows whether they were billed: these count in full. With a
ledger the count is in a file: a small JSON document under a lock, which outlives the processes, so that a run that is
taken up again goes on counting.
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

from lingjing.errors import InfrastructureError, UsageError
from lingjing.plugins.calls import SpendingLimitError
from lingjing.trace.calls import CallRequest, CallResult


class Amount(msgspec.Struct):
    """US dollars and tokens."""

    usd: float = 0.0
    tokens: int = 0

    def add(self, other: Amount, sign: int = 1) -> None:
        """Count the other one in, or out."""
        self.usd += sign * other.usd
        self.tokens += sign * other.tokens


class SpendingAccount(msgspec.Struct):
    """What is spent, and what is set aside for the questions that each process is asking now."""

    spent: Amount = msgspec.field(default_factory=Amount)
    held: dict[str, Amount] = {}


class SpendingLimits:
    """`max_cost` is in US dollars; None is no limit. `ledger` is the file, new or old; without one this process counts
    alone. Any thread may call it."""

    def __init__(self, max_cost: float | None, max_tokens: int | None, ledger: Path | None = None) -> None:
        self._most = (max_cost, max_tokens)
        self._ledger = ledger
        self._account = SpendingAccount()
        self._lock = threading.Lock()

    @property
    def money_is_capped(self) -> bool:
        """Whether every call must have a price."""
        return self._most[0] is not None

    @property
    def counts(self) -> bool:
        """Whether anything is limited or written down."""
        return self._ledger is not None or self._most != (None, None)

    def reserve(self, request: CallRequest) -> None:
        """Set aside what the question can cost. Raises `SpendingLimitError` if that is more than is left."""
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
                    f"aside, and one may cost ${bound.usd:.4f}",
                    hint="raise --max-cost, or shorten what the model is sent",
                )
            if max_tokens is not None and used.tokens + bound.tokens > max_tokens:
                raise SpendingLimitError(
                    f"tokens: the limit of {max_tokens} does not cover another call: {used.tokens} are spent or set "
                    f"aside, and one may take {bound.tokens}",
                    hint="raise --max-tokens, or shorten what the model is sent",
                )
            account.held.setdefault(_process(os.getpid()), Amount()).add(bound)

    def settle(self, request: CallRequest, result: CallResult) -> None:
        """Count what the question has cost in place of what was set aside for it."""
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
        """What is spent so far, by all processes that share the ledger."""
        with self._counting() as account:
            return account.spent

    @contextmanager
    def _counting(self) -> Iterator[SpendingAccount]:
        """The account, for one change of it."""
        with self._lock:
            if self._ledger is None:
                yield self._account
                return
            with _locked(self._ledger) as file:
                account = _read(file, self._ledger)
                for process in [name for name in account.held if not _is_alive(name)]:
                    account.spent.add(account.held.pop(process))  # it may have been billed for what it asked
                yield account
                _write(file, msgspec.json.encode(account), self._ledger)


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
        return msgspec.json.decode(data, type=SpendingAccount) if data else SpendingAccount()
    except msgspec.DecodeError as error:
        raise UsageError(f"`{path}` is no ledger: {error}", hint="name another file; a new one is made") from error


def _write(file: int, data: bytes, path: Path) -> None:
    """In place and with the lengths filled up by spaces, so that no moment leaves a shorter document behind."""
    try:
        os.pwrite(file, data.ljust(os.fstat(file).st_size), 0)
    except OSError as error:
        raise InfrastructureError(f"cannot write the ledger `{path}`: {error.strerror}") from error


@cache
def _process(pid: int) -> str:
    return f"{os.uname().nodename}:{pid}:{_started(pid)}"


def _is_alive(process: str) -> bool:
    """Whether that process still runs; one of another machine is taken to."""
    node, pid, started = process.rsplit(":", 2)
    return node != os.uname().nodename or (pid.isdigit() and _started(int(pid)) == started)


def _started(pid: int) -> str:
    """When a process was started, in clock ticks since the machine was: with its number it is one of a kind."""
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]
    return ""


__all__ = ["Amount", "SpendingAccount", "SpendingLimits"]
