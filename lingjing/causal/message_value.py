"""The value of a message: what its absence changes in the score, found by branches.

For each message that somebody was sent, the episode is played once more with that message arriving at nobody, all else
under common random numbers; its value is the score that was reached less the score that the branch reaches. A report
that is still adjudicated counts as made, so the value is that of telling the others. With `unsaid`, messages are never
sent at all, so that no adjudicator hears them either: then all reports have a value, and not only what was told.

A star's message travels twice (to the hub, and from it), so `Hops` says which of the two a message was.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import fmean
from typing import Literal

import msgspec

from lingjing.analysis.messages import admitted_messages
from lingjing.causal.branch_host import BranchHost, HostProgress
from lingjing.causal.branching import NullFork, failed_answers, own_failures
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.redriven import BranchOptions
from lingjing.errors import UsageError
from lingjing.mission.instance import Instance
from lingjing.trace.admitted_messages import AdmittedMessage
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, MessageChange, Reason

Hop = Literal["to hub", "from hub", "to all"]
"""Which way a message went: a star's two hops, or a broadcast."""

EQUAL = 1e-9


class MessageValue(msgspec.Struct, frozen=True, kw_only=True):
    """One message: `value` is the score lost without it (negative: gained), `ticks` how many later the episode ended
    without it; `swayed` is the first boundary that other decisions led to without it (None: nobody made use of it);
    `decisive` if the episode was won with it and is lost without it, or the other way round. `reason` is why it then
    ended."""

    id: str
    tick: int
    sender: str
    kind: str
    category: str
    hop: Hop
    value: float
    ticks: int
    swayed: int | None
    decisive: bool
    reason: Reason


class KindValue(msgspec.Struct, frozen=True, kw_only=True):
    """All messages of one kind and hop in one mode: how many, the mean of their values, how many were of any value,
    decisive, harmful or moot (of no use to anybody), and how many ticks later the episode ended without one."""

    mode: str
    kind: str
    hop: Hop
    messages: int
    mean: float
    valuable: int
    decisive: int
    harmful: int
    moot: int
    ticks: float


class EpisodeValues(msgspec.Struct, frozen=True, kw_only=True):
    """The messages of one episode and what each was worth; none of them if the `null` fork was not the episode.
    `left_out` were beyond the budget of branches. `unanswered` counts the branches in which answers of policies were
    replaced for reasons for which none was in the trace."""

    path: str
    mission: str
    mode: str
    seed: int
    success: bool
    score: float
    ticks: int
    unsaid: bool
    null: NullFork
    messages: tuple[MessageValue, ...] = ()
    left_out: int = 0
    unanswered: dict[str, int] = {}
    branches: int = 0
    cpu_s: float = 0.0


class ModeValue(msgspec.Struct, frozen=True, kw_only=True):
    """All episodes of one mode: how often they were won, how many messages of each were tried, and what these were
    worth; `left_out` were beyond the budget of branches."""

    mode: str
    episodes: int
    won: int
    messages: float
    value: float
    decisive: float
    moot: float
    ticks: float
    left_out: float = 0.0


def message_values(
    trace: Trace,
    options: BranchOptions,
    *,
    unsaid: bool = False,
    most: int = 200,
    progress: HostProgress | None = None,
) -> EpisodeValues:
    """Play the episode once without each of its messages, the first `most`, if a null fork is the episode.

    Raises `UsageError` for an episode that was cut short, or that cannot be branched here.
    """
    outcome = trace.outcome
    if outcome is None or outcome.reason in CUT_SHORT:
        raise UsageError(f"{trace.path} was cut short", hint="its score is not known")
    said = [one for one in admitted_messages(trace) if one.recipients or unsaid]
    tried = said[:most]
    plans = [
        BranchPlan(at=one.tick - 1, messages=(MessageChange(message=one.id, act="withhold" if unsaid else "drop"),))
        for one in tried
    ]
    with BranchHost(trace, msgspec.structs.replace(options, referenced=()), progress) as host:
        host.departures()  # to the end: whoever decides otherwise than in the trace is named
        (null,) = host.play([BranchPlan(at=0)], "null fork", ahead=plans)
        if null.differs is not None:
            tried, plans = [], []
        results = host.play(plans, "messages")
        spent = host.cpu_s + host.unused_s
    instance = trace.header.instance
    return EpisodeValues(
        path=str(trace.path),
        mission=instance.mission,
        mode=instance.mode,
        seed=instance.seed,
        success=outcome.success,
        score=outcome.score,
        ticks=outcome.ticks,
        unsaid=unsaid,
        null=NullFork.of(null),
        messages=tuple(
            MessageValue(
                id=one.id,
                tick=one.tick,
                sender=one.sender,
                kind=one.kind,
                category=one.category,
                hop=_hop(one, instance),
                value=outcome.score - result.score,
                ticks=result.ticks - outcome.ticks,
                swayed=result.swayed,
                decisive=result.success != outcome.success,
                reason=result.reason,
            )
            for one, result in zip(tried, results, strict=True)
        ),
        left_out=max(0, len(said) - most),
        unanswered=dict(sorted(failed_answers((null, *results), own_failures(trace)).items())),
        branches=1 + len(results),
        cpu_s=spent,
    )


def by_kind(episodes: Iterable[EpisodeValues]) -> tuple[KindValue, ...]:
    """The table per kind and mode, in the order of modes and of what was worth most."""
    groups: dict[tuple[str, str, Hop], list[MessageValue]] = {}
    for episode in episodes:
        for one in episode.messages:
            groups.setdefault((episode.mode, one.kind, one.hop), []).append(one)
    rows = [
        KindValue(
            mode=mode,
            kind=kind,
            hop=hop,
            messages=len(each),
            mean=fmean(one.value for one in each),
            valuable=sum(one.value > EQUAL for one in each),
            decisive=sum(one.decisive for one in each),
            harmful=sum(one.value < -EQUAL for one in each),
            moot=sum(one.swayed is None for one in each),
            ticks=fmean(one.ticks for one in each),
        )
        for (mode, kind, hop), each in groups.items()
    ]
    return tuple(sorted(rows, key=lambda row: (row.mode, -row.mean, row.kind, row.hop)))


def by_mode(episodes: Sequence[EpisodeValues]) -> tuple[ModeValue, ...]:
    """Modes side by side: means of what was said and what it was worth, over episodes whose null forks they were."""
    rows = []
    believed = [one for one in episodes if one.null.identical]
    for mode in dict.fromkeys(one.mode for one in believed):
        each = [one for one in believed if one.mode == mode]
        said = [one.messages for one in each]
        rows.append(
            ModeValue(
                mode=mode,
                episodes=len(each),
                won=sum(one.success for one in each),
                messages=fmean(len(one) for one in said),
                value=fmean(sum(message.value for message in one) for one in said),
                decisive=fmean(sum(message.decisive for message in one) for one in said),
                moot=_moot(said),
                ticks=fmean(one.ticks for one in each),
                left_out=fmean(one.left_out for one in each),
            )
        )
    return tuple(sorted(rows, key=lambda row: row.mode))


def _moot(said: Sequence[Sequence[MessageValue]]) -> float:
    """The share of messages that nobody made use of."""
    every = [message for one in said for message in one]
    return fmean(message.swayed is None for message in every) if every else 0.0


def _hop(message: AdmittedMessage, instance: Instance) -> Hop:
    hub = instance.comms.hub
    if hub is None:
        return "to all"
    return "from hub" if message.sender == hub else "to hub"
