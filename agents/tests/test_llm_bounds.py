"""The answers of a hostile service are bounded in memory and in time, through both clients."""

import datetime as dt
import math
import resource
import threading
from collections.abc import Iterable, Iterator
from email.utils import format_datetime
from importlib.util import find_spec

import pytest
import zstandard
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries
from lingjing_agents.llm.through_litellm import LitellmClient
from lingjing_agents.llm.wire import ANSWER_BYTES, pause_s

from agents.tests.hostile_server import BLOCK, answered, completion, gzip_bomb, serve_raw
from agents.tests.test_llm_secrets import check_that_no_exception_or_log_holds_the_key
from lingjing.plugins.backbone import Backbone, ChatMessage, ChatRequest, ModelError

ROOM = 400_000
"""Kilobytes by which a client's process may grow; the bombs contain gigabytes."""

BOMB = gzip_bomb()
_PACKER = zstandard.ZstdCompressor().compressobj()
ZSTD_BOMB = b"".join(_PACKER.compress(b" " * 1_048_576) for _ in range(256)) + _PACKER.flush()
"""256 MB of spaces, packed piece by piece, so that the peak of memory, which these tests measure, stays low."""
LATER = "Fri, 31 Dec 2399 23:59:59 GMT"


def once(data: bytes):
    return lambda request: iter([data])


def endless(head: bytes, piece: bytes):
    def pieces(request: bytes) -> Iterator[bytes]:
        yield head
        while True:
            yield piece

    return pieces


def trickling(data: bytes):
    """Send a valid answer, one byte at a time: the whole takes many times the deadline."""

    def pieces(request: bytes) -> Iterator[bytes]:
        for byte in data:
            yield bytes([byte])
            threading.Event().wait(0.2)

    return pieces


def dripping(head: bytes, piece: bytes):
    """Send a piece at intervals; the test is about the wait."""

    def pieces(request: bytes) -> Iterator[bytes]:
        yield head
        while True:
            threading.Event().wait(0.2)
            yield piece

    return pieces


GOOD = completion("hi").split(b"\r\n\r\n", 1)[1]
CHUNK = b"%x\r\n%b\r\n" % (BLOCK, b" " * BLOCK)
CHUNKED = b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n"
ENDLESS_GZIP = CHUNKED.replace(b"\r\n\r\n", b"\r\ncontent-encoding: gzip\r\n\r\n")

