"""A service's limits apply across threads and processes, and never delay a call beyond its deadline."""

import asyncio
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from lingjing_agents.llm.asking import open_model
from lingjing_agents.llm.limits import LimitedClient, limited
from lingjing_agents.llm.models import ServiceEntry
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline

from agents.tests.chat_server import Reply, serve
from lingjing.plugins.backbone import ChatMessage, ChatRequest, ModelCompletion, ModelError
from lingjing.plugins.calls import UnrecordedCalls
from lingjing.plugins.options import read_options
from lingjing.plugins.policy import UsageError

REQUEST = ChatRequest("m", (ChatMessage("user", "x" * 400),))


@pytest.fixture(autouse=True)
def own_turns(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def service(**limits: float) -> ServiceEntry:
    return ServiceEntry.model_validate(limits)


class Counting:
    """A model that counts its concurrent calls and stores their times."""

    def __init__(self, tokens: int = 0, together: int = 0) -> None:
        """Create a client. If `together` is not 0, the first answers wait for this number of concurrent calls."""
        self.now = self.most = 0
        self.together = together
        self.times: list[float] = []
        self.tokens = tokens
        self.lock = threading.Lock()

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        with self.lock:
            self.now += 1
            self.most = max(self.most, self.now)
            self.times.append(time.monotonic())
        while self.most < self.together:
            await asyncio.sleep(0.02)
        await asyncio.sleep(0.02)
        with self.lock:
            self.now -= 1
        return ModelCompletion("ok", "stop", self.tokens, 0)


def test_a_folder_that_cannot_be_made_is_named(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "absent"))
    with pytest.raises(UsageError, match=r"cannot create .*absent/lingjing-turns"):
        limited(Counting(), service(concurrency=1), "http://localhost")


async def test_concurrent_calls_are_limited_across_clients_and_threads() -> None:
    model = Counting(together=3)

    def ask() -> None:
        async def several() -> None:
            await asyncio.gather(
                *(LimitedClient(model, service(concurrency=3), "u").complete(REQUEST, 3600) for _ in range(5))
            )

        asyncio.run(several())

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(model.times) == 20
    assert model.most == 3


async def test_requests_are_paced() -> None:
    """A turn never comes before its time. A delay of the first request delays the others too."""
    model, began = Counting(), time.monotonic()
    client = LimitedClient(model, service(requests_per_minute=1200), "u")
    await asyncio.gather(*(client.complete(REQUEST, 3600) for _ in range(10)))
    for number, at in enumerate(sorted(model.times)):
        assert at - began >= number * 0.05 - 1e-3


async def test_used_tokens_delay_the_next_calls() -> None:
    model, began = Counting(tokens=1000), time.monotonic()
    client = LimitedClient(model, service(tokens_per_minute=600_000), "u")
    for _ in range(4):
        await client.complete(REQUEST, 3600)
    for number, at in enumerate(model.times):
        assert at - began >= number * 0.1 - 1e-3


async def test_the_limit_of_a_service_does_not_delay_other_services() -> None:
    model = Counting()
    slow = service(requests_per_minute=0.001)
    await LimitedClient(model, slow, "a").complete(REQUEST, 60)
    await LimitedClient(model, slow, "b").complete(REQUEST, 60)
    with pytest.raises(ModelError, match=r"^no turn at a within 60.0 s: it is limited to 0.001 requests a minute"):
        await LimitedClient(model, slow, "a").complete(REQUEST, 60)
    assert len(model.times) == 2


HOLD = """
import asyncio, sys
from lingjing_agents.llm.limits import LimitedClient
from agents.tests.test_llm_limits import REQUEST, service
class Slow:
    async def complete(self, request, timeout_s):
        print("asked", flush=True)
        await asyncio.sleep(3600)
asyncio.run(LimitedClient(Slow(), service(concurrency=1), "u").complete(REQUEST, 3600))
"""


async def test_a_call_waits_for_the_turn_of_another_process_until_that_process_dies() -> None:
    model, root = Counting(), Path(__file__).parents[2]
    client = LimitedClient(model, service(concurrency=1), "u")
    with subprocess.Popen([sys.executable, "-c", HOLD], stdout=subprocess.PIPE, cwd=root) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"asked\n"
        with pytest.raises(ModelError, match="limited to 1 calls at a time") as caught:
            await client.complete(REQUEST, 0.3)
        assert caught.value.fault == "service"
        other.kill()
    assert (await client.complete(REQUEST, 3600)).text == "ok"


async def test_a_turn_is_released_after_a_failed_or_cancelled_call() -> None:
    class Failing:
        async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
            raise ModelError("no")

    for _ in range(3):
        with pytest.raises(ModelError, match="no"):
            await LimitedClient(Failing(), service(concurrency=1), "u").complete(REQUEST, 60)
    waiting = asyncio.create_task(LimitedClient(Counting(), service(concurrency=1), "u").complete(REQUEST, 60))
    await asyncio.sleep(0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert (await LimitedClient(Counting(), service(concurrency=1), "u").complete(REQUEST, 3600)).text == "ok"


async def test_a_call_fails_at_once_if_its_turn_comes_after_the_deadline(tmp_path) -> None:
    with serve([Reply()]) as server:
        own = tmp_path / "own.toml"
        own.write_text(
            f'[services.lab]\nbase_url = "{server.url}"\nrequests_per_minute = 0.001\n'
            '[models.ours]\nservice = "lab"\nserved = "ours"\n'
        )
        model = open_model(read_options(ModelOptions, {"model": "ours", "models": own}, "p"), UnrecordedCalls())
        await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(3600))
        deadline = CallDeadline(3600)
        with pytest.raises(ModelError, match="no turn"):
            await model.ask(1, (ChatMessage("user", "hi"),), deadline)
        assert deadline.left_s() > 0  # refused at once, not when the time was out
        assert len(server.requests) == 1


def test_a_folder_that_other_users_may_write_is_rejected(tmp_path) -> None:
    LimitedClient(Counting(), service(concurrency=1), "u")
    (folder,) = tmp_path.glob("lingjing-turns-*")
    folder.chmod(0o777)
    with pytest.raises(UsageError, match="is not private to this user"):
        LimitedClient(Counting(), service(concurrency=1), "u")


async def test_a_broken_file_of_due_times_or_a_reset_clock_delays_no_call(tmp_path) -> None:
    client = LimitedClient(Counting(), service(requests_per_minute=1000), "u")
    (due,) = [folder / "due" for folder in tmp_path.glob("lingjing-turns-*/*")]
    for text in ("", "{", '{"request": 1e300, "tokens": 1e300}', "[]"):
        due.write_text(text)
        assert (await client.complete(REQUEST, 600)).text == "ok"


def test_a_client_without_limits_is_not_wrapped() -> None:
    model = Counting()
    assert limited(model, service(), "u") is model
