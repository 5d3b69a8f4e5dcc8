"""The check of a chat model before a suite: one real request in each column, and two about a drawn picture.

The request of a column is the first one of a real episode, of the agent that sees most; all other agents are idle. The
drawn picture shows one red rectangle. The same question without it tells the tokens of the picture, and the answer the
convention in which the model writes boxes.
"""

from __future__ import annotations

import asyncio
import io
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import msgspec

from lingjing.analysis.box_conventions import Numbers, readings
from lingjing.analysis.detection import OVERLAP, iou
from lingjing.bench.columns import Column
from lingjing.mission.instance import GivenOption, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.play.episode import OutsideControl, Session
from lingjing.play.options import PlayOptions, compiled
from lingjing.plugins.asking import AskOptions, ask
from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.calls import CallRequest, CallResult, UnrecordedCalls
from lingjing.plugins.frame_detector import UnitBox
from lingjing.plugins.options import read_options
from lingjing.plugins.policy import NoDecisionError
from lingjing.trace.call_store import CALLS_NAME, CallReader
from lingjing.trace.records import CameraPose, FrameInfo

SIZE = (1920, 1080)
"""Width and height of the drawn picture, pixels: those of the shipped cameras."""

BOX: UnitBox = (0.62, 0.10, 0.80, 0.26)
"""The red rectangle, shares of the picture. Chosen: no other convention turns it into a box that overlaps with it."""

QUESTION = (
    "Where is the red rectangle? Answer with one JSON object and nothing else: "
    '{"box": [x_min, y_min, x_max, y_max]}, the edges as shares (0 to 1) of the picture, origin top left.'
)

AS_ASKED = "as asked (shares, x first)"
"""The convention that the prompts ask for."""

UNREADABLE = "the answer holds no four numbers"
ELSEWHERE = "under no convention where the rectangle is"

_NUMBERS = re.compile(r"\[\s*" + r"\s*,\s*".join([r"(-?\d+(?:\.\d+)?)"] * 4) + r"\s*\]")
"""Four numbers in brackets."""

_TRACED = MappingProxyType({"encoding": "paper"})
"""The options of all suites of the paper."""


@dataclass(frozen=True, slots=True)
class ColumnCheck:
    """The first request of a column, and what came of it."""

    column: str
    agent: str
    """The agent that was asked."""
    pictures: int
    """Pictures in the request."""
    result: CallResult | None
    """The answer; None if no request was made."""
    fault: str
    """The reason for which the answer was not used; "" if it was."""


@dataclass(frozen=True, slots=True)
class PictureCheck:
    """The answers about the drawn picture."""

    tokens: int | None
    """Tokens of the picture; None if the service does not count or does not answer."""
    convention: str
    """The convention of the box in words."""
    failure: str
    """The reason without an answer; "" with one."""
    cost_usd: float


def check_column(column: Column, arguments: Mapping[str, GivenOption], max_cost: float | None) -> ColumnCheck:
    """Make the first request of a column, in a folder that is removed. Raises the errors of `lingjing.run`."""
    options = PlayOptions(
        mission=str(column.path), mode=column.mode, tier=column.tier, language=column.language, overview=False
    )
    mission = compiled(options)
    agent = _watcher(instantiate(mission, seed=0, mode=column.mode, tier=column.tier))
    options = msgspec.structs.replace(
        options, policy="idle", policies_for={agent: "react"}, policy_args={**_TRACED, **arguments}, max_cost=max_cost
    )
    with tempfile.TemporaryDirectory(prefix="lingjing-") as folder, Session() as session:
        out = Path(folder) / "episode"
        report = session.play(options, mission, out=out, outside=OutsideControl(_one_tick))
        record = out / CALLS_NAME
        if not record.is_file():
            return ColumnCheck(column.name, agent, 0, None, report.detail or "no request was made")
        with closing(CallReader(record)) as reader:
            call = next(call for call in reader.calls(agent) if call.tick >= 0)
        from lingjing.trace.reader import read_trace

        made = [made for boundary in read_trace(report.trace).boundaries for made in boundary.decisions]
        fault = next((decision.detail for decision in made if decision.agent == agent and decision.substituted), "")
    return ColumnCheck(column.name, agent, len(call.pictures), call.result, fault or report.detail)


