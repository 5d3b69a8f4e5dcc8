"""Counted budgets and allowances: what a command or a message uses up, and who has nothing left.

A limit counts what the kernel admits, in policy order; the candidate that would pass the bound is refused as `limit`.
A limit inside a stage counts from the stage's beginning until it is done for everybody. An agent that has spent its
tokens or money, or when all together have, is not asked any more: its decisions are no-ops with the reason `allowance`;
a message beyond an allowance of messages is refused with that reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from lingjing.kernel.progress import EpisodeProgress, Spent
from lingjing.kernel.registry import Registry
from lingjing.mission.instance import Allowance, Budget, Instance, LimitSpec
from lingjing.trace.records import DecisionRecord

ALLOWANCE = "allowance"
"""The reason code of what a spent allowance prevents."""

LIMIT = "limit"
"""The reason code of what a counted budget prevents."""


def limit_key(limit: LimitSpec) -> str:
    """What a limit is counted under."""
    return f"{limit.stage}.{limit.name}" if limit.stage else limit.name


class Budgets:
    """The counted budgets and allowances of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._limits = instance.limits
        self._whole = instance.budget
        self._own = {agent.id: agent.budget for agent in instance.agents if agent.budget is not None}

    def tally(self, registry: Registry) -> Tally:
        """A fresh count for the candidates of one boundary."""
        running = tuple(limit for limit in self._limits if not limit.stage or _is_running(limit.stage, registry))
        return Tally(self, running, dict(registry.progress.used), dict(registry.progress.spent))

    def exhausted(self, progress: EpisodeProgress, agents: Iterable[str]) -> dict[str, str]:
        """The agents that have nothing left to think with, and which bound says so."""
        whole = self._model_bound(self._whole, _total(progress.spent))
        found: dict[str, str] = {}
        for agent in agents:
            own = self._own.get(agent)
            bound = self._model_bound(own, progress.spent.get(agent, Spent())) if own is not None else ""
            if bound or whole:
                found[agent] = f"`{agent}` has spent its {bound}" if bound else f"all together have spent their {whole}"
        return found

    def spend(self, progress: EpisodeProgress, decisions: Iterable[DecisionRecord]) -> EpisodeProgress:
        """The progress with what the decisions' model calls have cost."""
        paid = [(made.agent, made.decision.usage) for made in decisions if made.decision.usage is not None]
        if not paid:
            return progress
        spent = dict(progress.spent)
        for agent, usage in paid:
            before = spent.get(agent, Spent())
            spent[agent] = replace(
                before,
                tokens=before.tokens + usage.prompt_tokens + usage.completion_tokens,
                money_usd=before.money_usd + usage.cost_usd,
            )
        return replace(progress, spent=spent)

    def no_messages_left(self, sender: str, spent: Mapping[str, Spent]) -> str:
        """Which allowance of messages the sender has used up, or ""."""
        own = self._own.get(sender)
        if own is not None and own.messages is not None and spent.get(sender, Spent()).messages >= own.messages:
            return f"`{sender}` may send {own.messages} messages in all"
        if self._whole.messages is not None and _total(spent).messages >= self._whole.messages:
            return f"all together may send {self._whole.messages} messages"
        return ""

    def _model_bound(self, bound: Budget | Allowance | None, spent: Spent) -> str:
        if bound is None:
            return ""
        if bound.tokens is not None and spent.tokens >= bound.tokens:
            return f"{bound.tokens} tokens"
        if bound.money_usd is not None and spent.money_usd >= bound.money_usd:
            return f"{bound.money_usd:g} US dollars"
        return ""


@dataclass(slots=True)
class Tally:
    """The counts while one boundary's candidates are looked at in their order."""

    budgets: Budgets
    limits: tuple[LimitSpec, ...]
    used: dict[str, int]
    spent: dict[str, Spent]

    def command(self, resource: str, verb: str) -> str:
        """What forbids one more command like this, or ""."""
        return self._forbidden([limit for limit in self.limits if _counts_command(limit, resource, verb)])

    def message(self, sender: str, kind: str) -> tuple[str, str]:
        """Reason code and sentence of what forbids one more message like this, or two empty strings."""
        detail = self._forbidden([limit for limit in self.limits if _counts_message(limit, kind)])
        if detail:
            return LIMIT, detail
        detail = self.budgets.no_messages_left(sender, self.spent)
        return (ALLOWANCE, detail) if detail else ("", "")

    def take_command(self, resource: str, verb: str) -> None:
        """Count an admitted command."""
        self._take([limit for limit in self.limits if _counts_command(limit, resource, verb)])

    def take_message(self, sender: str, kind: str) -> None:
        """Count an admitted message."""
        self._take([limit for limit in self.limits if _counts_message(limit, kind)])
        before = self.spent.get(sender, Spent())
        self.spent[sender] = replace(before, messages=before.messages + 1)

    def onto(self, progress: EpisodeProgress) -> EpisodeProgress:
        """The progress with these counts."""
        return replace(progress, used=self.used, spent=self.spent)

    def _forbidden(self, limits: Iterable[LimitSpec]) -> str:
        for limit in limits:
            if self.used.get(limit_key(limit), 0) >= limit.most:
                return f"the limit `{limit.name}` of {limit.most} is used up"
        return ""

    def _take(self, limits: Iterable[LimitSpec]) -> None:
        for limit in limits:
            key = limit_key(limit)
            self.used[key] = self.used.get(key, 0) + 1


def _counts_command(limit: LimitSpec, resource: str, verb: str) -> bool:
    return any(
        item.kind == "command" and item.resource == resource and item.name in ("", verb) for item in limit.counts
    )


def _counts_message(limit: LimitSpec, kind: str) -> bool:
    return any(item.kind == "message" and item.name == kind for item in limit.counts)


def _is_running(stage: str, registry: Registry) -> bool:
    """Whether a stage has begun for somebody and is not done for everybody who began it."""
    begun = [subject for name, subject in registry.progress.began if name == stage]
    return any((stage, subject) not in registry.stages for subject in begun)


def _total(spent: Mapping[str, Spent]) -> Spent:
    return Spent(
        tokens=sum(one.tokens for one in spent.values()),
        money_usd=sum(one.money_usd for one in spent.values()),
        messages=sum(one.messages for one in spent.values()),
    )
