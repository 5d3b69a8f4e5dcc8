"""Reductions of the grammar to the syntax tree: one method an alias of `ljs.lark`, plus the ranking of operators.

A method's arguments are the values on the right-hand side in order, tokens included, None for what is absent.
An expression under construction is a flat list `[operand, operator, operand, …]` until its owner asks for it; depth is
bounded here so that no later phase recurses without limit.
"""

# ruff: noqa: D102 - the docstring of a reduction is its rule in ljs.lark
from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeVar

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.tokens import Token
from lingjing.mission.functions import RANKS

DEEPEST = 120
"""Levels of one expression's tree. The longest rule of the project's missions has eight."""

_ESCAPE = re.compile(r"\\(.)")
_ESCAPES = {"n": "\n", "t": "\t"}
T = TypeVar("T")
Arguments = list[s.CallArgument]
FlatExpr = list[Any]
"""`[operand, operator token, operand, …]`, or a lone operand."""


class Builder:
    """Builds nodes; `faulty` is filled by the parser before it reduces ERROR."""

    def __init__(self, report: Reporter) -> None:
        self.report = report

    def actions(self) -> dict[str, Callable[..., Any]]:
        """Alias → method."""
        return {
            name: getattr(self, name) for name in dir(self) if not name.startswith("_") and name not in _NOT_ACTIONS
        }

    # -- lists and structure

    def first(self, item: T) -> list[T]:
        return [item]

    def more(self, items: list[T], _separator: Token, item: T) -> list[T]:
        items.append(item)
        return items

    def file(self, items: list[s.Statement]) -> s.File:
        return s.File(0, items[-1].end, tuple(items))

    def empty_file(self) -> s.File:
        return s.File(0, 0, ())

    def block(self, opening: Token, items: list[s.Statement], closing: Token) -> s.BracedBlock:
        return s.BracedBlock(opening.start, closing.end, tuple(items))

    def empty_block(self, opening: Token, closing: Token) -> s.BracedBlock:
        return s.BracedBlock(opening.start, closing.end, ())

    def guard(self, _when: Token, condition: FlatExpr) -> s.Expression:
        return self._done(condition)

    def index(self, _opening: Token, value: FlatExpr, _closing: Token) -> s.Expression:
        return self._done(value)

    def set(self, opening: Token, names: list[Token], closing: Token) -> s.NameSet:
        return s.NameSet(opening.start, closing.end, tuple(map(_word, names)))

    def path(self, name: Token) -> list[Token]:
        return [name]

    def longer_path(self, path: list[Token], _dot: Token, name: Token) -> list[Token]:
        path.append(name)
        return path

    def no_params(self, _opening: Token, closing: Token) -> tuple[s.Typed, ...]:
        return ()

    def params(self, _opening: Token, items: list[s.Typed], _closing: Token) -> tuple[s.Typed, ...]:
        return tuple(items)

    def typed(
        self,
        name: Token,
        _colon: Token,
        kind: Token,
        _in: Token | None,
        bounds: FlatExpr | None,
        optional: Token | None,
    ) -> s.Typed:
        limits = None if bounds is None else self._done(bounds)
        end = optional.end if optional else limits.end if limits else kind.end
        return s.Typed(name.start, end, _word(name), _word(kind), limits, optional is not None)

    def no_clauses(self) -> list[s.Clause]:
        return []

    def and_clause(self, clauses: list[s.Clause], clause: s.Clause) -> list[s.Clause]:
        clauses.append(clause)
        return clauses

    def clause(self, keyword: Token, name: Token) -> s.Clause:
        return s.Clause(keyword.start, name.end, keyword.text, _word(name))

    def channel(self, source: FlatExpr, star: Token | None = None) -> s.ObservedChannel:
        value = self._done(source)
        return s.ObservedChannel(value.start, star.end if star else value.end, value, star is not None)

    # -- statements

    def version(self, keyword: Token, number: Token) -> s.Version:
        return s.Version(keyword.start, number.end, self.number(number))

    def use(self, keyword: Token, dot: Token | None, path: list[Token], names: s.BracedBlock | None) -> s.UseLine:
        return s.UseLine(keyword.start, (names or path[-1]).end, tuple(map(_word, path)), names, dot is not None)

    def mission(
        self,
        keyword: Token,
        name: Token,
        _extends: Token | None,
        base: Token | None,
        title: Token | None,
        block: s.BracedBlock,
    ) -> s.MissionBlock:
        shown = self.text(title) if title else None
        return s.MissionBlock(keyword.start, block.end, _word(name), shown, block, _word(base) if base else None)

    def override(self, keyword: Token, item: s.Statement) -> s.Override:
        return s.Override(keyword.start, item.end, item)

    def goal(self, keyword: Token, text: Token) -> s.TextLine:
        return s.TextLine(keyword.start, text.end, keyword.text, self.text(text))

    prompt = goal

    def scene(self, keyword: Token, kind: Token, block: s.BracedBlock | None) -> s.SceneBlock:
        return s.SceneBlock(keyword.start, (block or kind).end, _word(kind), block)

    def section(self, keyword: Token, block: s.BracedBlock) -> s.SettingsBlock:
        return s.SettingsBlock(keyword.start, block.end, keyword.text, block)

    def preset(self, keyword: Token, name: Token, block: s.BracedBlock | None) -> s.SettingsBlock:
        inside = block or s.BracedBlock(name.end, name.end, ())
        return s.SettingsBlock(keyword.start, inside.end, keyword.text, inside, _word(name))

    def param(self, keyword: Token, name: Token, _equal: Token, value: FlatExpr) -> s.Param:
        done = self._done(value)
        return s.Param(keyword.start, done.end, _word(name), done)

    def mode(self, keyword: Token, default: Token, _in: Token | None, allowed: s.NameSet | None) -> s.ModeLine:
        only = _word(default)
        names = allowed or s.NameSet(only.start, only.end, (only,))
        return s.ModeLine(keyword.start, names.end, only, names)

    def region(self, keyword: Token, name: Token, _equal: Token, shape: FlatExpr) -> s.RegionLine:
        done = self._done(shape)
        return s.RegionLine(keyword.start, done.end, _word(name), done)

    def grid(self, keyword: Token, name: Token, _over: Token, region: Token, block: s.BracedBlock) -> s.GridBlock:
        return s.GridBlock(keyword.start, block.end, _word(name), _word(region), block)

    def entity(
        self,
        keyword: Token,
        name: Token,
        index: s.Expression | None,
        _colon: Token | None,
        kind: Token | None,
        guard: s.Expression | None,
        block: s.BracedBlock | None,
    ) -> s.EntityBlock:
        end = (block or guard or kind or index or name).end
        of_type = _word(kind) if kind else None
        return s.EntityBlock(keyword.start, end, keyword.text, _word(name), index, of_type, guard, block)

    def camera(
        self, keyword: Token, name: Token, _colon: Token | None, preset: Token | None, block: s.BracedBlock | None
    ) -> s.CameraBlock:
        end = (block or preset or name).end
        return s.CameraBlock(keyword.start, end, _word(name), block, _word(preset) if preset else None)

    def agent(
        self,
        keyword: Token,
        name: Token,
        index: s.Expression | None,
        _as: Token,
        role: Token,
        _controls: Token | None,
        controls: list[FlatExpr] | None,
        guard: s.Expression | None,
        block: s.BracedBlock | None,
    ) -> s.AgentBlock:
        held = tuple(map(self._done, controls or ()))
        end = (block or guard or (held[-1] if held else role)).end
        return s.AgentBlock(keyword.start, end, _word(name), index, _word(role), held, guard, block)

    def authority(
        self,
        keyword: Token,
        roles: list[Token],
        _may: Token,
        _command: Token,
        resource: FlatExpr,
        guard: s.Expression | None,
    ) -> s.AuthorityLine:
        done = self._done(resource)
        return s.AuthorityLine(keyword.start, (guard or done).end, tuple(map(_word, roles)), done, guard)

    def message(
        self,
        keyword: Token,
        name: Token,
        _colon: Token,
        kind: Token,
        _from: Token,
        senders: list[Token],
        _to: Token,
        recipients: list[Token],
        guard: s.Expression | None,
    ) -> s.MessageLine:
        end = (guard or recipients[-1]).end
        return s.MessageLine(
            keyword.start,
            end,
            _word(name),
            _word(kind),
            tuple(map(_word, senders)),
            tuple(map(_word, recipients)),
            guard,
        )

    def adjudicate(
        self, keyword: Token, name: Token, parameters: tuple[s.Typed, ...], block: s.BracedBlock
    ) -> s.RuleBlock:
        return s.RuleBlock(keyword.start, block.end, _word(name), parameters, block)

    def unlock(self, keyword: Token, name: Token, parameters: tuple[s.Typed, ...], guard: s.Expression) -> s.UnlockLine:
        return s.UnlockLine(keyword.start, guard.end, _word(name), parameters, guard)

    def stage(
        self,
        keyword: Token,
        name: Token,
        _per: Token | None,
        variable: Token | None,
        _in: Token | None,
        domain: Token | None,
        block: s.BracedBlock,
    ) -> s.StageBlock:
        bound = _word(variable) if variable else None
        over = _word(domain) if domain else None
        return s.StageBlock(keyword.start, block.end, _word(name), bound, over, block)

    def relation(
        self,
        keyword: Token,
        kind: Token,
        source: Token,
        arrow: Token,
        target: Token,
        clauses: list[s.Clause],
        guard: s.Expression | None,
    ) -> s.RelationLine:
        end = (guard or (clauses[-1] if clauses else target)).end
        mutual = arrow.type == "BOTH"
        return s.RelationLine(
            keyword.start, end, _word(kind), _word(source), _word(target), mutual, tuple(clauses), guard
        )

    def outcome(self, keyword: Token, _when: Token, condition: FlatExpr) -> s.OutcomeLine:
        done = self._done(condition)
        return s.OutcomeLine(keyword.start, done.end, keyword.text, done)

    def condition(self, keyword: Token, _when: Token, condition: FlatExpr) -> s.Condition:
        done = self._done(condition)
        return s.Condition(keyword.start, done.end, keyword.text, done)

    def bare_condition(self, keyword: Token, condition: FlatExpr) -> s.Condition:
        done = self._done(condition)
        return s.Condition(keyword.start, done.end, keyword.text, done)

    def limit(
        self,
        keyword: Token,
        name: Token,
        _le: Token,
        most: FlatExpr,
        _counts: Token,
        counts: list[s.ObservedChannel],
        guard: s.Expression | None,
    ) -> s.LimitLine:
        end = (guard or counts[-1]).end
        return s.LimitLine(keyword.start, end, _word(name), self._done(most), tuple(counts), guard)

    def permit(self, keyword: Token, resource: s.ObservedChannel, guard: s.Expression) -> s.PermitLine:
        return s.PermitLine(keyword.start, guard.end, resource, guard)

    def constraint(
        self,
        keyword: Token,
        kind: Token,
        name: Token,
        _per: Token | None,
        variable: Token | None,
        _in: Token | None,
        domain: Token | None,
        guard: s.Expression | None,
        block: s.BracedBlock,
    ) -> s.ConstraintBlock:
        bound, over = _word(variable) if variable else None, _word(domain) if domain else None
        return s.ConstraintBlock(keyword.start, block.end, _word(kind), _word(name), bound, over, guard, block)

    def inspection(
        self,
        keyword: Token,
        name: Token,
        _of: Token,
        asset: FlatExpr,
        _by: Token,
        inspectors: list[FlatExpr],
        guard: s.Expression | None,
        block: s.BracedBlock,
    ) -> s.InspectionBlock:
        by = tuple(map(self._done, inspectors))
        return s.InspectionBlock(keyword.start, block.end, _word(name), self._done(asset), by, guard, block)

    def event(
        self,
        keyword: Token,
        name: Token,
        _at: Token,
        tilde: Token | None,
        at: FlatExpr,
        guard: s.Expression | None,
        block: s.BracedBlock,
    ) -> s.EventBlock:
        drawn = tilde is not None
        return s.EventBlock(keyword.start, block.end, _word(name), self._done(at), drawn, guard, block)

    def change(self, keyword: Token, entity: FlatExpr) -> s.ChangeLine:
        done = self._done(entity)
        return s.ChangeLine(keyword.start, done.end, keyword.text, done)

    def axis(self, name: Token, _in: Token, values: FlatExpr) -> s.Axis:
        done = self._done(values)
        return s.Axis(name.start, done.end, _word(name), done)

    def sweep(
        self, keyword: Token, name: Token, _over: Token, axes: list[s.Axis], guard: s.Expression | None
    ) -> s.SweepLine:
        return s.SweepLine(keyword.start, (guard or axes[-1]).end, _word(name), tuple(axes), guard)

    def observes(self, keyword: Token, channels: list[s.ObservedChannel]) -> s.Observes:
        return s.Observes(keyword.start, channels[-1].end, tuple(channels))

    def verb(self, keyword: Token, name: Token, parameters: tuple[s.Typed, ...]) -> s.VerbLine:
        return s.VerbLine(keyword.start, (parameters[-1] if parameters else name).end, _word(name), parameters)

    def interaction(self, keyword: Token, name: Token, block: s.BracedBlock) -> s.InteractionBlock:
        return s.InteractionBlock(keyword.start, block.end, _word(name), block)

    def mount(self, keyword: Token, view: Token, block: s.BracedBlock) -> s.MountBlock:
        return s.MountBlock(keyword.start, block.end, _word(view), block)

    def part(self, keyword: Token, name: Token, _colon: Token, shape: Token, block: s.BracedBlock) -> s.PartBlock:
        return s.PartBlock(keyword.start, block.end, _word(name), _word(shape), block)

    def record(
        self, keyword: Token, name: Token, _colon: Token, category: Token, block: s.BracedBlock
    ) -> s.RecordBlock:
        return s.RecordBlock(keyword.start, block.end, _word(name), _word(category), block)

    def reveal(
        self, keyword: Token, what: Token, _o: Token, entity: FlatExpr, _c: Token, _to: Token, role: Token
    ) -> s.RevealLine:
        return s.RevealLine(keyword.start, role.end, _word(what), self._done(entity), _word(role))

    def property(
        self,
        hidden: Token | None,
        state: Token | None,
        name: Token,
        relation: Token,
        value: FlatExpr,
        guard: s.Expression | None,
    ) -> s.PropertyLine:
        done = self._done(value)
        start, end = (hidden or state or name).start, (guard or done).end
        return s.PropertyLine(
            start, end, _word(name), relation.text, done, hidden is not None, guard, state is not None
        )

    def bounded(self, name: Token, relation: Token, value: FlatExpr) -> s.PropertyLine:
        done = self._done(value)
        return s.PropertyLine(name.start, done.end, _word(name), relation.text, done, hidden=False, guard=None)

    def field(self, typed: s.Typed) -> s.FieldLine:
        return s.FieldLine(typed.start, typed.end, typed)

    def bare(self, name: Token) -> s.Bare:
        return s.Bare(name.start, name.end, _word(name))

    def unknown_block(self, name: Token, block: s.BracedBlock) -> s.UnknownBlock:
        return s.UnknownBlock(name.start, block.end, _word(name), block)

    def faulty(self, error: Token) -> s.Faulty:
        return s.Faulty(error.start, error.end, tuple(error.text.split()), None)

    def faulty_block(self, error: Token, block: s.BracedBlock) -> s.Faulty:
        return s.Faulty(error.start, block.end, tuple(error.text.split()), block)

    # -- expressions

    def operand(self, value: s.Expression) -> s.Expression:
        return value

    def operation(self, left: FlatExpr, operator: Token, right: s.Expression) -> FlatExpr:
        if type(left) is list:
            left.append(operator)
            left.append(right)
            return left
        return [left, operator, right]

    def name(self, token: Token) -> s.Name:
        return s.Name(token.start, token.end, token.text)

    def number(self, token: Token) -> s.NumberLiteral | s.Broken:
        try:
            value = float(token.text)
        except ValueError:
            return s.Broken(token.start, token.end)
        if value in (float("inf"), float("-inf")):
            self.report.at("LJ0006", token, f"`{token.text[:20]}` is too large a number")
            return s.Broken(token.start, token.end)
        return s.NumberLiteral(token.start, token.end, value, token.unit)

    def text(self, token: Token) -> s.TextLiteral:
        if token.text.startswith('""' + '"') and len(token.text) >= 6:
            raw = _dedented(token.text[3:-3])
        else:
            raw = token.text[1:-1] if len(token.text) > 1 and token.text.endswith('"') else token.text[1:]
        if "\\" in raw:
            raw = _ESCAPE.sub(lambda match: _ESCAPES.get(match[1], match[1]), raw)
        return s.TextLiteral(token.start, token.end, raw)

    def flag(self, token: Token) -> s.FlagLiteral:
        return s.FlagLiteral(token.start, token.end, token.text == "true")

    def set_operand(self, names: s.NameSet) -> s.NameSet:
        return names

    def paren(self, opening: Token, arguments: Arguments, closing: Token) -> s.Expression:
        items = self._unnamed(arguments)
        if len(items) == 1:
            item = items[0]
            if type(item) is s.UnaryExpr and item.operator == "not":  # a `not` in brackets is closed: see `_Ranker`
                return s.UnaryExpr(opening.start, closing.end, item.depth, "not", item.operand)
            return item
        return self._bounded(s.Tuple(opening.start, closing.end, _below(items), items))

    def empty_list(self, opening: Token, closing: Token) -> s.List:
        return s.List(opening.start, closing.end, 1, ())

    def list(self, opening: Token, arguments: Arguments, closing: Token) -> s.Expression:
        items = self._unnamed(arguments)
        return self._bounded(s.List(opening.start, closing.end, _below(items), items))

    def empty_call(self, name: Token, _opening: Token, closing: Token) -> s.CallExpr:
        return s.CallExpr(name.start, closing.end, 1, _word(name), ())

    def call(self, name: Token, _opening: Token, arguments: Arguments, closing: Token) -> s.Expression:
        depth = _below(tuple(argument.value for argument in arguments))
        return self._bounded(s.CallExpr(name.start, closing.end, depth, _word(name), tuple(arguments)))

    def subscript(self, base: s.Expression, _opening: Token, index: FlatExpr, closing: Token) -> s.Expression:
        done = self._done(index)
        return self._bounded(s.Subscript(base.start, closing.end, _below((base, done)), base, done))

    def attribute(self, base: s.Expression, _dot: Token, name: Token) -> s.Expression:
        return self._bounded(s.FieldExpr(base.start, name.end, _below((base,)), base, _word(name)))

    def negative(self, sign: Token, operand: s.Expression) -> s.Expression:
        return self._bounded(s.UnaryExpr(sign.start, operand.end, _below((operand,)), "-", operand))

    def negation(self, sign: Token, operand: s.Expression) -> s.Expression:
        return self._bounded(s.UnaryExpr(sign.start, operand.end, _below((operand,)), "not", operand))

    def quantified(self, word: Token, variable: Token, _colon: Token, body: FlatExpr) -> s.Expression:
        return self._quantified(word, variable, None, body)

    def quantified_in(
        self, word: Token, variable: Token, _in: Token, domain: Token, _colon: Token, body: FlatExpr
    ) -> s.Expression:
        return self._quantified(word, variable, _word(domain), body)

    def positional(self, value: FlatExpr) -> s.CallArgument:
        done = self._done(value)
        return s.CallArgument(done.start, done.end, None, done)

    def named(self, name: Token, _equal: Token, value: FlatExpr) -> s.CallArgument:
        done = self._done(value)
        return s.CallArgument(name.start, done.end, _word(name), done)

    def comprehension(self, value: FlatExpr, _for: Token, variable: Token, _in: Token, domain: Token) -> s.CallArgument:
        done = self._done(value)
        over = s.ForClause(variable.start, domain.end, _word(variable), _word(domain))
        return s.CallArgument(done.start, domain.end, None, done, over)

    def named_number(self, name: Token, value: Token) -> s.CallArgument:
        return s.CallArgument(name.start, value.end, _word(name), self.number(value))

    # -- private

    def _quantified(self, word: Token, variable: Token, domain: s.Name | None, body: FlatExpr) -> s.Expression:
        done = self._done(body)
        depth = _below((done,))
        return self._bounded(s.QuantifiedExpr(word.start, done.end, depth, word.text, _word(variable), domain, done))

    def _unnamed(self, arguments: Arguments) -> tuple[s.Expression, ...]:
        for argument in arguments:
            if argument.over is not None:
                over = argument.over
                self.report.at("LJ0012", over, "`for … in …` belongs into a call: `sum(… for x in group)`")
            if argument.name is not None:
                name = argument.name
                self.report.at("LJ0012", name, "only a call has named arguments")
        return tuple([argument.value for argument in arguments])

    def _done(self, flat: FlatExpr | s.Expression) -> s.Expression:
        if type(flat) is not list:
            return flat  # type: ignore[return-value]
        if len(flat) > 2 * DEEPEST:
            start, end = flat[0].start, flat[-1].end
            self.report("LJ0005", start, end, f"an expression has more than {DEEPEST} operators", "split it into rules")
            return s.Broken(start, end)
        return _Ranker(self, flat).run()

    def _bounded(self, node: s.CompositeExpr) -> s.Expression:
        if node.depth <= DEEPEST:
            return node  # type: ignore[return-value]
        self.report.at("LJ0005", node, f"an expression is nested deeper than {DEEPEST}")
        return s.Broken(node.start, node.end)


