"""Estimates of a suite's model calls, their price and their duration before it starts.

A policy that calls models estimates the calls of an episode by itself (`PolicyPlugin.estimate`); the sums over a suite
are made here. If rows of the same cell exist, their means replace the estimate. Three numbers are told: the usual
one, of episodes that end as early as the measured ones; that of episodes that use all of their ticks; and the upper
bound.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from lingjing.bench.planning import Player, SuiteCell
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import SuiteEpisode, cost_of
from lingjing.errors import UsageError
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.policy_files import PRICE_OPTIONS
from lingjing.plugins.calls import CallEstimate, CallSum, EpisodeShape
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import read_given_options

ANSWER_S = 5.0
"""Seconds in which a model answers, where nothing else is given. Chosen."""


@dataclass(frozen=True, slots=True)
class CostEstimate:
    """The estimated calls of one entrant's episodes."""

    entrant: str
    episodes: int
    """Number of episodes."""
    usual: CallSum
    """The calls if episodes end as early as the measured ones."""
    full: CallSum
    """The calls if episodes use all of their ticks."""
    most: CallSum
    """Upper bound."""
    ticks: float
    """Ticks of all usual episodes: so many answers follow each other."""
    work_s: float
    """CPU seconds of the usual episodes."""
    unmeasured: tuple[str, ...] = ()
    """Missions that were reckoned with the means of others."""

    def wall_s(self, jobs: int, answer_s: float) -> float:
        """Return the seconds of the usual episodes, `jobs` at a time."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return max((self.ticks * answer_s + self.work_s) / jobs, self.work_s / cores)


def prices_of(player: Player) -> tuple[float, float] | None:
    """Return US dollars per million tokens of prompt and answer, or None if a price is unknown. The entrant's options
    have priority, then the listed model, then the defaults of the policy's options.
    """
    own = [player.args.get(name) for name in PRICE_OPTIONS]
    listed = (player.model.price_in, player.model.price_out) if player.model else player.declared.prices
    price_in, price_out = (
        float(price) if isinstance(price, int | float | str) else usual
        for price, usual in zip(own, listed, strict=True)
    )
    return None if price_in is None or price_out is None else (price_in, price_out)


def is_paid(player: Player) -> bool:
    """Return whether the entrant's calls may cost money; an unknown price counts as one."""
    return player.declared.calls and prices_of(player) != (0.0, 0.0)


def check_ready(players: Sequence[Player], max_cost: float | None) -> None:
    """Raise `UsageError` if the key of a model is missing, or if a cost limit is set and prices are unknown."""
    keys: dict[str, list[str]] = {}
    for player in players:
        usual = player.model.key_variable if player.model else ""
        variable = str(player.args.get("api_key_env", usual))
        if variable and not os.environ.get(variable):
            keys.setdefault(variable, []).append(player.name)
    if keys:
        listed = "; ".join(f"{', '.join(names)}: {variable} is not set" for variable, names in keys.items())
        raise UsageError(
            f"models cannot be called: {listed}", hint="export the keys, or choose other entrants with --entrants"
        )
    unknown = [player.name for player in players if is_paid(player) and prices_of(player) is None]
    if unknown and max_cost is not None:
        raise UsageError(
            f"--max-cost needs prices, and those of {', '.join(unknown)} are unknown",
            hint="set the args price_in and price_out (US dollars per million tokens), or list the models in a file of "
            "your own (LINGJING_MODELS=FILE; a file in the arg `models` is read by the policy alone)",
        )


def estimates(
    episodes: Sequence[SuiteEpisode], missions: Mapping[str, Mission], rows: Sequence[SuiteRow], host: PluginHost
) -> list[CostEstimate]:
    """Return the estimate of each entrant that calls models.

    `missions` are the missions by name; `rows` are earlier results, which replace the estimate of their cells; `host`
    knows the policies.
    """
    measured: dict[tuple[str, str, str, str], list[SuiteRow]] = {}
    for row in rows:
        if row.standing == "counted" and row.report.metrics is not None:
            measured.setdefault(row.cell, []).append(row)
    numbers = Counter(id(episode.cell) for episode in episodes)
    cells = {id(episode.cell): episode.cell for episode in episodes}
    result = []
    for name in dict.fromkeys(cell.player.name for cell in cells.values()):
        own = [(cell, numbers[at]) for at, cell in cells.items() if cell.player.name == name]
        if own[0][0].player.declared.calls:
            result.append(_of_entrant(name, own, missions, measured, host))
    return result


def cost_lines(listed: Sequence[CostEstimate], jobs: int = 1, answer_s: float = ANSWER_S) -> Iterator[str]:
    """Yield one line per entrant, the total, and the assumptions; nothing if there are no estimates."""
    for estimate in listed:
        hours = f"{estimate.wall_s(jobs, answer_s) / 3600.0:,.1f} h"
        yield (
            f"{estimate.entrant}: {estimate.episodes} episodes, about {_in_words(estimate.usual)}, {hours}; "
            f"if all ticks are used {_in_words(estimate.full)}; at most {_in_words(estimate.most)}"
        )
    if len(listed) > 1:
        sums = [add_calls(*(getattr(estimate, name) for estimate in listed)) for name in ("usual", "full", "most")]
        yield "together about {}; if all ticks are used {}; at most {}".format(*map(_in_words, sums))
    if listed:
        others = sorted({mission for estimate in listed for mission in estimate.unmeasured})
        rest = f"; not measured, reckoned with the means of the others: {', '.join(others)}" if others else ""
        yield (
            f"reckoned from one measured episode of each column, with {answer_s:g} s an answer and {jobs} at a time "
            f"(--answer-s, -j); at most: repairs, full requests, longest answers{rest}"
        )


