"""The budget of branches of one search, and their results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from lingjing.causal.branch_host import BranchHost
from lingjing.causal.branching import BranchResult, failed_answers, own_failures
from lingjing.causal.interventions import BranchPlan


class BranchBudget:
    """A limited number of branches of a host. Results that are kept are not played again.

    `short`: True if more branches were needed than available. `unanswered`: branches with replaced answers of
    policies, by reason, without the trace's own reasons.
    """

    def __init__(self, host: BranchHost, most: int) -> None:
        self.short = False
        self.unanswered: Counter[str] = Counter()
        self._host = host
        self._most = most
        self._kept: dict[BranchPlan, BranchResult] = {}
        self._own_failures = own_failures(host.trace)

    @property
    def left(self) -> int:
        """The number of branches that may still be played."""
        return max(0, self._most - self._host.played)

    @property
    def kept(self) -> int:
        """The number of kept results."""
        return len(self._kept)

    def play(
        self, plans: Sequence[BranchPlan], work: str, ahead: Sequence[BranchPlan] = ()
    ) -> tuple[BranchResult, ...]:
        """Play these plans, without regard to the budget; plans `ahead` may be requested next, the likeliest first."""
        results = self._host.play(plans, work, ahead)
        self.unanswered.update(failed_answers(results, self._own_failures))
        return results

    def keep(self, plan: BranchPlan, result: BranchResult) -> None:
        """Keep the result of a plan."""
        self._kept[plan] = result

    def result(self, plan: BranchPlan) -> BranchResult | None:
        """Return the kept result of a plan, or None."""
        return self._kept.get(plan)

    def won(self, plans: Sequence[BranchPlan], work: str) -> list[bool]:
        """Return whether each plan wins.

        Plans without a kept result are played within the budget, and their results are kept. Plans beyond the budget
        count as lost.
        """
        new = [plan for plan in dict.fromkeys(plans) if plan not in self._kept]
        within = new[: self.left]
        self.short |= len(within) < len(new)
        self._kept |= zip(within, self.play(within, work), strict=True)
        return [plan in self._kept and self._kept[plan].success for plan in plans]
