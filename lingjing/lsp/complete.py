"""Completion: the keywords, names, properties, fields and units that are possible at a cursor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from lingjing.dsl.checking import library, settings, types
from lingjing.dsl.checking.scope import SymbolTables, TypeDecl
from lingjing.dsl.checking.toplevel import load_library
from lingjing.dsl.checking.typenames import word as type_word
from lingjing.dsl.syntax.keys import PropertyKey
from lingjing.dsl.syntax.lexer import OPERANDS
from lingjing.dsl.syntax.statement_kinds import FILE, TYPE, NamePlace
from lingjing.dsl.syntax.statements import KINDS, STATEMENTS
from lingjing.dsl.syntax.tokens import Token
from lingjing.lsp.analysis import Analysis
from lingjing.lsp.context import Context, context_at
from lingjing.lsp.pattern import due_in, keyword_place
from lingjing.mission import functions as f
from lingjing.mission.kinds import engine_kind
from lingjing.mission.units import ANGLE, BY_NAME, NONE, SPEED, UNITS, Dimension, dimension_name, unit_of


@dataclass(frozen=True, slots=True)
class CompletionItem:
    """A proposal for the text at the cursor."""

    label: str
    """The inserted text."""
    kind: str
    """`keyword`, `name`, `property`, `field`, `unit`, `function`, `verb`, `type`, `value` or `module`."""
    detail: str = ""
    """Short description; empty without one."""


@dataclass(frozen=True, slots=True)
class Completion:
    """The proposals, and the extent of the text that they replace."""

    items: tuple[CompletionItem, ...]
    start: int
    end: int


_COMPOUND = ("m/s", "km/h", "m/s^2", "deg/s", "m^2", "m^3", "kB/s", "B/s", "kg*m^2")
"""Compound units that are proposed."""
_AFTER_OPERAND = ("in", "and", "or", "when", "at", "by", "from", "to")
"""Keywords that may follow an operand."""


def complete(analysis: Analysis, offset: int) -> Completion:
    """Return the proposals at an offset."""
    context = context_at(analysis.source.text, offset)
    items = () if context.silent else tuple(dict.fromkeys(_Completer(analysis, context, offset).items()))
    return Completion(items, context.word_start, offset)


class _Completer:
    def __init__(self, analysis: Analysis, context: Context, offset: int) -> None:
        self.analysis = analysis
        self.at = context
        self.offset = offset
        self.scope: SymbolTables = analysis.scope
        self.due = due_in(context.statement)

    def items(self) -> Iterator[CompletionItem]:
        at = self.at
        if at.in_text:
            yield from self._names(("symbol",))
        elif at.number:
            yield from self._units()
        elif at.before() == "DOT":
            yield from self._fields()
        elif at.kind() == "USE":
            yield from self._of_library(at.blocks[-1])
        elif at.kind() == "ACTIONS" and at.before() in ("", "SEP"):
            yield from self._verbs()
        elif not at.statement or (at.before() == "HIDDEN" and len(at.statement) == 1):
            yield from self._beginnings()
        else:
            yield from self._inner()

    # -- beginnings of statements

    def _beginnings(self) -> Iterator[CompletionItem]:
        if not self.at.statement:
            place = self._place()
            kinds = [kind for kind in STATEMENTS if place in kind.within and not kind.has_subject]
            yield from (CompletionItem(kind.keyword, "keyword") for kind in kinds)
            if place == TYPE:
                yield CompletionItem("engine", "keyword")
        for name, detail in self._keys():
            yield CompletionItem(name, "property", detail)

    def _place(self) -> str:
        """The block around the cursor, as the table of statements names places."""
        kind = self.at.kind()
        if kind in ("ASSET", "TARGET") and not self.at.inside("MISSION"):
            return TYPE
        return kind.lower() or FILE

    def _keys(self) -> Iterator[tuple[str, str]]:
        kind = self.at.kind()
        if kind in ("ASSET", "TARGET"):
            for key in types.COMMON_KEYS.values():
                yield key.name, type_word(key.type)
            decl = self._type()
            for name, attribute in (decl.attributes if decl else {}).items():
                yield name, type_word(attribute.type)
        else:
            for key in self._known_keys().values():
                if key.proposed:
                    yield key.name, type_word(key.type)

    def _known_keys(self) -> dict[str, PropertyKey]:
        """The properties of the block around the cursor."""
        if self.at.kind() != "SCENE":
            kind = KINDS.get(self.at.kind().lower())
            return kind.keys if kind is not None else {}
        head = self.at.blocks[-1]
        return settings.scene_keys(head[1].text if len(head) > 1 else "")

    def _type(self) -> TypeDecl | None:
        return self.scope.types.get(self.at.type_name())

    def _verbs(self) -> Iterator[CompletionItem]:
        decl = self._type()
        for name, verb in (decl.verbs if decl else {}).items():
            yield CompletionItem(name, "verb", ", ".join(argument.name for argument in verb.arguments))

    # -- inside a statement

    def _inner(self) -> Iterator[CompletionItem]:
        at = self.at
        if len(at.statement) == 1 and at.before() in ("NAME", "STRING") and (words := self._after_subject()):
            yield from words
            return
        proposals = list(self._of_pattern())
        if proposals:
            yield from proposals
        elif at.before() == "COLON" and not self._in_quantifier():
            yield from self._types_due()
        elif at.before() == "TILDE":
            yield from (
                CompletionItem(name, "function", distribution.doc) for name, distribution in f.DISTRIBUTIONS.items()
            )
        elif at.before() == "AS":
            yield from self._names(("role",))
        elif at.before() in ("CONTROLS", "COMMAND"):
            yield from self._groups("asset")
        elif at.head() in ("EQUAL", "NAME") and (key := self._key()) is not None and key.choices:
            yield from (CompletionItem(choice, "value") for choice in key.choices)
        elif at.before() in OPERANDS:
            yield from (CompletionItem(word, "keyword") for word in (*_AFTER_OPERAND, *self.due.words))
        else:
            yield from self._expression()

    def _after_subject(self) -> list[CompletionItem]:
        """The keywords that follow the first word of a statement in this block."""
        place = self._place()
        return [
            CompletionItem(kind.keyword, "keyword") for kind in STATEMENTS if kind.has_subject and place in kind.within
        ]

    def _of_pattern(self) -> Iterator[CompletionItem]:
        """The names, or else the words, that the statement's pattern requires at the cursor."""
        due, kind = self.due, KINDS.get(self.at.statement[keyword_place(self.at.statement)].type.lower())
        if kind is None or due.within_value:
            return
        if due.element is None:
            yield from (CompletionItem(word, "keyword") for word in due.words)
        elif due.element.symbol == "path":
            paths = (path for first in library.SHIPPED for path in library.known_paths(first))
            yield from (CompletionItem(path, "module") for path in paths)
        else:
            yield from self._of_place(kind.place(due.element.label))

    def _of_place(self, place: NamePlace) -> Iterator[CompletionItem]:
        yield from (CompletionItem(word, "value") for word in place.choices)
        if place.offers:
            yield from _OFFERS[place.offers](self)
            return
        dependent = place.dependency and self.at.statement[1].text == "dependency"
        yield from self._names((place.dependency if dependent else place.spaces) or ())

    def _in_quantifier(self) -> bool:
        return any(token.type in ("EXISTS", "FORALL") for token in self.at.statement)

    def _types_due(self) -> Iterator[CompletionItem]:
        head = self.at.head()
        if head in ("ADJUDICATE", "UNLOCK"):
            yield from self.domains()
        elif head == "VERB":
            yield from (CompletionItem(name, "type", unit.unit) for name, unit in BY_NAME.items())
            yield CompletionItem("name", "type")
        elif self.at.kind() == "RECORD":
            yield from (CompletionItem(name, "type") for name in f.FIELD_TYPES)

    # -- declarations that a place of a statement takes

    def entity_types(self) -> Iterator[CompletionItem]:
        """The types of assets or of targets, by the keyword of the statement."""
        for name, decl in self.scope.types.items():
            if decl.role == self.at.head().lower():
                yield CompletionItem(name, "type", f"{decl.role} moved by {decl.engine}")

    def records(self) -> Iterator[CompletionItem]:
        """The records of messages."""
        yield from (CompletionItem(name, "type", record.category) for name, record in self.scope.records.items())

    def presets(self) -> Iterator[CompletionItem]:
        """The presets of cameras."""
        yield from (CompletionItem(name, "type", "camera preset") for name in self.scope.cameras)

    def regions(self) -> Iterator[CompletionItem]:
        """Yield the regions of the mission."""
        for name, symbol in self.scope.symbols.items():
            if symbol.kind == "region":
                yield CompletionItem(name, "name", "region")

    def interactions(self) -> Iterator[CompletionItem]:
        """The interactions of all types."""
        yield from (CompletionItem(name, "value", "interaction") for name in self.scope.interactions())

    def domains(self) -> Iterator[CompletionItem]:
        """Groups and message kinds, over which a variable may range."""
        yield from (CompletionItem(name, "name", info.role) for name, info in self.scope.groups.items())
        yield from (CompletionItem(name, "name", "message") for name in self.scope.messages)

    def _expression(self) -> Iterator[CompletionItem]:
        for local in self.analysis.names.locals_at(self.offset):
            yield CompletionItem(local.key[1], "name", "bound here")
        for name in self._bound_in_statement():
            yield CompletionItem(name, "name", "bound here")
        yield from self._names(("symbol", "type", "message", "agent", "role"))
        rule = any(self.at.inside(kind) for kind in ("ADJUDICATE", "STAGE", "CONSTRAINT")) or self.at.head() in (
            "UNLOCK", "SUCCESS", "FAILURE", "DONE", "WHEN", "PERMIT", "ALWAYS",
        )  # fmt: skip
        for name, function in f.FUNCTIONS.items():
            if function.where == "anywhere" or (function.where == "rule") == rule:
                yield CompletionItem(name, "function", function.doc)
        if rule:
            yield from (CompletionItem(name, "function", "rule") for name in self.scope.rules)
            yield from (CompletionItem(word, "keyword") for word in ("exists", "forall", "not", "true", "false"))
        if self.at.head() == "OBSERVES":
            yield from (CompletionItem(word, "name") for word in ("peers", "events"))

    def _bound_in_statement(self) -> Iterator[str]:
        """Names that unfinished tokens bind: `r` after `exists r`, `v` in a rule's parameters, `i` in a group's
        block."""
        for tokens in (*self.at.blocks, self.at.statement):
            for before, token, after in zip(tokens, tokens[1:], tokens[2:], strict=False):
                if token.type == "NAME" and (
                    before.type in ("EXISTS", "FORALL", "PER")
                    or (after.type in ("COLON", "IN") and before.type in ("LPAR", "COMMA", "LSQB"))
                ):
                    yield token.text
        if any(head and head[0].type in ("ASSET", "TARGET", "AGENT") for head in self.at.blocks):
            yield "i"

    def _names(self, spaces: tuple[str, ...]) -> Iterator[CompletionItem]:
        for space in spaces:
            if space == "type":
                yield from (CompletionItem(name, "type", decl.role) for name, decl in self.scope.types.items())
                continue
            for declared, name, _ in self.analysis.names.declared:
                if declared == space:
                    yield CompletionItem(name, "name", space if space != "symbol" else self._kind_of(name))

    def _kind_of(self, name: str) -> str:
        symbol = self.scope.symbols.get(name)
        return type_word(symbol.type) if symbol else ""

    def _groups(self, role: str) -> Iterator[CompletionItem]:
        yield from (CompletionItem(name, "name", role) for name, info in self.scope.groups.items() if info.role == role)

    # -- libraries, fields, units

    def _of_library(self, head: list[Token]) -> Iterator[CompletionItem]:
        path = tuple(token.text for token in head if token.type == "NAME")
        file = library.find_file(path) if path else None
        if file is None:
            return
        declarations, _ = load_library(file)
        yield from (CompletionItem(name, "type", decl.role) for name, decl in declarations.types.items())
        yield from (CompletionItem(name, "type", "record") for name in declarations.records)
        yield from (CompletionItem(name, "type", "mission") for name in declarations.missions)

    def _fields(self) -> Iterator[CompletionItem]:
        chain = _chain(self.at.statement)
        if self.at.head() == "USE":
            for path in library.known_paths(self.at.statement[1].text):
                if path.startswith(".".join(token.text for token in self.at.statement[1:-1]) + "."):
                    yield CompletionItem(path.rsplit(".", 1)[1], "module", path)
            return
        for name, kind in _members(self, chain):
            yield CompletionItem(name, "field", kind)

    def _units(self) -> Iterator[CompletionItem]:
        due = self._dimension_due()
        spellings = [name for name in (*UNITS, *_COMPOUND) if name not in ("ticks", "tokens", "°")]
        for name in spellings:
            unit = unit_of(name)
            if unit is not None and (due is None or unit.dimension == due):
                yield CompletionItem(name, "unit", dimension_name(unit.dimension))
        if not self.at.word:
            yield from (CompletionItem(word, "keyword") for word in _AFTER_OPERAND)

    def _dimension_due(self) -> Dimension | None:
        """The dimension of the number before the cursor, if its place determines it."""
        statement = self.at.statement
        for option in self._option_before():
            return option
        key = self._key()
        if key is not None and key.type.kind in ("directed", "level"):
            turned = any(token.type in ("FROM", "TO") for token in statement)
            return (ANGLE if turned else SPEED) if key.type.kind == "directed" else BY_NAME["length"].dimension
        if key is not None and key.type.dimension is not None:
            return key.type.dimension
        if self.at.kind() == "ACTIONS":
            return self._bound_of_verb()
        return next((unit.dimension for token in reversed(statement) if token.unit and (unit := unit_of(token.unit))
                     and unit.dimension != NONE), None)  # fmt: skip

    def _option_before(self) -> Iterator[Dimension | None]:
        """`apart >= 80 |`, `spread 8 |`, `distance_xy(a, b) <= 50 |`."""
        tokens = self.at.statement[:-1] if self.at.before() in ("NUMBER", "QUANTITY") else self.at.statement
        if tokens and tokens[-1].type in ("LE", "OP", "EQUAL"):
            tokens = tokens[:-1]
            if tokens and tokens[-1].type == "RPAR" and (called := _called(tokens)) in f.FUNCTIONS:
                yield f.FUNCTIONS[called].result.dimension
        if tokens and tokens[-1].type == "NAME" and len(tokens) > 1:
            for signature in (*f.FUNCTIONS.values(), *f.DISTRIBUTIONS.values()):
                for option in signature.options:
                    if option.name == tokens[-1].text and option.type.dimension is not None:
                        yield option.type.dimension

    def _key(self) -> PropertyKey | None:
        """The property with its value at the cursor."""
        name = next((token.text for token in self.at.statement if token.type == "NAME"), "")
        if self.at.kind() not in ("ASSET", "TARGET"):
            return self._known_keys().get(name)
        decl = self._type()
        attribute = decl.attributes.get(name) if decl else None
        return PropertyKey(name, attribute.type) if attribute else types.COMMON_KEYS.get(name)

    def _bound_of_verb(self) -> Dimension | None:
        name = self.at.statement[-3].text if len(self.at.statement) >= 3 else self.at.statement[0].text
        decl = self._type()
        verb = decl.verbs.get(name) if decl else None
        unit = unit_of(verb.arguments[0].dimension) if verb and verb.arguments else None
        return unit.dimension if unit else None


