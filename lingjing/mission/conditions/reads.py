"""`Reader`: the leaves of a condition, and the quantities that each leaf reads.

A rule that a condition calls is expanded once for each condition, so that the size stays linear in the mission.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.conditions.declarations import Declarations, Group
from lingjing.mission.conditions.quantities import Cause, Quantity, QuantityKind, Record
from lingjing.mission.evaluate import Scope, number
from lingjing.mission.expression_text import spell
from lingjing.mission.functions import OPERATIONS, TEMPORAL, conditions_of
from lingjing.mission.vocabulary import PHOTO

_DISTANCES = ("distance", "distance_xy")

Names = Mapping[str, str]
"""Bound names → the group or message kind that each ranges over."""

_TAINTED: Mapping[QuantityKind, str] = {
    "position": "position",
    "velocity": "position",
    "heading": "position",
    "status": "status",
}
"""Kind → the field in `Taint.fields` that it depends on, if it has another name."""

_FIELDS: Mapping[str, QuantityKind] = {
    "position": "position",
    "velocity": "velocity",
    "heading_deg": "heading",
    "status": "status",
}
"""Fields that every entity has during a mission, by their names in the graph."""


class Leaf(Record, frozen=True, kw_only=True):
    """One part of a condition: a comparison, a fact such as `emitted(rescue, v)`, or the call of a rule."""

    text: str
    """The part as it is written."""
    negated: bool = False
    """True if it stands under an odd number of `not`s."""
    via: tuple[str, ...] = ()
    """The rules through which the condition reads it, outermost first; empty for a part of its own text."""
    necessary: bool = False
    """True if the condition holds only where this part does (or does not, if negated), for at least one member of each
    group that a quantifier names."""
    quantities: tuple[Quantity, ...] = ()
    """The quantities that it reads, each once."""

    radius_m: float | None = None
    """The distance that it compares a distance with, metres, at the default settings; None for another part."""

    @property
    def hidden(self) -> bool:
        """True if it reads a hidden quantity."""
        return any(quantity.hidden for quantity in self.quantities)


class _PartPlace(NamedTuple):
    """The place of a part in a condition."""

    negated: bool
    necessary: bool
    via: tuple[str, ...]


_WHOLE = _PartPlace(negated=False, necessary=True, via=())
"""The place of the whole condition."""


class Reader:
    """Reads one condition."""

    def __init__(self, declarations: Declarations) -> None:
        self._of = declarations
        self._expanded: set[str] = set()

    def leaves(self, expr: ex.Expr, names: Names) -> Iterator[Leaf]:
        """The leaves of a condition in reading order, with those of the rules that it calls."""
        yield from self._leaves(expr, names, _WHOLE)

    def value(self, expr: ex.Expr, names: Names) -> Leaf:
        """The quantities of a value that decides together with a condition, such as a deadline."""
        place = _WHOLE._replace(necessary=False)
        return self._leaf(expr, place, tuple(dict.fromkeys(self._read(expr, names))))

    def _leaves(self, expr: ex.Expr, names: Names, place: _PartPlace) -> Iterator[Leaf]:
        match expr:
            case ex.Binary(operator="and" | "or" as operator, left=left, right=right):
                both = (operator == "and") is not place.negated
                inner = place if both else place._replace(necessary=False)
                yield from self._leaves(left, names, inner)
                yield from self._leaves(right, names, inner)
            case ex.Unary(operator="not", operand=operand):
                yield from self._leaves(operand, names, place._replace(negated=not place.negated))
            case ex.Quantified(variable=variable, domain=domain, body=body):
                yield Leaf(text=f"{variable} in {domain}", via=place.via, quantities=self._range(domain, body))
                yield from self._leaves(body, {**names, variable: domain}, place)
            case ex.Call(rule=True):
                yield from self._called(expr, names, place)
            case ex.Call(function=function) if function in TEMPORAL:
                lengths = (self._read(length, names) for length in expr.arguments[TEMPORAL[function] :])
                yield self._leaf(expr, place, tuple(dict.fromkeys((_TIME, *itertools.chain(*lengths)))))
                for number, condition in enumerate(conditions_of(expr)):
                    necessary = place.necessary and not place.negated and (function != "before" or number == 0)
                    yield from self._leaves(condition, names, place._replace(necessary=necessary))
            case _:
                yield self._leaf(
                    expr, place, tuple(dict.fromkeys(self._read(expr, names))), _radius_m(expr, self._of.scope)
                )
                for over_time in _over_time_in(expr):  # inside of `count(held(…) for …)`
                    inner = place._replace(necessary=False)
                    yield from self._leaves(over_time, {**names, **_bound_in(expr)}, inner)
                for call in _rules_in(expr):  # inside of `count(…)` and other aggregates
                    yield from self._called(call, {**names, **_bound_in(expr)}, place._replace(necessary=False))

    def _leaf(
        self, expr: ex.Expr, place: _PartPlace, quantities: tuple[Quantity, ...], radius_m: float | None = None
    ) -> Leaf:
        return Leaf(
            text=spell(expr),
            negated=place.negated,
            via=place.via,
            necessary=place.necessary,
            quantities=quantities,
            radius_m=radius_m,
        )

    def bound(self, names: Names) -> Iterator[Leaf]:
        """One leaf for each name that the declaration binds."""
        for name, domain in names.items():
            quantities = tuple(self._domain(domain, indirect=True))
            yield Leaf(text=f"{name} in {domain}", quantities=quantities)

    def _called(self, call: ex.Call, names: Names, place: _PartPlace) -> Iterator[Leaf]:
        read = tuple(quantity for argument in call.arguments for quantity in self._index(argument, names))
        judged = Quantity(kind="rule", name=call.function)
        yield self._leaf(call, place, (judged, *read))
        rule = self._of.rules.get(call.function)
        if rule is None or rule.name in self._expanded:
            return
        self._expanded.add(rule.name)
        domains = {parameter.name: parameter.domain for parameter in rule.parameters}
        inner = place._replace(via=(*place.via, rule.name))
        for leaf in self.bound(domains):
            yield Leaf(text=leaf.text, via=inner.via, quantities=leaf.quantities)
        yield from self._leaves(rule.condition, domains, inner)

    # -- what one leaf reads

    def _read(self, expr: ex.Expr, names: Names) -> Iterator[Quantity]:
        match expr:
            case ex.Attr(base=base, name=name):
                yield from self._field(base, name, names)
            case ex.Index() | ex.Ref(kind="local" | "group" | "entity"):
                yield from self._index(expr, names)
                yield from self._entity(expr, "position", names)
            case ex.Ref(kind="clock"):
                yield _TIME if expr.name == "now" else Quantity(kind="setting", name=expr.name)
            case ex.Ref(kind="region" | "grid", name=name):
                yield Quantity(kind="region", name=name, hidden=name in self._of.hidden_regions)
            case ex.Ref(name=name):
                yield Quantity(kind="setting", name=name, hidden=name in self._of.hidden_settings)
            case ex.Call(rule=True):
                yield Quantity(kind="rule", name=expr.function)
            case ex.Call(function=function) if function in _FACTS:
                for argument in expr.arguments:
                    yield from self._index(argument, names)
                yield from _FACTS[function](self, expr, names)
            case (
                ex.Quantified(variable=variable, domain=domain, body=body)
                | ex.Aggregate(variable=variable, domain=domain, body=body)
            ):
                yield from self._range(domain, body)
                yield from self._read(body, {**names, variable: domain})
            case _:
                for child in ex.children(expr):
                    yield from self._read(child, names)

    def _field(self, base: ex.Expr, name: str, names: Names) -> Iterator[Quantity]:
        owner = self._owner(base, names)
        if owner is None:
            yield from self._read(base, names)  # a coordinate of a position, the box of a true picture
            return
        yield from self._index(base, names)
        if owner in self._of.messages:
            yield self._message(owner, name, indirect=_is_bound(base))
        else:
            yield from self._entity(base, name, names)

    def _owner(self, base: ex.Expr, names: Names) -> str | None:
        """The group or message kind that an entity expression names; None for another expression."""
        match base:
            case ex.Ref(kind="local", name=name):
                return names.get(name)
            case ex.Ref(kind="group" | "entity", name=name):
                return name
            case ex.Index(base=inner):
                return self._owner(inner, names)
        return None

    def _index(self, expr: ex.Expr, names: Names) -> Iterator[Quantity]:
        """The quantities in the index of an entity expression."""
        if isinstance(expr, ex.Index):
            yield from self._read(expr.index, names)

    def _entity(self, expr: ex.Expr, field: str, names: Names) -> Iterator[Quantity]:
        owner = self._owner(expr, names) or ""
        group = self._of.group(owner)
        if group is not None:
            plain = "" if field == "position" else field
            yield self._of_group(group, _kind_of(group, field), plain, indirect=_is_bound(expr))
        elif owner in self._of.messages:
            yield self._message(owner, "position", indirect=_is_bound(expr))

    def _of_group(self, group: Group, kind: QuantityKind, name: str = "", *, indirect: bool = False) -> Quantity:
        shown = name or (kind if kind in ("position", "velocity", "heading", "status") else "")
        causes = tuple(_CAUSES[kind](self._of, group, name)) if kind in _CAUSES else ()
        share = name in group.shares
        return Quantity(
            kind=kind,
            owner=group.name,
            name=shown,
            causes=causes,
            least=0.0 if share else None,
            most=1.0 if share else None,
            hidden=bool(group.hidden) or (group.name, _TAINTED.get(kind, name)) in self._of.taint.fields,
            indirect=indirect,
        )

    def _message(self, kind: str, field: str = "", *, indirect: bool = False) -> Quantity:
        spec = next((item for item in self._of.messages[kind].fields if item.name == field), None)
        return Quantity(
            kind="message",
            owner=kind,
            name=field,
            causes=(Cause(kind="message", name=kind, by=self._of.senders(kind)),),
            least=(0.0 if field == "sent" else None) if spec is None else spec.minimum,
            most=None if spec is None else spec.maximum,
            indirect=indirect,
        )

    def _range(self, domain: str, body: ex.Expr) -> tuple[Quantity, ...]:
        """The members that a quantifier or an aggregate binds."""
        return tuple(self._domain(domain, indirect=next(_rules_in(body), None) is not None))

    def _domain(self, domain: str, *, indirect: bool = False) -> Iterator[Quantity]:
        if domain in self._of.messages:
            yield self._message(domain, indirect=indirect)
        elif (group := self._of.group(domain)) is not None:
            yield self._of_group(group, "presence", indirect=indirect)

    # -- what the facts of a running mission read

    def _emitted(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        event = call.arguments[0]
        kind = event.name if isinstance(event, ex.Symbol | ex.Ref) else spell(event)
        owners = [self._of.group(self._owner(argument, names) or "") for argument in call.arguments[1:]]
        groups = [group for group in owners if group is not None]
        secret = self._is_secret(kind, groups)
        if not groups:
            groups = [g for g in self._of.groups.values() if any(spec.name == kind for spec in g.interactions)]
        if not groups:
            yield Quantity(kind="event", name=kind, causes=(Cause(kind="engine", name="any"),))
        for group in groups:
            yield Quantity(
                kind="event",
                owner=group.name,
                name=kind,
                causes=tuple(_event_causes(self._of, group, kind)),
                hidden=bool(group.hidden) or secret,
            )

    def _is_secret(self, interaction: str, named: list[Group]) -> bool:
        """True if hidden values decide an interaction with the named targets, or with any target if none is named."""
        targets = {group.name for group in named if any(spec.name == interaction for spec in group.interactions)}
        return any(
            name == interaction and (not targets or target in targets) for name, target in self._of.taint.interactions
        )

    def _count(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        counted = call.arguments[0]
        if isinstance(counted, ex.Symbol) and counted.name in self._of.events:
            cause = Cause(kind="event", name=counted.name)
            yield Quantity(kind="event", name=counted.name, causes=(cause,), least=0.0)
        else:
            yield from self._emitted(call, names)

    def _assigned(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        asset, target = (self._of.group(self._owner(argument, names) or "") for argument in call.arguments[:2])
        causes = [Cause(kind="verb", name=verb, by=asset.commanded_by) for verb in asset.moving_verbs] if asset else []
        causes += [
            Cause(kind="message", name=message.kind, by=self._of.senders(message.kind))
            for message in self._of.messages.values()
            if message.category == "assignment"
        ]
        hidden = any(group is not None and self._hides_place(group) for group in (asset, target))
        hidden = hidden or (target is not None and target.name in self._of.taint.sighted)
        owner = target.name if target is not None else ""
        yield Quantity(
            kind="assignment", owner=owner, name=asset.name if asset else "", causes=tuple(causes), hidden=hidden
        )
        for argument in call.arguments[:2]:  # a part that names an entity reads it, besides its assignments
            group = self._of.group(self._owner(argument, names) or "")
            if group is not None and not _is_bound(argument):
                yield self._of_group(group, "presence")

    def _hides_place(self, group: Group) -> bool:
        return bool(group.hidden) or (group.name, "position") in self._of.taint.fields

    def _alive(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        for argument in call.arguments:
            yield from self._domain(self._owner(argument, names) or "", indirect=_is_bound(argument))

    def _photographed(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        for argument in call.arguments:
            group = self._of.group(self._owner(argument, names) or "")
            if group is not None:
                yield self._of_group(group, "picture", indirect=_is_bound(argument))

    def _speed(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        for argument in call.arguments:
            group = self._of.group(self._owner(argument, names) or "")
            if group is not None:
                yield self._of_group(group, "velocity", indirect=_is_bound(argument))

    def _truth(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        group = self._of.group(self._owner(call.arguments[0], names) or "")
        causes = tuple(
            cause
            for carrier in self._of.groups.values()
            if carrier.role == "asset"
            for cause in _picture_causes(self._of, carrier, "")
        )
        # The true box of a public target reveals only whether a report matches, which is in the trace alone.
        hidden = group is None or self._hides_place(group)
        owner = group.name if group else ""
        indirect = _is_bound(call.arguments[0])
        yield Quantity(kind="true box", owner=owner, causes=causes, hidden=hidden, indirect=indirect)
        for argument in call.arguments[1:]:
            yield from self._read(argument, names)

    def _inspection(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        named = call.arguments[0]
        name = named.name if isinstance(named, ex.Symbol | ex.Ref) else spell(named)
        asset, inspectors, replan = self._of.inspections.get(name, ("", (), ""))
        bodies = [group for group in map(self._of.group, (asset, *inspectors)) if group is not None]
        causes = [cause for group in bodies for cause in _motion_causes(self._of, group, "")]
        if replan:
            causes.append(Cause(kind="message", name=replan, by=self._of.senders(replan)))
        secret = OPERATIONS[call.function].secret or any(map(self._hides_place, bodies))
        kind: QuantityKind = "counter" if call.function == "replans" else "route"
        yield Quantity(kind=kind, owner=name, causes=tuple(dict.fromkeys(causes)), hidden=secret)

    def _used(self, call: ex.Call, names: Names) -> Iterator[Quantity]:
        named = call.arguments[0]
        name = named.name if isinstance(named, ex.Symbol | ex.Ref) else spell(named)
        causes = [
            Cause(kind="message" if kind == "message" else "verb", name=counted or "*")
            for kind, counted in self._of.counted.get(name, ())
        ]
        yield Quantity(kind="counter", owner=name, causes=tuple(causes), least=0.0)


_TIME = Quantity(kind="time", name="now", causes=(Cause(kind="time", name="now"),), least=0.0)

_FACTS: Mapping[str, Callable[[Reader, ex.Call, Names], Iterator[Quantity]]] = {
    "emitted": Reader._emitted,
    "assigned": Reader._assigned,
    "alive": Reader._alive,
    "photographed": Reader._photographed,
    "speed": Reader._speed,
    "truth": Reader._truth,
    "inspected": Reader._inspection,
    "clear": Reader._inspection,
    "replans": Reader._inspection,
    "used": Reader._used,
    "count": Reader._count,
}
"""Functions of a running mission. Their arguments name things and are not read as positions."""


def _kind_of(group: Group, field: str) -> QuantityKind:
    changing = field in group.states or field in group.shares
    return _FIELDS.get(field) or ("state" if changing else "property")


def _motion_causes(of: Declarations, group: Group, name: str) -> Iterator[Cause]:
    for verb in group.moving_verbs:
        yield Cause(kind="verb", name=verb, by=group.commanded_by)
    if group.drifts:
        yield Cause(kind="engine", name=group.engine)
    for spec in group.interactions:
        if spec.name in group.aboard:
            yield Cause(kind="interaction", name=spec.name, by=of.actors(spec))


def _status_causes(of: Declarations, group: Group, name: str) -> Iterator[Cause]:
    for spec in group.interactions:
        yield Cause(kind="interaction", name=spec.name, by=of.actors(spec))
    yield Cause(kind="engine", name=group.engine)
    yield from _presence_causes(of, group, name)
    yield from _set_causes(of, group, "status")


def _state_causes(of: Declarations, group: Group, field: str) -> Iterator[Cause]:
    plain = group.states.get(field, "")
    if not plain:  # a share that the engine reports, such as a battery: motion consumes it
        yield from _motion_causes(of, group, field)
        yield Cause(kind="engine", name=group.engine)
        return
    for target in of.groups.values():
        for spec in target.interactions:
            own = target.name == group.name and spec.own == plain
            if own or (spec.carried == plain and group.name in of.actors(spec)):
                yield Cause(kind="interaction", name=spec.name, by=of.actors(spec))
    if group.engine != "city":
        yield Cause(kind="engine", name=group.engine)
    yield from _set_causes(of, group, field)


def _set_causes(of: Declarations, group: Group, field: str) -> Iterator[Cause]:
    for event in of.settings.get((group.name, field), ()):
        yield Cause(kind="event", name=event)


def _presence_causes(of: Declarations, group: Group, name: str) -> Iterator[Cause]:
    for event in of.presences.get(group.name, ()):
        yield Cause(kind="event", name=event)
    if group.role == "asset":
        yield Cause(kind="engine", name=group.engine)


def _event_causes(of: Declarations, group: Group, name: str) -> Iterator[Cause]:
    performed = [spec for spec in group.interactions if spec.name == name]
    for spec in performed:
        yield Cause(kind="interaction", name=spec.name, by=of.actors(spec))
    if not performed:
        yield Cause(kind="engine", name=group.engine)


def _picture_causes(of: Declarations, group: Group, name: str) -> Iterator[Cause]:
    if PHOTO in group.verbs:
        yield Cause(kind="verb", name=PHOTO, by=group.commanded_by)
    if group.photographs:
        yield Cause(kind="engine", name="camera")


_CAUSES: Mapping[QuantityKind, Callable[[Declarations, Group, str], Iterator[Cause]]] = {
    "position": _motion_causes,
    "velocity": _motion_causes,
    "heading": _motion_causes,
    "status": _status_causes,
    "state": _state_causes,
    "presence": _presence_causes,
    "picture": _picture_causes,
}


def _is_bound(expr: ex.Expr) -> bool:
    """True for a bound name, and for a field or a member of one."""
    while isinstance(expr, ex.Index | ex.Attr):
        expr = expr.base
    return isinstance(expr, ex.Ref) and expr.kind == "local"


def _radius_m(expr: ex.Expr, scope: Scope) -> float | None:
    """The number on the other side of a distance, if it is known before a run."""
    match expr:
        case ex.Binary(operator="<" | "<=" | ">" | ">=", left=ex.Call(function=function), right=bound) if (
            function in _DISTANCES
        ):
            pass
        case ex.Binary(operator="<" | "<=" | ">" | ">=", left=bound, right=ex.Call(function=function)) if (
            function in _DISTANCES
        ):
            pass
        case _:
            return None
    try:
        return number(bound, scope)
    except MissionError:
        return None


def _over_time_in(expr: ex.Expr) -> Iterator[ex.Call]:
    """The calls of functions over time below an aggregate or another value."""
    return (part for part in ex.parts(expr) if isinstance(part, ex.Call) and part.function in TEMPORAL)


def _rules_in(expr: ex.Expr) -> Iterator[ex.Call]:
    """The calls of rules below an aggregate or another value."""
    return (part for part in ex.parts(expr) if isinstance(part, ex.Call) and part.rule)


def _bound_in(expr: ex.Expr) -> dict[str, str]:
    return {part.variable: part.domain for part in ex.parts(expr) if isinstance(part, ex.Aggregate | ex.Quantified)}


def domains_of(declaration: model.Rule | model.Unlock) -> dict[str, str]:
    """The names that a rule or an unlock binds, with the group or message kind of each."""
    return {parameter.name: parameter.domain for parameter in declaration.parameters}
