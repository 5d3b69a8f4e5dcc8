"""Figures of several episodes together: what the paper pools, balances or compares.

Rates over pictures and actions are pooled: counts are added up before they are divided. Infrastructure failures are
left out, as the paper leaves them out of all its figures of models. Of a trace only its `EpisodeCounts` are kept,
so that a thousand traces are never in memory at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import fmean

import msgspec

from lingjing.analysis.behaviour import BehaviourRates, JudgedAction, actions, by_tercile
from lingjing.analysis.detection import detect, ratio
from lingjing.analysis.families import FAMILIES, FailureFamily, attribute
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT


class EpisodeCounts(msgspec.Struct, frozen=True, kw_only=True):
    """What pools need of one episode. `retained` if it ended by itself; `hits` and `wrong` are true positives, and
    false positives and negatives over its aligned frames; `tokens` those of all model calls."""

    mission: str
    mode: str
    seed: int
    retained: bool
    success: bool
    hits: int
    wrong: int
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
        wrong=found.false_positives + found.false_negatives,
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


def f1(episodes: Iterable[EpisodeCounts]) -> float | None:
    """Detection F1 over the aligned frames of all episodes."""
    found = list(episodes)
    hits = sum(one.hits for one in found)
    return ratio(2 * hits, 2 * hits + sum(one.wrong for one in found))


def f1_domain_difference(simulated: Sequence[EpisodeCounts], real: Sequence[EpisodeCounts]) -> float | None:
    """F1 on real-style pictures less F1 on the matched simulator's: negative where they are harder.

    Raises `UsageError` if the two sets are not matched: the same missions, modes and seeds, equally often.
    """
    here, there = Counter(one.key for one in simulated), Counter(one.key for one in real)
    if here != there:
        mission, mode, seed = min((here - there) + (there - here))
        raise UsageError(f"the two sets are not matched: {mission} {mode} seed {seed} is not equally often in both")
    one, other = f1(simulated), f1(real)
    return None if one is None or other is None else other - one


def relative_cost(episodes: Iterable[EpisodeCounts], baseline: Iterable[EpisodeCounts]) -> float | None:
    """Prompt and completion tokens of all model calls over those of the baseline; None if the baseline has none."""
    return ratio(sum(one.tokens for one in episodes), sum(one.tokens for one in baseline))


def drift(episodes: Iterable[EpisodeCounts]) -> dict[str, BehaviourRates]:
    """Adherence, repetition, out of bounds and forgotten subgoals by tercile of each agent's actions, pooled."""
    return by_tercile(action for one in episodes if one.retained for action in one.actions)


def family_shares(episodes: Iterable[EpisodeCounts]) -> dict[FailureFamily, float] | None:
    """Of all retained failed episodes, the share of each failure family; None if none failed."""
    counted = Counter(one.family for one in episodes if one.family is not None)
    return {family: counted[family] / counted.total() for family in FAMILIES} if counted else None
