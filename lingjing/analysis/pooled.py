"""Figures of several episodes together: what the paper pools, balances or compares.

Rates over pictures and actions are pooled: counts are added up before they are divided. Infrastructure failures are
left out, as the paper leaves them out of all its figures of models. Of a trace only its `EpisodeCounts` are kept,
so that a thousand traces are never in memory at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import fmean, median

import msgspec

from lingjing.analysis.behaviour import BehaviourRates, JudgedAction, actions, by_tercile
from lingjing.analysis.detection import PerceptionCounts, calibration_error, detect, ratio
from lingjing.analysis.families import FAMILIES, FailureFamily, attribute
from lingjing.analysis.metrics import stages_of
from lingjing.analysis.repetition import target_events
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT


class EpisodeCounts(msgspec.Struct, frozen=True, kw_only=True):
    """What pools need of one episode. `retained` if it ended by itself; `tokens` are those of all model calls.

    Over its aligned frames: `hits`, `false` and `missed` are true positives, false positives and false negatives.
    `repeated` of `events` are target events; `stages` say of each stage whether it and all before it are complete.
    """

    mission: str
    mode: str
    seed: int
    retained: bool
    success: bool
    hits: int
    false: int
    missed: int
    perceived: PerceptionCounts
    events: int
    repeated: int
    stages: tuple[tuple[str, bool], ...]
    tokens: int
    actions: tuple[JudgedAction, ...]
    family: FailureFamily | None

    @property
    def key(self) -> tuple[str, str, int]:
        """What matched episodes have in common: mission, mode, seed."""
        return self.mission, self.mode, self.seed


def counts_of(trace: Trace) -> EpisodeCounts:
    """The counts of one trace."""
    instance, outcome = trace.header.instance, trace.outcome
    found, attributed = detect(trace), attribute(trace)
    repeated, events = target_events(trace)
    spent = [
        made.decision.usage
        for record in trace.boundaries
        for made in record.decisions
        if made.decision.usage is not None
    ]
    return EpisodeCounts(
        mission=instance.mission,
        mode=instance.mode,
        seed=instance.seed,
        retained=outcome is not None and outcome.reason not in CUT_SHORT,
        success=outcome is not None and outcome.success,
        hits=found.true_positives,
        false=found.false_positives,
        missed=found.false_negatives,
        perceived=found.counts,
        events=events,
        repeated=repeated,
        stages=tuple((stage.name, stage.cumulative) for stage in stages_of(trace)),
        tokens=sum(usage.prompt_tokens + usage.completion_tokens for usage in spent),
        actions=actions(trace),
        family=None if attributed is None else attributed.family,
    )


def tsr(episodes: Iterable[EpisodeCounts]) -> float | None:
    """Task success rate: the share of episodes in which every terminal condition was confirmed within the budget."""
    counted = [one.success for one in episodes if one.retained]
    return ratio(sum(counted), len(counted))


def macro_average(episodes: Iterable[EpisodeCounts]) -> float | None:
    """The task-balanced mean of TSR, which is first averaged across the two modes of a task that has two."""
    columns: dict[str, dict[str, list[EpisodeCounts]]] = {}
    for one in episodes:
        if one.retained:
            columns.setdefault(one.mission, {}).setdefault(one.mode, []).append(one)
    tasks = [fmean(rate for one in modes.values() if (rate := tsr(one)) is not None) for modes in columns.values()]
    return fmean(tasks) if tasks else None


class PerceptionRates(msgspec.Struct, frozen=True, kw_only=True):
    """What the paper says of perception, over the aligned frames and reports of several episodes; None over none."""

    precision: float | None
    recall: float | None
    f1: float | None
    miss_rate: float | None
    hallucination_rate: float | None
    confusion_rate: float | None
    localisation_error_m: float | None
    calibration_error: float | None


def perception(episodes: Iterable[EpisodeCounts]) -> PerceptionRates:
    """The rates of pooled frames and reports: "pools the retained frames, actions, and messages"."""
    kept = [one for one in episodes if one.retained]
    told = [one.perceived for one in kept]
    frames, hits = sum(one.frames for one in told), sum(one.hits for one in kept)
    false, missed = sum(one.false for one in kept), sum(one.missed for one in kept)
    errors = [error for one in told for error in one.errors_m]
    return PerceptionRates(
        precision=ratio(hits, hits + false),
        recall=ratio(hits, hits + missed),
        f1=ratio(2 * hits, 2 * hits + false + missed),
        miss_rate=ratio(sum(one.missing for one in told), frames),
        hallucination_rate=ratio(sum(one.hallucinating for one in told), frames),
        confusion_rate=ratio(sum(one.confusing for one in told), frames),
        localisation_error_m=median(errors) if errors else None,
        calibration_error=calibration_error([said for one in told for said in one.confidences]),
    )


def f1(episodes: Iterable[EpisodeCounts]) -> float | None:
    """Detection F1 over the aligned frames of all retained episodes."""
    return perception(episodes).f1


def repeated_target_rate(episodes: Iterable[EpisodeCounts]) -> float | None:
    """Rep: "Number of repeated target events divided by all valid target events in the matched episodes"."""
    kept = [one for one in episodes if one.retained]
    return ratio(sum(one.repeated for one in kept), sum(one.events for one in kept))


def cumulative_stages(episodes: Iterable[EpisodeCounts]) -> dict[str, dict[str, float]]:
    """Cumulative stage success by mission and stage: the share of its episodes "that complete every task stage up to
    and including the reported stage"."""
    told: dict[str, dict[str, list[bool]]] = {}
    for one in episodes:
        for name, complete in one.stages if one.retained else ():
            told.setdefault(one.mission, {}).setdefault(name, []).append(complete)
    return {mission: {name: fmean(done) for name, done in stages.items()} for mission, stages in told.items()}


def f1_domain_difference(simulated: Sequence[EpisodeCounts], real: Sequence[EpisodeCounts]) -> float | None:
    """F1 on real-style pictures less F1 on the matched simulator's: negative where they are harder.

    Raises `UsageError` if the two sets are not matched: the same missions, modes and seeds, equally often, those that
    were cut short left out.
    """
    here, there = (Counter(one.key for one in some if one.retained) for some in (simulated, real))
    if here != there:
        mission, mode, seed = min((here - there) + (there - here))
        raise UsageError(f"the two sets are not matched: {mission} {mode} seed {seed} is not equally often in both")
    one, other = f1(simulated), f1(real)
    return None if one is None or other is None else other - one


def relative_cost(episodes: Iterable[EpisodeCounts], baseline: Iterable[EpisodeCounts]) -> float | None:
    """Prompt and completion tokens of all model calls, a retained episode, over those of the baseline: of as many
    episodes the totals' ratio. None if the baseline has none, or nothing is retained."""
    here, there = ([one.tokens for one in some if one.retained] for some in (episodes, baseline))
    return ratio(fmean(here), fmean(there)) if here and there else None


def drift(episodes: Iterable[EpisodeCounts]) -> dict[str, BehaviourRates]:
    """Adherence, repetition, out of bounds and forgotten subgoals by tercile of each agent's actions, pooled."""
    return by_tercile(action for one in episodes if one.retained for action in one.actions)


def family_shares(episodes: Iterable[EpisodeCounts]) -> dict[FailureFamily, float] | None:
    """Of all retained failed episodes, the share of each failure family; None if none failed."""
    counted = Counter(one.family for one in episodes if one.family is not None)
    return {family: counted[family] / counted.total() for family in FAMILIES} if counted else None
