"""A mission as a task of Inspect AI: `inspect eval lingjing/mission -T mission=ssr --model openai/gpt-5.4`.

Concepts. A *sample* is one episode: a mission, a mode, a tier and a seed. `react` plays all agents of the mission. Each
request that it would send to a chat service goes to a *respondent*, which is an agent of Inspect, and the text of the
agent's answer returns as that of the service. So prompts, pictures, checks and limits are those of `lingjing run
--policy react`, and the transcript of a sample has every run of the respondent. The score is the engine's: 1 for a won
episode.

The respondent is one call of the evaluated model, or any agent: `mission(mission="ssr", respondent=my_agent())` in
Python, or the name of an installed one, `-T respondent=package/name`. It is run anew for each request, with the
messages of the request as its input. An episode that the infrastructure aborts is an error of its sample and has no
score.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import msgspec
from inspect_ai import Task, task
from inspect_ai.agent import Agent, AgentState, agent, run
from inspect_ai.dataset import Sample
from inspect_ai.model import (
    ChatMessage,
    ChatMessageAssistant,
    ChatMessageSystem,
    ChatMessageUser,
    ContentImage,
    ContentText,
    ModelOutput,
    get_model,
)
from inspect_ai.scorer import Score, Scorer, Target, mean, scorer, stderr
from inspect_ai.solver import Generate, Solver, TaskState, solver
from inspect_ai.util import registry_create

from lingjing.bench.suite import seeds_of
from lingjing.dsl.loading.load import load_mission
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instantiate import choose_mode
from lingjing.mission.languages import ORIGINAL, in_language
from lingjing.mission.tiers import USUAL, settings_of_tier, tiers_of
from lingjing.play.asynchronous import arun
from lingjing.play.report import ABORTED, EpisodeReport

_NAMESPACE = "" if "site-packages" in Path(__file__).parts else "lingjing/"
"""The beginning of registered names. Inspect adds `lingjing/` itself to those of an installed package, and not to those
of a working copy, because the distribution has another name than the package."""
_REPORT = "lingjing_report"
"""The key of an episode's report in the store of its sample."""
_LOOK_S = 0.2
"""Seconds between two looks of a waiting request at the end of its sample (chosen)."""
_LARGEST_REQUEST = 256_000_000
"""The largest request, bytes (chosen): 16 pictures of 1080p are 20 MB."""


@task(name=f"{_NAMESPACE}mission")
def mission(
    mission: str = "ssr",
    mode: str | None = None,
    seeds: str = "0-4",
    tier: int | None = None,
    language: str = ORIGINAL,
    respondent: Agent | str | None = None,
    **options: Any,
) -> Task:
    """A mission as a task, with one sample for each seed.

    `mission`: the name of a shipped mission or a file. `seeds`: `20` for 0 to 19, or `3-7`. `tier`: 1 by default, where
    the mission declares it. `language`: `zh`, for example. `options`: those of `episode`. Raises `UsageError` and
    `MissionError` for wrong ones.
    """
    loaded = load_mission(mission)
    chosen = choose_mode(loaded, mode)
    played = (USUAL if USUAL in tiers_of(loaded) else 0) if tier is None else tier
    settings_of_tier(loaded, played, chosen)  # refuses a tier that the mission does not declare
    in_language(loaded, language)  # refuses a language that it lacks
    spoken = "" if language == ORIGINAL else f"-{language}"
    samples = [
        Sample(
            id=f"{loaded.name}-{chosen}-{played}{spoken}-{seed}",
            input=loaded.title,
            metadata={"mission": mission, "mode": chosen, "tier": played, "language": language, "seed": seed},
        )
        for seed in _seeds(seeds)
    ]
    return Task(dataset=samples, solver=episode(respondent, **options), scorer=adjudicated(), name=loaded.name)


@agent(name=f"{_NAMESPACE}one_call")
def one_call() -> Agent:
    """A respondent that calls the evaluated model once."""

    async def execute(state: AgentState) -> AgentState:
        state.output = await get_model().generate(state.messages)
        state.messages.append(state.output.message)
        return state

    return execute


@solver(name=f"{_NAMESPACE}episode")
def episode(respondent: Agent | str | None = None, out: str | None = None, **options: Any) -> Solver:
    """A solver that plays the episode of a sample.

    `respondent`: an agent of Inspect, or the name of a registered one; None for one call of the evaluated model. `out`:
    the folder of the runs (default: `runs/`). `options`: options of `react`.
    """
    answering: Agent = registry_create("agent", respondent) if isinstance(respondent, str) else respondent or one_call()

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        sample = state.metadata
        with _service() as (url, pending, closed):
            playing = asyncio.create_task(
                arun(
                    sample["mission"],
                    mode=sample["mode"],
                    tier=sample["tier"],
                    language=sample["language"],
                    seed=sample["seed"],
                    policy="react",
                    policy_args={"model": str(get_model()), "base_url": url, "client": "direct", **options},
                    out=Path(out) / str(state.sample_id) if out is not None else None,
                    overview=False,
                )
            )
            report = await _played(playing, pending, answering, closed)
        if report.reason == ABORTED:
            raise InfrastructureError(f"the episode was aborted: {report.detail}", hint=f"see {report.folder}")
        state.store.set(_REPORT, msgspec.to_builtins(report))
        words = f"{report.reason} after {report.ticks} ticks, score {report.score:.3f}"
        state.output = ModelOutput.from_content(str(get_model()), words)
        return state

    return solve


