"""One HTTP exchange with an untrusted service: at most `ANSWER_BYTES` are read, in any compression.

Every wait is asynchronous, so a caller's deadline ends slow bytes and endless headers. Redirects are not followed: a
key goes only to its own address. Connections belong to one exchange, because each policy call has its own event loop.
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

from lingjing.decoding import from_json

ANSWER_BYTES = 4 * 1024 * 1024
"""Largest uncompressed answer. Chosen: half a million tokens of text with their reasoning."""

REFUSAL_BYTES = 64 * 1024
"""Bytes that are read of an answer without a success status: its beginning holds the reason."""

_CHUNK = 64 * 1024
"""Bytes per read. Chosen."""
_GZIP = 16 + zlib.MAX_WBITS
"""zlib's window size with a gzip header."""
_SECONDS = re.compile(r"[0-9]+(\.[0-9]+)?", re.ASCII)
_HOP_HEADERS = ("content-encoding", "content-length", "transfer-encoding", "connection")
"""Headers that describe the transfer, not the content."""


class UnreadableAnswerError(Exception):
    """An answer is longer than `ANSWER_BYTES`, or its compression was not requested or is broken."""


@dataclass(frozen=True, slots=True)
class HttpAnswer:
    """A complete answer."""

    status: int
    """The HTTP status."""
    headers: httpx.Headers
    """The headers."""
    body: bytes
    """The uncompressed body."""

    @property
    def retry_after_s(self) -> float | None:
        """The pause that the service requests, in seconds; None without a valid one."""
        milliseconds = self.headers.get("retry-after-ms", "")
        if _SECONDS.fullmatch(milliseconds.strip()):
            return float(milliseconds) / 1000
        return pause_s(self.headers.get("retry-after"), self.headers.get("date"))


def pause_s(retry_after: str | None, answered: str | None = None) -> float | None:
    """Return a `Retry-After` value as seconds from now.

    It is a number of seconds or an HTTP date (RFC 9110, 10.2.3). A date is relative to the service's own clock if
    `answered`, its `Date` header, is known. A past date or negative number gives 0, a number beyond floats infinity,
    any other text None.
    """
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
    """Return the time of an HTTP date; None for any other text."""
    try:
        moment = parsedate_to_datetime(text)
    except (ValueError, TypeError, OverflowError, IndexError):
        return None
    return moment if moment.tzinfo else moment.replace(tzinfo=dt.UTC)


async def exchange(request: httpx.Request, timeout_s: float | None) -> HttpAnswer:
    """Send `request` and read the answer. `timeout_s` bounds each step; the caller bounds the whole.

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
                f"the service's answer is declared as gzip and cannot be unpacked: {error}"
            ) from error
        finally:
            await response.aclose()
    return HttpAnswer(response.status_code, response.headers, body)


@cache
def _certificates() -> ssl.SSLContext:
    """Return the trusted authorities. They are read once, which takes 24 ms of CPU; any thread may use them."""
    return httpx.create_ssl_context()


class BoundedTransport(httpx.AsyncBaseTransport):
    """`exchange` as a transport for other httpx clients. Event loops may share it."""

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """Make one exchange. An unreadable answer raises `httpx.ReadError`."""
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
    """Reject JSON that is nested deeper than Python's stack. Other parsers take many seconds to do so."""
    try:
        from_json(body)
    except RecursionError as error:
        raise UnreadableAnswerError("the service's answer is nested too deeply") from error
    except (msgspec.DecodeError, UnicodeDecodeError):
        return  # the caller reports it


async def _read(response: httpx.Response) -> bytes:
    """Return the body of an answer, or the beginning of a refusal."""
    refused = not response.is_success
    most = REFUSAL_BYTES if refused else ANSWER_BYTES
    unpack = _unpacker(response.headers.get("content-encoding", ""))
    body, packed_bytes = bytearray(), 0
    async for chunk in response.aiter_raw(_CHUNK):
        packed_bytes += len(chunk)
        body += unpack(chunk, most + 1 - len(body))  # one byte above the limit shows that there is more
        if max(len(body), packed_bytes) > most:
            if refused:
                break
            raise UnreadableAnswerError(f"the service's answer is longer than {most} bytes")
    return bytes(body[:most])


def _unpacker(encoding: str) -> Callable[[bytes, int], bytes]:
    """Return a function that uncompresses a chunk to at most a number of bytes."""
    packed = encoding.strip().lower()
    if packed in ("", "identity"):
        return lambda chunk, most: chunk[:most]
    if packed not in ("gzip", "x-gzip"):
        raise UnreadableAnswerError(f"the service's answer has the encoding {packed[:40]}, which was not requested")
    unpacker = zlib.decompressobj(_GZIP)
    return lambda chunk, most: b"" if unpacker.eof else unpacker.decompress(chunk, most)
