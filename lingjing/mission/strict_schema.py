"""`strict_schema`: a JSON Schema as strict validators take it, which refuse words and names that they do not know."""

from __future__ import annotations

from typing import Any


def strict_schema(schema: Any) -> Any:
    """The same schema without OpenAPI's `discriminator` (each alternative's tag is an enum of one already), and with
    whatever an alternative requires declared in that alternative."""
    if isinstance(schema, list):
        return [strict_schema(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    told = {key: strict_schema(value) for key, value in schema.items() if key != "discriminator"}
    if list(told) == ["required"] and isinstance(told["required"], list):
        told |= {"type": "object", "properties": {name: {} for name in told["required"]}}
    return told


__all__ = ["strict_schema"]
