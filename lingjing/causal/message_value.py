"""The value of messages, measured by branches.

For each delivered message, the episode is played once more without its delivery, under common random numbers. The
value is the recorded score less the score of the branch. A report that is still adjudicated counts as made, so its
value is that of informing other agents. With `unsaid` messages are not sent at all, so no adjudicator receives them;
then reports have their complete value.

In the star mode a message travels twice (to the hub, and from the hub); `Hop` distinguishes the two.
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
"""The direction of a message: one of a star's two hops, or a broadcast."""

EQUAL = 1e-9
"""Difference up to which two scores are equal. Chosen: far above rounding errors."""


class MessageValue(msgspec.Struct, frozen=True, kw_only=True):
    """The value of one message."""

    id: str
    tick: int
    sender: str
    kind: str
    category: str
    hop: Hop
    value: float
    """The loss of score without it; negative: a gain."""
    ticks: int
    """Ticks by which the episode ended later without it."""
    swayed: int | None
    """The first boundary after different decisions without it; None: no agent used it."""
    decisive: bool
    """True if success changes without it."""
    reason: Reason
    """The reason of the outcome without it."""


class KindValue(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of all messages of one kind and hop in one mode."""

    mode: str
    kind: str
    hop: Hop
    messages: int
    """Number of messages."""
    mean: float
    """Mean value."""
    valuable: int
    """Messages with a positive value."""
    decisive: int
    """Decisive messages."""
    harmful: int
    """Messages with a negative value."""
    moot: int
    """Messages that no agent used."""
    ticks: float
    """Mean number of ticks by which the episode ended later."""


class EpisodeValues(msgspec.Struct, frozen=True, kw_only=True):
    """The values of the messages of one episode."""

    path: str
    mission: str
    mode: str
    seed: int
    success: bool
    score: float
    ticks: int
    unsaid: bool
    """True if messages were not sent at all."""
    null: NullFork
    """The null fork; if it differs, no message is measured."""
    messages: tuple[MessageValue, ...] = ()
    left_out: int = 0
    """The number of messages beyond the budget."""
    unanswered: dict[str, int] = {}
    """Branches with replaced answers of policies, by reason, without the trace's own reasons."""
    branches: int = 0
    """The number of played branches."""
    cpu_s: float = 0.0
    """CPU time of the branches, seconds."""


class ModeValue(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of all episodes of one mode."""

    mode: str
    episodes: int
    won: int
    """The number of won episodes."""
    messages: float
    """Mean number of measured messages per episode."""
    value: float
    """Mean total value per episode."""
    decisive: float
    """Mean number of decisive messages per episode."""
    moot: float
    """The share of messages that no agent used."""
    ticks: float
    """Mean ticks of the episodes."""
    left_out: float = 0.0
    """Mean number of messages beyond the budget."""


def message_values(
    trace: Trace,
    options: BranchOptions,
    *,
    unsaid: bool = False,
    most: int = 200,
    progress: HostProgress | None = None,
) -> EpisodeValues:
    """Play the episode once without each of its first `most` messages, if its null fork is identical.

    Raises `UsageError` for an episode that was cut short, or that cannot be branched here.
    """
    outcome = trace.outcome
    if outcome is None or outcome.reason in CUT_SHORT:
        raise UsageError(
            f"{trace.path} was cut short", hint="its score is unknown: choose an episode that ended by itself"
        )
    sent = [message for message in admitted_messages(trace) if message.recipients or unsaid]
    measured = sent[:most]
    plans = [
        BranchPlan(
            at=message.tick - 1, messages=(MessageChange(message=message.id, act="withhold" if unsaid else "drop"),)
        )
        for message in measured
    ]
    with BranchHost(trace, msgspec.structs.replace(options, referenced=()), progress) as host:
        host.departures()  # replays to the end, and reports a policy that does not reproduce its decisions
        (null,) = host.play([BranchPlan(at=0)], "null fork", ahead=plans)
        if null.differs is not None:
            measured, plans = [], []
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
                id=message.id,
                tick=message.tick,
                sender=message.sender,
                kind=message.kind,
                category=message.category,
                hop=_hop(message, instance),
                value=outcome.score - result.score,
                ticks=result.ticks - outcome.ticks,
                swayed=result.swayed,
                decisive=result.success != outcome.success,
                reason=result.reason,
            )
            for message, result in zip(measured, results, strict=True)
        ),
        left_out=max(0, len(sent) - most),
        unanswered=dict(sorted(failed_answers((null, *results), own_failures(trace)).items())),
        branches=1 + len(results),
        cpu_s=spent,
    )


def by_kind(episodes: Iterable[EpisodeValues]) -> tuple[KindValue, ...]:
    """Return statistics by kind, hop and mode, ordered by mode and mean value."""
    groups: dict[tuple[str, str, Hop], list[MessageValue]] = {}
    for episode in episodes:
        for message in episode.messages:
            groups.setdefault((episode.mode, message.kind, message.hop), []).append(message)
    rows = [
        KindValue(
            mode=mode,
            kind=kind,
            hop=hop,
            messages=len(each),
            mean=fmean(message.value for message in each),
            valuable=sum(message.value > EQUAL for message in each),
            decisive=sum(message.decisive for message in each),
            harmful=sum(message.value < -EQUAL for message in each),
            moot=sum(message.swayed is None for message in each),
            ticks=fmean(message.ticks for message in each),
        )
        for (mode, kind, hop), each in groups.items()
    ]
    return tuple(sorted(rows, key=lambda row: (row.mode, -row.mean, row.kind, row.hop)))


def by_mode(episodes: Sequence[EpisodeValues]) -> tuple[ModeValue, ...]:
    """Return statistics by mode over episodes with an identical null fork."""
    rows = []
    valid = [item for item in episodes if item.null.identical]
    for mode in dict.fromkeys(item.mode for item in valid):
        each = [item for item in valid if item.mode == mode]
        messages = [item.messages for item in each]
        rows.append(
            ModeValue(
                mode=mode,
                episodes=len(each),
                won=sum(item.success for item in each),
                messages=fmean(len(item) for item in messages),
                value=fmean(sum(message.value for message in item) for item in messages),
                decisive=fmean(sum(message.decisive for message in item) for item in messages),
                moot=_moot(messages),
                ticks=fmean(item.ticks for item in each),
                left_out=fmean(item.left_out for item in each),
            )
        )
    return tuple(sorted(rows, key=lambda row: row.mode))


def _moot(episodes: Sequence[Sequence[MessageValue]]) -> float:
    """Return the share of messages that no agent used."""
    every = [message for messages in episodes for message in messages]
    return fmean(message.swayed is None for message in every) if every else 0.0


def _hop(message: AdmittedMessage, instance: Instance) -> Hop:
    hub = instance.comms.hub
    if hub is None:
        return "to all"
    return "from hub" if message.sender == hub else "to hub"
