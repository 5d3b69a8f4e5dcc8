"""Limits of calls to a service, at a time and per minute, across all processes of a user on this machine.

A folder of the user under the system's temporary folder holds the state: a lock file for each concurrent call, which
the system releases when its process ends, and one file with the times at which the next request and the next tokens are
due. Requests are spaced evenly, so that no minute has more than one request too many.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from hashlib import sha256
from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.backbone import Backbone, ChatRequest, ModelCompletion, ModelError
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.models import ServiceEntry

_POLL_S = 0.05
"""Seconds between two attempts to get a lock. Chosen."""
_SPARE_S = 0.05
"""Seconds that remain of a call's time when its wait is abandoned, so that the failure arrives before the caller's
deadline.
"""

_BYTES_PER_TOKEN = 4
"""Mean bytes per token of an English text; an estimate until the answer is counted."""
_BOOT = Path("/proc/sys/kernel/random/boot_id")
"""Linux's identifier of the present boot, since the monotonic clock restarts with it."""


class _Due(msgspec.Struct):
    """The next free times on the machine's monotonic clock."""

    request: float = 0.0
    """Seconds at which the next request may be sent."""
    tokens: float = 0.0
    """Seconds at which the next tokens may be sent."""
    boot: str = ""
    """The boot to which these times belong."""


class LimitedClient:
    """A client that waits for its turn. Clients with the same `url` share the limits of its service."""

    def __init__(self, client: Backbone, service: ServiceEntry, url: str) -> None:
        self._client = client
        self._service = service
        self._url = url
        self._folder = _own_folder() / sha256(url.encode()).hexdigest()[:16]
        _make(self._folder)

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Wait for a turn and make the call. Raises `ModelError`, with fault `service` if no turn comes in time."""
        started = time.monotonic()
        estimate = _estimated(request)
        async with self._turn(estimate, timeout_s):
            answer = await self._client.complete(request, timeout_s - (time.monotonic() - started))
        self._correct(answer.prompt_tokens + answer.completion_tokens - estimate)
        return answer

    @asynccontextmanager
    async def _turn(self, tokens: float, timeout_s: float) -> AsyncIterator[None]:
        try:
            async with asyncio.timeout(max(0.0, timeout_s - _SPARE_S)):
                await asyncio.sleep(self._paced(tokens, timeout_s))
                slot = await self._slot()
        except TimeoutError:
            raise self._without_turn(timeout_s) from None
        try:
            yield
        finally:
            if slot is not None:
                os.close(slot)  # releases its lock

    def _paced(self, tokens: float, timeout_s: float) -> float:
        """Return the seconds until the request may be sent, and reserve its time. Raises `ModelError` if that is too
        late.
        """
        service, now = self._service, time.monotonic()
        if service.requests_per_minute is None and service.tokens_per_minute is None:
            return 0.0
        with self._moments() as due:
            start = max(now, due.request, due.tokens)
            if start - now > timeout_s - _SPARE_S:
                raise self._without_turn(timeout_s)
            if service.requests_per_minute is not None:
                due.request = start + 60.0 / service.requests_per_minute
            if service.tokens_per_minute is not None:
                due.tokens = start + 60.0 * tokens / service.tokens_per_minute
        return start - now

    def _correct(self, tokens: float) -> None:
        """Add the tokens of the answer beyond the estimate; `tokens` may be negative."""
        if self._service.tokens_per_minute is not None:
            with self._moments() as due:
                due.tokens += 60.0 * tokens / self._service.tokens_per_minute

    async def _slot(self) -> int | None:
        """Return a locked file as soon as one is free, or None without a limit on concurrent calls."""
        if self._service.concurrency is None:
            return None
        while True:
            for number in range(self._service.concurrency):
                file = os.open(self._folder / f"turn-{number}", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    os.close(file)
                else:
                    return file
            await asyncio.sleep(_POLL_S)

    @contextmanager
    def _moments(self) -> Iterator[_Due]:
        file = os.open(self._folder / "due", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
            due, boot = _Due(), _BOOT.read_text().strip()
            with contextlib.suppress(msgspec.DecodeError):  # the file is new or incomplete
                due = from_json(os.pread(file, 4096, 0), _Due)
            due = due if due.boot == boot else _Due(boot=boot)
            yield due
            os.pwrite(file, msgspec.json.encode(due).ljust(200), 0)
        finally:
            os.close(file)

    def _without_turn(self, timeout_s: float) -> ModelError:
        service = self._service
        limits = {
            "calls at a time": service.concurrency,
            "requests a minute": service.requests_per_minute,
            "tokens a minute": service.tokens_per_minute,
        }
        listed = ", ".join(f"{most:g} {unit}" for unit, most in limits.items() if most is not None)
        return ModelError(f"no turn at {self._url} within {timeout_s:.1f} s: it is limited to {listed}")


def _estimated(request: ChatRequest) -> float:
    """Return the estimated tokens of a request. Pictures and the answer are added when the answer has been counted."""
    texts = sum(len(message.text.encode()) for message in request.messages)
    return (texts or len(request.whole)) / _BYTES_PER_TOKEN


def _own_folder() -> Path:
    """Return a folder that only this user can write. Raises `UsageError` if it cannot be made or belongs to another
    user.
    """
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"lingjing-turns-{os.getuid()}"
    _make(folder)
    status = folder.lstat()
    if status.st_uid != os.getuid() or status.st_mode & 0o077 or folder.is_symlink():
        raise UsageError(f"`{folder}` is not private to this user", hint="remove it, or set XDG_RUNTIME_DIR")
    return folder


def _make(folder: Path) -> None:
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        hint = "set XDG_RUNTIME_DIR, or TMPDIR, to a folder of yours"
        raise UsageError(
            f"cannot create `{folder}`, which holds the limits of calls: {error.strerror}", hint=hint
        ) from error


def limited(client: Backbone, service: ServiceEntry, url: str) -> Backbone:
    """Return the client with the limits of its service, or the client itself without limits."""
    limits = (service.concurrency, service.requests_per_minute, service.tokens_per_minute)
    return LimitedClient(client, service, url) if any(limit is not None for limit in limits) else client
