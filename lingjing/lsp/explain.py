"""What something is, in Markdown: a name with its type, value and comment; a unit; a function; a keyword."""

from __future__ import annotations

from lingjing.dsl.checking.scope import TypeDecl
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.typenames import word as type_word
from lingjing.dsl.syntax.lexer import MASTER
from lingjing.dsl.syntax.tokens import INNER, STATEMENTS
from lingjing.lsp.analysis import Analysis, comment_above, library_file
from lingjing.lsp.context import context_at
from lingjing.lsp.names import Occurrence
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS, STATE_FIELDS, Signature
from lingjing.mission.kinds import engine_kind
from lingjing.mission.kinds_format import VerbKind
from lingjing.mission.units import NONE, dimension_name, dimension_unit, si_value, unit_of

KEYWORDS: dict[str, str] = {
    "ljs": "`ljs 1`: the version of the language.",
    "use": "`use std.air { quadrotor }`: types and records from a library.",
    "mission": '`mission name "title" { … }`',
    "goal": '`goal "…"`: what everybody is told.',
    "prompt": '`prompt "…"`: what this agent is told besides the goal.',
    "scene": "`scene bay { datum = sea level at -3.5 m }`: where it happens.",
    "clock": "`clock { tick = 10 s, sync = 500 ms }`: the decision interval and the engines' common step.",
    "budget": "`budget { ticks <= 60, policy <= 90 s }`: what may be spent.",
    "weather": "`weather { wind = 4 m/s from 220 deg }`",
    "comms": "`comms { hub = … when mode == star, delay = 1 tick, payload <= 4 kB }`: the message bus.",
    "actions": "`actions { takeoff, forward <= 50 m }`: which of the type's verbs may be commanded, and how far.",
    "param": "`param uavs = 3 in 1..10`: a value that a run may set, within bounds.",
    "mode": "`mode broadcast in { star, broadcast }`: how agents speak; the first is the default.",
    "region": "`region search = polygon(…)`: a named area.",
    "grid": "`grid cells over search { shape = 3 by 3, overlap = 20 % }`",
    "target": "`target victim[1..n] : person_in_water { hidden position ~ sites(search) }`: what the mission is about.",
    "asset": "`asset uav[1..n] : quadrotor { … }`: what agents command.",
    "camera": "`camera nadir { size = 1920 by 1080, hfov = 84 deg, channels = [rgb] }`",
    "agent": "`agent scout[i in 1..n] as searcher controls uav[i] { observes … }`: who decides.",
    "authority": "`authority searcher may command boat when …`: command without embodiment.",
    "message": "`message detection : report from searcher to all`: who may say what to whom.",
    "adjudicate": "`adjudicate matched(v: victim, r: detection) { when … }`: an event, once it is true.",
    "unlock": "`unlock rescue(v: victim) when …`: when an interaction is allowed.",
    "stage": "`stage detect per v in victim { done when … }`: a step of the mission for each target.",
    "relation": "`relation cooperation a <-> b over cells`: how roles work together.",
    "success": "`success when …`: the mission is won.",
    "failure": "`failure when …`: the mission is lost.",
    "when": "`when …`: only if the condition holds.",
    "done": "`done when …`: the stage is over.",
    "observes": "`observes uav[i].*, cells, peers.position`: what the agent sees each tick.",
    "verb": "`verb forward(distance: length in 0 m..500 m)`: a command of an asset type.",
    "interaction": "`interaction rescue { by = vessel, within = 50 m }`: what can be done to a target.",
    "mount": "`mount front { ahead = 0.3 m, above = 0 m, tilt = 10 deg }`: where a type's cameras of a view sit.",
    "part": "`part hull : box { length = 2 m, width = 1 m, height = 1 m }`: a solid that a type's bodies show.",
    "record": "`record report : report { class: name }`: the fields of a message.",
    "reveal": "`reveal image(target) to role`: the one audited way out of `hidden`.",
    "hidden": "`hidden position ~ …`: no agent may learn it but through a sensor; what reads it is hidden too.",
    "state": "`state load = 0 kg`: a number its engine changes while the mission runs.",
    "override": "`override …`: takes the place of a declaration of the base mission.",
    "sweep": "`sweep fleet over uavs in [1, 2, 3]`: a matched study.",
    "limit": "`limit moves <= 50 counts dog.forward`: a counted budget.",
    "permit": "`permit van.setDestination when …`: rejected until then.",
    "constraint": "`constraint hard fence per u in uav { always u in area }`",
    "always": "`always …`: what must hold at every step.",
    "event": "`event squall at 12 tick { weather { … } }`: what happens by itself.",
    "appear": "`appear jam[2]`: the entity is there from now on.",
    "vanish": "`vanish jam[1]`: the entity is gone from now on.",
    "inspection": "`inspection checked of van by uav { within = 25 m }`: waypoints to be seen in their order.",
    "exists": "`exists r: …`: there is one for which it is true.",
    "forall": "`forall v in victim: …`: it is true for every one.",
}
"""One line for each keyword that needs one."""


def explain(analysis: Analysis, offset: int) -> tuple[str, int, int] | None:
    """Markdown for what stands at an offset and the stretch it is about; None if there is nothing to say."""
    one = analysis.names.at(offset)
    if one is not None:
        said = _name(analysis, one)
        if said:
            return said, one.start, one.end
    return _token(analysis, offset)