def add_calls(*sums: CallSum) -> CallSum:
    """Return the sum. Its price leaves out the parts of unknown price, and is unknown if all are."""
    known = [part.cost_usd for part in sums if part.cost_usd is not None]
    return CallSum(
        calls=sum(part.calls for part in sums),
        prompt_tokens=sum(part.prompt_tokens for part in sums),
        cached_tokens=sum(part.cached_tokens for part in sums),
        completion_tokens=sum(part.completion_tokens for part in sums),
        cost_usd=sum(known) if known or not sums else None,
    )


def _of_entrant(
    name: str,
    cells: Sequence[tuple[SuiteCell, int]],
    missions: Mapping[str, Mission],
    measured: Mapping[tuple[str, str, str, str], Sequence[SuiteRow]],
    host: PluginHost,
) -> CostEstimate:
    parts = [(_of_cell(cell, missions, measured.get(cell.key, ()), host), number) for cell, number in cells]
    sums = {
        kind: add_calls(*(_times(getattr(estimate, kind), number) for estimate, number in parts))
        for kind in ("usual", "full", "most")
    }
    return CostEstimate(
        name,
        sum(number for _, number in cells),
        **sums,
        ticks=sum(estimate.ticks * number for estimate, number in parts),
        work_s=sum(estimate.work_s * number for estimate, number in parts),
        unmeasured=tuple(
            dict.fromkeys(
                cell.column.mission
                for (cell, _), (estimate, _) in zip(cells, parts, strict=True)
                if not estimate.measured
            )
        ),
    )


def _of_cell(
    cell: SuiteCell, missions: Mapping[str, Mission], rows: Sequence[SuiteRow], host: PluginHost
) -> CallEstimate:
    """Return the estimate of one episode of the cell."""
    column = cell.column
    instance = instantiate(
        missions[column.mission],
        seed=0,
        mode=column.mode,
        settings=column.settings,
        tier=column.tier,
        language=column.language,
    )
    plugin = host.policy(cell.player.policy)
    if plugin.estimate is None:
        return _without_estimate(instance, cell.player)
    shape = EpisodeShape(
        mission=column.mission, mode=column.mode, ticks=instance.budget.ticks, roles=_asked_roles(instance, cell.player)
    )
    estimate: CallEstimate = plugin.estimate(read_given_options(plugin, cell.args), shape)
    return _as_rows(estimate, rows) if rows else estimate


def _asked_roles(instance: Instance, player: Player) -> dict[str, int]:
    """Return the number of agents by role, without those that another policy plays."""
    others = {*player.policies_for}
    names = ((agent.role, {agent.id, agent.role, agent.id.partition("[")[0]}) for agent in instance.agents)
    return dict(Counter(role for role, own in names if not own & others))


def _without_estimate(instance: Instance, player: Player) -> CallEstimate:
    """Return the estimate of a policy that declares none: one call of each agent at each tick, at an unknown price."""
    calls = CallSum(calls=sum(_asked_roles(instance, player).values()) * instance.budget.ticks, cost_usd=None)
    return CallEstimate(usual=calls, full=calls, most=calls, ticks=instance.budget.ticks, measured=False)


def _as_rows(estimate: CallEstimate, rows: Sequence[SuiteRow]) -> CallEstimate:
    """Return the estimate with the means of played episodes as the usual ones."""
    metrics = [row.report.metrics for row in rows if row.report.metrics is not None]
    usual = CallSum(
        calls=sum(metric.calls for metric in metrics) / len(rows),
        prompt_tokens=sum(metric.tokens for metric in metrics) / len(rows),  # including the tokens of answers
        cost_usd=sum(map(cost_of, rows)) / len(rows),
    )
    return CallEstimate(
        usual=usual, full=estimate.full, most=estimate.most, ticks=0.0,
        work_s=sum(row.wall_s for row in rows) / len(rows), measured=True,
    )  # fmt: skip


def _times(part: CallSum, number: int) -> CallSum:
    return CallSum(
        calls=part.calls * number,
        prompt_tokens=part.prompt_tokens * number,
        cached_tokens=part.cached_tokens * number,
        completion_tokens=part.completion_tokens * number,
        cost_usd=None if part.cost_usd is None else part.cost_usd * number,
    )


def _in_words(part: CallSum) -> str:
    """Return calls and price: `1,200 calls, $3.40`."""
    price = "at an unknown price" if part.cost_usd is None else f"${part.cost_usd:,.2f}"
    return f"{part.calls:,.0f} calls, {price}"


__all__ = [
    "ANSWER_S", "CostEstimate", "add_calls", "check_ready", "cost_lines", "estimates", "is_paid", "prices_of"
]  # fmt: skip
