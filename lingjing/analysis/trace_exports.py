"""A trace as files of other programs: `lingjing trace export`.

- `csv` and `parquet`: a folder with one file for each table of `lingjing.trace.tables`, such as `bodies.csv`.
- `geojson` (RFC 7946): one file, in degrees of WGS84: the way of each body as a line with a time for each point, and
  the place of each report as a point.

A file or folder appears whole or not at all.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args, get_type_hints

from lingjing.analysis.played_city import rebuilt_city
from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.mission.frames import to_geodetic
from lingjing.plugins.host import PluginHost
from lingjing.scene.atomic_folder import folder_beside
from lingjing.scene.exports import write_export
from lingjing.suggest import nearest_or
from lingjing.trace.reader import Trace
from lingjing.trace.tables import ROWS, TableName, table_rows

TABLES: tuple[TableName, ...] = get_args(TableName)
KINDS = ("csv", "parquet", "geojson")
"""The formats."""

Feature = dict[str, Any]


def export_trace(trace: Trace, kind: str, path: Path) -> tuple[Path, ...]:
    """Write a trace in a format, and return the written files.

    `path` is a folder that does not exist yet for csv and parquet, and a file for geojson. Raises `UsageError` for an
    unknown format, an existing folder, a package that is not installed, a city that cannot be rebuilt (geojson), and a
    place that cannot be written; nothing half-written stays behind.
    """
    if kind == "geojson":
        write_export(path, geojson(trace))
        return (path,)
    if kind not in KINDS:
        raise UsageError(
            f"no format is called `{kind}`", hint=nearest_or(kind, KINDS, f"there are: {', '.join(KINDS)}")
        )
    encode: Callable[[Trace, TableName], bytes] = table_csv if kind == "csv" else table_parquet
    if path.exists():
        raise UsageError(f"`{path}` exists already", hint="name a folder that does not exist yet")
    files = {f"{table}.{kind}": encode(trace, table) for table in TABLES}
    try:
        with folder_beside(path) as folder:
            for name, data in files.items():
                (folder / name).write_bytes(data)
            folder.rename(path)
    except OSError as error:
        hint = "free some space, or choose another place with -o; nothing was left behind"
        raise UsageError(f"cannot write `{path}`: {error.strerror or error}", hint=hint) from error
    return tuple(path / name for name in files)


def table_csv(trace: Trace, table: TableName) -> bytes:
    """Return a table as CSV (RFC 4180, UTF-8): a line of names, then the rows; None is empty."""
    names = list(get_type_hints(ROWS[table]))
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(names)
    writer.writerows([getattr(row, name) for name in names] for row in table_rows(trace, table))
    return text.getvalue().encode()


def table_parquet(trace: Trace, table: TableName) -> bytes:
    """Return a table as Parquet. Raises `UsageError` if pyarrow is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise UsageError("Parquet needs the package pyarrow", hint=install_line("bench")) from error
    kinds = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
    columns = get_type_hints(ROWS[table])
    fields = [pa.field(name, kinds[_plain(hint)]) for name, hint in columns.items()]
    rows = [{name: getattr(row, name) for name in columns} for row in table_rows(trace, table)]
    buffer = io.BytesIO()
    parquet.write_table(pa.Table.from_pylist(rows, schema=pa.schema(fields)), buffer, compression="zstd")
    return buffer.getvalue()


def geojson(trace: Trace) -> bytes:
    """Return ways and reports as GeoJSON. Raises `UsageError` if the city of the trace cannot be rebuilt."""
    origin = rebuilt_city(trace, PluginHost()).origin
    instance = trace.header.instance
    document = {
        "type": "FeatureCollection",
        "name": f"{instance.mission}-{instance.mode}, seed {instance.seed}",
        "attribution": trace.header.attribution,
        "features": [*_ways(trace, origin), *_reports(trace, origin)],
    }
    return json.dumps(document, ensure_ascii=False, allow_nan=False).encode()


def _ways(trace: Trace, origin: tuple[float, float]) -> Iterator[Feature]:
    entities = {entity.id: entity for entity in trace.header.instance.entities}
    rows: dict[str, list[Any]] = {}
    for row in trace.rows("bodies"):
        rows.setdefault(row.entity, []).append(row)
    for name, states in rows.items():
        places = [_place((row.x_m, row.y_m), origin) for row in states]
        line = {"type": "LineString", "coordinates": places}
        geometry = line if len(places) > 1 else {"type": "Point", "coordinates": places[0]}
        entity = entities[name]
        yield _feature(
            geometry, kind="way", entity=name, type=entity.type, role=entity.role,
            time_s=[row.time_s for row in states], z_m=[row.z_m for row in states],
            status=[row.status for row in states],
        )  # fmt: skip


def _reports(trace: Trace, origin: tuple[float, float]) -> Iterator[Feature]:
    seen: set[str] = set()
    for record in trace.boundaries:
        for message in record.messages:
            position = message.body.get("position")
            if message.id in seen or not isinstance(position, tuple | list) or len(position) < 2:
                continue
            seen.add(message.id)
            east, north = (float(part) if isinstance(part, int | float) else 0.0 for part in position[:2])
            yield _feature(
                {"type": "Point", "coordinates": _place((east, north), origin)}, kind="message", id=message.id,
                message=message.kind, sender=message.sender, tick=message.tick, time_s=record.time_s,
            )  # fmt: skip


def _place(point: Sequence[float], origin: tuple[float, float]) -> list[float]:
    latitude, longitude = to_geodetic(point[0], point[1], origin)
    return [longitude, latitude]


def _feature(geometry: Mapping[str, object], **properties: object) -> Feature:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _plain(hint: object) -> type:
    """Return the type of a column's values, without None."""
    return next(kind for kind in (bool, int, float, str) if hint in (kind, kind | None))


__all__ = ["KINDS", "export_trace", "geojson", "table_csv", "table_parquet"]
