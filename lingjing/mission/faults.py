"""Errors of a JSON value that does not match a type: each with its path and a hint.

The value is validated against the JSON Schema of the type (draft 2020-12) by `jsonschema`. That library is loaded here
and only after an error.
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
"""Names of the types of JSON Schema in messages."""


def schema_faults(value: object, kind: Any) -> tuple[Fault, ...]:
    """Every error of a decoded JSON value that is no `kind`, in no particular order. `kind` is a type that msgspec
    supports."""
    from jsonschema import Draft202012Validator

    validator = Draft202012Validator(msgspec.json.schema(kind))
    return tuple(dict.fromkeys(faults_of(validator.iter_errors(value))))


def faults_of(errors: Iterable[ValidationError]) -> Iterator[Fault]:
    """The errors of a validator of draft 2020-12, in words."""
    for error in errors:
        yield from _faults(error)


def lines_of(faults: Iterable[Fault], path: str = "") -> str:
    """The errors in words, one a line, after the name of the document."""
    return "\n".join(": ".join(part for part in (path, fault.where, fault.message) if part) for fault in faults)


def kind_of(value: object) -> str:
    """A JSON value in words, for messages."""
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
    """The faults behind one validation error. If a value may have one of several types, those of the type that it most
    probably should have."""
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error.absolute_path)[:200]
    where = where.removeprefix(".")
    value, schema = error.instance, error.schema
    if error.validator == "anyOf":
        yield from _union_faults(error, where)
    elif error.validator == "required":
        (name,) = [field for field in error.validator_value if error.message.startswith(f"{field!r} is")]
        yield Fault(where, f"'{name}' is missing", "add the field")
    elif error.validator == "additionalProperties":
        known = schema.get("properties", {})
        for name in value:
            if name not in known:
                yield Fault(where, f"there is no field '{name[:80]}'", _nearest(name, known))
    elif error.validator == "enum" and isinstance(value, str):
        yield Fault(where, _worded(error), _nearest(value, map(str, error.validator_value)))
    else:
        yield Fault(where, _worded(error), "")


def _union_faults(error: ValidationError, where: str) -> Iterator[Fault]:
    """The faults of a value of a union type. The tag of an object selects its type; without one, the message lists the
    types."""
    tag = error.schema.get("discriminator", {}).get("propertyName", "")
    branches: dict[int, list[ValidationError]] = {}
    for suberror in error.context or ():
        branches.setdefault(int(suberror.relative_schema_path[0]), []).append(suberror)
    candidates = [branch for branch in branches.values() if not any(_rules_out(each, tag) for each in branch)]
    if len(candidates) == 1:
        yield from faults_of(candidates[0])
        return
    wrong_tags = [[each for each in branch if _is_other_tag(each, tag)] for branch in branches.values()]
    fewest = min((len(branch) for branch in wrong_tags if branch), default=0)
    nearest = [branch[0] for branch in wrong_tags if len(branch) == fewest > 0]
    if nearest and isinstance(error.instance, Mapping):
        name = nearest[0].relative_path[0]
        tags = sorted({_expected_tag(each) for each in nearest if each.relative_path[0] == name})
        value = error.instance.get(name)
        yield Fault(
            f"{where}.{name}".lstrip("."), f"{_either(tags)} is due, this is {kind_of(value)}", _nearest(value, tags)
        )
        return
    kinds = [
        _DUE[each.validator_value]
        for each in error.context or ()
        if not each.relative_path and each.validator == "type"
    ]
    yield Fault(where, f"{_either(kinds)} is due, this is {kind_of(error.instance)}", "")


def _rules_out(error: ValidationError, tag: str) -> bool:
    """True if the error excludes a branch of the union: the value has another JSON type or another tag."""
    kind = str(error.validator)
    if error.relative_path:
        return _is_other_tag(error, tag)
    return kind == "type" or (kind == "required" and str(error.message).startswith(f"{tag!r} is"))


def _is_other_tag(error: ValidationError, tag: str) -> bool:
    """True if the error is about a tag: a property with exactly one allowed value. `tag` is its name, or "" if
    unknown."""
    alone = error.validator == "const" or (error.validator == "enum" and list(error.relative_path) == [tag])
    return alone and len(error.relative_path) == 1


def _expected_tag(error: ValidationError) -> str:
    return str(error.validator_value if error.validator == "const" else error.validator_value[0])


def _worded(error: ValidationError) -> str:
    value, due = error.instance, error.validator_value
    match error.validator:
        case "type":
            kinds = [_DUE[item] for item in ([due] if isinstance(due, str) else due)]
            return f"{_either(kinds)} is due, this is {kind_of(value)}"
        case "enum":
            return f"{_either([str(item) or 'an empty text' for item in due])} is due, this is {kind_of(value)}"
        case "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum":
            return f"{BOUNDS[error.validator]} {due} is due, this is {value}"
        case "minItems" | "maxItems":
            return f"a list of {due} is due, this one has {len(value)}"
    return str(error.message)[:200]


def _either(words: Iterable[str]) -> str:
    """Return the words as `a, b or c`."""
    *most, last = dict.fromkeys(words)
    return f"{', '.join(most)} or {last}" if most else last


def _nearest(word: object, known: Iterable[str]) -> str:
    close = nearest(str(word), known)
    return f"did you mean '{close}'?" if close else ""
