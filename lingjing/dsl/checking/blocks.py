"""Blocks of `key = value` lines: the keys of a block, and reading of its lines into checked values.

A key gives a property's name, type and relations. `BlockReader.read` reports lines that do not fit (unknown keys, wrong
relations, repeated lines, misplaced statements) and returns the others by name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from lingjing.dsl.checking.corrections import size_of
from lingjing.dsl.checking.elaborate import Elaborator
from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, UNKNOWN, Environment, Taint, TypedExpression
from lingjing.dsl.source.reporter import Change
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.foreign import CONTROL, KEYS, PREFIXES
from lingjing.dsl.syntax.keys import PropertyKey
from lingjing.dsl.syntax.statement_kinds import FILE, TYPE
from lingjing.dsl.syntax.statements import KINDS, kind_of
from lingjing.mission import expression as ex
from lingjing.mission.functions import DEGREES, DISTRIBUTIONS, MPS, NUMBER, Type
from lingjing.mission.units import NONE, dimension_unit
from lingjing.suggest import did_you_mean, is_certain, nearest

SEA_LEVEL = "sea level"


class BlockReader:
    """Reads blocks with their keys."""

    def __init__(self, elaborator: Elaborator) -> None:
        self.of = elaborator
        self.report = elaborator.report

    def read(
        self,
        block: s.BracedBlock | None,
        keys: dict[str, PropertyKey],
        what: str,
        *,
        environment: Environment = STATIC,
        others: tuple[type, ...] = (),
        owner: s.SyntaxNode | None = None,
        lenient: bool = False,
    ) -> dict[str, PropertyEntry]:
        """Return the block's correct properties. `others`: statement types that the caller reads itself.

        `lenient`: True to skip unknown keys, if the permitted keys are not known.
        """
        entries: dict[str, PropertyEntry] = {}
        seen: dict[str, s.PropertyLine] = {}
        for item in block.items if block else ():
            if isinstance(item, s.PropertyLine):
                if lenient and item.name.text not in keys:
                    continue
                self._property(item, keys, what, environment, seen, entries)
            elif not isinstance(item, (*others, s.Faulty)):
                self.misplaced(item, what, keys)
        faulty = any(isinstance(item, s.Faulty) for item in (block.items if block else ()))
        place = owner or block
        if place is not None and not faulty:
            self._required(keys, seen, what, place)
        return entries

    def misplaced(self, item: s.Statement, what: str, keys: Iterable[str] = ()) -> None:
        """Report a statement that does not belong in this block."""
        text = self.report.source.text[item.start : item.end]
        first = text.split(None, 1)[0].rstrip(":({,") if text.split() else ""
        declared = getattr(item, "name", None)
        was_poisoned = isinstance(declared, s.Name) and declared.text in self.of.scope.poisoned
        if isinstance(item, s.PropertyLine | s.UnknownBlock) and isinstance(declared, s.Name):
            self.of.scope.poisoned.add(declared.text)  # it may have been intended as the declaration that it resembles
        name: s.SyntaxNode = item
        if isinstance(item, s.Bare | s.UnknownBlock):
            name, first = item.name, item.name.text
        end = name.end if name is not item else item.start + len(first)
        code = "LJ0108" if isinstance(item, s.Bare | s.UnknownBlock | s.FieldLine) else "LJ0107"
        hint = did_you_mean(first, list(keys)) if code == "LJ0108" else ""
        hint = CONTROL.get(first, hint)
        if code == "LJ0108" and was_poisoned:
            return
        if isinstance(item, s.FieldLine):
            hint = f"write `{first} = …`"
        if isinstance(item, s.PropertyLine) and isinstance(item.value, s.CallExpr) and first not in CONTROL:
            hint = hint or f"an entity is declared: `asset {first} : TYPE {{ position = (… m, … m) }}`"
        message = f"`{first}` has no meaning in {what}" if code == "LJ0107" else f"{what} knows no `{first}`"
        hint = hint or _place_of(item)
        self.report(code, name.start, max(end, name.start + 1), message, hint)

    def leak(self, taint: Taint, node: s.SyntaxNode, sink: str) -> None:
        """Report a hidden value that becomes visible, with its path."""
        if not taint:
            return
        from lingjing.mission.diagnostics import Related

        names = [step.name for step in taint]
        way = " → ".join([name for name, before in zip(names, ["", *names], strict=False) if name != before] + [sink])
        related = tuple(
            Related(step.span, f"{step.name}{' is hidden here' if i == 0 else ''}") for i, step in enumerate(taint)
        )
        self.report.at(
            "LJ0401",
            node,
            f"a hidden value reaches {sink}: {way}",
            "hidden values may reach only `adjudicate`, `truth(…)` and sensors",
            related=related,
        )

    # -- private

    def _property(
        self,
        item: s.PropertyLine,
        keys: dict[str, PropertyKey],
        what: str,
        environment: Environment,
        seen: dict[str, s.PropertyLine],
        entries: dict[str, PropertyEntry],
    ) -> None:
        name = item.name
        key = keys.get(name.text)
        if key is None:
            proposed = [each.name for each in keys.values() if each.proposed]
            right_name = KEYS.get(name.text)
            right_name = right_name if right_name in proposed and right_name not in seen else None
            hint = f"write `{right_name}`" if right_name else did_you_mean(name.text, proposed)
            hint = PREFIXES.get(name.text, hint)
            close = right_name or nearest(name.text, proposed)
            certain = right_name is None and is_certain(name.text, set(proposed) - seen.keys())
            self.report.at("LJ0108", name, f"{what} knows no `{name.text}`", hint, replace=close, safe=certain)
            if close is not None:
                seen.setdefault(close, item)  # otherwise it would be reported as missing too
            return
        if name.text in seen:
            first = seen[name.text].name
            self.duplicate(name, first, f"`{name.text}` is given twice")
            return
        seen[name.text] = item
        if item.hidden and not key.hideable:
            self.report(
                "LJ0402",
                item.start,
                name.end,
                f"`{name.text}` in {what} cannot be hidden",
                "only properties of targets and assets can be hidden",
            )
            return
        if item.guard is not None and not key.guarded:
            guard = item.guard
            self.report.at("LJ0307", guard, f"`{name.text}` cannot depend on a condition")
            return
        if item.relation not in key.relations:
            allowed = " or ".join(f"`{relation}`" for relation in key.relations)
            self.report(
                "LJ0303",
                name.start,
                item.value.start,
                f"`{name.text}` takes {allowed}, not `{item.relation}`",
                f"write `{name.text} {key.relations[0]} …`",
                replace=f"{name.text} {key.relations[0]} " if len(key.relations) == 1 else None,
                safe=item.relation != "~",
            )
            return
        if self._is_undrawn(item, key):
            return
        parts = self.parts(item.value, key, item.relation, environment)
        if any(part is UNKNOWN for part in parts):
            return
        if not self.in_bounds(item, key, parts):
            return
        if key.public:
            for part in parts:
                self.leak(part.taint, item.value, f"`{name.text}` of {what}")
        entries[name.text] = PropertyEntry(item, key, parts)

    def _is_undrawn(self, item: s.PropertyLine, key: PropertyKey) -> bool:
        """True for `position = sites(…)`, a draw after `=`. Reports it."""
        value = item.value
        drawn = isinstance(value, s.CallExpr) and value.function.text in DISTRIBUTIONS
        if not drawn or item.relation == "~" or "~" not in key.relations:
            return False
        if not isinstance(value, s.CallExpr) or value.function.text in self.of.scope.rules:
            return False
        message, hint = f"`{value.function.text}(…)` draws a value", f"write `{key.name} ~ …`"
        self.report.at("LJ0302", value.function, message, hint, edits=((item.name.end, value.start, " ~ "),))
        return True

    def in_bounds(self, item: s.PropertyLine, key: PropertyKey, parts: tuple[TypedExpression, ...]) -> bool:
        """True if a value, and all results of a draw, are within the key's bounds. Reports a value that is not."""
        number = self.of.constant(parts[0].ir)
        if number is not None and key.whole and number != int(number):
            place = item.value
            self.report.at("LJ0206", place, f"`{key.name}` counts in whole numbers, this is {number:g}")
            return False
        outside = [each for each in self._ends(parts[0].ir) if not _within(key, each)]
        if not outside:
            return True
        unit = f" {dimension_unit(key.type.dimension)}".rstrip() if key.type.dimension else ""
        limits = (("above", key.above), ("at least", key.low), ("at most", key.high))
        bounds = " and ".join(f"{word} {limit:.12g}{unit}" for word, limit in limits if limit is not None)
        message, hint = f"`{key.name}` must be {bounds}", ""
        if (key.low, key.high) == (0.0, 1.0) and key.type.dimension in (None, NONE) and 1.0 < outside[0] <= 100.0:
            hint = f"write `{outside[0]:g} %`"
        if isinstance(parts[0].ir, ex.Draw):
            endless = math.isinf(outside[0])
            message += ", this draw has no such end" if endless else f", this draw can give {outside[0]:g}{unit}"
            hint = "cut it off: `normal(…, low >= …, high <= …)`" if endless else ""
        self.report.at("LJ0206", item.value, message, hint)
        return False

    def _ends(self, ir: ex.Expr) -> list[float]:
        """The constants between which a value lies: itself, or the ends of a draw; infinite where a draw is not cut
        off.
        """
        ends: list[ex.Expr] = [ir]
        endless: list[float] = []
        if isinstance(ir, ex.Draw):
            cuts = dict(ir.named)
            ends = list(ir.arguments)
            if ir.distribution == "normal":
                ends = [cuts[name] for name in ("low", "high") if name in cuts]
                endless = [end for name, end in (("low", -math.inf), ("high", math.inf)) if name not in cuts]
            elif ir.distribution not in ("uniform", "integer"):
                ends = [item for listed in ends if isinstance(listed, ex.Sequence) for item in listed.items]
        return [number for end in ends if (number := self.of.constant(end)) is not None] + endless

    def check_state(self, item: s.PropertyLine, kind: Type) -> None:
        """Check that a state is a number. Places and headings change without a declaration."""
        if not item.state or kind.kind == "any":
            return
        if item.name.text in ("position", "heading"):
            self.report("LJ0110", item.start, item.name.end, f"`{item.name.text}` changes by itself: it is no state")
        elif kind.kind != "quantity":
            self.report.at("LJ0201", item.value, f"a state is a number, this is {with_article(kind)}")

    def duplicate(self, node: s.SyntaxNode, first: s.SyntaxNode, message: str, code: str = "LJ0103") -> None:
        """Report a repeated declaration, with the place of the first."""
        from lingjing.mission.diagnostics import Related

        self.report.at(
            code,
            node,
            message,
            "remove one of the two",
            related=(Related(self.report.span(first.start, first.end), "first given here"),),
        )

    def parts(
        self, node: s.Expression, key: PropertyKey, relation: str, environment: Environment
    ) -> tuple[TypedExpression, ...]:
        """Return the checked value in its parts."""
        what = f"`{key.name}`"
        kind = key.type.kind
        if isinstance(node, s.Broken):
            return (UNKNOWN,)
        if kind == "directed":
            return self._directed(node, key, relation, environment)
        if kind == "size":
            return self._size(node, what, environment)
        if kind == "level":
            return (self._level(node, what, environment),)
        if relation == "~" and key.choices is not None:
            return (self._drawn_choice(node, key, environment),)
        if relation == "~":
            value = self.of.calls.draw(node, environment)
            return (value if self.of.fits(value, key.type, node, what) else UNKNOWN,)
        if (
            kind == "name"
            and isinstance(node, s.Name)
            and (key.choices is not None or node.text not in environment.locals)
        ):
            return (self._choice(node, key),)
        if key.file_ending and isinstance(node, s.TextLiteral):
            return (self._file(node, key),)
        if kind == "list" and key.type.item == "name" and isinstance(node, s.List):
            return (self._choices(node, key, environment),)
        return (self.of.expect(node, environment, key.type, what),)

    def _choice(self, node: s.Name, key: PropertyKey) -> TypedExpression:
        if key.choices is None or node.text in key.choices:
            return TypedExpression(ex.Symbol(node.text), key.type)
        self.report.unknown("LJ0109", node, f"`{key.name}` cannot be `{node.text}`", key.choices, sure=True)
        return UNKNOWN

    def _file(self, node: s.TextLiteral, key: PropertyKey) -> TypedExpression:
        if node.value.endswith(key.file_ending) and len(node.value) > len(key.file_ending):
            return TypedExpression(ex.Text(node.value), key.type)
        message = f"`{key.name}` cannot be the file `{node.value}`"
        self.report.at("LJ0109", node, message, f"name a file that ends in `{key.file_ending}`, or write a word")
        return UNKNOWN

    def _drawn_choice(self, node: s.Expression, key: PropertyKey, environment: Environment) -> TypedExpression:
        """`~ choice([red, blue])`: a draw among the words that the key permits."""
        drawn = node.function.text if isinstance(node, s.CallExpr) else ""
        listed = node.arguments[0].value if isinstance(node, s.CallExpr) and len(node.arguments) == 1 else None
        if drawn not in ("choice", "subset") or not isinstance(listed, s.List):
            message = f"`{key.name}` is drawn from a list of its words"
            self.report.at("LJ0301", node, message, f"write `{key.name} ~ choice([…])`")
            return UNKNOWN
        items = [self._word(item, key, environment) for item in listed.items]
        if not items or UNKNOWN in items:
            return UNKNOWN
        return TypedExpression(ex.Draw(drawn, (ex.Sequence(tuple(item.ir for item in items)),)), key.type)

    def _word(self, node: s.Expression, key: PropertyKey, environment: Environment) -> TypedExpression:
        if isinstance(node, s.Name):
            return self._choice(node, key)
        return self.of.expect(node, environment, Type("name"), f"`{key.name}`")

    def _choices(self, node: s.List, key: PropertyKey, environment: Environment) -> TypedExpression:
        items = [self._word(item, key, environment) for item in node.items]
        names = [item.ir for item in items]
        if len(names) != len(set(names)) and UNKNOWN not in items:
            self.report.at("LJ0103", node, f"`{key.name}` names something twice")
            return UNKNOWN
        if UNKNOWN in items:
            return UNKNOWN
        return TypedExpression(ex.Sequence(tuple(names)), key.type)

    def _directed(
        self, node: s.Expression, key: PropertyKey, relation: str, environment: Environment
    ) -> tuple[TypedExpression, ...]:
        word = key.type.of
        if not isinstance(node, s.BinaryExpr) or node.operator != word:
            self.report.at(
                "LJ0205",
                node,
                f"`{key.name}` is a speed and a direction",
                f"write `{key.name} {relation} 4 m/s {word} 220 deg`",
                edits=_directed_edits(node, word),
            )
            return (UNKNOWN,)
        parts = []
        for part, due in ((node.left, MPS), (node.right, DEGREES)):
            drawn = relation == "~" and isinstance(part, s.CallExpr)
            value = self.of.calls.draw(part, environment) if drawn else self.of.value(part, environment)
            parts.append(value if self.of.fits(value, due, part, f"`{key.name}`") else UNKNOWN)
        if relation == "~" and not any(isinstance(part.ir, ex.Draw) for part in parts) and UNKNOWN not in parts:
            self.report.at("LJ0301", node, "nothing is drawn here", f"write `{key.name} = …`, or draw the speed")
            return (UNKNOWN,)
        return tuple(parts)

    def _size(self, node: s.Expression, what: str, environment: Environment) -> tuple[TypedExpression, ...]:
        if not isinstance(node, s.BinaryExpr) or node.operator != "by":
            right = size_of(node, self.report.source)
            self.report.at("LJ0205", node, f"{what} is two numbers", f"write `{right or '3 by 3'}`", replace=right)
            return (UNKNOWN,)
        return tuple(self._whole(part, what, environment) for part in (node.left, node.right))

    def _whole(self, node: s.Expression, what: str, environment: Environment) -> TypedExpression:
        value = self.of.expect(node, environment, NUMBER, what)
        number = self.of.constant(value.ir)
        if number is not None and (number < 1 or number != int(number)):
            self.report.at("LJ0206", node, f"{what} counts in whole numbers from 1")
            return UNKNOWN
        return value

    def _level(self, node: s.Expression, what: str, environment: Environment) -> TypedExpression:
        metres = Type("quantity", (1, 0, 0, 0, 0, 0, 0, 0))
        if isinstance(node, s.BinaryExpr) and node.operator == "at":
            if isinstance(node.left, s.Name) and node.left.text.split() == SEA_LEVEL.split():
                return self.of.expect(node.right, environment, metres, what)
            left = node.left
            self.report.at("LJ0205", left, "a level is that of the sea", "write `sea level at -3.5 m`")
            return UNKNOWN
        return self.of.expect(node, environment, metres, what)

    def _required(
        self, keys: dict[str, PropertyKey], seen: dict[str, s.PropertyLine], what: str, place: s.SyntaxNode
    ) -> None:
        for key in keys.values():
            if key.required and key.name not in seen:
                end = place.start + len(self.report.source.text[place.start : place.end].split(None, 1)[0])
                self.report(
                    "LJ0106",
                    place.start,
                    min(end, place.end),
                    f"{what} lacks `{key.name}`",
                    f"add `{key.name} {key.relations[0]} …`: {with_article(key.type)}",
                )


