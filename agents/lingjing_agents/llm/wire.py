"""One HTTP exchange with a service that is not trusted: at most `ANSWER_BYTES` are read, however they are packed.

Every wait is asynchronous, so a caller's deadline ends whatever a service does: dripping bytes, headers without an
end, redirects (which are not followed: a key goes where it was sent). Connections belong to one exchange, because each
policy call has an event loop of its own.
"""

from __future__ import annotations

import datetime as dt
import re
import ssl
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from functools import cache

import httpx
import msgspec

ANSWER_BYTES = 4 * 1024 * 1024
"""Of an answer, unpacked: half a million tokens of text with their reasoning."""

REFUSAL_BYTES = 64 * 1024
"""Of an answer whose status is no success: its beginning says why."""

_CHUNK = 64 * 1024
_GZIP = 16 + zlib.MAX_WBITS
_SECONDS = re.compile(r"[0-9]+(\.[0-9]+)?", re.ASCII)
_HOP_HEADERS = ("content-encoding", "content-length", "transfer-encoding", "connection")


class UnreadableAnswerError(Exception):
    """An answer is longer than `ANSWER_BYTES`, or packed in a way that was not asked for or is broken."""


@dataclass(frozen=True, slots=True)
class HttpAnswer:
    """A whole answer: `body` is unpacked."""

    status: int
    headers: httpx.Headers
    body: bytes

    @property
    def retry_after_s(self) -> float | None:
        """The seconds that the service asks to be left alone; None if it does not say so in a way that is known."""
        milliseconds = self.headers.get("retry-after-ms", "")
        if _SECONDS.fullmatch(milliseconds.strip()):
            return float(milliseconds) / 1000
        return pause_s(self.headers.get("retry-after"), self.headers.get("date"))


def pause_s(retry_after: str | None, answered: str | None = None) -> float | None:
    """A `Retry-After` value as seconds from now: a number of seconds or an HTTP date (RFC 9110, 10.2.3), which counts
    from the service's own clock if it tells the time (`answered`, its `Date`). One in the past is 0, so is a negative
    number; more digits than a float holds are infinite; None for what is neither."""
    text = (retry_after or "").strip()
    if _SECONDS.fullmatch(text):
        return float(text)
    if _SECONDS.fullmatch(text.removeprefix("-")):
        return 0.0
    until = _moment(text)
    if until is None:
        return None
    return max(0.0, (until - (_moment(answered or "") or dt.datetime.now(dt.UTC))).total_seconds())


def _moment(text: str) -> dt.datetime | None:
    """An HTTP date; None for anything else."""
    try:
        moment = parsedate_to_datetime(text)
    except (ValueError, TypeError, OverflowError, IndexError):
        return None
    return moment if moment.tzinfo else moment.replace(tzinfo=dt.UTC)


async def exchange(request: httpx.Request, timeout_s: float | None) -> HttpAnswer:
    """Send `request` and read the answer. `timeout_s` bounds each step; the whole is the caller's to bound.

    Raises `httpx.HTTPError`, `httpx.InvalidURL` or `UnreadableAnswerError`.
    """
    request.headers["accept-encoding"] = "identity"
    async with httpx.AsyncClient(timeout=timeout_s, verify=_certificates()) as client:
        request.extensions = {**request.extensions, "timeout": client.timeout.as_dict()}
        response = await client.send(request, stream=True)
        try:
            body = await _read(response)
        except zlib.error as error:
            raise UnreadableAnswerError(
                f"the service's answer is not the gzip that it is said to be: {error}"
            ) from error
        finally:
            await response.aclose()
    return HttpAnswer(response.status_code, response.headers, body)


@cache
def _certificates() -> ssl.SSLContext:
    """The authorities that are trusted, read once: that takes 24 ms of CPU, and any thread may use them."""
    return httpx.create_ssl_context()


class BoundedTransport(httpx.AsyncBaseTransport):
    """The same for whoever brings an httpx client of its own; it may be shared among event loops."""

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """One exchange; an answer that cannot be read is a `httpx.ReadError`."""
        whole = httpx.Request(request.method, request.url, headers=request.headers, content=await request.aread())
        timeout = request.extensions.get("timeout", {}).get("read")
        try:
            answer = await exchange(whole, timeout)
            _check_depth(answer.body)
        except UnreadableAnswerError as error:
            failure = httpx.ReadError(str(error), request=request)
        else:
            headers = [(name, value) for name, value in answer.headers.raw if name.lower().decode() not in _HOP_HEADERS]
            return httpx.Response(answer.status, headers=headers, content=answer.body, request=request)
        raise failure


def _check_depth(body: bytes) -> None:
    """Refuse JSON that is nested deeper than Python's stack: others take many seconds to say so."""
    try:
        msgspec.json.decode(body)
    except RecursionError as error:
        raise UnreadableAnswerError("the service's answer is nested too deeply") from error
    except (msgspec.DecodeError, UnicodeDecodeError):
        return  # whoever asked says what is wrong


async def _read(response: httpx.Response) -> bytes:
    """The body: whole if it is an answer, its beginning if it is a refusal."""
    refused = not response.is_success
    most = REFUSAL_BYTES if refused else ANSWER_BYTES
    unpack = _unpacker(response.headers.get("content-encoding", ""))
    body, packed_bytes = bytearray(), 0
    async for chunk in response.aiter_raw(_CHUNK):
        packed_bytes += len(chunk)
        body += unpack(chunk, most + 1 - len(body))  # one byte more than may be kept shows that there is more
        if max(len(body), packed_bytes) > most:
            if refused:
                break
            raise UnreadableAnswerError(f"the service's answer is longer than {most} bytes")
    return bytes(body[:most])


def _unpacker(encoding: str) -> Callable[[bytes, int], bytes]:
    """A function of a chunk and the most bytes to make of it."""
    packed = encoding.strip().lower()
    if packed in ("", "identity"):
        return lambda chunk, most: chunk[:most]
    if packed not in ("gzip", "x-gzip"):
        raise UnreadableAnswerError(f"the service's answer is packed as {packed[:40]}, which was not asked for")
    unpacker = zlib.decompressobj(_GZIP)
    return lambda chunk, most: b"" if unpacker.eof else unpacker.decompress(chunk, most)
