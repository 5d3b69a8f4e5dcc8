"""The error names the cause of a service's failure, also if the deadline passes before the attempts are used up."""

import asyncio
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import ClassVar

import msgspec
import pytest
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries
from lingjing_agents.react.policy import ReactError

from agents.tests.agent_kit import Inbox, brief, observe, react
from agents.tests.hostile_server import answered
from lingjing.plugins.backbone import ChatMessage, ChatRequest, ModelError
from lingjing.plugins.calls import CallResult
from lingjing.testing import PluginHost, build_policy

RESET, PLAIN, GZIP, CUT = (
    "Connection reset by peer",
    r"\[SSL: \w+\]",
    "is declared as gzip",
    "peer closed",
)

BYTES = {
    PLAIN: b"SSH-2.0-OpenSSH\r\n" * 10,
    GZIP: answered("200 OK", b"nonsense", "content-encoding: gzip"),
    CUT: b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\nabc",
}


@contextmanager
def failing(cause: str, times: int, held: list[socket.socket] | None = None) -> Iterator[str]:
    """Yield the URL of a service that fails its first `times` connections and answers nothing afterwards.

    `held` collects all connections in the order of their arrival.
    """
    listener, held = socket.create_server(("127.0.0.1", 0)), [] if held is None else held

    def serve() -> None:
        with suppress(OSError):
            for number in range(10_000):
                connection, _ = listener.accept()
                held.append(connection)
                if number < times:
                    with suppress(OSError):
                        connection.recv(65536)
                        if cause == RESET:
                            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                        else:  # read to the end, because unread bytes at the close would reset the connection
                            connection.sendall(BYTES[cause])
                            connection.shutdown(socket.SHUT_WR)
                            while connection.recv(65536):
                                pass
                    connection.close()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"{'https' if cause == PLAIN else 'http'}://127.0.0.1:{listener.getsockname()[1]}/v1"
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        for connection in held:
            connection.close()


class EndingDeadline(CallDeadline):
    """A deadline that is distant at first, and near after the first failed call, independent of the machine's speed."""

    made: ClassVar[list[float]] = []

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self.made.append(seconds)
        self._left = iter((600.0, 600.0, 0.3))

    def left_s(self) -> float:
        return next(self._left, 0.0)


async def asked(url: str, deadline: CallDeadline, attempts: Attempts, tries: int = 2) -> None:
    request = ChatRequest(model="m", messages=(ChatMessage("user", "hello"),))
    await complete_with_retries(DirectClient(url), request, deadline, attempts, tries=tries)


@pytest.mark.parametrize("cause", [RESET, PLAIN, GZIP, CUT])
async def test_a_failure_names_its_cause(cause: str):
    with failing(cause, 2) as url, pytest.raises(ModelError, match=cause):
        await asked(url, CallDeadline(600.0), Attempts())


@pytest.mark.parametrize("cause", [RESET, PLAIN, GZIP, CUT])
async def test_an_earlier_deadline_does_not_hide_the_cause(cause: str):
    attempts = Attempts()
    with failing(cause, 1) as url, pytest.raises(ModelError, match=f"within .* s; before that: .*{cause}") as failure:
        await asked(url, EndingDeadline(5.0), attempts, tries=5)
    assert failure.value.fault == "time"
    assert attempts.calls == 2


async def test_a_refused_connection_is_named():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        with pytest.raises(ModelError, match="Connection refused"):
            await asked(f"http://127.0.0.1:{listener.getsockname()[1]}/v1", CallDeadline(600.0), Attempts())


async def test_a_policy_gives_up_before_the_kernel_and_reports_the_cause(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("lingjing_agents.react.policy.CallDeadline", EndingDeadline)
    EndingDeadline.made.clear()
    with failing(RESET, 1) as url:
        policy = react(model="m", base_url=url, deadline="600", tries="5")
        await policy.reset(msgspec.structs.replace(brief("scout[1]"), decision_s=10.0))
        with pytest.raises(ReactError, match=r"before that: .*Connection reset by peer"):
            await policy.act(observe("scout[1]", 0), Inbox())
    assert EndingDeadline.made == [9.0]


async def test_a_cancelled_policy_records_the_cause():
    recorded: list[str] = []
    held: list[socket.socket] = []

    class Calls:
        replaying = capped = False
        broker = None

        def begin(self, request: object) -> None: ...

        def end(self, request: object, result: CallResult) -> None:
            recorded.append(result.failure)

    with failing(RESET, 1, held) as url:
        options = {"model": "m", "base_url": url, "deadline": "600", "tries": "5"}
        policy = build_policy(PluginHost().policy("react"), options, Calls())
        await policy.reset(brief("scout[1]"))
        act = asyncio.ensure_future(policy.act(observe("scout[1]", 0), Inbox()))
        while len(held) < 2:
            await asyncio.sleep(0.01)
        act.cancel()
        with pytest.raises(asyncio.CancelledError):
            await act
    assert len(recorded) == 1
    assert recorded[0].startswith("the policy was given up while it waited; before that: ")
    assert RESET in recorded[0]
