"""One branch of a re-driven episode, in a forked copy of its process: played to its end and told in a few numbers."""

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


class BranchResult(msgspec.Struct, frozen=True, kw_only=True):
    """How a branch ended.

    `differs` is the first boundary whose digest is not the trace's (None: all are equal, to the end). `swayed` is the
    first that other decisions led to, but for what was withheld (None: nobody decided otherwise). `replaced` are the
    records that the plan replaced, `departed` those beside these in which agents departed from their references, if
    the plan watches. `pictures` were asked of the camera. `unanswered` counts the answers of policies that
    were replaced in the branch, by reason. `cpu_s` is what the branch took, its fork's `fork_s` included, without the
    camera. `failed` says why the branch says nothing (an engine, the camera or a reference failed), `exit_code` which
    kind of error that is.
    """

    success: bool = False
    reason: Reason = "error"
    detail: str = ""
    score: float = 0.0
    scr: float = 0.0
    ticks: int = 0
    digest: str = ""
    differs: int | None = None
    swayed: int | None = None
    replaced: tuple[ReplacedPart, ...] = ()
    departed: tuple[ReplacedPart, ...] = ()
    pictures: int = 0
    unanswered: dict[str, int] = {}
    cpu_s: float = 0.0
    fork_s: float = 0.0
    failed: str = ""
    hint: str = ""
    exit_code: int = ExitCode.INFRASTRUCTURE
    path: str = ""

    def error(self) -> LingjingError:
        """That of a branch that `failed`."""
        return error_of(self.exit_code, f"a branch was cut short: {self.failed}", self.hint)


class NullFork(msgspec.Struct, frozen=True, kw_only=True):
    """A branch from boundary 0 that changes nothing; `boundary` is the first where it differs all the same."""

    identical: bool
    boundary: int | None = None

    @classmethod
    def of(cls, branch: BranchResult) -> NullFork:
        """What a branch that changed nothing says."""
        return cls(identical=branch.differs is None, boundary=branch.differs)


def own_failures(trace: Trace) -> frozenset[str]:
    """The reasons for which answers of policies were replaced in an episode itself."""
    return frozenset(made.substituted for one in trace.boundaries for made in one.decisions)


def failed_answers(results: Iterable[BranchResult], own: frozenset[str]) -> Counter[str]:
    """In how many branches answers of policies were replaced, by reason, but for the reasons that are the episode's
    own."""
    return Counter(reason for one in results for reason in one.unanswered.keys() - own)


def play_branch(episode: RedrivenEpisode, plan: BranchPlan) -> BranchResult:
    """Play the branch to its end. The episode is used up."""
    while episode.tick < plan.at:
        episode.advance()
    pictures = episode.run.pictures
    pictures.until, pictures.camera = episode.tick, episode.camera.capture
    if not plan.watch:
        episode.references.keep({one.agent for one in plan.substitutions})
    episode.kernel.transit = transit(plan.messages)
    episode.kernel.unsaid = plan.withheld
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
        swayed=_swayed(episode.trace, records[1 + any(one.act == "withhold" for one in plan.messages) :]),
        replaced=tuple(policies.replaced),
        departed=tuple(policies.departed) if plan.watch else (),
        pictures=pictures.asked,
        unanswered=dict(Counter(made.substituted for one in records[1:] for made in one.decisions if made.substituted)),
        failed=(outcome.detail or outcome.reason) if outcome.reason in CUT_SHORT else "",
        hint=outcome.hint,
        path=str(writer.end(outcome)) if writer is not None else "",
    )


def _record(
    record: BoundaryRecord, frames: Sequence[StoredFrame], records: list[BoundaryRecord], writer: _BranchTrace | None
) -> None:
    records.append(replace(record, snapshots=()))
    if writer is not None:
        writer.add(record, [(one.info, one.jpeg, one.depth, one.semantic) for one in frames])


def _differs(trace: Trace, at: int, digests: Sequence[str], outcome: Outcome) -> int | None:
    """The first boundary from `at` on where the digests differ, or where one of the two has ended."""
    recorded = current_digests(trace)[at:]
    for number, (one, other) in enumerate(zip(recorded, digests, strict=False)):
        if one != other:
            return at + number
    if len(digests) < len(recorded) or (len(digests) > len(recorded) and trace.complete):
        return at + min(len(recorded), len(digests))
    other_end = trace.complete and trace.outcome is not None and trace.outcome.reason != outcome.reason
    return at + len(recorded) - 1 if other_end else None


def _swayed(trace: Trace, records: Sequence[BoundaryRecord]) -> int | None:
    """The first boundary that other commands or messages led to than in the trace, as far as that goes."""
    for record in records:
        if record.tick < len(trace.boundaries) and _acts(record) != _acts(trace.boundaries[record.tick]):
            return record.tick
    return None


def _acts(record: BoundaryRecord) -> list[tuple[object, ...]]:
    return [(made.agent, made.decision.command, made.decision.messages) for made in record.decisions]


class _BranchTrace:
    """A branch as a trace of its own: the recorded boundaries up to where it leaves, then its own."""

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
        """One boundary."""
        self.writer.boundary(replace(record, relations=self._relations.take(record)), pictures)

    def end(self, outcome: Outcome) -> Path:
        """Where the trace lies."""
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
