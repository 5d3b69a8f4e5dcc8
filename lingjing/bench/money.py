"""What a suite's calls of models will cost, reckoned before it is started.

An episode makes at most one decision for each agent and tick of its budget. The usual prompt of `react` takes
`TEXT_TOKENS` beside its pictures (measured: 2,700 to 5,300 in the missions that ship); where rows of the same cell are
there already, what they cost is the estimate instead. The bound counts every decision with all of its repairs, a prompt
that fills the context and the longest answer.
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
ANSWER_TOKENS = 400
PICTURES = 2
CONTEXT_TOKENS = 16_384
"""The context that the paper gives open models; a prompt is counted as no longer than this."""

LONGEST_ANSWER = 2_048
REPAIRS = 1


@dataclass(frozen=True, slots=True)
class CostEstimate:
    """What the episodes of one entrant will cost: calls at most, US dollars as usual and at most."""

    entrant: str
    episodes: int
    calls: int
    about_usd: float
    most_usd: float


def prices_of(player: Player) -> tuple[float, float] | None:
    """US dollars per million tokens in and out; None where one is not known. Options of the entrant count first."""
    given = [player.args.get(name) for name in ("price_in", "price_out")]
    listed = (player.model.price_in, player.model.price_out) if player.model else (None, None)
    price_in, price_out = (
        float(told) if isinstance(told, int | float | str) else known for told, known in zip(given, listed, strict=True)
    )
    return None if price_in is None or price_out is None else (price_in, price_out)


def is_paid(player: Player) -> bool:
    """Whether its calls cost money, as far as anybody knows: a price that is not known may be any."""
    return player.declared.calls and prices_of(player) != (0.0, 0.0)


def check_ready(players: Sequence[Player], max_cost: float | None) -> None:
    """Raise `UsageError` where a model's key is missing, or money is to be capped and prices are not known."""
    keys: dict[str, list[str]] = {}
    for player in players:
        usual = player.model.key_variable if player.model else ""
        variable = str(player.args.get("api_key_env", usual))
        if variable and not os.environ.get(variable):
            keys.setdefault(variable, []).append(player.name)
    if keys:
        told = "; ".join(f"{', '.join(names)}: {variable} is not set" for variable, names in keys.items())
        raise UsageError(f"models cannot be asked: {told}", hint="export the keys, or leave these out with --entrants")
    unknown = [player.name for player in players if is_paid(player) and prices_of(player) is None]
    if unknown and max_cost is not None:
        raise UsageError(
            f"money cannot be capped: the prices of {', '.join(unknown)} are not known",
            hint="give them as args price_in and price_out (US dollars per million tokens), or in your own list of "
            "models (LINGJING_MODELS=FILE; one that an arg `models` names is read by the policy alone)",
        )


def estimates(
    episodes: Sequence[SuiteEpisode], missions: Mapping[str, Mission], rows: Sequence[SuiteRow]
) -> list[CostEstimate]:
    """What the episodes of each entrant whose calls cost money will cost; nan where its prices are not known."""
    measured: dict[tuple[str, str, str, str], list[float]] = {}
    for row in rows:
        if row.standing == "counted":
            measured.setdefault(row.cell, []).append(cost_of(row))
    cells = {id(episode.cell): episode.cell for episode in episodes}
    decisions = {at: _decisions(cell, missions) for at, cell in cells.items()}
    found = []
    for name in dict.fromkeys(episode.cell.player.name for episode in episodes):
        own = [episode.cell for episode in episodes if episode.cell.player.name == name]
        if is_paid(own[0].player):
            calls = [decisions[id(cell)] for cell in own]
            about = sum(_about(cell, number, measured) for cell, number in zip(own, calls, strict=True))
            longest = [number * _calls_of_decision(cell) for cell, number in zip(own, calls, strict=True)]
            most = sum(number * _most(cell) for cell, number in zip(own, longest, strict=True))
            found.append(CostEstimate(name, len(own), sum(longest), about, most))
    return found


def in_words(found: Sequence[CostEstimate]) -> Iterator[str]:
    """A line for each entrant, what all of them cost together, and how that is reckoned; nothing of none."""
    for one in found:
        known = not math.isnan(one.most_usd)
        cost = f": about ${one.about_usd:,.2f}, at most ${one.most_usd:,.2f}" if known else "; its price is not known"
        yield f"{one.entrant}: {one.episodes} episodes, at most {one.calls:,} calls{cost}"
    if found:
        priced = [one for one in found if not math.isnan(one.most_usd)]
        about, most = sum(one.about_usd for one in priced), sum(one.most_usd for one in priced)
        rest = " without those whose price is not known" if len(priced) < len(found) else ""
        yield f"together about ${about:,.2f}, at most ${most:,.2f}{rest}"
        yield (
            f"reckoned with a decision of every agent at every tick, {TEXT_TOKENS:,} tokens of text and {PICTURES} "
            f"pictures a prompt, {ANSWER_TOKENS} tokens an answer; at most: repairs, full contexts, longest answers"
        )


def _decisions(cell: SuiteCell, missions: Mapping[str, Mission]) -> int:
    """How often the agents of an episode decide at most."""
    column = cell.column
    instance = instantiate(missions[column.mission], seed=0, mode=column.mode, settings=column.settings)
    return len(instance.agents) * instance.budget.ticks


def _calls_of_decision(cell: SuiteCell) -> int:
    """The calls of one decision at most: the first, its repairs, closer looks at its pictures."""
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
    """An option that is a whole number, however the suite spells it."""
    told = cell.args.get(name, usual)
    return int(told) if isinstance(told, int | float | str) else usual


def _usd(cell: SuiteCell, prompt: int, answer: int) -> float:
    prices = prices_of(cell.player)
    return math.nan if prices is None else (prompt * prices[0] + answer * prices[1]) / 1e6


__all__ = ["CostEstimate", "check_ready", "estimates", "in_words", "is_paid", "prices_of"]
