"""`library_page`: a page about the declarations of one library file, such as `std.air`, from the file itself.

`declaration_text` writes one of them; the editor's hover shows the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lingjing.dsl.checking import library
from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.scope import CameraDecl, Declaration, GroupInfo, RecordDecl, TypeDecl, WeatherDecl
from lingjing.dsl.checking.status_words import status_words
from lingjing.dsl.checking.toplevel import load_library
from lingjing.errors import UsageError
from lingjing.mission import model
from lingjing.mission.expression_text import SUM, ExpressionWriter
from lingjing.mission.kinds import engine_kind
from lingjing.mission.units import BY_NAME
from lingjing.suggest import did_you_mean

_WRITER = ExpressionWriter()


def library_page(name: str) -> str:
    """The page of a library file by its name in `use`, as Markdown. Raises `UsageError` if there is no such file."""
    words = tuple(name.split("."))
    file = library.find_file(words) if all(word.isidentifier() for word in words) else None
    if file is None:
        known = library.known_paths(words[0]) or library.known_paths("std")
        raise UsageError(f"there is no library `{name}`", hint=did_you_mean(name, known))
    declared = load_library(file)[0].declared
    parts = [f"# `{name}`\n\nA mission uses a declaration of it with `use {name} {{ … }}`."]
    for title, kind in _KINDS.items():
        matching = [decl for decl in declared.values() if isinstance(decl, kind)]
        if matching:
            parts.append(f"## {title}")
            parts.extend(f"### `{decl.name}`\n\n{declaration_text(decl)}" for decl in matching)
    return "\n\n".join(parts) + "\n"


def declaration_text(decl: Declaration) -> str:
    """A type, record or preset in words: engine, properties, verbs, states, status words and interactions."""
    if isinstance(decl, TypeDecl):
        return "\n".join(_type(decl))
    if isinstance(decl, RecordDecl):
        fields = ", ".join(f"`{_field(field)}`" for field in decl.fields)
        return f"A message record ({decl.category}) with {fields}."
    if isinstance(decl, CameraDecl | WeatherDecl):
        lines = (f"`{name} {entry.relation} {_value(entry)}`" for name, entry in decl.entries.items())
        return f"{'A camera' if isinstance(decl, CameraDecl) else 'A weather'} with {', '.join(lines)}."
    return "A mission."


_KINDS: dict[str, type] = {
    "Asset and target types": TypeDecl, "Message records": RecordDecl, "Cameras": CameraDecl, "Weather": WeatherDecl,
}  # fmt: skip
"""Title of a section → the declarations in it."""


def _value(entry: PropertyEntry) -> str:
    between = {"size": " by ", "directed": f" {entry.key.type.of} "}.get(entry.key.type.kind, " ")
    return between.join(_WRITER.text(part.ir) for part in entry.parts)


def _type(decl: TypeDecl) -> Iterator[str]:
    based = f" It extends `{decl.bases[0]}`." if decl.bases else ""
    yield f"An {decl.role} type of the engine `{decl.engine}`.{based}".replace("An target", "A target") + "\n"
    states = {name for name, known in decl.attributes.items() if known.state}
    yield from _line("properties", _properties([prop for prop in decl.properties if prop.plain not in states]))
    yield from _line("states", [_property(prop) for prop in decl.properties if prop.plain in states])
    yield from _line("status words", status_words(GroupInfo(decl.name, decl.role, decl, decl.attributes)) or ())
    yield from _line("mounts of cameras", decl.mounts)
    described = engine_kind(decl.engine).verbs
    for verb in decl.verbs.values():
        doc = described[verb.name].doc if verb.name in described else ""
        yield f"- verb `{verb_text(verb)}`{': ' + doc if doc else ''}"
    for interaction in decl.interactions.values():
        yield f"- interaction `{interaction.name}`: {', '.join(_terms(interaction))}"


def _line(title: str, items: Iterable[str]) -> Iterator[str]:
    listed = ", ".join(f"`{item}`" for item in items)
    if listed:
        yield f"- {title}: {listed}"


def _properties(properties: list[model.Property]) -> Iterator[str]:
    """The properties; the two ends of a range are one."""
    highs = {prop.name: prop for prop in properties if "_high" in prop.name}
    for prop in properties:
        high = highs.get(prop.name.replace("_low", "_high")) if "_low" in prop.name else None
        if high is not None:
            text = f"{_WRITER.text(prop.value, SUM)}..{_WRITER.text(high.value, SUM)}"
            yield f"{prop.name.partition('_low')[0]} {prop.relation} {text}"
        elif prop.name.replace("_high", "_low") not in {each.name for each in properties} or "_high" not in prop.name:
            yield _property(prop)


def _property(prop: model.Property) -> str:
    return f"{'hidden ' if prop.hidden else ''}{prop.plain} {prop.relation} {_WRITER.text(prop.value)}"


def verb_text(verb: model.Verb) -> str:
    """A verb with its arguments, as a type declares it."""
    return f"{verb.name}({', '.join(map(_argument, verb.arguments))})"


def _argument(argument: model.Argument) -> str:
    named = next((name for name, known in BY_NAME.items() if known.unit == argument.dimension), "number")
    words = [f"{argument.name}: {'name' if argument.dimension == 'name' else named}"]
    if argument.minimum is not None and argument.maximum is not None:
        words.append(f"in {_WRITER.text(argument.minimum, SUM)}..{_WRITER.text(argument.maximum, SUM)}")
    return " ".join([*words, "optional"] if argument.optional else words)


def _field(field: model.Field) -> str:
    bounds = f" in {field.minimum:g}..{field.maximum:g}" if None not in (field.minimum, field.maximum) else ""
    unit = f" {field.unit}" if field.unit and bounds else ""
    named = next((name for name, known in BY_NAME.items() if field.unit and known.unit == field.unit), field.type)
    return f"{field.name}: {named}{bounds}{unit}{' optional' if field.optional else ''}"


def _terms(interaction: model.Interaction) -> Iterator[str]:
    yield f"by `{interaction.by}`"
    yield f"within {_WRITER.text(interaction.within)}"
    if interaction.lasting is not None:
        yield f"lasting {_WRITER.text(interaction.lasting)}"
    if interaction.takes:
        yield f"takes `{interaction.takes}`" + (
            f" from the actor's `{interaction.source}`" if interaction.source else ""
        )
    if interaction.gives:
        limit = f" up to its `{interaction.up_to}`" if interaction.up_to else ""
        yield f"gives the actor's `{interaction.gives}`{limit}"
    if interaction.told:
        yield f"its event is visible to {interaction.told}"
