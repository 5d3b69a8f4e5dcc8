"""The status words that the entities of a group can have, and comparisons of a status with a word.

The words come from the description of the engine (`kinds.json`), from the natures of the city's targets
(`lingjing.mission.natures`), from the interactions of the type, and from a declared `status = …`. Where the engine's
words are not described, every word is permitted.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.dsl.checking.calls import children
from lingjing.dsl.checking.expressions import ExpressionChecker
from lingjing.dsl.checking.properties import suffix_of
from lingjing.dsl.checking.scope import GroupInfo, PropertyType, TypeDecl
from lingjing.dsl.checking.typenames import of_type, with_article
from lingjing.dsl.checking.values import UNKNOWN, Environment, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.functions import STATUS, Type
from lingjing.mission.kinds import engine_kind
from lingjing.mission.natures import CITY, TargetTraits, later_words, nature_of
from lingjing.mission.vocabulary import DORMANT
from lingjing.suggest import did_you_mean, nearest

Words = tuple[str, ...] | None
"""The possible status words of an entity; None if they are not known."""


def status_words(group: GroupInfo) -> Words:
    """The status words of a group's entities, sorted; None if they are not known."""
    decl = group.type
    if decl is None:
        return None
    declared = set(_declared(group, decl))
    if group.role == "target" and decl.engine == CITY:
        return tuple(sorted(_of_nature(group, decl, declared)))
    words = engine_kind(decl.engine).words
    if words is None:
        return None
    done = {interaction.done_word for interaction in decl.interactions.values()}
    absent = {DORMANT} if group.role == "target" else set()
    return tuple(sorted({*words, *done, *absent, *declared}))


def _of_nature(group: GroupInfo, decl: TypeDecl, declared: set[str]) -> set[str]:
    states = {name: known for name, known in group.attributes.items() if known.state}
    interactions = tuple(decl.interactions.values())
    properties = {prop.name: prop.value for prop in decl.properties}
    surface = group.lines.get("on", properties.get("on"))
    nature = nature_of(
        TargetTraits(
            states=[stored_name(name, known) for name, known in states.items()],
            properties=properties,
            interactions=interactions,
            surface=surface.text if isinstance(surface, s.Name) else getattr(surface, "name", ""),
            blocks=_is_true(properties.get("blocks"), group.lines.get("blocks")),
        )
    )
    return {*(declared or {nature.word}), *later_words(nature, interactions, states)}


def stored_name(name: str, known: PropertyType) -> str:
    """Return the name of a property in a compiled mission, which ends in the suffix of its unit."""
    return name + (suffix_of(known.type.dimension) if known.type.kind == "quantity" else "")


def _is_true(inherited: ex.Expr | None, own: s.Expression | None) -> bool:
    if own is not None:
        return isinstance(own, s.FlagLiteral) and own.value
    return isinstance(inherited, ex.Flag) and inherited.value


def _declared(group: GroupInfo, decl: TypeDecl) -> Iterator[str]:
    """The words of `status = …`, or all those of a draw, in the entity's block or else in its type."""
    own = group.lines.get("status")
    if own is not None:
        yield from _spelled(own)
        return
    for prop in decl.properties:
        for part in ex.parts(prop.value) if prop.name == "status" else ():
            if isinstance(part, ex.Symbol | ex.Text):
                yield part.name if isinstance(part, ex.Symbol) else part.value


def _spelled(node: s.Expression) -> Iterator[str]:
    if isinstance(node, s.Name | s.TextLiteral):
        yield node.text if isinstance(node, s.Name) else node.value
    for part in children(node):
        yield from _spelled(part)


def status_side(
    of: ExpressionChecker, status: TypedExpression, node: s.Expression, environment: Environment
) -> TypedExpression:
    """Check the other side of a comparison with a status: a word, a list of words, or a value of a run that is a word.

    Reports a word that the entity never has, and a value that is not a word.
    """
    known = status_words(of.scope.groups[status.type.of])
    if isinstance(node, s.List | s.NameSet):
        items = node.items if isinstance(node, s.List) else node.names
        checked = [status_side(of, status, item, environment) for item in items]
        kind = Type("list", item="name")
        return UNKNOWN if UNKNOWN in checked else TypedExpression(ex.Sequence(tuple(c.ir for c in checked)), kind)
    if isinstance(node, s.TextLiteral):
        return _word(of, status.type.of, node, known)
    if isinstance(node, s.Name) and node.text not in environment.locals:
        if known is None and _is_declared(of, node.text):
            return of.value(node, environment)
        return _word(of, status.type.of, node, known)
    value = of.value(node, environment)
    if value.type.kind in ("name", "status", "text", "any"):
        return value
    hint = did_you_mean("", known or ())
    of.report.at("LJ0201", node, f"a status word is due here, this is {with_article(value.type)}", hint)
    return UNKNOWN


def _is_declared(of: ExpressionChecker, name: str) -> bool:
    scope = of.scope
    return name in scope.symbols or name in scope.agents or name in scope.roles


def _word(of: ExpressionChecker, group: str, node: s.Name | s.TextLiteral, known: Words) -> TypedExpression:
    word = node.text if isinstance(node, s.Name) else node.value
    if known is None or word in known:
        quoted = isinstance(node, s.TextLiteral)
        return TypedExpression(ex.Text(word) if quoted else ex.Symbol(word), of_type(STATUS, group))
    close = nearest(word, known)
    if isinstance(node, s.Name) and close is None and _is_declared(of, word):
        value = of.value(node, Environment(rule=True))
        message = f"a status word is due here, this is {with_article(value.type)}"
        of.report.at("LJ0201", node, message, f"the words of `{group}`: {', '.join(known)}")
        return UNKNOWN
    hint = f"did you mean `{close}`?" if close else f"its words: {', '.join(known)}"
    of.report.at("LJ0109", node, f"the status of `{group}` is never `{word}`", hint, replace=close)
    return UNKNOWN
