"""The content of a page from a trace: head, steps, details and ending."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from lingjing.analysis.ending import cause, why
from lingjing.analysis.played_city import city_of, credit
from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.scene.surroundings import OVERHEAD_M
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord
from lingjing.viewer.ground import PageGround, ground_of
from lingjing.viewer.head import EndingCard, EpisodeHead, ending_of, head_of
from lingjing.viewer.steps import StepDetail, StepMaker, ViewStep

CHUNK = 50
"""Number of steps in one message with details. Chosen."""


class PageStart(msgspec.Struct, frozen=True):
    """The content that a page requests first."""

    head: EpisodeHead
    steps: list[ViewStep]
    ending: EndingCard | None
    """The card about the end; None for a running episode."""
    live: bool
    """True if more steps will follow."""
    notes: list[str]
    """Notes for the reader, such as on missing pictures."""


@dataclass
class PageContent:
    """The content of a page for the boundaries of one trace so far."""

    trace: Trace
    truth: bool
    steps: list[ViewStep] = field(default_factory=list)
    details: list[StepDetail] = field(default_factory=list)

    def __post_init__(self) -> None:
        instance = self.trace.header.instance
        self._maker = StepMaker(instance, max(len(self.trace.boundaries), 1), truth=self.truth)
        self.take(self.trace.boundaries)

    def take(self, records: tuple[BoundaryRecord, ...]) -> None:
        """Add boundaries, in order."""
        for record in records:
            step, detail = self._maker.step(record)
            self.steps.append(step)
            self.details.append(detail)

    @property
    def head(self) -> EpisodeHead:
        """The head. Its extent contains everything that the steps show."""
        header = self.trace.header
        places: list[Vector2] = [
            (sample[1], sample[2])
            for step in self.steps
            for samples in step.moves.values()
            for sample in samples
            if sample[3] < OVERHEAD_M
        ]
        return head_of(header, credit(header.attribution), truth=self.truth, places=places)

    def ending(self) -> EndingCard:
        """Return the ending, with the whole explanation if the truth may be shown."""
        explanation = why(self.trace).text if self.truth else ""
        return ending_of(self.trace.outcome, cause(self.trace), explanation)

    def ground(self) -> PageGround:
        """Return the ground in and around the shown extent."""
        return ground_of_trace(self.trace, self.head.frame)

    def page_start(self, *, live: bool = False, notes: list[str] | None = None) -> PageStart:
        """Return the content without details, ground and pictures."""
        return PageStart(self.head, self.steps, None if live else self.ending(), live, notes or [])


def ground_of_trace(trace: Trace, frame: Extent) -> PageGround:
    """Return the ground of a trace in and around an extent."""
    return ground_of(city_of(trace), frame)


def page_json(value: object) -> bytes:
    """Return JSON that is safe inside of HTML: `<`, `>`, `&` and the line separators of JavaScript are escaped."""
    text = msgspec.json.encode(value)
    for mark in (b"<", b">", b"&"):
        text = text.replace(mark, b"\\u%04x" % ord(mark))
    return text.replace("\u2028".encode(), b"\\u2028").replace("\u2029".encode(), b"\\u2029")