class _Ranker:
    """Precedence climbing over one flat list; `not` binds looser than comparisons and tighter than `and`."""

    def __init__(self, builder: Builder, flat: FlatExpr) -> None:
        self.builder = builder
        self.flat = flat
        self.at = 0

    def run(self) -> s.Expression:
        return self._climb(0)

    def _climb(self, least: int) -> s.Expression:
        left = self._operand()
        while self.at < len(self.flat):
            operator = self.flat[self.at].text
            rank = RANKS[operator]
            if rank < least:
                break
            self.at += 1
            right = self._climb(rank + 1)
            depth = _below((left, right))
            left = self.builder._bounded(s.BinaryExpr(left.start, right.end, depth, operator, left, right))
        return left

    def _operand(self) -> s.Expression:
        value: s.Expression = self.flat[self.at]
        if type(value) is s.UnaryExpr and value.operator == "not" and not self._closed(value):
            self.flat[self.at] = value.operand
            operand = self._climb(RANKS["not"] + 1)
            depth = _below((operand,))
            return self.builder._bounded(s.UnaryExpr(value.start, operand.end, depth, "not", operand))
        self.at += 1
        return value

    def _closed(self, value: s.UnaryExpr) -> bool:
        """Whether the `not` stands in brackets of its own, and so takes nothing to its right."""
        return self.builder.report.source.text.startswith("(", value.start)


_NOT_ACTIONS = frozenset({"actions", "report"})


def _dedented(raw: str) -> str:
    """The lines of a long text without their common indentation and without the blank first and last line."""
    lines = raw.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    rest = [line for line in lines[1:] if line.strip()]
    margin = min((len(line) - len(line.lstrip(" \t")) for line in rest), default=0)
    kept = [lines[0].strip(), *(line[margin:].rstrip() for line in lines[1:])]
    while kept and not kept[0]:
        kept.pop(0)
    while kept and not kept[-1]:
        kept.pop()
    return "\n".join(kept)


def _word(token: Token) -> s.Name:
    return s.Name(token.start, token.end, token.text)


def _below(nodes: tuple[s.Expression, ...]) -> int:
    depth = 0
    for node in nodes:
        if isinstance(node, s.CompositeExpr) and node.depth > depth:
            depth = node.depth
    return depth + 1
