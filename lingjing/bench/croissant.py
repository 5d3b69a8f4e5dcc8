"""Croissant cards (MLCommons, version 1.0): the files, columns and checksums of results and frame sets as JSON-LD.

The card stands beside the files that it describes, and names them by relative paths. `mlcroissant` validates it and
loads the records. A card names no place in the web: a publisher adds `url` and `datePublished`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import lingjing
from lingjing.analysis.metrics import Metrics
from lingjing.bench.dataset_card import PAPER, column_meanings
from lingjing.bench.parquet import stored_columns
from lingjing.bench.rows import SuiteRow
from lingjing.errors import UsageError

CROISSANT = "croissant.json"
"""The file's name."""

LICENCE = "https://spdx.org/licenses/Apache-2.0"
"""Licence of the project, which the data that it makes takes over."""

_CONTEXT: dict[str, Any] = {
    "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs", "column": "cr:column",
    "conformsTo": "dct:conformsTo", "cr": "http://mlcommons.org/croissant/", "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"}, "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/", "examples": {"@id": "cr:examples", "@type": "@json"}, "extract": "cr:extract",
    "field": "cr:field", "fileProperty": "cr:fileProperty", "fileObject": "cr:fileObject", "fileSet": "cr:fileSet",
    "format": "cr:format", "includes": "cr:includes", "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath",
    "key": "cr:key", "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path", "recordSet": "cr:recordSet",
    "references": "cr:references", "regex": "cr:regex", "repeated": "cr:repeated", "replace": "cr:replace",
    "sc": "https://schema.org/", "separator": "cr:separator", "source": "cr:source", "subField": "cr:subField",
    "transform": "cr:transform", "samplingRate": "cr:samplingRate", "equivalentProperty": "cr:equivalentProperty",
}  # fmt: skip
"""The context of Croissant 1.0, as the specification prints it."""

_TYPES = {"bool": "sc:Boolean", "int64": "sc:Integer", "double": "sc:Float", "string": "sc:Text"}
"""Croissant's types by Arrow's; columns of other types (lists of stages) have no field."""

_FRAME_FIELDS = (
    ("file_name", "sc:Text", "name of the picture in the folder of its split"),
    ("present", "sc:Boolean", "true if the picture shows a target of the class"),
    ("hard", "sc:Text", "kind of hard negative; empty for another picture"),
    ("mission", "sc:Text", "mission of the episode"),
    ("seed", "sc:Integer", "seed of the episode"),
    ("camera", "sc:Text", "camera that took the picture"),
)
"""Fields of `metadata.jsonl`: name, type, meaning."""


def results_croissant(file: Path, rows: Sequence[SuiteRow]) -> str:
    """Return the card of a suite's `results.parquet` with these rows. Raises `UsageError` if it cannot be read."""
    suite = rows[0].suite if rows else "none"
    meanings = column_meanings()
    fields = [
        _field("episodes", name, _TYPES[kind], meanings.get(name) or _metric_meaning(name), file.name)
        for name, kind in stored_columns().items()
        if kind in _TYPES
    ]
    maps = dict.fromkeys(row.report.attribution for row in rows)
    about = f"{len(rows)} episodes of the suite {suite}, as specified in: {PAPER}."
    return _card(
        f"Lingjing results: {suite}",
        " ".join([about, *(f"Map: {text}" for text in maps if text not in ("", "procedural"))]),
        [_file(file, file.name, "application/x-parquet")],
        [_records("episodes", "One record for each episode.", fields)],
    )


def frames_croissant(folder: Path, classes: Iterable[str], splits: Sequence[str]) -> str:
    """Return the card of the folder of a frame set."""
    files, records = [], []
    for cls in classes:
        for split in splits:
            path = folder / cls / split / "metadata.jsonl"
            if not path.is_file() or not path.stat().st_size:
                continue
            name = f"{cls}/{split}"
            files.append(_file(path, f"{name}/metadata.jsonl", "application/jsonlines"))
            files.append(
                {"@type": "cr:FileSet", "@id": f"{name}/pictures", "name": f"{name}/pictures",
                 "encodingFormat": "image/jpeg", "includes": f"{name}/*.jpg"}
            )  # fmt: skip
            fields = [_field(name, *part, f"{name}/metadata.jsonl") for part in _FRAME_FIELDS]
            records.append(_records(name, f"Pictures with and without {cls}, for {split}.", fields))
    about = "Labelled pictures from episodes of simulated missions, one set for each class."
    return _card("Lingjing frames", about, files, records)


def parquet_file(place: Path) -> Path:
    """Return the file of results that a place names. Raises `UsageError` without one."""
    file = place / "results.parquet" if place.is_dir() else place
    if not file.is_file():
        raise UsageError(f"`{place}` holds no results.parquet", hint="name a suite's folder, or its results.parquet")
    return file


def _card(name: str, description: str, files: list[dict[str, Any]], records: list[dict[str, Any]]) -> str:
    card = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": name,
        "description": description,
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "license": LICENCE,
        "version": lingjing.__version__,
        "citeAs": PAPER,
        "distribution": files,
        "recordSet": records,
    }
    return json.dumps(card, indent=1, ensure_ascii=False) + "\n"


def _file(path: Path, name: str, form: str) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}", hint="name a file of results") from error
    return {
        "@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": name, "encodingFormat": form,
        "contentSize": f"{len(data)} B", "sha256": hashlib.sha256(data).hexdigest(),
    }  # fmt: skip


def _records(name: str, description: str, fields: list[dict[str, Any]]) -> dict[str, Any]:
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "description": description, "field": fields}


def _field(records: str, name: str, kind: str, description: str, file: str) -> dict[str, Any]:
    return {
        "@type": "cr:Field", "@id": f"{records}/{name}", "name": f"{records}/{name}", "description": description,
        "dataType": kind, "source": {"fileObject": {"@id": file}, "extract": {"column": name}},
    }  # fmt: skip


def _metric_meaning(name: str) -> str:
    return Metrics.definition(name) if name in Metrics.__struct_fields__ else name


__all__ = ["CROISSANT", "frames_croissant", "parquet_file", "results_croissant"]
