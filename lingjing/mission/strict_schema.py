"""`strict_schema`: JSON Schemas for strict validators, which reject unknown keywords and undeclared names."""

from __future__ import annotations

from inspect import cleandoc
from typing import Any


def strict_schema(schema: Any) -> Any:
    """Return the schema without OpenAPI's `discriminator`, and with every required name declared in its alternative.
    The tag of each alternative is an enum of one value already."""
    if isinstance(schema, list):
        return [strict_schema(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: strict_schema(value) for key, value in schema.items() if key != "discriminator"}
    if list(kept) == ["required"] and isinstance(kept["required"], list):
        kept |= {"type": "object", "properties": {name: {} for name in kept["required"]}}
    if isinstance(kept.get("description"), str):  # docstrings, of which Python 3.13 drops the indentation
        kept["description"] = cleandoc(kept["description"])
    return kept


__all__ = ["strict_schema"]
