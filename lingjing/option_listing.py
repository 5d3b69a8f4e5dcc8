"""The options of a model in words: spelling, type, bounds, default and help.

They are derived from the model's JSON Schema, so that all constraints that pydantic can check are listed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema


class OptionSpec(msgspec.Struct, frozen=True, kw_only=True):
    """One declared option in words."""

    name: str
    """The spelling."""
    type: str
    """The type."""
    bounds: str = ""
    """The bounds; "" without any."""
    default: str = ""
    """The default as text; "" without one."""
    required: bool = False
    """True if the option has no default."""
    help: str = ""
    """The description."""


def option_specs(model: type[BaseModel]) -> tuple[OptionSpec, ...]:
    """Return every option of a model in the order of declaration.

    An option of a type without JSON Schema, such as a function, is listed as `any`.
    """
    schema = model.model_json_schema(mode="validation", schema_generator=_ListedSchema)
    if "$ref" in schema:  # a recursive model
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
    """A JSON Schema generator that accepts types and defaults without a JSON form: any value, and no default."""

    def handle_invalid_for_json_schema(self, schema: object, error_info: str) -> dict[str, Any]:
        return {}

    def emit_warning(self, kind: object, detail: str) -> None:
        """Do nothing: pydantic's warnings are not meant for readers of the list."""


def _resolved(schema: Mapping[str, Any], shared: Mapping[str, Any], within: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return a schema with its references replaced by their targets. A recursive reference becomes any object."""
    parts = [schema, *schema.get("allOf", ())]
    names = [str(part["$ref"]).rpartition("/")[2] for part in parts if "$ref" in part]
    if any(name in within for name in names):
        return {"type": "object"}
    result = dict(schema)
    for name in names:
        result = {**_resolved(shared.get(name, {}), shared, (*within, name)), **result}
    for key in ("items", "additionalProperties"):
        if isinstance(result.get(key), Mapping):
            result[key] = _resolved(result[key], shared, (*within, *names))
    for key in ("anyOf", "oneOf", "prefixItems"):
        if key in result:
            result[key] = [_resolved(part, shared, (*within, *names)) for part in result[key]]
    if "properties" in result:
        parts = result["properties"]
        result["properties"] = {name: _resolved(part, shared, (*within, *names)) for name, part in parts.items()}
    return result


def _type(schema: Mapping[str, Any]) -> str:
    if "enum" in schema or "const" in schema:
        return "word" if all(isinstance(value, str) for value in _choices(schema)) else "choice"
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " or ".join(dict.fromkeys(_type(part) for part in schema[key] if part.get("type") != "null"))
    match schema.get("type"):
        case "array":
            kind = "set" if schema.get("uniqueItems") else "list"
            if "prefixItems" in schema:
                return f"{kind} of {', '.join(map(_type, schema['prefixItems']))}"
            return f"{kind} of {_type(schema['items'])}" if schema.get("items") else kind
        case "object":
            return _object(schema)
    return _TYPES.get(str(schema.get("type", "")), "any")


_TYPES = {"number": "number", "integer": "whole number", "string": "text", "boolean": "yes or no"}


def _object(schema: Mapping[str, Any]) -> str:
    """Return the type of an object in words: `object of number`, `object (tries: whole number from 1, wait:
    number)`.
    """
    if schema.get("properties"):
        fields = (
            f"{name}: {' '.join(filter(None, (_type(p), _bounds(p))))}" for name, p in schema["properties"].items()
        )
        return f"object ({', '.join(fields)})"
    values = schema.get("additionalProperties")
    return f"object of {_type(values)}" if isinstance(values, Mapping) and values else "object"


def _choices(schema: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(schema.get("enum", (schema.get("const"),)))


def _bounds(schema: Mapping[str, Any]) -> str:
    """Return the bounds in words; those of a list include those of its items."""
    if "enum" in schema or "const" in schema:
        return ", ".join(_text(value) for value in _choices(schema))
    texts = [_bounds(part) for key in ("anyOf", "oneOf") for part in schema.get(key, ())]
    if "minimum" in schema and "maximum" in schema:
        texts.append(f"{_text(schema['minimum'])} to {_text(schema['maximum'])}")
        schema = {key: value for key, value in schema.items() if key not in ("minimum", "maximum")}
    if schema.get("minLength") == 1:
        texts.append("not empty")
        schema = {key: value for key, value in schema.items() if key != "minLength"}
    texts += [words.format(_text(schema[key])) for key, words in _BOUNDS.items() if key in schema]
    for key in ("items", "additionalProperties"):
        each = _bounds(schema[key]) if isinstance(schema.get(key), Mapping) else ""
        texts.append(f"each {each}" if each else "")
    return ", ".join(filter(None, dict.fromkeys(texts)))


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
