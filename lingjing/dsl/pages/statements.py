"""`statements_page`: the reference page of the statements, from the table of `lingjing.dsl.syntax.statements`."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.dsl.checking.typenames import word as type_word
from lingjing.dsl.syntax.keys import PropertyKey
from lingjing.dsl.syntax.statement_kinds import FILE, LISTS, TYPE, PatternElement, StatementKind
from lingjing.dsl.syntax.statements import STATEMENTS
from lingjing.dsl.syntax.tokens import SYMBOLS
from lingjing.mission.units import dimension_unit

_HEAD = """# The statements of `.ljs`

This page lists every statement with its form, its place and the properties of its block. `python tools/statements.py` writes it from the table that the compiler, the formatter and the editors read. [The language](language.md) explains the statements with whole examples.

A form is written as follows: `‹name›` stands for a name or value, `‹name›, …` for one or more with commas between them, and `[…]` may be left out. `{ … }` is a block. `[when ‹condition›]` limits a declaration to the runs in which the condition on the mode and the params holds.

In the tables of properties, *relations* are the signs after the name: `=` fixes the value, `~` draws it for each episode, `<=` bounds it. The limits are in the unit of the column *type*. The last column is the value that holds without the line; an empty cell means that there is none.
"""  # noqa: E501 - a paragraph of Markdown is one line
_SIGNS = {kind: sign for sign, kind in SYMBOLS.items() if kind != "OP"}
_RULES = {
    "block": "{ … }", "guard": "when ‹condition›", "index": "[‹index› in 1..‹count›]",
    "set": "{ ‹name›, … }", "params": "(‹name›: ‹type›, …)", "item": "‹statement›", "channel": "‹asset›[.‹verb›]",
    "path": "‹path›",
    "clauses": "[carries ‹message›] [over ‹thing›] [by ‹message›] [per ‹variable›]",
}  # fmt: skip
"""Rules of the grammar that are not shown by the name of their field."""


def statements_page() -> str:
    """Return the page as Markdown."""
    parts = [_HEAD]
    for title, place in _sections():
        kinds = [kind for kind in STATEMENTS if _home(kind) == place]
        if kinds:
            parts.append(f"## {title}\n")
            parts.extend("\n".join(_statement(kind)) for kind in kinds)
    return "\n".join(parts).rstrip() + "\n"


def _sections() -> Iterator[tuple[str, str]]:
    yield "At the top of a file", FILE
    yield "In a mission", "mission"
    yield "In a type", TYPE
    for kind in STATEMENTS:
        if kind.keyword != "mission" and kind.opens_block:
            yield f"In `{kind.keyword}`", kind.keyword


def _home(kind: StatementKind) -> str:
    """The place under which a statement is listed: a mission if it may stand there, else its first place."""
    return "mission" if "mission" in kind.within else kind.within[0]


def _statement(kind: StatementKind) -> Iterator[str]:
    yield f"### `{kind.keyword}`\n"
    yield f"{kind.doc[0].upper()}{kind.doc[1:]}. It stands {_places(kind)}.\n"
    yield "```text"
    yield from forms(kind)
    yield "```\n"
    for label, name in kind.names.items():
        if name.choices:
            words = ", ".join(f"`{word}`" for word in name.choices)
            yield f"‹{label}› is {'one of ' if name.spaces == () else 'a name, or '}{words}.\n"
    yield f"Example: `{kind.example}`\n"
    if kind.keys:
        yield "| property | relations | type | limits | without it |"
        yield "| --- | --- | --- | --- | --- |"
        yield from map(_property, kind.keys.values())
        yield ""


def _places(kind: StatementKind) -> str:
    words = {FILE: "at the top of a file", "mission": "in a mission", TYPE: "in a type"}
    places = [words.get(place, f"in `{place}`") for place in kind.within]
    return places[0] if len(places) == 1 else f"{', '.join(places[:-1])} or {places[-1]}"


def forms(kind: StatementKind) -> Iterator[str]:
    """The ways to write a statement, as on the reference page."""
    if not kind.forms:
        yield from (f"{kind.keyword} ‹property› {relation} ‹value›" for relation in ("=", "~", "<="))
    for form in kind.forms:
        text, group = kind.keyword, 0
        for element in form.elements():
            opened = element.group != group and element.group
            text += ("]" if element.group != group and group else "") + " " + ("[" if opened else "") + _shown(element)
            group = element.group
        yield _tight(text + ("]" if group else ""))


def _shown(element: PatternElement) -> str:
    if element.word:
        return element.word
    if element.symbol in _SIGNS:
        return _SIGNS[element.symbol]
    if element.symbol in _RULES:
        return _RULES[element.symbol]
    label = (element.label or element.symbol).lower()
    named = f'"‹{label}›"' if element.symbol == "STRING" else f"‹{label}›"
    return f"{named}, …" if element.symbol in LISTS else named


def _tight(text: str) -> str:
    """A form without blanks inside round brackets and after `[`, and with its parameters beside the name."""
    for loose, tight in (("( ", "("), (" )", ")"), (" (", "("), ("[ ", "["), (" [‹index›", "[‹index›")):
        text = text.replace(loose, tight)
    return text.replace("[[‹index› in 1..‹count›]]", "[[‹index› in] 1..‹count›]")


def _property(key: PropertyKey) -> str:
    relations = " ".join(f"`{relation}`" for relation in key.relations)
    unit = dimension_unit(key.type.dimension) if key.type.dimension else ""
    typed = type_word(key.type) + (f" (`{unit}`)" if unit else "")
    absent = "an error" if key.required else f"`{key.default}`" if key.default else ""
    return f"| `{key.name}` | {relations} | {typed} | {_limits(key)} | {absent} |"


def _limits(key: PropertyKey) -> str:
    if key.choices is not None:
        return ", ".join(f"`{choice}`" for choice in key.choices)
    limits = [f"at least {key.low:g}"] if key.low is not None else []
    limits += [f"above {key.above:g}"] if key.above is not None else []
    limits += [f"at most {key.high:g}"] if key.high is not None else []
    limits += ["a whole number"] if key.whole else []
    return ", ".join(limits)