class DeclarationChecker:
    """Base of the checkers of declarations: a method for each kind returns its part of the mission, or None if
    faulty."""

    def __init__(self, blocks: BlockReader) -> None:
        self.blocks = blocks
        self.of = blocks.of
        self.report = blocks.report
        self.scope = blocks.of.scope

    def asset(self, node: s.Expression, what: str, environment: Environment = STATIC) -> TypedExpression | None:
        """Return the checked asset or group of assets; None for other expressions, which are reported. `what` names the
        place.
        """
        value = self.of.value(node, environment)
        if value is UNKNOWN:
            return None
        if value.type.kind not in ("entity", "group"):
            self.report.at("LJ0201", node, f"an asset is due {what}, this is {with_article(value.type)}")
            return None
        if self.scope.groups[value.type.of].role != "asset":
            self.report.at("LJ0114", node, f"`{value.type.of}` is a target: agents cannot command it")
            return None
        return value


_PLACES = {FILE: "at the top of a file", TYPE: "in a type", **{word: f"in `{word}`" for word in KINDS}}
_PLACES["mission"] = "in a mission"


def _place_of(item: s.Statement) -> str:
    """The place where a statement stands, for one in another place."""
    kind = kind_of(item)
    if kind is None:
        return ""
    return f"it stands {' or '.join(_PLACES[place] for place in kind.within)}"


def _directed_edits(node: s.Expression, word: str) -> tuple[Change, ...]:
    """The edit that writes a speed and a direction with the right word between them."""
    if isinstance(node, s.BinaryExpr) and node.operator in ("at", "from", "to", "by"):
        return ((node.left.end, node.right.start, f" {word} "),)
    if isinstance(node, s.Tuple) and len(node.items) == 2:
        first, second = node.items
        return ((node.start, first.start, ""), (first.end, second.start, f" {word} "), (second.end, node.end, ""))
    return ()


def _within(key: PropertyKey, number: float) -> bool:
    below = (key.low is not None and number < key.low) or (key.above is not None and number <= key.above)
    return not below and (key.high is None or number <= key.high)