TOO_LONG = {
    "a gzip bomb": once(BOMB),
    "an endless stream": endless(CHUNKED, CHUNK),
    "an endless answer to the end of the connection": endless(b"HTTP/1.1 200 OK\r\n\r\n", b" " * BLOCK),
    "brotli, which was not requested": once(answered("200 OK", b"\x0b" * 9, "content-encoding: br")),
    "a zstd bomb": once(answered("200 OK", ZSTD_BOMB, "content-encoding: zstd")),
    "gzip in gzip": once(answered("200 OK", BOMB[:BLOCK], "content-encoding: gzip, gzip")),
    "deflate, which was not requested": once(answered("200 OK", b"x", "content-encoding: deflate")),
    "a body that is not gzip": once(answered("200 OK", b"{}", "content-encoding: gzip")),
    "an endless header": endless(b"HTTP/1.1 200 OK\r\n", b"x: " + b"y" * 1000 + b"\r\n"),
    "a header without an end": endless(b"HTTP/1.1 200 OK\r\nx: ", b"y" * BLOCK),
    "no HTTP": endless(b"", b"\0" * BLOCK),
    "a body that is too short": once(b"HTTP/1.1 200 OK\r\ncontent-length: 5000\r\n\r\n{}"),
    "a body that is too long": once(b"HTTP/1.1 200 OK\r\ncontent-length: 5\r\n\r\n" + b"{}" * 5000),
    "a negative length": once(b"HTTP/1.1 200 OK\r\ncontent-length: -1\r\n\r\n{}"),
    "two lengths": once(b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\ncontent-length: 3\r\n\r\n{}"),
    "deep JSON": once(answered("200 OK", b'{"choices":' + b"[" * 500_000)),
    "a deep completion": once(answered("200 OK", b'{"choices":[{"message":{"content":"x","y":' + b"[" * 500_000)),
    "a chunk that is longer than declared": once(CHUNKED + b"5\r\n" + GOOD + b"\r\n0\r\n\r\n"),
    "a chunk that is shorter than declared": once(CHUNKED + b"ffff\r\n" + GOOD + b"\r\n0\r\n\r\n"),
    "a chunk of more than 64 bits": once(CHUNKED + b"f" * 40 + b"\r\n" + GOOD),
    "a chunk of a negative size": once(CHUNKED + b"-5\r\n" + GOOD),
    "chunks without the last": once(CHUNKED + b"%x\r\n" % len(GOOD) + GOOD + b"\r\n"),
    "a chunk's size without an end": endless(CHUNKED, b"0" * BLOCK),
    "trailers without an end": endless(CHUNKED + b"0\r\n", b"x: " + b"y" * 1000 + b"\r\n"),
    "headers of 10 MB": once(b"HTTP/1.1 200 OK\r\n" + b"x: y\r\n" * 1_700_000 + b"\r\n" + GOOD),
    "two completions in one body": once(answered("200 OK", GOOD + GOOD)),
    "HTTP/1.0 that is cut off": once(b"HTTP/1.0 200 OK\r\n\r\n" + GOOD[:30]),
    "HTTP/1.0 that is shorter than declared": once(b"HTTP/1.0 200 OK\r\ncontent-length: 999\r\n\r\n" + GOOD),
    "another protocol": once(b"HTTP/1.1 101 Switching Protocols\r\nupgrade: h2c\r\n\r\n" + GOOD),
    "an event stream, which was not requested": once(answered("200 OK", b"data: " + GOOD + b"\n\ndata: [DONE]\n\n")),
    "half a character": once(answered("200 OK", b'{"choices":[{"message":{"content":"\xe4"}}]}')),
}

LATE = {
    "a dripping body": dripping(CHUNKED, b"1\r\n \r\n"),
    "a dripping header": dripping(b"HTTP/1.1 200 OK\r\n", b"x"),
    "interim answers": dripping(b"", b"HTTP/1.1 102 Processing\r\n\r\n"),
    "a flood of interim answers": endless(b"", b"HTTP/1.1 102 Processing\r\n\r\n" * 2000),
    "no answer": dripping(b"", b""),
    "a good answer, byte by byte": trickling(completion("hi")),
}


def direct(url: str) -> Backbone:
    return DirectClient(url, "a-key")


def through_litellm(url: str) -> Backbone:
    if find_spec("litellm") is None:
        pytest.skip("litellm is an optional extra")
    return LitellmClient(url, "a-key")


CLIENTS = [direct, pytest.param(through_litellm, marks=pytest.mark.slow)]
FEW = {"a gzip bomb", "an endless stream", "deep JSON", "a dripping body"}
"""The cases that run through litellm too; the other code is shared."""


def cases(names: Iterable[str]) -> list[object]:
    return [
        *(pytest.param(name, direct, id=name) for name in names),
        *(
            pytest.param(name, through_litellm, id=f"{name}, through litellm", marks=pytest.mark.thorough)
            for name in names
            if name in FEW
        ),
    ]


async def ask(client: Backbone, seconds: float, tries: int = 1):
    model = "openai/m" if isinstance(client, LitellmClient) else "m"
    request = ChatRequest(model, (ChatMessage("user", "hello"),))
    return await complete_with_retries(client, request, CallDeadline(seconds), Attempts(), tries=tries)


@pytest.mark.parametrize(("case", "client"), cases(TOO_LONG))
async def test_an_invalid_or_endless_answer_is_rejected_with_bounded_memory(case: str, client):
    with serve_raw(once(completion("hi"))) as url:
        assert (await ask(client(url), 600)).text == "hi"  # loads everything that is loaded only once
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with serve_raw(TOO_LONG[case]) as url, pytest.raises(ModelError) as failure:
        await ask(client(url), 600)
    assert failure.value.fault == "service" and len(str(failure.value).splitlines()) == 1
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM


@pytest.mark.parametrize(("case", "client"), cases(LATE))
async def test_the_deadline_ends_an_answer_that_never_ends(case: str, client):
    if client is not direct:  # its import takes seconds of the first deadline
        with serve_raw(once(completion("hi"))) as url:
            await ask(client(url), 600)
    with serve_raw(LATE[case]) as url, pytest.raises(ModelError) as failure:
        await ask(client(url), 1.0)
    assert failure.value.fault == "time"


@pytest.mark.parametrize("client", CLIENTS)
async def test_only_the_start_of_a_long_refusal_is_reported(client):
    refusal = endless(CHUNKED.replace(b"200 OK", b"402 Pay"), CHUNK.replace(b" ", b"$"))
    with serve_raw(refusal) as url, pytest.raises(ModelError, match=r"\$\$\$") as failure:
        await ask(client(url), 600)
    assert failure.value.status == 402


async def test_a_compressed_refusal_keeps_its_status():
    with serve_raw(once(gzip_bomb("401 No"))) as url, pytest.raises(ModelError) as failure:
        await ask(direct(url), 600)
    assert failure.value.status == 401


@pytest.mark.parametrize("client", CLIENTS)
async def test_redirects_are_not_followed_with_a_key(client):
    redirected = []

    def elsewhere(request: bytes) -> Iterator[bytes]:
        redirected.append(request)
        yield completion("stolen")

    with serve_raw(elsewhere) as other:
        away = once(answered("307 Temporary Redirect", b"", f"location: {other}/chat/completions"))
        with serve_raw(away) as url, pytest.raises(ModelError, match="307"):
            await ask(client(url), 600)
    assert not redirected


async def test_a_gzip_answer_that_was_not_requested_is_read():
    import gzip

    plain = completion("hi").split(b"\r\n\r\n", 1)[1]
    with serve_raw(once(answered("200 OK", gzip.compress(plain), "content-encoding: GZIP"))) as url:
        assert (await ask(direct(url), 600)).text == "hi"


@pytest.mark.parametrize(
    "answer",
    [
        pytest.param(b"HTTP/1.0 200 OK\r\n\r\n" + GOOD, id="HTTP/1.0 to the end of the connection"),
        pytest.param(CHUNKED + b"%x;x=y\r\n" % len(GOOD) + GOOD + b"\r\n0\r\nx: y\r\n\r\n", id="trailers"),
        pytest.param(completion("hi") + completion("no"), id="a second answer that was not requested"),
    ],
)
async def test_a_valid_answer_in_an_old_or_unusual_form_is_read(answer: bytes):
    with serve_raw(once(answer)) as url:
        assert (await ask(direct(url), 600)).text == "hi"


async def test_an_answer_up_to_the_bound_is_read():
    text = "x" * (ANSWER_BYTES - 1000)
    with serve_raw(once(completion(text))) as url:
        assert (await ask(direct(url), 600)).text == text


@pytest.mark.parametrize(
    ("header", "expected_s"),
    [
        ("2", 2.0), (" 1.5 ", 1.5), ("0", 0.0), ("-1", 0.0), ("-0.5", 0.0), ("9" * 400, math.inf), ("1" * 12, 1.1e11),
        ("²", None), ("٣", None), ("", None), (None, None), ("1e400", None), ("nan", None), ("1.2.3", None),
        ("inf", None), ("soon", None), ("2 s", None), ("--1", None), ("Fri, 31 Dec 1999 23:59:59 GMT", 0.0),
        ("Fri, 99 Dec 1999 23:59:59 GMT", None), ("Fri, 31 Dec 99999999999 23:59:59 GMT", None),
        ("Fri, 31 Dec 1999 23:59:59 +9999999999", None),
    ],
)  # fmt: skip
def test_retry_after_is_parsed_in_all_its_forms(header: str | None, expected_s: float | None):
    assert pause_s(header) == (expected_s if expected_s is None else pytest.approx(expected_s, rel=0.02))


@pytest.mark.parametrize(
    ("until", "now", "expected_s"),
    [
        ("Sun, 06 Nov 1994 08:50:07 GMT", "Sun, 06 Nov 1994 08:49:37 GMT", 30.0),
        ("Sunday, 06-Nov-94 08:50:07 GMT", "Sun, 06 Nov 1994 08:49:37 GMT", 30.0),
        ("Sun Nov  6 08:50:07 1994", "Sun, 06 Nov 1994 08:49:37 GMT", 30.0),
        ("Sun, 06 Nov 1994 08:49:37 GMT", "Sun, 06 Nov 1994 08:50:07 GMT", 0.0),
    ],
)
def test_a_retry_date_counts_from_the_clock_of_the_service(until: str, now: str, expected_s: float):
    assert pause_s(until, now) == expected_s


def test_a_retry_date_without_a_service_clock_counts_from_the_local_clock():
    until = dt.datetime.now(dt.UTC).replace(microsecond=0) + dt.timedelta(hours=1)
    waited_s = pause_s(format_datetime(until, usegmt=True), "yesterday")
    assert waited_s is not None
    assert (until - dt.datetime.now(dt.UTC)).total_seconds() <= waited_s <= 3600  # whatever it took to get here


@pytest.mark.parametrize("pause", ["99999999999", "9" * 400, LATER])
@pytest.mark.parametrize("client", CLIENTS)
async def test_a_requested_pause_beyond_the_deadline_fails_at_once(client, pause: str):
    busy = answered("429 Busy", b"come back later", f"retry-after: {pause}")
    with serve_raw(once(busy)) as url, pytest.raises(ModelError, match="come back later"):
        await ask(client(url), 600)


async def test_retry_after_in_milliseconds_takes_precedence():
    answers = iter([answered("429 Busy", b"{}", "retry-after: 3600", "retry-after-ms: 10"), completion("hi")])
    with serve_raw(lambda request: iter([next(answers)])) as url:
        assert (await ask(direct(url), 600, tries=2)).text == "hi"


@pytest.mark.parametrize("client", CLIENTS)
async def test_an_invalid_retry_after_is_ignored(client):
    answers = iter([answered("429 Busy", b"{}", "retry-after: \xb2"), completion("hi")])
    with serve_raw(lambda request: iter([next(answers)])) as url:
        assert (await ask(client(url), 600, tries=2)).text == "hi"


@pytest.mark.slow
async def test_exceptions_their_causes_and_logs_hold_no_key_through_litellm(monkeypatch, caplog, capfd):
    """This file has loaded litellm anyway; in another one it takes seconds of another process of the tests."""
    await check_that_no_exception_or_log_holds_the_key("litellm", monkeypatch, caplog, capfd)
