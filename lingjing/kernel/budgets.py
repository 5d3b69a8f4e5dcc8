"""Counted budgets and allowances: the consumption of commands and messages, and the agents without a remainder.

A limit counts admitted commands and messages in policy order. The candidate that would exceed it is rejected as
`limit`. A limit inside a stage counts from the stage's beginning until it is done for all subjects. An agent is not
called any more when it has spent its own tokens or money, or when all agents together have spent theirs. Its decisions
are then no-ops with the reason `allowance`; a message beyond an allowance of messages is rejected with that reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from lingjing.kernel.progress import EpisodeProgress, Spent
from lingjing.kernel.registry import Registry
from lingjing.mission.instance import Allowance, Budget, Instance, LimitSpec
from lingjing.sums import total
from lingjing.trace.records import DecisionRecord

ALLOWANCE = "allowance"
"""The reason code of a rejection or no-op because of a spent allowance."""

LIMIT = "limit"
"""The reason code of a rejection because of a counted budget."""


def limit_key(limit: LimitSpec) -> str:
    """Return the key under which a limit is counted: `stage.name`, or `name` for the whole episode."""
    return f"{limit.stage}.{limit.name}" if limit.stage else limit.name


class Budgets:
    """The counted budgets and allowances of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._limits = instance.limits
        self._whole = instance.budget
        self._own = {agent.id: agent.budget for agent in instance.agents if agent.budget is not None}

    def tally(self, registry: Registry) -> Tally:
        """Return the counter for the candidates of one boundary."""
        running = tuple(limit for limit in self._limits if not limit.stage or _is_running(limit.stage, registry))
        return Tally(self, running, dict(registry.progress.used), dict(registry.progress.spent))

    def exhausted(self, progress: EpisodeProgress, agents: Iterable[str]) -> dict[str, str]:
        """Return the agents that may not call models any more, with the bound that they have reached."""
        whole = self._model_bound(self._whole, _total(progress.spent))
        reasons: dict[str, str] = {}
        for agent in agents:
            own = self._own.get(agent)
            bound = self._model_bound(own, progress.spent.get(agent, Spent())) if own is not None else ""
            if bound or whole:
                reasons[agent] = (
                    f"`{agent}` has spent its {bound}" if bound else f"all together have spent their {whole}"
                )
        return reasons

    def spend(self, progress: EpisodeProgress, decisions: Iterable[DecisionRecord]) -> EpisodeProgress:
        """Return the progress with the cost of the decisions' model calls."""
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
        """Describe the allowance of messages that the sender has used up; "" if there is none."""
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
    """The counts while the candidates of one boundary are validated in order."""

    budgets: Budgets
    """The budgets and allowances that are counted."""
    limits: tuple[LimitSpec, ...]
    """The limits that apply at this boundary."""
    used: dict[str, int]
    """The count of each limit, by `limit_key`."""
    spent: dict[str, Spent]
    """The consumption of each agent."""

    def command(self, resource: str, verb: str) -> str:
        """Describe the limit that forbids one more such command; "" if none does."""
        return self._forbidden([limit for limit in self.limits if _counts_command(limit, resource, verb)])

    def message(self, sender: str, kind: str) -> tuple[str, str]:
        """Return the reason code and description of the limit that forbids one more such message, or two empty
        strings.
        """
        detail = self._forbidden([limit for limit in self.limits if _counts_message(limit, kind)])
        if detail:
            return LIMIT, detail
        detail = self.budgets.no_messages_left(sender, self.spent)
        return (ALLOWANCE, detail) if detail else ("", "")

    def count_command(self, resource: str, verb: str) -> None:
        """Count an admitted command."""
        self._take([limit for limit in self.limits if _counts_command(limit, resource, verb)])

    def count_message(self, sender: str, kind: str) -> None:
        """Count an admitted message."""
        self._take([limit for limit in self.limits if _counts_message(limit, kind)])
        before = self.spent.get(sender, Spent())
        self.spent[sender] = replace(before, messages=before.messages + 1)

    def applied_to(self, progress: EpisodeProgress) -> EpisodeProgress:
        """Return the progress with these counts."""
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
    """Return whether a stage has begun for at least one subject and is not yet done for all of them."""
    begun = [subject for name, subject in registry.progress.began if name == stage]
    return any((stage, subject) not in registry.stages for subject in begun)


def _total(spent: Mapping[str, Spent]) -> Spent:
    return Spent(
        tokens=sum(each.tokens for each in spent.values()),
        money_usd=total(each.money_usd for each in spent.values()),
        messages=sum(each.messages for each in spent.values()),
    )
