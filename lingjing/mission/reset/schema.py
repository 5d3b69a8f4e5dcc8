"""The JSON Schema of `resetScenario` documents, generated from their shapes."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import models_json_schema

from lingjing.mission.reset.fields import FIELDS
from lingjing.mission.reset.shapes import CommandEnvelope, HiddenPlace, InitialState, Scenario


def reset_scenario() -> dict[str, Any]:
    """The alternatives and definitions. Hidden places may be a list or one object."""
    shapes = ((CommandEnvelope, "validation"), (Scenario, "validation"), (HiddenPlace, "validation"))
    places, schema = models_json_schema(shapes, ref_template="#/$defs/{model}")  # type: ignore[arg-type]
    definitions: dict[str, Any] = schema["$defs"]
    target = places[HiddenPlace, "validation"]
    hidden = {"anyOf": [{"type": "array", "items": target}, target]}
    definitions[InitialState.__name__]["properties"] |= {field.name: hidden for field in FIELDS}
    for definition in definitions.values():
        for name, field_schema in definition.get("properties", {}).items():
            definition["properties"][name] = _nullable(field_schema)
    return {"anyOf": [places[CommandEnvelope, "validation"], places[Scenario, "validation"]], "$defs": definitions}


def _nullable(schema: dict[str, Any]) -> dict[str, Any]:
    """A field's schema without pydantic's titles and without our list of spellings."""
    return {key: value for key, value in schema.items() if key not in ("title", "spellings")}
