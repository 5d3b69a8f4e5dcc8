"""Figures of several traces together: what the paper pools, balances or compares.

Rates over pictures and actions are pooled: counts are added up before they are divided. Infrastructure failures are
left out, as the paper leaves them out of all its figures of models.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import fmean

from lingjing.analysis.behaviour import BehaviourRates, actions, by_tercile
from lingjing.analysis.detection import detect, ratio
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT

EpisodeKey = tuple[str, str, int]
"""Mission, mode and seed: what matched episodes have in common."""


def retained(traces: Iterable[Trace]) -> list[Trace]:
    """The traces of episodes that ended by themselves."""
    return [trace for trace in traces if trace.outcome is not None and trace.outcome.reason not in CUT_SHORT]


def tsr(traces: Iterable[Trace]) -> float | None:
    """Task success rate: the share of episodes in which every terminal condition was confirmed within the budget."""
    counted = [trace.outcome.success for trace in retained(traces) if trace.outcome is not None]
    return ratio(sum(counted), len(counted))


def macro_average(traces: Iterable[Trace]) -> float | None:
    """The task-balanced mean of TSR, which is first averaged across the two modes of a task that has two."""
    columns: dict[str, dict[str, list[Trace]]] = {}
    for trace in retained(traces):
        instance = trace.header.instance
        columns.setdefault(instance.mission, {}).setdefault(instance.mode, []).append(trace)
    tasks = [fmean(rate for one in modes.values() if (rate := tsr(one)) is not None) for modes in columns.values()]
    return fmean(tasks) if tasks else None


def f1(traces: Iterable[Trace]) -> float | None:
    """Detection F1 over the aligned frames of all traces."""
    found = [detect(trace) for trace in traces]
    hits = sum(one.true_positives for one in found)
    wrong = sum(one.false_positives + one.false_negatives for one in found)
    return ratio(2 * hits, 2 * hits + wrong)


def f1_domain_difference(simulated: Sequence[Trace], real: Sequence[Trace]) -> float | None:
    """F1 on real-style pictures less F1 on the matched simulator's: negative where they are harder.

    Raises `UsageError` if the two sets are not matched: the same missions, modes and seeds, equally often.
    """
    here, there = sorted(map(cell_of, simulated)), sorted(map(cell_of, real))
    if here != there:
        odd = next(iter(sorted(set(here) ^ set(there))), (here or there)[0])
        raise UsageError(f"the two sets are not matched: {odd[0]} {odd[1]} seed {odd[2]} is not equally often in both")
    one, other = f1(simulated), f1(real)
    return None if one is None or other is None else other - one


def relative_cost(traces: Iterable[Trace], baseline: Iterable[Trace]) -> float | None:
    """Prompt and completion tokens of all model calls over those of the baseline; None if the baseline has none."""
    return ratio(tokens(traces), tokens(baseline))


def tokens(traces: Iterable[Trace]) -> int:
    """All prompt and completion tokens of model calls."""
    spent = [
        made.decision.usage
        for trace in traces
        for record in trace.boundaries
        for made in record.decisions
        if made.decision.usage is not None
    ]
    return sum(usage.prompt_tokens + usage.completion_tokens for usage in spent)


def drift(traces: Iterable[Trace]) -> dict[str, BehaviourRates]:
    """Adherence, repetition, out of bounds and forgotten subgoals by tercile of each agent's actions, pooled."""
    return by_tercile(one for trace in retained(traces) for one in actions(trace))


def cell_of(trace: Trace) -> EpisodeKey:
    """What a trace is matched by."""
    instance = trace.header.instance
    return instance.mission, instance.mode, instance.seed
