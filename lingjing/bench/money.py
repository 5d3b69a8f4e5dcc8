"""Estimates of a suite's model costs before it starts.

An episode makes at most one decision per agent and tick of its budget. The usual prompt of `react` has `TEXT_TOKENS`
tokens besides its pictures (measured: 2,700 to 5,300 in the shipped missions). If rows of the same cell exist, the
estimate is their mean cost. The upper bound counts every decision with all of its repairs, a prompt that fills the
context and the longest answer.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from lingjing.bench.planning import Player, SuiteCell
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import SuiteEpisode, cost_of
from lingjing.errors import UsageError
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission

TEXT_TOKENS = 4_000
"""Tokens of text in a usual prompt; the middle of the measured range above."""

ANSWER_TOKENS = 400
"""Tokens of a usual answer. Chosen."""

PICTURES = 2
"""Pictures in a usual prompt. Chosen."""

CONTEXT_TOKENS = 16_384
"""The context length of open models in the paper, tokens; no prompt counts as longer."""

LONGEST_ANSWER = 2_048
"""The default limit of an answer, tokens."""

REPAIRS = 1
"""The default number of repairs of an invalid answer."""


@dataclass(frozen=True, slots=True)
class CostEstimate:
    """The estimated cost of one entrant's episodes."""

    entrant: str
    episodes: int
    """Number of episodes."""
    calls: int
    """The greatest possible number of model calls."""
    about_usd: float
    """Expected cost, US dollars; nan if the prices are unknown."""
    most_usd: float
    """Upper bound of the cost, US dollars; nan if the prices are unknown."""


def prices_of(player: Player) -> tuple[float, float] | None:
    """Return US dollars per million tokens of prompt and answer, or None if a price is unknown. The entrant's options
    have priority.
    """
    own = [player.args.get(name) for name in ("price_in", "price_out")]
    listed = (player.model.price_in, player.model.price_out) if player.model else (None, None)
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
    episodes: Sequence[SuiteEpisode], missions: Mapping[str, Mission], rows: Sequence[SuiteRow]
) -> list[CostEstimate]:
    """Return the estimate of each entrant with paid calls.

    `missions` are the missions by name; `rows` are earlier results, which replace the estimate of their cells.
    """
    measured: dict[tuple[str, str, str, str], list[float]] = {}
    for row in rows:
        if row.standing == "counted":
            measured.setdefault(row.cell, []).append(cost_of(row))
    cells = {id(episode.cell): episode.cell for episode in episodes}
    decisions = {at: _decisions(cell, missions) for at, cell in cells.items()}
    result = []
    for name in dict.fromkeys(episode.cell.player.name for episode in episodes):
        own = [episode.cell for episode in episodes if episode.cell.player.name == name]
        if is_paid(own[0].player):
            calls = [decisions[id(cell)] for cell in own]
            about = sum(_about(cell, number, measured) for cell, number in zip(own, calls, strict=True))
            longest = [number * _calls_of_decision(cell) for cell, number in zip(own, calls, strict=True)]
            most = sum(number * _most(cell) for cell, number in zip(own, longest, strict=True))
            result.append(CostEstimate(name, len(own), sum(longest), about, most))
    return result


def cost_lines(listed: Sequence[CostEstimate]) -> Iterator[str]:
    """Yield one line per entrant, the total, and the assumptions; nothing if there are no estimates."""
    for estimate in listed:
        known = not math.isnan(estimate.most_usd)
        cost = (
            f": about ${estimate.about_usd:,.2f}, at most ${estimate.most_usd:,.2f}"
            if known
            else "; its price is unknown"
        )
        yield f"{estimate.entrant}: {estimate.episodes} episodes, at most {estimate.calls:,} calls{cost}"
    if listed:
        priced = [estimate for estimate in listed if not math.isnan(estimate.most_usd)]
        about, most = sum(estimate.about_usd for estimate in priced), sum(estimate.most_usd for estimate in priced)
        rest = " without entrants of unknown price" if len(priced) < len(listed) else ""
        yield f"together about ${about:,.2f}, at most ${most:,.2f}{rest}"
        yield (
            f"assumed: a decision of every agent at every tick, {TEXT_TOKENS:,} tokens of text and {PICTURES} pictures "
            f"per prompt, {ANSWER_TOKENS} tokens per answer; at most: repairs, full contexts, longest answers"
        )


def _decisions(cell: SuiteCell, missions: Mapping[str, Mission]) -> int:
    """Return the greatest number of decisions of an episode."""
    column = cell.column
    instance = instantiate(
        missions[column.mission], seed=0, mode=column.mode, settings=column.settings, tier=column.tier
    )
    return len(instance.agents) * instance.budget.ticks


def _calls_of_decision(cell: SuiteCell) -> int:
    """Return the greatest number of calls per decision: the first, its repairs, and closer looks at its pictures."""
    return 1 + _whole(cell, "repairs", REPAIRS) + _whole(cell, "crops", 0)


def _about(cell: SuiteCell, decisions: int, measured: Mapping[tuple[str, str, str, str], Sequence[float]]) -> float:
    before = measured.get(cell.key)
    if before:
        return sum(before) / len(before)
    model = cell.player.model
    pictures = PICTURES * (model.image_tokens if model else 0)
    return decisions * _usd(cell, min(TEXT_TOKENS + pictures, CONTEXT_TOKENS), ANSWER_TOKENS)


def _most(cell: SuiteCell) -> float:
    return _usd(cell, CONTEXT_TOKENS, _whole(cell, "max_tokens", LONGEST_ANSWER))


def _whole(cell: SuiteCell, name: str, usual: int) -> int:
    """Return an option that is a whole number; the suite may write it as a text."""
    value = cell.args.get(name, usual)
    return int(value) if isinstance(value, int | float | str) else usual


def _usd(cell: SuiteCell, prompt: int, answer: int) -> float:
    prices = prices_of(cell.player)
    return math.nan if prices is None else (prompt * prices[0] + answer * prices[1]) / 1e6


__all__ = ["CostEstimate", "check_ready", "cost_lines", "estimates", "is_paid", "prices_of"]