_OFFERS: dict[str, Callable[[_Completer], Iterable[CompletionItem]]] = {
    "type": _Completer.entity_types,
    "record": _Completer.records,
    "preset": _Completer.presets,
    "region": _Completer.regions,
    "interaction": _Completer.interactions,
    "domain": _Completer.domains,
}
"""Declarations that a place of a statement takes (`NamePlace.offers`) → their proposals."""


def _chain(statement: list[Token]) -> list[Token]:
    """The tokens of the operand before the last dot: `uav[i]` in `uav[i].`, `truth(v, r.frame)` in `truth(…).`."""
    depth, at = 0, len(statement) - 2
    while at >= 0:
        kind = statement[at].type
        depth += (kind in ("RPAR", "RSQB")) - (kind in ("LPAR", "LSQB"))
        joined = statement[at + 1].type in ("DOT", "LPAR", "LSQB")
        if depth < 0 or (depth == 0 and kind not in ("NAME", "DOT", "LPAR", "LSQB") and not joined):
            break
        if depth == 0 and kind == "NAME" and (at == 0 or statement[at - 1].type != "DOT"):
            return statement[at:-1]
        at -= 1
    return []


def _called(tokens: list[Token]) -> str:
    """The function of the call that ends the tokens."""
    depth = 0
    for at in range(len(tokens) - 1, 0, -1):
        depth += (tokens[at].type == "RPAR") - (tokens[at].type == "LPAR")
        if depth == 0:
            return tokens[at - 1].text
    return ""


