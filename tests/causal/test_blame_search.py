"""Tests of the search of `blame` on synthetic branches: its trials and its conclusions."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
import pytest

from lingjing import Trace
from lingjing.causal.blame import Blame, BlameOptions, _Search
from lingjing.causal.branching import BranchResult
from lingjing.causal.interventions import BranchPlan, ReplacedPart
from lingjing.causal.later_starts import LATER
from lingjing.causal.result_texts import blame_text
from lingjing.testing import rescue as kit
from lingjing.trace.records import Header, Substitution

replace = msgspec.structs.replace
WAY, ORDER, LATE = ("waypoint", "skipper", 4), ("execution", "scout[1]", 9), ("handoff", "scout[2]", 12)


class MadeUp:
    """A host with an episode that is won if all of `needed` are replaced at their boundaries. Each departs only if
    those before it are replaced, and an agent repeats its departure at three boundaries."""

    cpu_s = driven_s = camera_s = unused_s = 0.0
    pictures = 0
    agreements: Mapping[tuple[str, str], tuple[int, ...]] = {}

    def __init__(self, *needed: tuple[str, str, int]) -> None:
        header = Header(instance=kit.instance(), bindings=(), fingerprint={})
        self.trace = Trace(Path("made-up.mcap"), header, (), None, False)
        self.needed, self.played, self.purposes = needed, 0, [""]
        self.plans: list[BranchPlan] = []
        self.announced: set[BranchPlan] = set()

    def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
        faculty, agent, tick = self.needed[0]
        return {(faculty, agent): tuple(range(tick, tick + 3))}

    def play(self, plans: Sequence[BranchPlan], purpose: str, ahead: Sequence[BranchPlan]) -> tuple[BranchResult, ...]:
        self.played += len(plans)
        self.purposes += [purpose] * len(plans)
        self.plans += [*plans]
        self.announced.update(ahead)
        return tuple(map(self._result, plans))

    def _result(self, plan: BranchPlan) -> BranchResult:
        """Return the result of a branch; without a change it is that of the episode."""
        spans = {(part.faculty, part.agent): (part.first, part.last) for part in plan.substitutions}
        replaced: list[ReplacedPart] = []
        for faculty, agent, tick in self.needed:
            first, last = spans.get((faculty, agent), (99, None))
            parts = [ReplacedPart(at, agent, faculty) for at in range(tick, tick + 3)]
            mine = [part for part in parts if first <= part.boundary and (last is None or part.boundary <= last)]
            replaced += mine
            if tick not in {part.boundary for part in mine}:
                shown = tuple(part for part in parts if part not in mine and part.boundary >= plan.at and plan.watch)
                return BranchResult(reason="budget", replaced=tuple(replaced), departed=shown)
        return BranchResult(success=True, reason="success", score=1.0, replaced=tuple(replaced))


def searched(host: MadeUp, branches: int = 60, *, shares: bool = True, placebos: int = 0) -> Blame:
    result = Blame(path="made-up.mcap", success=False, reason="budget", score=0.0)
    options = BlameOptions(branches=branches, placebos=placebos, shares=shares)
    return _Search(host, options).run(result)  # type: ignore[arg-type]


def causes(result: Blame) -> list[list[tuple[str, str, int, bool]]]:
    return [
        [(cause.faculty, cause.agent, cause.boundary, cause.masked) for cause in repair.causes]
        for repair in result.repairs
    ]


def test_a_single_fault_is_named_with_its_first_boundary() -> None:
    result = searched(MadeUp(WAY))
    assert causes(result) == [[(*WAY, False)]]
    assert result.complete and result.repairs[0].causes[0].replaced == 1


class Slow(MadeUp):
    """A host with an episode that is won later if less is replaced."""

    def _result(self, plan: BranchPlan) -> BranchResult:
        result = super()._result(plan)
        return replace(result, ticks=30 - len(result.replaced))


def test_a_repair_reports_the_ticks_of_the_branch_that_replaces_only_its_causes() -> None:
    (repair,) = searched(Slow(WAY)).repairs
    assert (repair.causes[0].replaced, repair.ticks) == (1, 29)
    (two,) = searched(Slow(WAY, ORDER)).repairs
    assert (sum(cause.replaced for cause in two.causes), two.ticks) == (2, 28)


def test_a_fault_masked_by_another_fault_is_named_in_the_same_repair() -> None:
    result = searched(MadeUp(WAY, ORDER))
    assert causes(result) == [[(*WAY, False), (*ORDER, True)]]
    assert result.complete and result.departed == 1
    assert [(share.agent, share.share) for share in result.shares] == [("skipper", 0.5), ("scout[1]", 0.5)]
    assert "execution of scout[1], from boundary 9 (1 record replaced, boundary 9; it appears only if" in blame_text(
        result
    )


def test_a_chain_of_faults_that_mask_each_other_is_found() -> None:
    host = MadeUp(WAY, ORDER, LATE)
    result = searched(host)
    assert causes(result) == [[(*WAY, False), (*ORDER, True), (*LATE, True)]]
    assert host.purposes.count("all at once") == 3


def test_a_fault_that_appears_earlier_after_a_repair_is_replaced_from_that_boundary() -> None:
    class Sooner(MadeUp):
        """In the trace the second pair departs too, three boundaries later."""

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return super().departures() | {ORDER[:2]: (12, 13, 14)}

    host = Sooner(WAY, ORDER)
    result = searched(host)
    assert causes(result) == [[(*WAY, False), (*ORDER, False)]]
    assert result.complete and host.purposes.count("all at once") == 2


def test_the_earlier_of_two_equally_small_repairs_comes_first() -> None:
    class Either(MadeUp):
        """Won if any of the pairs is replaced."""

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return {(faculty, agent): (tick,) for faculty, agent, tick in self.needed}

        def _result(self, plan: BranchPlan) -> BranchResult:
            replaced = tuple(
                ReplacedPart(tick, agent, faculty)
                for faculty, agent, tick in self.needed
                if (faculty, agent)
                in {(substitution.faculty, substitution.agent) for substitution in plan.substitutions}
            )
            return BranchResult(success=bool(replaced), reason="success" if replaced else "budget", replaced=replaced)

    assert causes(searched(Either(ORDER, WAY))) == [[(*WAY, False)], [(*ORDER, False)]]


def test_a_repair_of_a_pair_with_few_departures_comes_before_one_with_many() -> None:
    """For equally small repairs: with many departures a repair by chance is more likely."""

    class Both(MadeUp):
        agreements = {("waypoint", "skipper"): tuple(range(1, 30, 2))}

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return {("waypoint", "skipper"): tuple(range(0, 30, 2)), ("execution", "scout[1]"): (9, 10, 11)}

        def _result(self, plan: BranchPlan) -> BranchResult:
            parts = tuple(
                ReplacedPart(item.first, item.agent, item.faculty)
                for item in plan.substitutions
                if item.first <= {"waypoint": 4, "execution": 11}[item.faculty]
            )
            return BranchResult(success=bool(parts), reason="success" if parts else "budget", replaced=parts)

    first, second = searched(Both(WAY, ORDER)).repairs
    assert [(item.causes[0].faculty, item.causes[0].rows, item.causes[0].replaced) for item in (first, second)] == [
        ("execution", 1, 1),
        ("waypoint", 15, 1),
    ]


def test_a_repair_that_works_only_from_a_later_start_comes_last_and_is_marked() -> None:
    class Two(Spoiled):
        """The episode is also won if the execution of a scout is replaced at both boundaries, 3 and 4."""

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return {**super().departures(), ("execution", "scout[2]"): (3, 4)}

        def _result(self, plan: BranchPlan) -> BranchResult:
            spans = {item.agent: (item.first, item.last or 99) for item in plan.substitutions}
            first, last = spans.get("scout[2]", (99, 0))
            if first <= 3 and last >= 4:
                parts = tuple(ReplacedPart(tick, "scout[2]", "execution") for tick in (3, 4))
                return BranchResult(success=True, reason="success", replaced=parts)
            return super()._result(replace(plan, substitutions=plan.substitutions[:1] if "skipper" in spans else ()))

    host = Two(WAY)
    host.agreements = {("waypoint", "skipper"): (15,)}
    result = searched(host)
    assert [(item.causes[0].agent, item.causes[0].late, item.causes[0].replaced) for item in result.repairs] == [
        ("scout[2]", False, 2),
        ("skipper", True, 1),
    ]
    assert blame_text(result).count("not if its earlier departures are replaced too") == 1


def test_a_cause_is_dated_to_the_start_of_the_run_of_departures_that_its_repair_replaces() -> None:
    """The agent has its own waypoints all the time and no command at 19; its decisions at 20 to 22 are right."""

    class OwnWay(MadeUp):
        agreements = {("execution", "skipper"): (20, 21, 22)}

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return {("waypoint", "skipper"): tuple(range(60)), ("execution", "skipper"): (19, *range(23, 60))}

        def _result(self, plan: BranchPlan) -> BranchResult:
            acts = next((item for item in plan.substitutions if item.faculty == "execution"), None)
            if acts is None or acts.first > 41 or (acts.last is not None and acts.last < max(acts.first, 23) + 1):
                return BranchResult(reason="budget")
            begin = acts.first if acts.first == 19 else max(acts.first, 23)
            ticks = [19, 23, 24] if begin == 19 else [begin, begin + 1]
            replaced = [ReplacedPart(item, "skipper", "execution") for item in ticks if item <= (acts.last or 99)]
            return BranchResult(success=True, reason="success", score=1.0, replaced=tuple(replaced))

    (repair,) = searched(OwnWay(WAY)).repairs
    assert [(item.faculty, item.boundary, item.first, item.last) for item in repair.causes] == [
        ("execution", 23, 41, 42)
    ]


@pytest.mark.parametrize("others", [(), (WAY,)])
def test_a_branch_that_replaces_only_the_named_windows_wins(others: tuple[tuple[str, str, int], ...]) -> None:
    """The reference starts again where the agent departed, and at first agrees with the agent."""

    class Anew(MadeUp):
        ticks = (9, 12, 20, 24)

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return {(faculty, agent): self.ticks for faculty, agent, _ in self.needed}

        def _result(self, plan: BranchPlan) -> BranchResult:
            spans = {(item.faculty, item.agent): (item.first, item.last or 99) for item in plan.substitutions}
            parts = [
                ReplacedPart(tick, agent, faculty)
                for (faculty, agent), (first, last) in spans.items()
                for tick in self.ticks
                if first + 2 * (first > 9) <= tick <= last
            ]
            made_good = {(item.faculty, item.agent) for item in parts if item.boundary == 24}
            won = len(made_good) == len(self.needed) and all(first <= 20 for first, _ in spans.values())
            return BranchResult(success=won, reason="success" if won else "budget", replaced=tuple(parts))

    host = Anew(ORDER, *others)
    (repair,) = searched(host).repairs
    windows = tuple(
        Substitution(faculty=item.faculty, agent=item.agent, first=item.first, last=item.last) for item in repair.causes
    )
    again = host._result(BranchPlan(at=20, substitutions=windows))
    assert again.success and [(item.first, item.last, item.replaced) for item in repair.causes] == [(20, 24, 1)] * (
        1 + len(others)
    )


class Spoiled(MadeUp):
    """An agent with its own strategy, which succeeds until its fault. A replacement from before the fault loses."""

    def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
        return {(faculty, agent): (1, 11, *range(20, 60, 4)) for faculty, agent, _ in self.needed}

    def _result(self, plan: BranchPlan) -> BranchResult:
        spans = {
            (substitution.faculty, substitution.agent): (substitution.first, substitution.last)
            for substitution in plan.substitutions
        }
        windows = [spans.get((faculty, agent), (0, 0)) for faculty, agent, _ in self.needed]
        won = all(11 < first <= 20 and (last is None or last >= 20) for first, last in windows)
        parts = tuple(
            ReplacedPart(tick, agent, faculty)
            for (faculty, agent), (first, last) in spans.items()
            for tick in self.departures()[faculty, agent]
            if first <= tick <= (last or 99)
        )
        return BranchResult(success=won, reason="success" if won else "budget", replaced=parts)


def test_a_pair_that_repairs_only_from_a_later_boundary_on_is_found() -> None:
    host = Spoiled(WAY)
    host.agreements = {("waypoint", "skipper"): (15, 45)}
    result = searched(host)
    (cause,) = result.repairs[0].causes
    assert (cause.boundary, cause.first, cause.last, cause.replaced) == (20, 20, 20, 1)
    assert result.complete and host.purposes.count("later starts") == 1 and "all at once" not in host.purposes
    assert [share.share for share in result.shares] == [1.0]


def test_an_agent_that_agreed_before_its_departures_is_not_replaced_alone_from_later_starts() -> None:
    host = Spoiled(WAY)
    host.agreements = {("waypoint", "skipper"): (0, 15)}
    assert searched(host).repairs[0].causes[0].first == 20
    assert "later starts" not in host.purposes and host.purposes.count("all at once") == 2


def test_later_starts_leave_half_of_the_budget_and_report_its_exhaustion() -> None:
    class Hopeless(Spoiled):
        def _result(self, plan: BranchPlan) -> BranchResult:
            return replace_success(super()._result(plan))

    host = Hopeless(WAY, ORDER)
    result = searched(host, branches=11)
    assert host.purposes.count("later starts") == 4 and result.exhausted
    whole = Hopeless(WAY, ORDER)
    assert not searched(whole).exhausted and whole.purposes.count("later starts") == 2 * LATER - 2


def test_the_replacement_of_all_pairs_at_once_can_begin_later() -> None:
    host = Spoiled(WAY, ORDER)
    host.agreements = {(faculty, agent): (15,) for faculty, agent, _ in (WAY, ORDER)}
    result = searched(host, branches=80)
    assert causes(result) == [[("execution", "scout[1]", 20, False), ("waypoint", "skipper", 20, False)]]
    assert result.complete and host.purposes.count("all at once") == 2
    text = blame_text(result)
    assert "score 0.00; replacing everything from the first departures on does not win" in text
    assert "replaced too" not in text  # the replacement of exactly these two from there on was never tried


def test_an_episode_that_no_replacement_wins_has_no_repairs() -> None:
    class Lost(MadeUp):
        def _result(self, plan: BranchPlan) -> BranchResult:
            return replace_success(super()._result(plan))

    host = Lost(WAY, ORDER)
    result = searched(host)
    assert result.repairs == () and not result.exhausted
    assert host.purposes.count("all at once") == 3  # the last from the middle of the departures on
    assert searched(Lost(WAY, ORDER), branches=3).exhausted
    placebos = searched(Lost(WAY, ORDER), placebos=3).placebos
    assert placebos is not None and placebos.uninvolved == 3  # although a repair by chance remains possible


class Hasty(MadeUp):
    """A host in which policies are late in each branch with a change."""

    def _result(self, plan: BranchPlan) -> BranchResult:
        late = {"policy_timeout": 2} if plan.substitutions else {}
        return replace(super()._result(plan), unanswered=late)


def test_late_answers_in_branches_are_reported_with_their_dependence_on_the_machine() -> None:
    result = searched(Hasty(WAY))
    assert result.unanswered == {"policy_timeout": result.branches - 1}
    text = blame_text(result)
    assert "(policy_timeout); their answers were replaced by doing nothing\nlate answers depend on" in text


def test_a_budget_of_one_branch_is_reported_as_too_small() -> None:
    result = searched(MadeUp(WAY), branches=1)
    assert (result.branches, result.tried, result.exhausted) == (1, 0, True)
    assert "Nothing was replaced: --branches is too small." in blame_text(result)
    some = searched(MadeUp(WAY, ORDER), branches=2)
    assert "No replacement wins this episode; not everything was tried." in blame_text(some)
    assert "placebos: none was played" in blame_text(some)


def test_the_search_is_complete_for_ten_pairs_and_incomplete_for_eleven() -> None:
    """At most 45 sets of two are tried: all pairs of ten."""

    class Needs(MadeUp):
        """Won if two certain agents, which depart from the start, are both replaced."""

        def __init__(self, shown: int) -> None:
            super().__init__(*(("waypoint", f"scout[{number}]", 4) for number in range(shown)))
            header = self.trace.header
            agents = tuple(replace(header.instance.agents[0], id=agent) for _, agent, _ in self.needed)
            header = replace(header, instance=replace(header.instance, agents=agents))
            self.trace = Trace(self.trace.path, header, (), None, False)

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            return {(faculty, agent): (tick,) for faculty, agent, tick in self.needed}

        def _result(self, plan: BranchPlan) -> BranchResult:
            mine = {substitution.agent for substitution in plan.substitutions}
            parts = tuple(ReplacedPart(4, agent, "waypoint") for agent in sorted(mine))
            won = {"scout[0]", "scout[1]"} <= mine
            return BranchResult(success=won, reason="success" if won else "budget", replaced=parts)

    assert searched(Needs(10), branches=500).complete
    assert not searched(Needs(11), branches=500).complete


def replace_success(result: BranchResult) -> BranchResult:
    """Return the branch as a lost one, with a cause that is in no faculty."""
    return BranchResult(reason="budget", replaced=result.replaced, departed=result.departed)


def test_branches_that_are_certain_to_be_needed_are_announced_ahead() -> None:
    host = MadeUp(WAY, ORDER)
    searched(host)
    requests = list(zip(host.plans, host.purposes[1:], strict=True))
    shares = [plan for plan, purpose in requests if purpose == "shares"]
    narrowing = [plan for plan, purpose in requests if purpose == "which boundaries"]
    assert set(shares) <= host.announced
    unforeseen = set(narrowing[1:]) - host.announced
    assert len(narrowing) > 3 and len(unforeseen) == 1  # its end depends on the replacements at its beginning


class Innocent(MadeUp):
    """Another agent departs from its reference too, without an effect."""

    def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
        return {**super().departures(), ("execution", "scout[2]"): (2, 3)}


def test_without_shares_the_repairs_are_equal_and_need_fewer_branches() -> None:
    whole, short = Innocent(WAY), Innocent(WAY)
    result = searched(whole)
    assert searched(short, shares=False) == replace(result, shares=(), branches=short.played)
    assert short.played < whole.played and "shares" not in short.purposes and len(result.shares) == 2


def test_an_exactly_sufficient_budget_is_not_exhausted() -> None:
    """There are places for two placebos, so more placebos in the options need no larger budget."""
    whole = searched(Innocent(WAY), placebos=8)
    assert whole.placebos is not None and whole.placebos.uninvolved == 2
    assert not searched(Innocent(WAY), branches=whole.branches, placebos=8).exhausted
    assert searched(Innocent(WAY), branches=whole.branches - 1, placebos=8).exhausted


def test_the_text_reports_how_many_pairs_the_shares_cover() -> None:
    class Crowd(MadeUp):
        """Four others depart from their references too."""

        def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
            others = ("execution", "handoff", "routing", "localisation")
            return {**super().departures(), **{(faculty, "scout[2]"): (9,) for faculty in others}}

    assert "Shapley shares of the win, of 3 of 5 pairs with departures:" in blame_text(searched(Crowd(WAY)))
