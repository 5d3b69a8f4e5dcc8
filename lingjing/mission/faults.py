"""What is wrong with a JSON value that should have been of a type: every fault, with its path and the way out.

A value is compared with the JSON Schema of the type (draft 2020-12), which `jsonschema` does; it is loaded only here,
when something is wrong.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import msgspec

from lingjing.errors import Fault
from lingjing.suggest import nearest
from lingjing.validation import BOUNDS, DUE, shown

if TYPE_CHECKING:
    from jsonschema import ValidationError

_DUE = {
    "number": DUE["float"],
    "integer": DUE["int"],
    "string": DUE["string"],
    "array": DUE["list"],
    "object": DUE["dict"],
    "boolean": "true or false",
    "null": "null",
}
"""What is due, by the types of JSON Schema."""


def schema_faults(value: object, kind: Any) -> tuple[Fault, ...]:
    """Every fault of a decoded JSON value that is no `kind` (a type that msgspec knows), by its place in the value."""
    from jsonschema import Draft202012Validator

    validator = Draft202012Validator(msgspec.json.schema(kind))
    return tuple(dict.fromkeys(faults_of(validator.iter_errors(value))))


def faults_of(errors: Iterable[ValidationError]) -> Iterator[Fault]:
    """The faults that a validator of draft 2020-12 found, in words."""
    for error in errors:
        yield from _faults(error)


def lines_of(faults: Iterable[Fault], path: str = "") -> str:
    """The faults in words, a line each, after the name of the document."""
    return "\n".join(": ".join(part for part in (path, one.where, one.message) if part) for one in faults)


def kind_of(value: object) -> str:
    """What a JSON value is, in words."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return f"the text '{value[:40]}'"
        case int() | float() if abs(value) < 1e300:
            return f"the number {shown(value)}"
        case None:
            return "null"
    return shown(value)


def _faults(error: ValidationError) -> Iterator[Fault]:
    """The faults behind one error: of a value that may be one of several types, those of the type that it means."""
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error.absolute_path)[:200]
    where = where.removeprefix(".")
    given, schema = error.instance, error.schema
    if error.validator == "anyOf":
        yield from _of_the_meant(error, where)
    elif error.validator == "required":
        (name,) = [one for one in error.validator_value if error.message.startswith(f"{one!r} is")]
        yield Fault(where, f"'{name}' is missing", "add the field")
    elif error.validator == "additionalProperties":
        known = schema.get("properties", {})
        for name in given:
            if name not in known:
                yield Fault(where, f"there is no field '{name[:80]}'", _nearest(name, known))
    elif error.validator == "enum" and isinstance(given, str):
        yield Fault(where, _worded(error), _nearest(given, map(str, error.validator_value)))
    else:
        yield Fault(where, _worded(error), "")


def _of_the_meant(error: ValidationError, where: str) -> Iterator[Fault]:
    """A tagged object is of the type that its tags name; of anything else it is said what could stand there."""
    tag = error.schema.get("discriminator", {}).get("propertyName", "")
    branches: dict[int, list[ValidationError]] = {}
    for one in error.context or ():
        branches.setdefault(int(one.relative_schema_path[0]), []).append(one)
    meant = [found for found in branches.values() if not any(_rules_out(one, tag) for one in found)]
    if len(meant) == 1:
        yield from faults_of(meant[0])
        return
    wrong = [[one for one in found if _is_other_tag(one, tag)] for found in branches.values()]
    fewest = min((len(found) for found in wrong if found), default=0)
    nearest = [found[0] for found in wrong if len(found) == fewest > 0]
    if nearest and isinstance(error.instance, Mapping):
        name = nearest[0].relative_path[0]
        tags = sorted({_tag_due(one) for one in nearest if one.relative_path[0] == name})
        given = error.instance.get(name)
        yield Fault(
            f"{where}.{name}".lstrip("."), f"{_either(tags)} is due, this is {kind_of(given)}", _nearest(given, tags)
        )
        return
    kinds = [
        _DUE[one.validator_value] for one in error.context or () if not one.relative_path and one.validator == "type"
    ]
    yield Fault(where, f"{_either(kinds)} is due, this is {kind_of(error.instance)}", "")


def _rules_out(error: ValidationError, tag: str) -> bool:
    """Whether it says that a branch was not meant at all: the value is of another JSON type, or has another tag."""
    kind = str(error.validator)
    if error.relative_path:
        return _is_other_tag(error, tag)
    return kind == "type" or (kind == "required" and str(error.message).startswith(f"{tag!r} is"))


def _is_other_tag(error: ValidationError, tag: str) -> bool:
    """Whether it says that a tag is another one: a property that only one value may have (`tag`, if it is known)."""
    alone = error.validator == "const" or (error.validator == "enum" and list(error.relative_path) == [tag])
    return alone and len(error.relative_path) == 1


def _tag_due(error: ValidationError) -> str:
    return str(error.validator_value if error.validator == "const" else error.validator_value[0])


def _worded(error: ValidationError) -> str:
    given, due = error.instance, error.validator_value
    match error.validator:
        case "type":
            kinds = [_DUE[one] for one in ([due] if isinstance(due, str) else due)]
            return f"{_either(kinds)} is due, this is {kind_of(given)}"
        case "enum":
            return f"{_either([str(one) or 'an empty text' for one in due])} is due, this is {kind_of(given)}"
        case "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum":
            return f"{BOUNDS[error.validator]} {due} is due, this is {given}"
        case "minItems" | "maxItems":
            return f"a list of {due} is due, this one has {len(given)}"
    return str(error.message)[:200]


def _either(words: Iterable[str]) -> str:
    """`a, b or c`."""
    *most, last = dict.fromkeys(words)
    return f"{', '.join(most)} or {last}" if most else last


def _nearest(word: object, known: Iterable[str]) -> str:
    close = nearest(str(word), known)
    return f"did you mean '{close}'?" if close else ""
