"""The page of an episode's model calls: one HTML file that needs no network and no server.

Each call is shown with its prompt, pictures, answer, the checks of the answer, its tokens and its cost. Texts and
pictures are stored once, as in the record. Pictures are scaled down until all of them together fit a budget.
"""

from __future__ import annotations

import base64
import io
import zlib
from collections.abc import Iterable, Mapping, Sequence

import msgspec
from PIL import Image

from lingjing.decoding import from_json
from lingjing.trace.call_store import CallReader
from lingjing.trace.calls import CallResult, RecordedCall
from lingjing.trace.reader import Trace
from lingjing.trace.records import DecisionRecord
from lingjing.viewer.page import CALLS, element, page
from lingjing.viewer.page_content import page_json

BUDGET_BYTES = 12_000_000
"""Largest total size of the JPEGs, bytes. Chosen, so that the file stays small."""

WIDTHS = (960, 640, 480, 320, 200)
"""Widths, pixels, that are tried in this order. A picture is never enlarged. Chosen."""

QUALITY = 80
"""Pillow's JPEG quality. Chosen."""

PROBES = -1
"""Calls at this tick are the harness's signs of life (`lingjing.play.recorded_calls.PROBE_TICK`)."""


class CallMessage(msgspec.Struct, frozen=True):
    """One turn of a request."""

    role: str
    text: int
    """The number of its text."""
    pictures: tuple[int, ...]
    """The numbers of its pictures."""


class CallDecision(msgspec.Struct, frozen=True, omit_defaults=True):
    """The decision of the agent at the boundary of a call."""

    command: str = ""
    """The command as JSON; "" for none."""
    messages: tuple[str, ...] = ()
    """The messages as JSON."""
    substituted: str = ""
    """The reason of a no-op in its place."""
    detail: str = ""
    """The error in words."""


class CallEntry(msgspec.Struct, frozen=True, omit_defaults=True):
    """One model call, as the page shows it."""

    agent: str
    tick: int
    number: int
    parameters: int
    """The number of the text of the parameters."""
    messages: tuple[CallMessage, ...]
    result: CallResult | None
    spent_usd: float
    """US dollars of all calls up to this one."""
    spent_tokens: int
    """Tokens of all calls up to this one."""
    decision: CallDecision | None = None


class CallsContent(msgspec.Struct, frozen=True):
    """The content of the page."""

    title: str
    facts: str
    priced: bool
    """True if the price of a call is known."""
    texts: tuple[str, ...]
    pictures: int
    """The number of pictures."""
    calls: tuple[CallEntry, ...]
    notes: tuple[str, ...]


def calls_page(
    record: CallReader,
    trace: Trace | None = None,
    *,
    agent: str | None = None,
    tick: int | None = None,
    budget_bytes: int = BUDGET_BYTES,
    served: bool = False,
) -> str:
    """Return the page of a record as HTML. `trace` is the trace of its episode: without it no decisions are shown.

    `agent` and `tick` select calls. `served`: a server sends the policy of its contents.

    Raises `UsageError` for a record with missing content.
    """
    calls = [call for call in record.calls(agent, tick) if call.tick != PROBES]
    names = list(dict.fromkeys(name for call in calls for name in call.pictures))
    pictures, notes = _pictures([record.content(bytes.fromhex(name)) for name in names], budget_bytes)
    content = _content(record, calls, names, trace, notes)
    elements = [element("calls", _deflated(content))]
    elements += [
        element(f"picture-{number}", base64.b64encode(jpeg).decode()) for number, jpeg in enumerate(pictures) if jpeg
    ]
    return page(f"{content.title} · model calls · Lingjing", "\n".join(elements), meta_policy=not served, assets=CALLS)


