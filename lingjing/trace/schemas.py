"""JSON Schemas of the project's own records, generated from the structs.

`python -m lingjing.trace.schemas [FOLDER]` writes them (default: the repository's `schemas/trace`). A test compares the
folder with the code. Every trace contains the schemas of its channels.
"""

from __future__ import annotations

import json
import sys
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from lingjing.data import data_path
from lingjing.mission.strict_schema import strict_schema
from lingjing.trace.container import ContainerSchema
from lingjing.trace.records import (
    BoundaryRecord,
    Command,
    EngineFrame,
    FrameInfo,
    Header,
    Outcome,
    Receipt,
    Score,
    Thought,
)

RECORDS: dict[str, type[msgspec.Struct]] = {
    "header": Header,
    "boundary": BoundaryRecord,
    "frame": FrameInfo,
    "outcome": Outcome,
    "engine_frame": EngineFrame,
    "thought": Thought,
    "command": Command,
    "receipt": Receipt,
    "score": Score,
}
"""The struct of each schema, by the name of the schema's file. The last four are messages for viewers
(`lingjing.trace.viewer_messages`)."""


@lru_cache(maxsize=len(RECORDS))
def schema_text(name: str) -> str:
    """Return the JSON Schema (2020-12) of one of `RECORDS`, indented, with a final newline.

    The root is written in full and is no reference, because viewers require `"type": "object"` there. OpenAPI's keyword
    `discriminator` is left out, because strict validators reject keywords that JSON Schema does not define.
    """
    return json.dumps(_schema(name), indent=2, sort_keys=True, ensure_ascii=False) + "\n"


@lru_cache(maxsize=len(RECORDS))
def container_schema(name: str) -> ContainerSchema:
    """Return the schema of one of `RECORDS` for the container."""
    return ContainerSchema(f"lingjing.{RECORDS[name].__name__}", "jsonschema", schema_text(name).encode())


def _write_schemas(folder: Path) -> tuple[Path, ...]:
    """Write `<name>.schema.json` for every record into `folder`, and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = tuple(folder / f"{name}.schema.json" for name in RECORDS)
    for name, path in zip(RECORDS, paths, strict=True):
        path.write_text(schema_text(name), encoding="utf-8")
    return paths


def _schema(name: str) -> dict[str, Any]:
    record = RECORDS[name]
    whole = strict_schema(msgspec.json.schema(record))
    definitions = whole["$defs"]
    root = definitions.pop(record.__name__)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"lingjing.{record.__name__}",
        **{key: value for key, value in root.items() if key != "title"},
        **({"$defs": definitions} if definitions else {}),
    }


if __name__ == "__main__":
    _write_schemas(Path(sys.argv[1]) if len(sys.argv) > 1 else data_path("schemas", "trace"))