def _name(analysis: Analysis, one: Occurrence) -> str:
    name = one.key[1]
    declared = analysis.names.declared.get(one.key)
    head = _head(analysis, one)
    if not head:
        return ""
    doc = analysis.doc(declared) if declared is not None else _library_doc(analysis, name)
    shown = _declaration_line(analysis, declared) if declared is not None else ""
    parts = [f"**{name}**: {head}", f"```ljs\n{shown}\n```" if shown else "", doc]
    return "\n\n".join(part for part in parts if part)


def _head(analysis: Analysis, one: Occurrence) -> str:
    space, name, _ = one.key
    scope = analysis.scope
    symbol = scope.symbols.get(name)
    if space == "symbol" and symbol is not None:
        unit = dimension_unit(symbol.type.dimension) if symbol.type.dimension not in (None, NONE) else ""
        hidden = ", hidden" if symbol.taint else ""
        measured = f" in `{unit}`" if unit else ""
        return f"{symbol.kind}, {with_article(symbol.type)}{measured}{hidden}"
    if space in ("type", "") and name in scope.types:
        return _type(scope.types[name])
    if space in ("record", "") and name in scope.records:
        record = scope.records[name]
        fields = ", ".join(f"`{field.name}: {field.type}`" for field in record.fields)
        return f"message record ({record.category}) with {fields}"
    if space == "message" and name in scope.messages:
        known = scope.messages[name][0]
        return f"message kind{f' of the record `{known.name}`' if known else ''}"
    if space in ("rule", "") and name in FUNCTIONS:
        return _signature(FUNCTIONS[name])
    if space in ("rule", "") and name in DISTRIBUTIONS:
        return _signature(DISTRIBUTIONS[name])
    if space == "local" and one.node is None:
        declared = analysis.names.declared.get(one.key)
        node = declared.node if declared else None
    else:
        node = one.node
    domain = getattr(node, "domain", None) or getattr(node, "type", None)
    if space == "local":
        return f"bound over `{domain.text}`" if domain is not None and hasattr(domain, "text") else "bound here"
    return _verb(analysis, name) if space == "verb" else space


def _verb(analysis: Analysis, name: str) -> str:
    """Which types have a verb, each with what its engine says that it does."""
    told = []
    for decl in analysis.scope.types.values():
        if name in decl.verbs:
            does = engine_kind(decl.engine).verbs.get(name, VerbKind()).doc
            told.append(f"`{decl.name}`: {does}" if does else f"`{decl.name}`")
    return f"verb of {'; of '.join(told)}" if told else "verb"


def _type(decl: TypeDecl) -> str:
    properties = ", ".join(f"`{name}` ({type_word(one.type)})" for name, one in decl.attributes.items())
    verbs = ", ".join(f"`{name}`" for name in decl.verbs)
    said = f"{decl.role} type, engine `{decl.engine}`"
    return said + (f"; has {properties}" if properties else "") + (f"; does {verbs}" if verbs else "")


def _signature(one: Signature) -> str:
    shown = ", ".join(f"{parameter.name}: {type_word(parameter.type)}" for parameter in one.parameters)
    options = "".join(f", {option.name} {option.relation} {type_word(option.type)}" for option in one.options)
    more = ", …" if one.variadic else ""
    result = "the same dimension" if one.same else type_word(one.result)
    return f"`{one.name}({shown}{more}{options})` gives {result}" + (f": {one.doc}" if one.doc else "")


def _library_doc(analysis: Analysis, name: str) -> str:
    decl = analysis.scope.types.get(name) or analysis.scope.records.get(name)
    other = library_file(decl.span.path) if decl is not None else None
    return comment_above(other.source, decl.span.start) if other is not None and decl is not None else ""


def _declaration_line(analysis: Analysis, declared: Occurrence) -> str:
    source = analysis.source
    line = source.line_text(source.line_of(declared.start)).strip()
    return line if len(line) <= 160 else f"{line[:157]}…"


def _token(analysis: Analysis, offset: int) -> tuple[str, int, int] | None:
    """What the word or number under the cursor is by itself."""
    source = analysis.source
    line = source.line_of(offset)
    start = source.line_starts()[line - 1]
    for match in MASTER.finditer(source.text, start, start + len(source.line_text(line))):
        if match.start() <= offset <= match.end() and match.lastgroup in ("WORD", "NUMBER", "UNIT"):
            number = match["NUMBER"] is not None
            said = _number(match[0], match["UNIT"] or "") if number else _word(analysis, match[0], match.start())
            if said:
                return said, match.start(), match.end()
    return None


def _number(text: str, unit: str) -> str:
    known = unit_of(unit) if unit else None
    if known is None:
        return ""
    value = si_value(float(text[: len(text) - len(unit)].strip()), unit)
    base = dimension_unit(known.dimension)
    return f"{dimension_name(known.dimension)}: `{value:g}{f' {base}' if base else ''}`"


def _word(analysis: Analysis, word: str, offset: int) -> str:
    if word in FUNCTIONS or word in DISTRIBUTIONS:
        return _signature(FUNCTIONS.get(word) or DISTRIBUTIONS[word])
    if word in STATE_FIELDS:
        return f"**{word}**: {with_article(STATE_FIELDS[word][1])}, of every entity while the mission runs"
    types = analysis.scope.types
    own = types.get(context_at(analysis.source.text, offset).type_name())
    for decl in (*((own,) if own is not None else ()), *types.values()):
        if word in decl.attributes:
            return f"**{word}**: {with_article(decl.attributes[word].type)} of `{decl.name}`"
        if word in decl.verbs:
            return f"**{word}**: {_verb(analysis, word)}"
    if word in STATEMENTS or word in INNER:
        return KEYWORDS.get(word, "")
    return ""
