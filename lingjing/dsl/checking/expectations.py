"""Checkers of expectations: `expect { oracle wins within 40 ticks, draws spread over search }`.

Policies are plug-ins, so their names are looked up when `lingjing test` runs the expectations.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.studies import StudyChecker
from lingjing.dsl.checking.values import STATIC, UNKNOWN
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import FLAG
from lingjing.mission.units import NONE, TICKS, TIME

MOST_SEEDS = 1000
"""Most seeds of one expectation (chosen): its episodes take an hour or more, so a larger number is a mistake."""

T = TypeVar("T", bound=s.SyntaxNode)
_Lines = s.PolicyLine | s.InfeasibleLine | s.DrawsLine


class ExpectationChecker(DeclarationChecker):
    """Checks the expectations of one mission."""

    def __init__(self, blocks: BlockReader, studies: StudyChecker) -> None:
        super().__init__(blocks)
        self.studies = studies

    def expect(self, node: s.ExpectBlock) -> tuple[model.Expectation, ...]:
        """Check the statement `expect { … }`. Returns the correct expectations."""
        results: list[model.Expectation | None] = []
        with self.of.without_clock():
            for item in node.block.items:
                if isinstance(item, _Lines):
                    results.append(self._line(item))
                elif isinstance(item, s.Bare):
                    name = item.name.text
                    hint = f"write `{name} wins` or `{name} loses`"
                    self.report.at("LJ0108", item, f"`expect` lacks the outcome of `{name}`", hint)
                elif not isinstance(item, s.Faulty):
                    self.blocks.misplaced(item, "`expect`")
        return tuple(result for result in results if result is not None)

    # -- private

    def _line(self, node: _Lines) -> model.Expectation | None:
        before = len(self.report.diagnostics)
        result: model.Expectation | None
        match node:
            case s.PolicyLine():
                result = self._policy(node)
            case s.DrawsLine():
                result = self._draws(node)
            case s.InfeasibleLine():
                result = self._infeasible(node)
        return result if len(self.report.diagnostics) == before else None

    def _policy(self, node: s.PolicyLine) -> model.PolicyExpectation:
        policy = node.policy.value if isinstance(node.policy, s.TextLiteral) else node.policy.text
        if not policy.strip():
            self.report.at("LJ0206", node.policy, "the name of the policy is empty")
        episodes = self._episodes(node.terms, model.ExpectedEpisodes())
        least = self._only(node.terms, s.LeastTerm)
        share = self._only(node.terms, s.ShareTerm)
        if least is not None and share is not None:
            self.report.at("LJ0103", share, "two shares of the seeds are given", "remove one of the two")
        if least is not None:
            episodes = self._of_seeds(least, node.terms, episodes)
        within = self._only(node.terms, s.WithinTerm)
        outcome: Literal["wins", "loses"] = "wins" if node.keyword == "wins" else "loses"
        return model.PolicyExpectation(
            policy=policy,
            outcome=outcome,
            share="at_least" if least is not None else _share(share),
            least=_whole(least.least) or 0 if least is not None else 0,
            within=self._duration(within) if within is not None else None,
            episodes=episodes,
        )

    def _infeasible(self, node: s.InfeasibleLine) -> model.InfeasibleExpectation:
        value = self.of.expect(node.condition, STATIC, FLAG, "`infeasible when`")
        self.blocks.leak(value.taint, node.condition, "an expectation")
        return model.InfeasibleExpectation(condition=value.ir)

    def _draws(self, node: s.DrawsLine) -> model.SpreadExpectation:
        symbol = self.scope.symbols.get(node.region.text)
        if symbol is None or symbol.kind != "region":
            regions = [name for name, known in self.scope.symbols.items() if known.kind == "region"]
            self.of.unknown_name(node.region, regions, "no region")
        for term in node.terms:
            if not isinstance(term, s.SeedsTerm | s.SettingsTerm):
                self.report.at("LJ0107", term, "`draws` has seeds and settings alone", "remove it")
        episodes = self._episodes(node.terms, model.ExpectedEpisodes(last_seed=19))
        return model.SpreadExpectation(region=node.region.text, episodes=episodes)

    def _only(self, terms: tuple[s.Term, ...], kind: type[T]) -> T | None:
        """The term of a kind. Reports a second one."""
        several = [term for term in terms if isinstance(term, kind)]
        for extra in several[1:]:
            self.report.at("LJ0103", extra, "this part of the expectation is given twice", "remove one of the two")
        return several[0] if several else None

    def _episodes(self, terms: tuple[s.Term, ...], default: model.ExpectedEpisodes) -> model.ExpectedEpisodes:
        seeds = self._only(terms, s.SeedsTerm)
        chosen = self._only(terms, s.SettingsTerm)
        first, last = self._range(seeds) if seeds is not None else (default.first_seed, default.last_seed)
        mode, tier, settings = "", 0, []
        for axis in chosen.settings if chosen is not None else ():
            if axis.name.text == "mode":
                mode = self._mode(axis)
            elif axis.name.text == "tier":
                tier = self._tier(axis)
            elif (setting := self.studies.setting(axis)) is not None:
                settings.append(setting)
        names = [axis.name for axis in chosen.settings] if chosen is not None else []
        for place, name in enumerate(names):
            if any(name.text == other.text for other in names[:place]):
                self.report.at("LJ0103", name, f"`{name.text}` is set twice")
        return model.ExpectedEpisodes(first_seed=first, last_seed=last, settings=tuple(settings), mode=mode, tier=tier)

    def _range(self, term: s.SeedsTerm) -> tuple[int, int]:
        first, last = _whole(term.first), _whole(term.last) if term.last is not None else _whole(term.first)
        if first is None or last is None:
            self.report.at("LJ0206", term, "a seed is a whole number from 0", "write `for seeds 0..4`")
        elif last < first:
            self.report.at("LJ0206", term, "the range of seeds runs backwards", f"write `for seeds {last}..{first}`")
        elif last - first >= MOST_SEEDS:
            self.report.at("LJ0206", term, f"an expectation has at most {MOST_SEEDS} seeds")
        else:
            return first, last
        return 0, 0

    def _of_seeds(
        self, term: s.LeastTerm, terms: tuple[s.Term, ...], episodes: model.ExpectedEpisodes
    ) -> model.ExpectedEpisodes:
        """`at least 3 of 5`: without `for seeds` it means the first 5 seeds, else it must count them."""
        least, whole = _whole(term.least), _whole(term.of)
        if least is None or whole is None or not 1 <= least <= whole <= MOST_SEEDS:
            hint = f"write `at least 3 of 5`, with numbers from 1 to {MOST_SEEDS}"
            self.report.at("LJ0206", term, "no such number of the seeds is possible", hint)
            return episodes
        if not any(isinstance(other, s.SeedsTerm) for other in terms):
            return msgspec.structs.replace(episodes, first_seed=0, last_seed=whole - 1)
        if len(episodes.seeds) != whole:
            message = f"`for seeds` has {len(episodes.seeds)} seeds, and `of {whole}` has another number"
            self.report.at("LJ0206", term, message, f"write `of {len(episodes.seeds)}`")
        return episodes

    def _duration(self, term: s.WithinTerm) -> ex.Expr | None:
        value = self.of.value(term.limit, STATIC)
        if value is UNKNOWN:
            return None
        number = self.of.constant(value.ir)
        if value.type.kind != "quantity" or value.type.dimension not in (TICKS, TIME) or number is None:
            text = self.report.source.text[term.limit.start : term.limit.end]
            hint = f"write `within {text} ticks`" if value.type.dimension in (None, NONE) else "write `within 40 ticks`"
            due = "the bound of an expectation is a number of ticks, or a time"
            self.report.at("LJ0203", term.limit, due, hint)
            return None
        if number <= 0:
            self.report.at("LJ0206", term.limit, "the bound of an expectation is above 0")
        unit = "ticks" if value.type.dimension == TICKS else "s"
        return value.ir if isinstance(value.ir, ex.Number) else ex.Number(number, unit)

    def _tier(self, axis: s.Axis) -> int:
        known = (0, *sorted(self.studies.tiers))
        if isinstance(axis.values, s.NumberLiteral) and axis.values.value in known and not axis.values.unit:
            return int(axis.values.value)
        tiers = " and ".join(map(str, known))
        self.report.at("LJ0206", axis.values, "the mission has no such tier", f"it has {tiers}")
        return 0

    def _mode(self, axis: s.Axis) -> str:
        allowed = self.scope.modes
        if isinstance(axis.values, s.Name) and axis.values.text in allowed:
            return axis.values.text
        if isinstance(axis.values, s.Name):
            self.report.unknown("LJ0109", axis.values, f"the mission has no mode `{axis.values.text}`", allowed)
        else:
            self.report.at("LJ0201", axis.values, "a mode is due", f"write `mode = {allowed[0]}`")
        return ""


def _share(term: s.ShareTerm | None) -> Literal["all", "some", "none"]:
    return "some" if term and term.word == "some" else "none" if term and term.word == "none" else "all"


def _whole(node: s.NumberLiteral | s.Broken) -> int | None:
    """The whole number from 0 that a literal is; None for another one."""
    if isinstance(node, s.Broken) or node.value < 0 or node.value != int(node.value) or node.value >= 2**63:
        return None
    return int(node.value)
