"""Checkers of adjudication rules, unlocks, stages and outcomes."""

from __future__ import annotations

from collections.abc import Callable

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.calls import children
from lingjing.dsl.checking.scope import RuleInfo, SymbolTables
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.status_words import stored_name
from lingjing.dsl.checking.values import RULE, STATIC, UNKNOWN, Environment
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import KINDS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Related
from lingjing.mission.functions import AGGREGATES, FLAG, FUNCTIONS
from lingjing.mission.kinds import engine_kind

_REQUIREMENT_HINT = "a requirement reads declared places and properties, params and the sizes of groups"


class RuleChecker(DeclarationChecker):
    """Checks rules and stages. A method for each kind returns its part of the graph, or None if it is faulty."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings

    def head(self, node: s.RuleBlock) -> None:
        """Register the rule's name and parameters."""
        name = node.name
        known = self.scope.rules.get(name.text)
        if known is not None:
            self.report.declared_twice(name, f"the rule `{name.text}`", known.span)
            return
        if name.text in FUNCTIONS or name.text in AGGREGATES:
            self.report.at("LJ0104", name, f"`{name.text}` is a built-in function", "choose another name")
            return
        self.scope.rules[name.text] = RuleInfo(name.text, node.parameters, self.report.span(name.start, name.end))

    def stage_head(self, node: s.StageBlock) -> None:
        """Register the stage's name."""
        known = self.scope.stages.get(node.name.text)
        if known is not None:
            self.report.declared_twice(node.name, f"the stage `{node.name.text}`", known[1])
            return
        variable = node.variable.text if node.variable else None
        self.scope.stages[node.name.text] = (variable, self.report.span(node.name.start, node.name.end))

    def rule(self, node: s.RuleBlock) -> model.Rule | None:
        """Check the statement `adjudicate name(…) { when … }`."""
        parameters, environment = self._parameters(node.parameters)
        condition = self.only_condition(node.block, "when", f"the rule `{node.name.text}`", node.name)
        if condition is None:
            return None
        value = self.of.expect(condition, environment, FLAG, "`when`")
        if value is UNKNOWN or parameters is None:
            return None
        return model.Rule(
            name=node.name.text,
            parameters=parameters,
            condition=value.ir,
            matching=_calls(condition, "truth"),
            when=self.settings.guard(node.guard),
        )

    def unlock(self, node: s.UnlockLine) -> model.Unlock | None:
        """Check the statement `unlock interaction(v: group) when …`."""
        interactions = self.scope.interactions()
        name = node.name
        if name.text not in interactions and not self.scope.incomplete:
            self.of.unknown_name(name, list(interactions), "no interaction")
        else:
            self._check_unlocked_groups(node)
        parameters, environment = self._parameters(node.parameters)
        value = self.of.expect(node.condition, environment, FLAG, "`when`")
        if value is UNKNOWN or parameters is None or name.text not in interactions:
            return None
        return model.Unlock(interaction=name.text, parameters=parameters, condition=value.ir)

    def stage(self, node: s.StageBlock, limit: Callable[[s.LimitLine], model.Limit | None]) -> model.Stage | None:
        """Check the statement `stage name per v in group { done when …, ticks <= 40, weight = 2 }`.

        `limit` checks the limits inside.
        """
        environment = self.per(node.variable, node.domain)
        what = f"the stage `{node.name.text}`"
        others = (s.Condition, s.LimitLine)
        known = STATIC if environment is None else Environment(environment.locals)
        entries = self.blocks.read(
            node.block, KINDS["stage"].keys, what, environment=known, others=others, owner=node.name
        )
        condition = self.only_condition(node.block, "done", what, node.name, others=(s.PropertyLine, s.LimitLine))
        limits = [limit(item) for item in node.block.items if isinstance(item, s.LimitLine)]
        if condition is None or environment is None:
            return None
        value = self.of.expect(condition, environment, FLAG, "`done when`")
        deadline = entries.get("deadline")
        if deadline is not None and not self._is_declared(deadline.value.ir, node.domain):
            hint = "use numbers, params, and properties of a member or an entity that nothing changes: `v.deadline`"
            self.report.at("LJ0304", deadline.node.value, "a deadline is known before the run", hint)
            return None
        return model.Stage(
            name=node.name.text,
            condition=value.ir,
            variable=node.variable.text if node.variable else None,
            domain=node.domain.text if node.domain else None,
            ticks=entries["ticks"].value.ir if "ticks" in entries else None,
            weight=entries["weight"].value.ir if "weight" in entries else None,
            deadline=None if deadline is None else deadline.value.ir,
            limits=tuple(item for item in limits if item is not None),
            when=self.settings.guard(node.guard),
        )

    def per(self, variable: s.Name | None, domain: s.Name | None) -> Environment | None:
        """The environment inside `per v in group`; None if the group does not exist."""
        if variable is None or domain is None:
            return RULE
        kind = self.of.calls.domain_type(domain)
        return None if kind is None else RULE.binding(variable.text, kind)

    def requirement(self, node: s.RequireLine) -> model.Requirement | None:
        """`require condition because "…"`: a condition over what is known before the run."""
        value = self.of.expect(node.condition, RULE, FLAG, "`require`")
        if value is UNKNOWN:
            return None
        for part in ex.parts(value.ir):
            text = self._known_in_a_run(part)
            if text:
                self.report.at("LJ0304", node.condition, f"`{text}` is not known before the run", _REQUIREMENT_HINT)
                return None
        return model.Requirement(condition=value.ir, reason=node.reason.value)

    def outcome(self, node: s.OutcomeLine) -> ex.Expr:
        """Check the statement `success when …`, `failure when …`."""
        return self.of.expect(node.condition, RULE, FLAG, f"`{node.keyword} when`").ir

    def unlocked_once(self, nodes: list[s.UnlockLine]) -> None:
        """Report interactions with two unlocking conditions."""
        first: dict[str, s.UnlockLine] = {}
        for node in nodes:
            known = first.setdefault(node.name.text, node)
            if known is not node:
                self.blocks.duplicate(node.name, known.name, f"`{node.name.text}` is unlocked twice", "LJ0104")

    def cycles(self, nodes: list[s.RuleBlock]) -> None:
        """Report rules that refer to themselves, directly or through other rules."""
        calls = {node.name.text: _called(node, self.scope) for node in nodes}
        by_name = {node.name.text: node for node in nodes}
        reported: set[str] = set()
        for node in nodes:
            way = way_back(node.name.text, calls)
            if way and not reported.intersection(way):
                reported.update(way)
                related = tuple(
                    Related(self.report.span(by_name[n].name.start, by_name[n].name.end), "the cycle continues here")
                    for n in way[1:-1]
                )
                self.report.at(
                    "LJ0308",
                    node.name,
                    f"the rule `{node.name.text}` refers to itself: {' → '.join(way)}",
                    related=related,
                )

    def only_condition(
        self, block: s.BracedBlock, keyword: str, what: str, owner: s.Name, others: tuple[type, ...] = ()
    ) -> s.Expression | None:
        """The single condition of a block: `when …`, `done when …` or `always …`. `others`: statements that are read
        elsewhere.
        """
        first: s.Condition | None = None
        faulty = False
        spelled = {"when": "when", "done": "done when", "always": "always"}[keyword]
        for item in block.items:
            if isinstance(item, s.Condition) and item.keyword == keyword:
                if first is not None:
                    self.report(
                        "LJ0103",
                        item.start,
                        item.start + len(item.keyword),
                        f"{what} has two conditions",
                        "join them with `and`",
                    )
                first = first or item
            elif isinstance(item, s.Faulty):
                faulty = True
            elif isinstance(item, s.Condition):
                self.report(
                    "LJ0110",
                    item.start,
                    item.start + len(item.keyword),
                    f"{what} needs `{spelled} …`",
                    f"write `{spelled}`",
                )
                faulty = True
            elif not isinstance(item, others):
                self.blocks.misplaced(item, what, (spelled,))
        if first is None and not faulty:
            self.report.at("LJ0106", owner, f"{what} lacks its condition", f"add `{spelled} …`")
        return first.condition if first else None

    # -- private

    def _known_in_a_run(self, part: ex.Expr) -> str:
        """The name of a value that only a run has; "" for a declared value."""
        match part:
            case ex.Call(function=name, rule=called):
                return f"{name}(…)" if called or FUNCTIONS[name].where == "rule" else ""
            case ex.Ref(kind="clock", name="now"):
                return "now"
            case ex.Quantified(domain=domain) | ex.Aggregate(domain=domain) if domain in self.scope.messages:
                return domain
            case ex.Attr(name="status" | "velocity" as name):
                return name
            case ex.Attr(base=ex.Ref(name=owner) | ex.Index(base=ex.Ref(name=owner)), name=name):
                info = self.scope.groups.get(owner)
                shares = engine_kind(info.type.engine).shares if info is not None and info.type is not None else ()
                return name if name in shares else ""
        return ""

    def _is_declared(self, value: ex.Expr, domain: s.Name | None) -> bool:
        """True if a value is made of numbers, params, and properties without changes of a bound member or a single
        entity.

        `domain`: the group of the bound member; None without one.
        """
        match value:
            case ex.Number() | ex.Ref(kind="param" | "clock"):
                return True
            case ex.Attr(base=ex.Ref(kind="local"), name=name) if domain is not None:
                return name not in self._changing(domain.text)
            case ex.Attr(base=ex.Ref(kind="entity", name=owner), name=name):
                return name not in self._changing(owner)
            case ex.Binary() | ex.Unary() | ex.Call(function="min" | "max"):
                return all(self._is_declared(child, domain) for child in ex.children(value))
        return False

    def _changing(self, group: str) -> set[str]:
        """The stored names of a group's fields that change during a run: the motion, the status, and all states."""
        info = self.scope.groups.get(group)
        attributes = info.attributes if info is not None else {}
        states = {stored_name(name, known) for name, known in attributes.items() if known.state}
        return {"position", "heading_deg", "status", "velocity", *states}

    def _check_unlocked_groups(self, node: s.UnlockLine) -> None:
        """Report an unlock for groups that do not have the interaction."""
        every = self.scope.groups.values()
        offering = [info.name for info in every if info.type and node.name.text in info.type.interactions]
        groups = [self.scope.groups.get(parameter.type.text) for parameter in node.parameters]
        known = [group for group in groups if group is not None and group.type is not None]
        if known and len(known) == len(groups) and not any(group.name in offering for group in known):
            hint = f"groups with it: {', '.join(f'`{name}`' for name in offering)}" if offering else ""
            message = f"`{node.name.text}` is no interaction of `{known[0].name}`"
            self.report.at("LJ0201", node.parameters[0].type, message, hint)

    def _parameters(self, nodes: tuple[s.Typed, ...]) -> tuple[tuple[model.RuleParameter, ...] | None, Environment]:
        environment, parameters, good = RULE, [], True
        names: set[str] = set()
        for node in nodes:
            kind = self.of.calls.domain_type(node.type)
            if node.name.text in names:
                self.report.at("LJ0103", node.name, f"`{node.name.text}` is given twice")
            names.add(node.name.text)
            if node.optional or node.bounds is not None:
                self.report.at("LJ0110", node, "a rule's parameter has a name and a group or message kind")
            if kind is None:
                good = False
                environment = environment.binding(node.name.text, UNKNOWN.type)
                continue
            environment = environment.binding(node.name.text, kind)
            parameters.append(model.RuleParameter(name=node.name.text, domain=node.type.text))
        return tuple(parameters) if good else None, environment


def _calls(node: s.Expression, function: str) -> bool:
    waiting = [node]
    while waiting:
        part = waiting.pop()
        if isinstance(part, s.CallExpr) and part.function.text == function:
            return True
        waiting.extend(children(part))
    return False


def _called(node: s.RuleBlock, scope: SymbolTables) -> list[str]:
    called: list[str] = []
    waiting: list[s.Expression] = [item.condition for item in node.block.items if isinstance(item, s.Condition)]
    while waiting:
        part = waiting.pop()
        if isinstance(part, s.CallExpr) and part.function.text in scope.rules:
            called.append(part.function.text)
        waiting.extend(children(part))
    return sorted(set(called))


def way_back(start: str, calls: dict[str, list[str]]) -> list[str]:
    """The shortest cycle from a name back to itself over the names that each one reads; empty without one."""
    came: dict[str, str] = {}
    waiting = [start]
    while waiting:
        name = waiting.pop(0)
        for called in calls.get(name, ()):
            if called == start:
                way = [start]
                while name != start:
                    way.insert(1, name)
                    name = came[name]
                return [*way, start]
            if called not in came:
                came[called] = name
                waiting.append(called)
    return []
