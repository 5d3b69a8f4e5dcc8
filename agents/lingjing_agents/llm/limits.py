"""How many calls a service gets at a time and a minute, over all processes of this machine that a user runs.

Turns are kept in a folder of the user's own under the system's folder for temporary files: a lock for each call at a
time, which the system frees when its process ends however it ends, and one file with the moments at which the next
request and the next token are due. Requests are paced evenly: in no minute there is more than one too many.
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

from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.chat import ChatRequest, ModelClient, ModelCompletion, ModelError
from lingjing_agents.llm.models import ServiceEntry

_POLL_S = 0.05
_SPARE_S = 0.05
"""So much of a call's time is left when its wait is given up: that is told before the caller's own deadline passes."""

_BYTES_PER_TOKEN = 4
_BOOT = Path("/proc/sys/kernel/random/boot_id")


class _Due(msgspec.Struct):
    """Seconds of the machine's monotonic clock at which the next request, and the next tokens, may be sent; `boot` says
    from which start of the machine they count."""

    request: float = 0.0
    tokens: float = 0.0
    boot: str = ""


class LimitedClient:
    """A client that waits for its turn. `url` says which service it asks: who asks the same one shares its limits."""

    def __init__(self, client: ModelClient, service: ServiceEntry, url: str) -> None:
        self._client = client
        self._service = service
        self._url = url
        self._folder = _own_folder() / sha256(url.encode()).hexdigest()[:16]
        _make(self._folder)

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Wait for a turn and ask. Raises `ModelError`; the service's fault if no turn comes in time."""
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
                os.close(slot)  # and its lock with it

    def _paced(self, tokens: float, timeout_s: float) -> float:
        """The seconds until the request may be sent; its place is taken unless that is too late."""
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
        """Count the tokens that were taken beyond the estimate, or were not."""
        if self._service.tokens_per_minute is not None:
            with self._moments() as due:
                due.tokens += 60.0 * tokens / self._service.tokens_per_minute

    async def _slot(self) -> int | None:
        """A locked file, once one is free; None if calls at a time are not limited."""
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
            with contextlib.suppress(msgspec.DecodeError):  # a new file, or half of one
                due = msgspec.json.decode(os.pread(file, 4096, 0), type=_Due)
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
        said = ", ".join(f"{most:g} {what}" for what, most in limits.items() if most is not None)
        return ModelError(f"no turn at {self._url} within {timeout_s:.1f} s: it is limited to {said}")


def _estimated(request: ChatRequest) -> float:
    """About how many tokens a request and its answer take; pictures count when the answer has been counted."""
    return sum(len(message.text.encode()) for message in request.messages) / _BYTES_PER_TOKEN


def _own_folder() -> Path:
    """A folder that this user alone can write. Raises `UsageError` if it cannot be made, or somebody else has made
    it."""
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"lingjing-turns-{os.getuid()}"
    _make(folder)
    found = folder.lstat()
    if found.st_uid != os.getuid() or found.st_mode & 0o077 or folder.is_symlink():
        raise UsageError(f"`{folder}` is not a folder of this user alone", hint="remove it, or set XDG_RUNTIME_DIR")
    return folder


def _make(folder: Path) -> None:
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        hint = "set XDG_RUNTIME_DIR, or TMPDIR, to a folder of yours"
        raise UsageError(f"cannot make `{folder}` for the limits of calls: {error.strerror}", hint=hint) from error


def limited(client: ModelClient, service: ServiceEntry, url: str) -> ModelClient:
    """The client with the limits of its service, or itself if there are none."""
    limits = (service.concurrency, service.requests_per_minute, service.tokens_per_minute)
    return LimitedClient(client, service, url) if any(limit is not None for limit in limits) else client