def _content(
    record: CallReader, calls: Sequence[RecordedCall], names: Sequence[str], trace: Trace | None, notes: list[str]
) -> CallsContent:
    texts: dict[str, int] = {}
    numbers = {name: number for number, name in enumerate(names)}
    decisions = _decisions(trace)
    entries, usd, tokens, priced = [], 0.0, 0, False
    for call in calls:
        result = call.result
        if result is not None:
            usd += (result.cost_usd or 0.0) + result.unknown_usd
            tokens += result.prompt_tokens + result.completion_tokens
            priced |= result.cost_usd is not None
        entries.append(
            CallEntry(
                agent=call.agent,
                tick=call.tick,
                number=call.number,
                parameters=_number(texts, _indented(call.head)),
                messages=tuple(_message(message, texts, numbers) for message in call.messages),
                result=None if result is None else msgspec.structs.replace(result, body=""),
                spent_usd=round(usd, 6),
                spent_tokens=tokens,
                decision=decisions.get((call.tick, call.agent)),
            )
        )
    episode = record.episode
    return CallsContent(
        title=f"{episode.mission} · {episode.mode} · seed {episode.seed}",
        facts=f"tier {episode.tier} · {len(entries)} calls",
        priced=priced,
        texts=tuple(texts),
        pictures=len(names),
        calls=tuple(entries),
        notes=tuple(notes),
    )


def _message(data: bytes, texts: dict[str, int], numbers: Mapping[str, int]) -> CallMessage:
    message = from_json(data)
    content = message.get("content") if isinstance(message, dict) else message
    role = str(message.get("role", "?")) if isinstance(message, dict) else "?"
    if not isinstance(content, list):
        text = content if isinstance(content, str) else _indented(msgspec.json.encode(message))
        return CallMessage(role, _number(texts, text), ())
    words = [str(part.get("text", "")) for part in content if isinstance(part, dict) and part.get("type") != "picture"]
    shown = tuple(
        numbers[part["sha256"]]
        for part in content
        if isinstance(part, dict) and part.get("type") == "picture" and part.get("sha256") in numbers
    )
    return CallMessage(role, _number(texts, "\n".join(words)), shown)


def _decisions(trace: Trace | None) -> dict[tuple[int, str], CallDecision]:
    """Return the decisions of a trace by the tick of their calls and agent. A boundary records those that led to it."""
    if trace is None:
        return {}
    return {
        (boundary.tick - 1, made.agent): _decision(made) for boundary in trace.boundaries for made in boundary.decisions
    }


def _decision(made: DecisionRecord) -> CallDecision:
    decision = made.decision
    return CallDecision(
        command="" if decision.command is None else msgspec.json.encode(decision.command).decode(),
        messages=tuple(msgspec.json.encode(message).decode() for message in decision.messages),
        substituted=made.substituted,
        detail=made.detail,
    )


def _number(texts: dict[str, int], text: str) -> int:
    """Return the number of a text, which is added if it is new."""
    return texts.setdefault(text, len(texts))


def _indented(data: bytes) -> str:
    return msgspec.json.format(data, indent=2).decode("utf-8", "replace")


def _pictures(files: Sequence[bytes], budget_bytes: int) -> tuple[list[bytes], list[str]]:
    """Return the scaled pictures, b"" for one that is left out, and notes for the reader."""
    if not files:
        return [], []
    if budget_bytes <= 0:
        return [b""] * len(files), ["The pictures are not in this file."]
    scaled: list[bytes] = []
    for width in WIDTHS:
        scaled = list(_scaled(files, width))
        if sum(map(len, scaled)) <= budget_bytes:
            return scaled, [f"Pictures are at most {width} pixels wide in this file; models were sent them whole."]
    left = budget_bytes
    for number, jpeg in enumerate(scaled):
        left -= len(jpeg)
        scaled[number] = jpeg if left >= 0 else b""
    kept = sum(map(bool, scaled))
    return scaled, [f"It holds {kept} of {len(files)} pictures, {WIDTHS[-1]} pixels wide, to stay small."]


def _scaled(files: Iterable[bytes], width: int) -> Iterable[bytes]:
    """Yield the pictures at most `width` pixels wide; b"" for one that cannot be decoded."""
    for data in files:
        try:
            image = Image.open(io.BytesIO(data), formats=("JPEG",)).convert("RGB")
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
            yield b""
            continue
        if image.width > width:
            image = image.resize((width, max(1, round(image.height * width / image.width))), Image.Resampling.BILINEAR)
        out = io.BytesIO()
        image.save(out, "JPEG", quality=QUALITY)
        yield out.getvalue()


def _deflated(value: object) -> str:
    return base64.b64encode(zlib.compress(page_json(value), 9)).decode()