def _members(completer: _Completer, chain: list[Token]) -> Iterator[tuple[str, str]]:
    """Yield the fields of an operand, with their types in words."""
    if not chain:
        return
    scope, first = completer.scope, chain[0].text
    if len(chain) > 2 and chain[-2].type == "DOT":
        if chain[-1].text == "position":
            yield from ((name, "length") for name in ("x", "y", "z"))
        return
    if len(chain) > 1 and chain[1].type == "LPAR":
        signature = f.FUNCTIONS.get(first)
        if signature is not None and signature.result.kind == "truth":
            yield from ((name, type_word(kind)) for name, kind in f.TRUTH_FIELDS.items())
        return
    domain = _domain(completer, first)
    if domain in scope.groups:
        for name, (_, kind) in f.STATE_FIELDS.items():
            yield name, type_word(kind)
        for name, attribute in scope.groups[domain].attributes.items():
            yield name, type_word(attribute.type)
        decl = scope.groups[domain].type
        yield from ((name, "share, 0 to 1") for name in (engine_kind(decl.engine).shares if decl else ()))
    elif domain in scope.messages:
        record = scope.messages[domain][0]
        yield from ((field.name, field.type) for field in (record.fields if record else ()))
        yield from ((name, type_word(kind)) for name, kind in f.MESSAGE_FIELDS.items())
    elif first == "peers":
        yield from ((name, "") for name in f.OBSERVED_FIELDS)
    elif (symbol := scope.symbols.get(first)) is not None and symbol.type.kind == "region":
        yield from (("centre", "position"), ("area", "area"))


