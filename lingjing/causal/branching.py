"""One branch of a re-driven episode in a forked process: played to its end and summarised."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
from msgspec.structs import replace

from lingjing.analysis.relations import RelationTracker
from lingjing.causal.interventions import BranchPlan, InterveningPolicies, ReplacedPart, transit
from lingjing.causal.redriven import RedrivenEpisode
from lingjing.errors import ExitCode, LingjingError, UsageError, error_of
from lingjing.kernel.episode import play
from lingjing.kernel.world.contract import StoredFrame
from lingjing.scene.city import City
from lingjing.scene.surroundings import surroundings
from lingjing.trace.copying import picture_parts
from lingjing.trace.digest import current_digests
from lingjing.trace.reader import Trace
from lingjing.trace.records import (
    CUT_SHORT,
    DIGEST_VERSION,
    FORMAT,
    BoundaryRecord,
    BranchOrigin,
    Header,
    Outcome,
    Reason,
)
from lingjing.trace.writer import PictureParts, TraceWriter

TRACE_NAME = "trace.mcap"
"""The file name of a branch's trace."""


class BranchResult(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a branch."""

    success: bool = False
    reason: Reason = "error"
    detail: str = ""
    score: float = 0.0
    scr: float = 0.0
    ticks: int = 0
    digest: str = ""
    differs: int | None = None
    """The first boundary with a digest other than the trace's; None if all are equal."""
    swayed: int | None = None
    """The first boundary after different decisions, not counting withheld messages; None if all decisions are equal."""
    replaced: tuple[ReplacedPart, ...] = ()
    """The parts that the plan replaced."""
    departed: tuple[ReplacedPart, ...] = ()
    """Departures that the plan did not replace; only if the plan watches."""
    pictures: int = 0
    """The number of requested pictures."""
    unanswered: dict[str, int] = {}
    """The number of replaced answers of policies in the branch, by reason."""
    cpu_s: float = 0.0
    """CPU time of the branch, its fork included and the camera excluded, seconds."""
    fork_s: float = 0.0
    """CPU time of the fork, seconds."""
    failed: str = ""
    """The error (of an engine, the camera or a reference) that makes the branch useless; empty if there is none."""
    hint: str = ""
    exit_code: int = ExitCode.INFRASTRUCTURE
    """The exit code of the error `failed`."""
    path: str = ""
    """The path of the branch's trace; empty if none was written."""

    def error(self) -> LingjingError:
        """Return the error of a `failed` branch."""
        return error_of(self.exit_code, f"a branch was cut short: {self.failed}", self.hint)


class NullFork(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a branch from boundary 0 without a change."""

    identical: bool
    """True if all digests equal those of the trace."""
    boundary: int | None = None
    """The first boundary that differs; None if there is none."""

    @classmethod
    def of(cls, branch: BranchResult) -> NullFork:
        """Return the result of a null fork."""
        return cls(identical=branch.differs is None, boundary=branch.differs)


def own_failures(trace: Trace) -> frozenset[str]:
    """Return the reasons of replaced answers in the episode itself."""
    return frozenset(made.substituted for record in trace.boundaries for made in record.decisions)


def failed_answers(results: Iterable[BranchResult], own: frozenset[str]) -> Counter[str]:
    """Return the number of branches with replaced answers, by reason, without the episode's own reasons."""
    return Counter(reason for result in results for reason in result.unanswered.keys() - own)


def play_branch(episode: RedrivenEpisode, plan: BranchPlan) -> BranchResult:
    """Play the branch to its end. The episode cannot be used afterwards."""
    while episode.tick < plan.at:
        episode.advance()
    pictures = episode.run.pictures
    pictures.until, pictures.camera = episode.tick, episode.camera.capture
    if not plan.watch:
        episode.references.keep({item.agent for item in plan.substitutions})
    episode.kernel.transit = transit(plan.messages)
    episode.kernel.removed_ids = plan.withheld
    if episode.calls is not None:
        episode.calls.branched = True
    policies = InterveningPolicies(episode.policies, episode.references, episode.kernel, plan)
    records = [replace(episode.published.record, snapshots=())]
    writer = None
    if plan.out:
        pictures.pixels = True
        writer = _BranchTrace(episode.trace, plan, episode.options.reference, episode.run.city)
    episode.recorder = lambda record, frames: _record(record, frames, records, writer)
    outcome = play(episode.kernel, policies, writer.writer if writer is not None else None, since=episode.published)
    return BranchResult(
        success=outcome.success,
        reason=outcome.reason,
        detail=outcome.detail,
        score=outcome.score,
        scr=outcome.scr,
        ticks=outcome.ticks,
        digest=outcome.digest,
        differs=_differs(episode.trace, plan.at, [record.digest for record in records], outcome),
        swayed=_swayed(episode.trace, records[1 + any(item.act == "withhold" for item in plan.messages) :]),
        replaced=tuple(policies.replaced),
        departed=tuple(policies.departed) if plan.watch else (),
        pictures=pictures.asked,
        unanswered=dict(
            Counter(made.substituted for item in records[1:] for made in item.decisions if made.substituted)
        ),
        failed=(outcome.detail or outcome.reason) if outcome.reason in CUT_SHORT else "",
        hint=outcome.hint,
        path=str(writer.end(outcome)) if writer is not None else "",
    )


def _record(
    record: BoundaryRecord, frames: Sequence[StoredFrame], records: list[BoundaryRecord], writer: _BranchTrace | None
) -> None:
    records.append(replace(record, snapshots=()))
    if writer is not None:
        writer.add(record, [(frame.info, frame.jpeg, frame.depth, frame.semantic, frame.instance) for frame in frames])


def _differs(trace: Trace, at: int, digests: Sequence[str], outcome: Outcome) -> int | None:
    """Return the first boundary from `at` on at which the digests differ, or only one of the two has ended."""
    recorded = current_digests(trace)[at:]
    for number, (digest_recorded, digest_played) in enumerate(zip(recorded, digests, strict=False)):
        if digest_recorded != digest_played:
            return at + number
    if len(digests) < len(recorded) or (len(digests) > len(recorded) and trace.complete):
        return at + min(len(recorded), len(digests))
    other_end = trace.complete and trace.outcome is not None and trace.outcome.reason != outcome.reason
    return at + len(recorded) - 1 if other_end else None


def _swayed(trace: Trace, records: Sequence[BoundaryRecord]) -> int | None:
    """Return the first boundary after commands or messages that differ from the trace's."""
    for record in records:
        if record.tick < len(trace.boundaries) and _acts(record) != _acts(trace.boundaries[record.tick]):
            return record.tick
    return None


def _acts(record: BoundaryRecord) -> list[tuple[object, ...]]:
    return [(made.agent, made.decision.command, made.decision.messages) for made in record.decisions]


class _BranchTrace:
    """The trace of a branch: the recorded boundaries up to the fork, then those of the branch."""

    def __init__(self, trace: Trace, plan: BranchPlan, reference: str, city: City) -> None:
        folder = Path(plan.out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"cannot write to `{folder}`: {error.strerror}", hint="choose another folder") from error
        header = _header(trace, plan, reference)
        shown = surroundings(city, header.instance)
        self.writer = TraceWriter(folder / TRACE_NAME, header, surroundings=shown)
        self._relations = RelationTracker(trace.header.instance)
        for record in trace.boundaries[: plan.at + 1]:
            self.add(record, [picture_parts(trace, frame.id) for frame in record.frames])

    def add(self, record: BoundaryRecord, pictures: Sequence[PictureParts]) -> None:
        """Write one boundary."""
        self.writer.boundary(replace(record, relations=self._relations.take(record)), pictures)

    def end(self, outcome: Outcome) -> Path:
        """Return the path of the trace."""
        return self.writer.part if outcome.reason in CUT_SHORT else self.writer.path


def _header(trace: Trace, plan: BranchPlan, reference: str) -> Header:
    return replace(
        trace.header,
        format=FORMAT,
        digest_version=DIGEST_VERSION,
        started_wall=dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        branch=BranchOrigin(
            trace=trace.path.name,
            at=plan.at,
            digest=trace.boundaries[plan.at].digest,
            substitutions=plan.substitutions,
            messages=plan.messages,
            reference=reference if plan.substitutions else "",
        ),
    )
