"""Markdown about something in the text: a name with its type, value and comment; a unit; a function; a keyword."""

from __future__ import annotations

from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.typenames import word as type_word
from lingjing.dsl.pages.library import declaration_text
from lingjing.dsl.syntax.lexer import MASTER
from lingjing.dsl.syntax.statements import STATEMENTS
from lingjing.lsp.analysis import Analysis, comment_above, library_file
from lingjing.lsp.context import context_at
from lingjing.lsp.names import Occurrence
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS, MESSAGE_FIELDS, STATE_FIELDS, Signature
from lingjing.mission.kinds import builtin_engines, engine_kind
from lingjing.mission.kinds_format import VerbKind
from lingjing.mission.units import NONE, dimension_name, dimension_unit, si_value, unit_of

KEYWORDS: dict[str, str] = {
    **{kind.keyword: f"`{kind.example}`: {kind.doc}." for kind in STATEMENTS},
    "exists": "`exists r: …`: true if it holds for at least one.",
    "forall": "`forall v in victim: …`: true if it holds for all.",
}
"""Keyword → one line about it."""
_SENDING = {
    "sender": "the agent that sent the message",
    "role": "the role of the agent that sent the message",
    "sent": "the time of the decision to send the message",
}
"""Field of every message → its meaning."""


def explain(analysis: Analysis, offset: int) -> tuple[str, int, int] | None:
    """Markdown about the thing at an offset, and the extent of that thing; None if there is nothing to show."""
    occurrence = analysis.names.at(offset)
    if occurrence is not None:
        markdown = _name(analysis, occurrence)
        if markdown:
            return markdown, occurrence.start, occurrence.end
    return _token(analysis, offset)


def _name(analysis: Analysis, occurrence: Occurrence) -> str:
    name = occurrence.key[1]
    declared = analysis.names.declared.get(occurrence.key)
    head = _head(analysis, occurrence)
    if not head:
        return ""
    doc = analysis.doc(declared) if declared is not None else _library_doc(analysis, name)
    shown = _declaration_line(analysis, declared) if declared is not None else ""
    parts = [f"**{name}**: {head}", f"```ljs\n{shown}\n```" if shown else "", doc]
    return "\n\n".join(part for part in parts if part)


def _head(analysis: Analysis, occurrence: Occurrence) -> str:
    space, name, _ = occurrence.key
    scope = analysis.scope
    symbol = scope.symbols.get(name)
    if space == "symbol" and symbol is not None:
        unit = dimension_unit(symbol.type.dimension) if symbol.type.dimension not in (None, NONE) else ""
        hidden = ", hidden" if symbol.taint else ""
        measured = f" in `{unit}`" if unit else ""
        return f"{symbol.kind}, {with_article(symbol.type)}{measured}{hidden}"
    if space in ("type", "") and name in scope.types:
        return declaration_text(scope.types[name])
    if space in ("record", "") and name in scope.records:
        return declaration_text(scope.records[name])
    if space == "message" and name in scope.messages:
        known = scope.messages[name][0]
        return f"message kind{f' of the record `{known.name}`' if known else ''}"
    if space in ("rule", "") and name in FUNCTIONS:
        return _signature(FUNCTIONS[name])
    if space in ("rule", "") and name in DISTRIBUTIONS:
        return _signature(DISTRIBUTIONS[name])
    if space == "local" and occurrence.node is None:
        declared = analysis.names.declared.get(occurrence.key)
        node = declared.node if declared else None
    else:
        node = occurrence.node
    domain = getattr(node, "domain", None) or getattr(node, "type", None)
    if space == "local":
        return f"bound over `{domain.text}`" if domain is not None and hasattr(domain, "text") else "bound here"
    return _verb(analysis, name) if space == "verb" else space


def _verb(analysis: Analysis, name: str) -> str:
    """The types that have a verb, each with its engine's description of the verb."""
    descriptions = []
    for decl in analysis.scope.types.values():
        if name in decl.verbs:
            does = engine_kind(decl.engine).verbs.get(name, VerbKind()).doc
            descriptions.append(f"`{decl.name}`: {does}" if does else f"`{decl.name}`")
    return f"verb of {'; of '.join(descriptions)}" if descriptions else "verb"


def _signature(function: Signature) -> str:
    shown = ", ".join(f"{parameter.name}: {type_word(parameter.type)}" for parameter in function.parameters)
    options = "".join(f", {option.name} {option.relation} {type_word(option.type)}" for option in function.options)
    more = ", …" if function.variadic else ""
    result = "the same dimension" if function.same else type_word(function.result)
    return f"`{function.name}({shown}{more}{options})` gives {result}" + (f": {function.doc}" if function.doc else "")


def _library_doc(analysis: Analysis, name: str) -> str:
    decl = analysis.scope.types.get(name) or analysis.scope.records.get(name)
    other = library_file(decl.span.path) if decl is not None else None
    return comment_above(other.source, decl.span.start) if other is not None and decl is not None else ""


def _declaration_line(analysis: Analysis, declared: Occurrence) -> str:
    source = analysis.source
    line = source.line_text(source.line_of(declared.start)).strip()
    return line if len(line) <= 160 else f"{line[:157]}…"


def _token(analysis: Analysis, offset: int) -> tuple[str, int, int] | None:
    """Markdown about the word or number at an offset by itself."""
    source = analysis.source
    line = source.line_of(offset)
    start = source.line_starts()[line - 1]
    for match in MASTER.finditer(source.text, start, start + len(source.line_text(line))):
        if match.start() <= offset <= match.end() and match.lastgroup in ("WORD", "NUMBER", "UNIT"):
            number = match["NUMBER"] is not None
            markdown = _number(match[0], match["UNIT"] or "") if number else _word(analysis, match[0], match.start())
            if markdown:
                return markdown, match.start(), match.end()
    return None


def _number(text: str, unit: str) -> str:
    known = unit_of(unit) if unit else None
    if known is None:
        return ""
    value = si_value(float(text[: len(text) - len(unit)].strip()), unit)
    base = dimension_unit(known.dimension)
    return f"{dimension_name(known.dimension)}: `{value:g}{f' {base}' if base else ''}`"


def _word(analysis: Analysis, word: str, offset: int) -> str:
    called = analysis.source.text.startswith("(", offset + len(word))
    if (word in FUNCTIONS and (called or not _is_attribute(analysis, word))) or word in DISTRIBUTIONS:
        return _signature(FUNCTIONS.get(word) or DISTRIBUTIONS[word])
    if word in STATE_FIELDS:
        return f"**{word}**: {with_article(STATE_FIELDS[word][1])}, of every entity while the mission runs"
    if word in MESSAGE_FIELDS:
        return f"**{word}**: {_SENDING[word]}, of every message in rules"
    sharing = [kind.name for kind in builtin_engines().values() if word in kind.shares]
    if sharing:
        return f"**{word}**: the share that is left, 0 to 1, of every body of {', '.join(sharing)} in rules"
    types = analysis.scope.types
    own = types.get(context_at(analysis.source.text, offset).type_name())
    for decl in (*((own,) if own is not None else ()), *types.values()):
        if word in decl.attributes:
            return f"**{word}**: {with_article(decl.attributes[word].type)} of `{decl.name}`"
        if word in decl.verbs:
            return f"**{word}**: {_verb(analysis, word)}"
    return KEYWORDS.get(word, "")


def _is_attribute(analysis: Analysis, word: str) -> bool:
    """True if a type has a property of this name, such as `speed`, which is a function too."""
    return any(word in decl.attributes for decl in analysis.scope.types.values())