def _domain(completer: _Completer, name: str) -> str:
    """The group or message kind that a name stands for or ranges over; "" without one."""
    for tokens in (completer.at.statement, *reversed(completer.at.blocks)):
        for variable, colon, domain in zip(tokens, tokens[1:], tokens[2:], strict=False):
            known = domain.text in completer.scope.groups or domain.text in completer.scope.messages
            if variable.text == name and colon.type in ("COLON", "IN") and known:
                return domain.text
    for local in completer.analysis.names.locals_at(completer.offset):
        if local.key[1] == name and local.node is not None:
            domain_name = getattr(local.node, "domain", None) or getattr(local.node, "type", None)
            if domain_name is not None:
                return str(domain_name.text)
    if name in completer.scope.symbols:
        return name
    return _inferred(completer, name)


def _inferred(completer: _Completer, name: str) -> str:
    """The domain of a quantified name, inferred from the rules that take it as an argument; "" if it is unknown."""
    tokens = completer.at.statement
    for at, token in enumerate(tokens):
        rule = completer.scope.rules.get(token.text)
        if rule is None or at + 1 >= len(tokens) or tokens[at + 1].type != "LPAR":
            continue
        arguments = [name_token.text for name_token in tokens[at + 2 :] if name_token.type == "NAME"]
        for parameter, argument in zip(rule.parameters, arguments, strict=False):
            if argument == name:
                return parameter.type.text
    kinds = list(completer.scope.messages)
    return kinds[0] if len(kinds) == 1 else ""