@scorer(metrics={"success": [mean(), stderr()], "score": [mean(), stderr()]})
def adjudicated() -> Scorer:
    """The engine's verdict on an episode: `success` is 1 if it was won, `score` is its score, 0 to 1."""

    async def score(state: TaskState, target: Target) -> Score:
        report = state.store.get(_REPORT)
        if report is None:
            raise UsageError("the sample has no episode", hint="play it with the solver lingjing/episode")
        value = {"success": float(report["success"]), "score": float(report["score"])}
        return Score(value=value, answer=report["reason"], explanation=state.output.completion, metadata=report)

    return score


# -- private


def _seeds(text: str) -> tuple[int, ...]:
    try:
        return seeds_of(str(text))
    except ValueError as error:
        raise UsageError(f"`seeds` {error}", hint="-T seeds=0-4") from error


_Pending = asyncio.Queue[tuple[list[ChatMessage], "Future[ModelOutput]"]]


async def _played(
    playing: asyncio.Task[EpisodeReport], pending: _Pending, respondent: Agent, closed: threading.Event
) -> EpisodeReport:
    """Answer the requests of an episode until it ends. Answers run in the context of the sample, so that its transcript
    has them. A cancelled sample closes the service first: the episode ends at its next boundary, and would wait for
    answers until then."""
    answers: set[asyncio.Task[None]] = set()
    try:
        while not playing.done():
            waiting = asyncio.create_task(pending.get())
            await asyncio.wait({playing, waiting}, return_when=asyncio.FIRST_COMPLETED)
            if not waiting.done():
                waiting.cancel()
                continue
            answer = asyncio.create_task(_answer(respondent, *waiting.result()))
            answers.add(answer)
            answer.add_done_callback(answers.discard)
        return await playing
    finally:
        closed.set()
        for left in (playing, *answers):
            left.cancel()
        await asyncio.gather(playing, *answers, return_exceptions=True)


async def _answer(respondent: Agent, messages: list[ChatMessage], result: Future[ModelOutput]) -> None:
    try:
        ended = await run(respondent, messages)
        state = ended if isinstance(ended, AgentState) else ended[0]
        result.set_result(state.output)
    except asyncio.CancelledError:
        result.set_exception(RuntimeError("the sample has ended"))
        raise
    except Exception as error:  # noqa: BLE001 - a service of a respondent that fails answers with the failure
        result.set_exception(error)


@contextmanager
def _service() -> Iterator[tuple[str, _Pending, threading.Event]]:
    """A chat service on loopback: its address, the queue of its requests, and an event after which it refuses all of
    them. The address holds a secret, so that no other process of the machine asks."""
    pending: _Pending = asyncio.Queue()
    closed = threading.Event()
    loop = asyncio.get_running_loop()
    secret = secrets.token_urlsafe(16)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            length = self.headers.get("content-length", "")
            if self.path != f"/{secret}/v1/chat/completions" or not length.isdigit():
                return self._send(404, {"error": {"message": "there is no such path"}})
            if int(length) > _LARGEST_REQUEST:
                return self._send(413, {"error": {"message": f"a request has at most {_LARGEST_REQUEST} bytes"}})
            request = json.loads(self.rfile.read(int(length)))
            result: Future[ModelOutput] = Future()
            if not closed.is_set():
                loop.call_soon_threadsafe(pending.put_nowait, (list(_messages(request["messages"])), result))
            try:
                while not result.done() and not closed.is_set():
                    wait((result,), timeout=_LOOK_S)
                if not result.done():  # a refusal that is not tried again
                    return self._send(400, {"error": {"message": "the sample has ended"}})
                return self._send(200, _completion(result.result()))
            except Exception as error:  # noqa: BLE001 - `react` receives any exception of the respondent
                return self._send(500, {"error": {"message": f"the respondent failed: {error}"[:2000]}})

        def _send(self, status: int, body: object) -> None:
            data = json.dumps(body).encode()
            try:
                self.send_response(status)
                self.send_header("content-type", "application/json")
                self.send_header("content-length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)
            except (BrokenPipeError, ConnectionResetError):
                self.close_connection = True

        def log_message(self, *args: object) -> None:
            """Print nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, name="lingjing-inspect", daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/{secret}/v1", pending, closed
    finally:
        closed.set()
        server.shutdown()
        server.server_close()


def _messages(messages: Sequence[dict[str, Any]]) -> Iterator[ChatMessage]:
    """The messages of a request in the OpenAI protocol as those of Inspect."""
    for message in messages:
        match message["role"]:
            case "system":
                yield ChatMessageSystem(content=_contents(message["content"]))
            case "assistant":
                yield ChatMessageAssistant(content=_contents(message["content"]))
            case _:
                yield ChatMessageUser(content=_contents(message["content"]))


def _contents(content: str | list[dict[str, Any]]) -> Any:
    if isinstance(content, str):
        return content
    return [
        ContentText(text=part["text"])
        if part["type"] == "text"
        else ContentImage(image=part["image_url"]["url"], detail=part["image_url"].get("detail", "auto"))
        for part in content
    ]


def _completion(output: ModelOutput) -> dict[str, Any]:
    """An answer in the OpenAI protocol."""
    usage = output.usage
    body: dict[str, Any] = {
        "id": "inspect",
        "object": "chat.completion",
        "created": 0,
        "model": output.model,
        "choices": [
            {
                "index": 0,
                "message": {"role": "assistant", "content": output.completion},
                "finish_reason": "length" if output.stop_reason in ("max_tokens", "model_length") else "stop",
            }
        ],
    }
    if usage is not None:
        body["usage"] = {
            "prompt_tokens": usage.input_tokens,
            "completion_tokens": usage.output_tokens,
            "total_tokens": usage.total_tokens,
        }
    return body
