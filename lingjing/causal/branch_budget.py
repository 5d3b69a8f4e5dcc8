"""`BranchBudget`: the branches that one search may play, and what came of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from lingjing.causal.branch_host import BranchHost
from lingjing.causal.branching import BranchResult, failed_answers, own_failures
from lingjing.causal.interventions import BranchPlan


class BranchBudget:
    """At most so many branches of a host. What came of a plan that is kept is never played again. `short` says that
    more was wanted than there was; `unanswered` counts the branches in which policies failed for reasons for which none
    does in the trace."""

    def __init__(self, host: BranchHost, most: int) -> None:
        self.short = False
        self.unanswered: Counter[str] = Counter()
        self._host = host
        self._most = most
        self._kept: dict[BranchPlan, BranchResult] = {}
        self._own_failures = own_failures(host.trace)

    @property
    def left(self) -> int:
        """How many may still be played."""
        return max(0, self._most - self._host.played)

    @property
    def kept(self) -> int:
        """Of how many plans it is kept what came of them."""
        return len(self._kept)

    def play(
        self, plans: Sequence[BranchPlan], what: str, ahead: Sequence[BranchPlan] = ()
    ) -> tuple[BranchResult, ...]:
        """Play these, whatever is left; what will be asked for next is said `ahead`, likeliest first."""
        results = self._host.play(plans, what, ahead)
        self.unanswered.update(failed_answers(results, self._own_failures))
        return results

    def keep(self, plan: BranchPlan, result: BranchResult) -> None:
        """Remember what came of a plan."""
        self._kept[plan] = result

    def result(self, plan: BranchPlan) -> BranchResult | None:
        """What came of a plan; None if that is not kept."""
        return self._kept.get(plan)

    def won(self, plans: Sequence[BranchPlan], what: str) -> list[bool]:
        """Whether each wins. Those that are not kept are played as far as the budget goes, and are kept then; what is
        not played counts as lost."""
        new = [plan for plan in dict.fromkeys(plans) if plan not in self._kept]
        within = new[: self.left]
        self.short |= len(within) < len(new)
        self._kept |= zip(within, self.play(within, what), strict=True)
        return [plan in self._kept and self._kept[plan].success for plan in plans]