def check_picture(arguments: Mapping[str, GivenOption]) -> PictureCheck:
    """Ask about the drawn picture, with it and without it. Raises `UsageError` for wrong options."""
    names = AskOptions.model_fields
    known = {name: value for name, value in arguments.items() if name in names or name == "deadline"}
    kept = _KeptCalls()
    model = ask(read_options(AskOptions, known, "the model"), kept)
    try:
        text = asyncio.run(model([ChatMessage("user", QUESTION, (_drawn(),))]))
        asyncio.run(model([ChatMessage("user", QUESTION)]))
    except NoDecisionError as error:
        return PictureCheck(None, "", str(error), kept.cost_usd)
    seen, blind = (result.prompt_tokens for result in kept.results)
    return PictureCheck(seen - blind if seen and blind else None, convention_of(text), "", kept.cost_usd)


def convention_of(text: str) -> str:
    """Return the convention under which the box of an answer is the red rectangle, in words."""
    match = _NUMBERS.search(text)
    if match is None:
        return UNREADABLE
    numbers: Numbers = tuple(map(float, match.groups()))  # type: ignore[assignment]
    width, height = SIZE
    pose = CameraPose(position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=0.0, width=width, height=height)
    if iou(numbers, BOX) >= OVERLAP:
        return AS_ASKED
    frame = FrameInfo(id="drawn", entity="", camera="", tick=0, time_s=0.0, pose=pose, channels=())
    return next((name for name, box in readings(numbers, frame) if iou(box, BOX) >= OVERLAP), ELSEWHERE)


class _KeptCalls(UnrecordedCalls):
    """A record that keeps the results."""

    def __init__(self) -> None:
        self.results: list[CallResult] = []

    @property
    def cost_usd(self) -> float:
        """The price of all calls, US dollars."""
        return sum(result.cost_usd or 0.0 for result in self.results)

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Keep the result."""
        self.results.append(result)


def _watcher(instance: Instance) -> str:
    """Return the agent with most cameras, the first of several."""
    cameras = {entity.id: len(entity.cameras) for entity in instance.entities}
    seen = {agent.id: sum(cameras.get(entity, 0) for entity in agent.controls) for agent in instance.agents}
    return max(seen, key=lambda agent: seen[agent])


def _one_tick(instance: Instance) -> Instance:
    return msgspec.structs.replace(instance, budget=msgspec.structs.replace(instance.budget, ticks=1))


def _drawn() -> bytes:
    """Return the drawn picture as JPEG."""
    from PIL import Image, ImageDraw

    width, height = SIZE
    picture = Image.new("RGB", SIZE, (120, 126, 130))
    ImageDraw.Draw(picture).rectangle(
        (BOX[0] * width, BOX[1] * height, BOX[2] * width, BOX[3] * height), fill=(214, 20, 30)
    )
    out = io.BytesIO()
    picture.save(out, "JPEG", quality=90)
    return out.getvalue()


def lines_of(checks: Sequence[ColumnCheck]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a table, with its head."""
    yield ("column", "agent", "pictures", "tokens in", "out", "USD", "seconds", "answer")
    for check in checks:
        result = check.result or CallResult(attempts=0)
        cost = "-" if result.cost_usd is None else f"{result.cost_usd:.4f}"
        answer = check.fault or result.failure or "used"
        yield (
            check.column, check.agent, str(check.pictures), str(result.prompt_tokens), str(result.completion_tokens),
            cost, f"{result.wall_s:.1f}", answer if len(answer) <= 90 else f"{answer[:90]}…",
        )  # fmt: skip


__all__ = ["AS_ASKED", "ColumnCheck", "PictureCheck", "check_column", "check_picture", "convention_of", "lines_of"]
