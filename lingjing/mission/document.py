"""Read and write `mission.json`; generate the JSON Schemas of the formats that this package reads and writes.

`python -m lingjing.mission.document [DIR]` writes the schemas to `schemas/`; a test compares them with the code.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import Fault, MissionError
from lingjing.mission import jsontext
from lingjing.mission.conditions.listing import ListedCondition, list_conditions
from lingjing.mission.diagnostics import Diagnostic
from lingjing.mission.faults import lines_of, schema_faults
from lingjing.mission.graph.exchange import ExchangeGraph, exchange
from lingjing.mission.model import Mission
from lingjing.mission.strict_schema import strict_schema

FORMAT: str = msgspec.structs.fields(Mission)[0].default
"""The format that this version reads and writes."""
_VERSION = FORMAT.rpartition("/")[2]
_FORMAT = re.compile(r"lingjing-mission/([1-9][0-9]{0,5})")

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


class MissionDocument(Mission, frozen=True, kw_only=True):
    """The content of `mission.json`: a mission with parts that are derived from it for other programs.

    A reader checks the form of the derived parts and then ignores them. They may be absent.
    """

    conditions: tuple[ListedCondition, ...] = ()
    """Every condition with what it reads, what changes that, its bounds, and what it decides."""
    graph: ExchangeGraph | None = None
    """The mission as a directed multigraph in the node-link form."""


def encode(mission: Mission) -> str:
    """The mission as `mission.json`: indented, keys in the order of the model, with a final newline."""
    listed = list_conditions(mission)
    document = MissionDocument(**_content(mission), conditions=listed.conditions, graph=exchange(mission, listed))
    return msgspec.json.format(msgspec.json.encode(document), indent=2).decode() + "\n"


def decode(text: str, path: str) -> Mission:
    """The mission of a `mission.json`. `path` is used in messages.

    Raises `UsageError` (line and column) if the text is not JSON, and `MissionError` with all errors if it is no
    mission.
    """
    try:
        encoded = text.removeprefix("\ufeff").encode("utf-8", "surrogatepass")
        return Mission(**_content(from_json(encoded, MissionDocument)))
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        value = jsontext.load(text, path)
        _check_version(value, path)
        faults = _faults(value)
        raise MissionError(
            lines_of(faults, path) or f"{path}: not a mission: {error}",
            hint="write mission.json with `lingjing compile`, or edit it according to schemas/mission.schema.json",
            faults=faults,
        ) from None


def _content(mission: Mission) -> dict[str, Any]:
    """The fields of a mission without the derived parts of a document."""
    return {name: getattr(mission, name) for name in Mission.__struct_fields__}


def _check_version(value: object, path: str) -> None:
    """Raise `MissionError` for a compiled mission of another version. Its other faults would mislead."""
    name = value.get("format") if isinstance(value, dict) else None
    version = _FORMAT.fullmatch(name) if isinstance(name, str) else None
    if version is None or name == FORMAT:
        return
    newer = len(version[1]) > len(_VERSION) or version[1] > _VERSION
    hint = "install a newer lingjing-sim" if newer else "compile it again from its .ljs file: `lingjing compile`"
    raise MissionError(
        f"{path}: format: it is a compiled mission of version {version[1]}, and this program reads version {_VERSION}",
        hint=hint,
        faults=(Fault("format", f"version {version[1]}, {_VERSION} is due", hint),),
    )


def _faults(value: object) -> tuple[Fault, ...]:
    """All errors of a JSON value that is no mission; none if it is nested too deep to be examined."""
    try:
        return schema_faults(value, MissionDocument)
    except RecursionError:
        return ()


def read(text: str, path: str, templates: Callable[[str], Mission]) -> tuple[Mission, tuple[str, ...]]:
    """The mission of any JSON text, a `mission.json` or a `resetScenario`, and notes on its interpretation.

    Raises the errors of `decode` and of `reset.reading.instantiate_document`, which also defines `templates`.
    """
    value = jsontext.load(text, path, notes=[], faults=[])
    if isinstance(value, dict) and str(value.get("format", "")).startswith("lingjing-mission"):
        return decode(text, path), ()
    from lingjing.mission.reset.reading import (
        instantiate_document,  # loads pydantic, which a mission.json does not need
    )

    return instantiate_document(text, path, templates)


def schemas() -> dict[str, bytes]:
    """Each schema of this package by file name, formatted as it is committed."""
    return {
        "mission.schema.json": _formatted({"$schema": _DIALECT, **msgspec.json.schema(MissionDocument)}),
        "diagnostics.schema.json": _formatted(_diagnostics()),
        "reset-scenario.schema.json": _formatted(_reset_scenario()),
    }


def main(arguments: Sequence[str] = ()) -> None:
    """Write the schemas to the folder named by the first argument (default: `schemas/` of the project)."""
    folder = Path(arguments[0]) if arguments else Path(__file__).resolve().parents[2] / "schemas"
    folder.mkdir(parents=True, exist_ok=True)
    for name, contents in schemas().items():
        (folder / name).write_bytes(contents)


def _diagnostics() -> dict[str, object]:
    """The schema of the output of `lingjing validate --output-format json`."""
    return {"$schema": _DIALECT, "title": "diagnostics", **msgspec.json.schema(tuple[Diagnostic, ...])}


def _reset_scenario() -> dict[str, object]:
    """The schema of an envelope or a bare scenario. Unknown fields are allowed and kept."""
    from lingjing.mission.reset.schema import reset_scenario

    return {"$schema": _DIALECT, "title": "resetScenario", **reset_scenario()}


def _formatted(schema: dict[str, object]) -> bytes:
    return msgspec.json.format(msgspec.json.encode(strict_schema(schema)), indent=2) + b"\n"


if __name__ == "__main__":
    main(sys.argv[1:])
