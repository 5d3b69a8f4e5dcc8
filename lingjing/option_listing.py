"""The options of a model as people read them: spelling, type and bounds in words, default and help.

They are read off the model's JSON Schema, so that everything pydantic can check is listed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema


class OptionSpec(msgspec.Struct, frozen=True, kw_only=True):
    """One declared option as it is listed: its spelling, type and bounds in words, default as text, and help."""

    name: str
    type: str
    bounds: str = ""
    default: str = ""
    required: bool = False
    help: str = ""


def option_specs(model: type[BaseModel]) -> tuple[OptionSpec, ...]:
    """Every option of a model as it is listed, in the order of declaration.

    One whose type JSON Schema has no words for, such as a function, is listed as `any`.
    """
    schema = model.model_json_schema(mode="validation", schema_generator=_ListedSchema)
    if "$ref" in schema:  # a model that has itself within
        schema = {**schema, **schema["$defs"][schema["$ref"].rpartition("/")[2]]}
    required = frozenset(schema.get("required", ()))
    shared = schema.get("$defs", {})
    listed = {name: _resolved(option, shared) for name, option in schema.get("properties", {}).items()}
    return tuple(
        OptionSpec(
            name=name,
            type=_type(option),
            bounds=_bounds(option),
            default="" if name in required or option.get("default") is None else _text(option["default"]),
            required=name in required,
            help=str(option.get("description", "")),
        )
        for name, option in listed.items()
    )


# -- private


class _ListedSchema(GenerateJsonSchema):
    """The JSON Schema of what it can express; the rest may be anything, and a default without JSON is left out."""

    def handle_invalid_for_json_schema(self, schema: object, error_info: str) -> dict[str, Any]:
        return {}

    def emit_warning(self, kind: object, detail: str) -> None:
        """Say nothing: the list is for people, who need no warning of pydantic's."""


def _resolved(one: Mapping[str, Any], shared: Mapping[str, Any], within: tuple[str, ...] = ()) -> dict[str, Any]:
    """A schema with what it refers to put in its place; what refers to itself is any object."""
    parts = [one, *one.get("allOf", ())]
    names = [str(part["$ref"]).rpartition("/")[2] for part in parts if "$ref" in part]
    if any(name in within for name in names):
        return {"type": "object"}
    found = dict(one)
    for name in names:
        found = {**_resolved(shared.get(name, {}), shared, (*within, name)), **found}
    for key in ("items", "additionalProperties"):
        if isinstance(found.get(key), Mapping):
            found[key] = _resolved(found[key], shared, (*within, *names))
    for key in ("anyOf", "oneOf", "prefixItems"):
        if key in found:
            found[key] = [_resolved(part, shared, (*within, *names)) for part in found[key]]
    if "properties" in found:
        parts = found["properties"]
        found["properties"] = {name: _resolved(part, shared, (*within, *names)) for name, part in parts.items()}
    return found


def _type(one: Mapping[str, Any]) -> str:
    if "enum" in one or "const" in one:
        return "word" if all(isinstance(value, str) for value in _choices(one)) else "choice"
    for key in ("anyOf", "oneOf"):
        if key in one:
            return " or ".join(dict.fromkeys(_type(part) for part in one[key] if part.get("type") != "null"))
    match one.get("type"):
        case "array":
            kind = "set" if one.get("uniqueItems") else "list"
            if "prefixItems" in one:
                return f"{kind} of {', '.join(map(_type, one['prefixItems']))}"
            return f"{kind} of {_type(one['items'])}" if one.get("items") else kind
        case "object":
            return _object(one)
    return _TYPES.get(str(one.get("type", "")), "any")


_TYPES = {"number": "number", "integer": "whole number", "string": "text", "boolean": "yes or no"}


def _object(one: Mapping[str, Any]) -> str:
    """`object of number`; `object (tries: whole number from 1, wait: number)`."""
    if one.get("properties"):
        fields = (f"{name}: {' '.join(filter(None, (_type(p), _bounds(p))))}" for name, p in one["properties"].items())
        return f"object ({', '.join(fields)})"
    values = one.get("additionalProperties")
    return f"object of {_type(values)}" if isinstance(values, Mapping) and values else "object"


def _choices(one: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(one.get("enum", (one.get("const"),)))


def _bounds(one: Mapping[str, Any]) -> str:
    """The bounds in words; of a list those of its items as well."""
    if "enum" in one or "const" in one:
        return ", ".join(_text(value) for value in _choices(one))
    told = [_bounds(part) for key in ("anyOf", "oneOf") for part in one.get(key, ())]
    if "minimum" in one and "maximum" in one:
        told.append(f"{_text(one['minimum'])} to {_text(one['maximum'])}")
        one = {key: value for key, value in one.items() if key not in ("minimum", "maximum")}
    if one.get("minLength") == 1:
        told.append("not empty")
        one = {key: value for key, value in one.items() if key != "minLength"}
    told += [words.format(_text(one[key])) for key, words in _BOUNDS.items() if key in one]
    for key in ("items", "additionalProperties"):
        each = _bounds(one[key]) if isinstance(one.get(key), Mapping) else ""
        told.append(f"each {each}" if each else "")
    return ", ".join(filter(None, dict.fromkeys(told)))


_BOUNDS = {
    "minimum": "at least {}", "exclusiveMinimum": "more than {}", "maximum": "at most {}",
    "exclusiveMaximum": "less than {}", "multipleOf": "a multiple of {}",
    "minLength": "{} letters or more", "maxLength": "{} letters at most", "pattern": "like {}",
    "minItems": "{} or more", "maxItems": "{} at most", "minProperties": "{} or more", "maxProperties": "{} at most",
}  # fmt: skip


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return f"{value:.15g}"
    return value if isinstance(value, str) else msgspec.json.encode(value).decode()
