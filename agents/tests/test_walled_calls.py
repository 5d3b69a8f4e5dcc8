"""Model calls of `react` behind walls: a broker makes them, with a real server on loopback."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from agents.tests.chat_server import Reply, serve
from agents.tests.test_recorded_calls import ARGUMENTS, KEY, LOOK, TEXT, decisions, looking
from lingjing import EpisodeReport, PlayOptions, Session
from lingjing import read as read_trace
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play.policy_processes.agent_process import PolicyProcess
from lingjing.play.policy_processes.messages import BeginModelCall, BrokerStart, EndModelCall, encoded
from lingjing.play.policy_processes.model_calls import ModelCallService
from lingjing.play.policy_processes.preloading import SERVES
from lingjing.play.policy_processes.servers import OpenServer, WalledServer, walls_of
from lingjing.plugins.calls import CallRequest, CallResult
from lingjing.plugins.loading import UNRECORDED
from lingjing.processes.fork_client import ForkServer
from lingjing.testing import recorded_calls

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="walls are made of Linux's own parts")


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TEST_KEY", KEY)


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "glance.ljs"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def walled() -> Iterator[WalledServer]:
    with (
        ForkServer(SERVES, walls=True) as server,
        ForkServer(SERVES) as other,
        closing(server.client()) as client,
        closing(other.client()) as brokers,
    ):
        options = PlayOptions(mission="", policy="react", isolate="yes")
        yield WalledServer(client, walls_of(options), None, lambda: brokers)


@pytest.fixture(scope="module")
def session(walled: WalledServer) -> Iterator[Session]:
    with Session(policy_server=walled) as made:
        yield made


def play(session: Session, mission: Path, out: Path, url: str, **changes: object) -> EpisodeReport:
    arguments = {**ARGUMENTS, "base_url": url}
    options = {"policy": "react", "policy_args": arguments, "overview": False, "isolate": "yes", "out": out, **changes}
    return session.run(mission, **options)


def test_calls_through_a_broker_equal_the_calls_of_the_policy_without_walls(
    session: Session, walled: WalledServer, mission: Path, tmp_path: Path
) -> None:
    """The same requests, decisions, record and digest with and without walls; and the record replays behind walls."""
    assert walled._open_client is not None
    with serve(looking()) as server, Session(policy_server=OpenServer(walled._open_client())) as plain:
        before = play(plain, mission, tmp_path / "plain", server.url, isolate="no")
        requests, server.requests[:] = list(server.requests), []
        server.script = looking()
        behind = play(session, mission, tmp_path / "walled", server.url)
        assert set(server.keys) == {f"Bearer {KEY}"}
        assert sorted(map(str, server.requests)) == sorted(map(str, requests)) != []
    assert decisions(behind) == decisions(before)
    assert behind.digest == before.digest
    kept, expected = recorded_calls(tmp_path / "walled"), recorded_calls(tmp_path / "plain")
    assert [(call.agent, call.tick, call.number, call.messages) for call in kept] == [
        (call.agent, call.tick, call.number, call.messages) for call in expected
    ]
    again = play(
        session, mission, tmp_path / "again", "http://127.0.0.1:1/v1", calls="replay", calls_from=tmp_path / "walled"
    )
    assert again.digest == behind.digest


def test_limits_hold_at_the_broker(session: Session, mission: Path, tmp_path: Path) -> None:
    with serve([Reply(LOOK)]) as server:
        report = play(session, mission, tmp_path / "out", server.url, max_tokens=1)
    assert report.reason == "infrastructure-abort"
    assert report.detail.startswith("tokens:")
    assert server.requests == []


def test_a_missing_key_is_reported_before_the_episode(
    session: Session, mission: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("TEST_KEY")
    with pytest.raises(UsageError, match="`TEST_KEY` is not set"):
        play(session, mission, tmp_path / "out", "http://127.0.0.1:1/v1")


def test_a_broker_that_dies_ends_the_episode_with_one_message(walled: WalledServer) -> None:
    start = BrokerStart(spec="react", arguments={**ARGUMENTS, "base_url": "http://127.0.0.1:1/v1"}, replaying=False,
                        capped=False)  # fmt: skip
    process = PolicyProcess("scout", walled, UNRECORDED, start)
    assert process._broker is not None
    os.kill(process._broker.pid, signal.SIGKILL)
    process._broker.wait(10.0)
    with pytest.raises(InfrastructureError, match=r"the broker of the model calls of `scout` has ended: .*SIGKILL"):
        process.receive()
    assert not process.is_alive


FOREIGN = '''
from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.calls import ModelQuestion
from lingjing.plugins.options import Field, PluginOptions
from lingjing.plugins.policy import Decision, Usage
from msgspec.structs import replace


class Options(PluginOptions):
    model: str
    base_url: str
    words: str = "hello"


class Asker:
    """A policy of a file that asks the model of its options."""

    options, calls = Options, True

    def __init__(self, options, calls):
        self.words, self.broker, self.calls_made = options.words, calls.broker, calls

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        question = ModelQuestion(observation.tick, (ChatMessage("user", self.words),), 20.0)
        return Decision(thought=(await self.broker.ask(question)).text)


class Denier(Asker):
    """Reports a usage that is too low."""

    async def act(self, observation, inbox):
        return replace(await super().act(observation, inbox), usage=Usage(calls=0, answers=2**40))


class Forger(Asker):
    """Writes what is no question to its broker."""

    async def act(self, observation, inbox):
        self.broker._channel.send(b"no question")
        return await super().act(observation, inbox)
'''


@pytest.mark.parametrize(("name", "thought"), [("Asker", "yes"), ("Denier", "yes"), ("Forger", "")])
def test_a_foreign_policy_calls_the_broker_and_an_invalid_question_is_a_policy_error(
    session: Session, mission: Path, tmp_path: Path, name: str, thought: str
) -> None:
    file = tmp_path / "foreign.py"
    file.write_text(FOREIGN)
    server_of_walls = session._policy_server
    assert isinstance(server_of_walls, WalledServer)
    options = PlayOptions(mission="", policy=f"{file}:{name}", isolate="yes")
    own = WalledServer(server_of_walls.client, walls_of(options), None, server_of_walls._open_client)
    with serve([Reply("yes")]) as server, Session(policy_server=own) as made:
        arguments = {"model": "m", "base_url": server.url, "words": "may I?"}
        report = play(made, mission, tmp_path / "out", server.url, policy=f"{file}:{name}", policy_args=arguments)
        trace = read_trace(report.trace)
    first = next(record for boundary in trace.boundaries for record in boundary.decisions)
    assert first.decision.thought == thought
    assert (first.substituted == "policy_error") == (name == "Forger"), first
    if name != "Forger":
        record, metrics = recorded_calls(tmp_path / "out"), report.metrics
        results = [call.result for call in record if call.result is not None]
        tokens = sum(result.prompt_tokens + result.completion_tokens for result in results)
        assert metrics is not None and (metrics.calls, metrics.tokens) == (len(record), tokens), "not what it reports"
        assert tokens > 0
        assert server.requests[0]["messages"] == [{"role": "user", "content": "may I?"}]
        assert msgspec.json.decode(recorded_calls(tmp_path / "out")[0].messages[0])["role"] == "user"


class _Calls:
    """A record that holds nothing and counts the requests."""

    replaying = False
    capped = False
    broker = None

    def __init__(self) -> None:
        self.requests = 0

    def begin(self, request: CallRequest) -> None:
        self.requests += 1

    def end(self, request: CallRequest, result: CallResult) -> None:
        self.requests += 1


_CALL = CallRequest(tick=3, number=0, head=b"{}", messages=())


@pytest.mark.parametrize(
    ("messages", "reason"),
    [
        ([BeginModelCall(request=replace(_CALL, tick=2**63 - 1))], "a model call at tick 9223372036854775807"),
        ([BeginModelCall(request=replace(_CALL, number=-5))], "with the number -5"),
        ([BeginModelCall(request=_CALL)] * 2, "model call 0 at tick 3 was begun before"),
        ([BeginModelCall(request=replace(_CALL, most_usd=-1.0))], "an impossible price"),
        ([EndModelCall(request=_CALL, result=CallResult(cost_usd=float("nan")))], "an impossible price"),
        ([EndModelCall(request=_CALL, result=CallResult(prompt_tokens=2**62))], "an impossible number of tokens"),
    ],
)
def test_an_impossible_or_repeated_model_call_is_an_invalid_message(messages: list[Any], reason: str) -> None:
    calls = _Calls()
    service = ModelCallService(calls)
    for message in messages[:-1]:
        service.answer(encoded(message))
    with pytest.raises(msgspec.ValidationError, match=reason):
        service.answer(encoded(messages[-1]))
    assert calls.requests == len(messages) - 1
