"""The model calls of an episode as a log of Inspect AI, for `inspect view`.

A log has a sample for each agent. Its transcript holds the agent's calls as model events, in order, with their pictures
and what came of each answer. Its scores are those of the episode. `inspect_ai` is imported at the first log.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import UsageError
from lingjing.trace.call_store import CallReader
from lingjing.trace.calls import CallResult, RecordedCall
from lingjing.trace.reader import Trace
from lingjing.trace.records import DecisionRecord

if TYPE_CHECKING:
    from inspect_ai.event import InfoEvent, ModelEvent
    from inspect_ai.log import EvalLog, EvalSample
    from inspect_ai.model import ChatMessage, ModelOutput, ModelUsage

SUFFIXES = (".eval", ".json")
"""The formats of Inspect's logs, by the suffix of the file."""


def write_inspect_log(record: CallReader, trace: Trace | None, path: Path, *, agent: str | None = None) -> None:
    """Write the calls of a record, or of one agent. `trace` is the trace of its episode: it adds decisions and scores.

    Raises `UsageError` without `inspect_ai`, for a file of another kind, and for a record without calls.
    """
    if path.suffix not in SUFFIXES:
        raise UsageError(f"cannot write `{path}`: a log of Inspect is an .eval or .json file", hint="calls.eval")
    try:
        from inspect_ai.log import write_eval_log
    except ImportError as error:
        raise UsageError("logs of Inspect need `inspect_ai`", hint="pip install inspect_ai") from error
    log = inspect_log(record, trace, agent=agent)
    try:
        write_eval_log(log, str(path), format="eval" if path.suffix == ".eval" else "json")
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="name another file") from error


def inspect_log(record: CallReader, trace: Trace | None, *, agent: str | None = None) -> EvalLog:
    """Return the log of a record. Raises `UsageError` for a record without calls."""
    from inspect_ai.log import EvalConfig, EvalDataset, EvalLog, EvalSpec, EvalStats

    calls: dict[str, list[RecordedCall]] = {}
    for call in record.calls(agent):
        if call.tick >= 0:  # others are the harness's signs of life
            calls.setdefault(call.agent, []).append(call)
    if not calls:
        raise UsageError(f"`{record.path}` holds no calls" + (f" of `{agent}`" if agent else ""))
    episode = record.episode
    name = f"{episode.mission}-{episode.mode}"
    model = str(from_json(next(iter(calls.values()))[0].head).get("model", "unknown"))
    return EvalLog(
        status="success",
        eval=EvalSpec(
            created=datetime.now(UTC).isoformat(),
            task=name,
            dataset=EvalDataset(name=name, samples=len(calls), sample_ids=[*calls]),
            model=model,
            config=EvalConfig(),
            metadata=msgspec.to_builtins(episode),
        ),
        stats=EvalStats(model_usage={model: _usage([call for own in calls.values() for call in own])}),
        samples=[_sample(record, trace, name, own, model) for name, own in calls.items()],
    )


def _sample(
    record: CallReader, trace: Trace | None, agent: str, calls: Sequence[RecordedCall], model: str
) -> EvalSample:
    from inspect_ai.log import EvalSample

    events = [event for call in calls for event in _events(record, trace, call, model)]
    last = calls[-1]
    return EvalSample(
        id=agent,
        epoch=1,
        input=_messages(record, calls[0]),
        target="",
        messages=_messages(record, last),
        output=_output(last.result, model),
        scores=_scores(trace),
        events=events,
        model_usage={model: _usage(calls)},
        total_time=sum(call.result.wall_s for call in calls if call.result is not None),
    )


def _events(
    record: CallReader, trace: Trace | None, call: RecordedCall, model: str
) -> Iterator[ModelEvent | InfoEvent]:
    """Yield a call, and what came of its answer."""
    from inspect_ai.event import InfoEvent, ModelEvent
    from inspect_ai.model import GenerateConfig

    result, head = call.result, from_json(call.head)
    limit = head.get("max_tokens") or head.get("max_completion_tokens")
    yield ModelEvent(
        model=model,
        input=_messages(record, call),
        tools=[],
        tool_choice="none",
        config=GenerateConfig(max_tokens=limit if isinstance(limit, int) else None),
        output=_output(result, model),
        error=result.failure if result is not None and result.failure else None,
        working_time=None if result is None else result.wall_s,
        metadata={"tick": call.tick, "call": call.number},
    )
    made = _decision(trace, call)
    if made is not None:
        yield InfoEvent(source=f"tick {call.tick}", data=from_json(msgspec.json.encode(made)))


def _decision(trace: Trace | None, call: RecordedCall) -> DecisionRecord | None:
    """Return the decision that a call led to; the boundary after its tick records it."""
    boundaries = () if trace is None else trace.boundaries
    made = (made for record in boundaries if record.tick == call.tick + 1 for made in record.decisions)
    return next((decision for decision in made if decision.agent == call.agent), None)


def _messages(record: CallReader, call: RecordedCall) -> list[ChatMessage]:
    return [_message(record, from_json(message)) for message in call.messages]


def _message(record: CallReader, message: dict[str, Any]) -> ChatMessage:
    from inspect_ai.model import ChatMessageAssistant, ChatMessageSystem, ChatMessageUser, ContentImage, ContentText

    content = message.get("content")
    parts: Any = content if isinstance(content, str) else msgspec.json.encode(message).decode()
    if isinstance(content, list):
        parts = [
            ContentImage(image=_data_url(record.content(bytes.fromhex(part["sha256"]))))
            if part.get("type") == "picture"
            else ContentText(text=str(part.get("text", "")))
            for part in content
        ]
    kinds = {"system": ChatMessageSystem, "assistant": ChatMessageAssistant}
    return kinds.get(str(message.get("role")), ChatMessageUser)(content=parts)


def _output(result: CallResult | None, model: str) -> ModelOutput:
    from inspect_ai.model import ModelOutput

    if result is None or result.failure:
        return ModelOutput(model=model, error=result.failure if result is not None else "no result was recorded")
    output = ModelOutput.from_content(model, result.text)
    output.usage = _usage_of(result)
    output.time = result.wall_s
    return output


def _usage(calls: Sequence[RecordedCall]) -> ModelUsage:
    from inspect_ai.model import ModelUsage

    total = ModelUsage()
    for call in calls:
        if call.result is not None:
            total += _usage_of(call.result)
    return total


def _usage_of(result: CallResult) -> ModelUsage:
    from inspect_ai.model import ModelUsage

    return ModelUsage(
        input_tokens=result.prompt_tokens - result.cached_tokens,
        output_tokens=result.completion_tokens,
        total_tokens=result.prompt_tokens + result.completion_tokens,
        input_tokens_cache_read=result.cached_tokens,
        total_cost=result.cost_usd,
    )


def _scores(trace: Trace | None) -> dict[str, Any] | None:
    from inspect_ai.scorer import Score

    if trace is None or trace.outcome is None:
        return None
    outcome = trace.outcome
    return {
        "success": Score(value="C" if outcome.success else "I", explanation=outcome.reason),
        "scr": Score(value=outcome.scr),
    }


def _data_url(jpeg: bytes) -> str:
    return "data:image/jpeg;base64," + base64.b64encode(jpeg).decode()
