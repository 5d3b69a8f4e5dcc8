"""Rows as Parquet files, which pandas, DuckDB, Polars and R read: one column per field or metric.

The columns `options` and `report` hold the complete episode as JSON, and rows are read back from them. The other
columns are for queries. pyarrow is imported when a file is read or written.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

import msgspec

import lingjing
from lingjing.analysis.metrics import Metrics, StageMetric
from lingjing.bench.rows import SuiteRow
from lingjing.decoding import converted
from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.trace.tables import FrameLibrary, frame_library

if TYPE_CHECKING:
    import pyarrow as pa

VERSION = b"1"
"""The version of the columns that are read back; stored in the file's metadata."""

_KEY = b"lingjing.results"
_MOVE = "move it away: in a suite's folder, the next `lingjing bench` plays the episodes that it held"
_AS_JSON = ("options", "report")
_REPORTED = {
    "success": bool, "reason": str, "scr": float, "score": float, "ticks": int, "digest": str, "frames_digest": str,
    "detail": str, "trace": str, "attribution": str, "family": str,
}  # fmt: skip
_MISSING = "the results of suites need pyarrow"


def encode_rows(rows: Iterable[SuiteRow]) -> bytes:
    """Return the rows as a Parquet file, sorted by key: equal rows give equal bytes."""
    arrow = _arrow()
    import pyarrow.parquet as parquet

    table = arrow.Table.from_pylist(
        [_flat(row) for row in sorted(rows, key=lambda row: row.key)], schema=_schema(arrow)
    )
    buffer = io.BytesIO()
    parquet.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def read_rows(file: Path) -> list[SuiteRow]:
    """Return the rows of a file of `encode_rows`. Raises `UsageError` for other files and versions."""
    arrow = _arrow()
    import pyarrow.parquet as parquet

    try:
        data = file.read_bytes()
    except FileNotFoundError as error:
        hint = "name a file that `lingjing bench` wrote, or its folder"
        raise UsageError(f"cannot read `{file}`: {error.strerror}", hint=hint) from error
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}", hint=_MOVE) from error
    try:
        # without Arrow's threads: a thread that is left when the interpreter ends aborts the process
        table = parquet.ParquetFile(io.BytesIO(data), pre_buffer=False).read(use_threads=False)
    except (arrow.ArrowInvalid, OSError) as error:
        reason = str(error).splitlines()[0]
        raise UsageError(
            f"`{file}` holds no results of a suite: {reason}", hint=f"it is incomplete or foreign; {_MOVE}"
        ) from error
    version = (table.schema.metadata or {}).get(_KEY, b"")
    if version != VERSION:
        form = f"it has version {version.decode(errors='replace')}" if version else "it has no version"
        hint = f"this is lingjing {lingjing.__version__}, which reads version {VERSION.decode()}"
        raise UsageError(f"`{file}` holds no results that this version can read: {form}", hint=hint)
    return list(_decoded(table, file))


def rows_frame(rows: Iterable[SuiteRow], library: FrameLibrary) -> Any:
    """Return the rows as a data frame with the columns of the file, without the JSON of options and reports.

    Raises `UsageError` for an unknown library and for one that is not installed.
    """
    frames, arrow = frame_library(library), _arrow()
    flat = [_flat(row) for row in sorted(rows, key=lambda row: row.key)]
    table = arrow.Table.from_pylist(flat, schema=_schema(arrow)).drop_columns(list(_AS_JSON))
    return frames.from_arrow(table) if library == "polars" else table.to_pandas(use_threads=False)


def stored_columns() -> dict[str, str]:
    """Return the columns of the file with the names of their Arrow types. Raises `UsageError` without pyarrow."""
    return {field.name: str(field.type) for field in _schema(_arrow())}


def _decoded(table: pa.Table, file: Path) -> Iterator[SuiteRow]:
    names = [name for name in SuiteRow.__struct_fields__ if name in table.schema.names]
    arrow = _arrow()
    known = [name for name in _schema(arrow).names if name in table.schema.names and name not in _AS_JSON]
    try:
        queried, stored = table.select(known).to_pylist(), table.select(names).to_pylist()
    except (arrow.ArrowException, KeyError, ValueError, OverflowError) as error:
        raise UsageError(f"the columns of `{file}` cannot be read: {error}", hint=f"it is foreign; {_MOVE}") from error
    for at, plain in enumerate(stored):
        try:
            whole = {name: json.loads(value) if name in _AS_JSON else value for name, value in plain.items()}
            row = converted(whole, SuiteRow)
            flat = _flat(row)
        except (msgspec.ValidationError, ValueError, TypeError, RecursionError) as error:
            made = f"lingjing {plain.get('version') or 'of an unknown version'}, code {str(plain.get('code'))[:12]}"
            hint = (
                f"it was made by {made}; this is lingjing {lingjing.__version__}: read it with that version, or "
                "score its kept traces with this one: lingjing report FOLDER/runs"
            )
            raise UsageError(f"row {at} of `{file}` cannot be read: {error}", hint=hint) from error
        changed = next((name for name in known if _differs(name, queried[at][name], flat.get(name))), "")
        if changed:
            raise UsageError(
                f"row {at} of `{file}` contradicts itself: its column `{changed}` is not that of its report",
                hint=f"the file was changed after it was written; {_MOVE}",
            )
        yield row


def _differs(name: str, stored: object, value: object) -> bool:
    """Return whether a column has another value than its row. A tuple is stored as a list, and a setting of 2 may be
    read as 2.0.
    """
    if name == "settings" and isinstance(stored, str) and isinstance(value, str):
        try:
            return bool(json.loads(stored) != json.loads(value))
        except (ValueError, RecursionError):
            return True
    is_nan = isinstance(stored, float) and isinstance(value, float) and stored != stored and value != value
    return not is_nan and stored != (list(value) if isinstance(value, tuple) else value)


def _flat(row: SuiteRow) -> dict[str, Any]:
    metrics = {} if row.report.metrics is None else msgspec.to_builtins(row.report.metrics)
    own = {name: getattr(row, name) for name in SuiteRow.__struct_fields__ if name not in _AS_JSON}
    reported = {name: _texted(getattr(row.report, name)) for name in _REPORTED}
    return {
        **metrics,
        **own,
        **reported,
        "settings": json.dumps(row.options.settings, sort_keys=True),
        "options": msgspec.json.encode(row.options, order="deterministic").decode(),
        "report": json.dumps(msgspec.to_builtins(row.report)),  # JSON escapes file names that are not valid text
    }


def _texted(value: object) -> object:
    """Return a value for a column; bytes of a file name that are not valid text become escapes."""
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value


def _schema(arrow: Any) -> pa.Schema:
    """Return one column for each field of a row, of its metrics, and for the report's fields that tables use."""
    own = {name: hint for name, hint in get_type_hints(SuiteRow).items() if name not in _AS_JSON}
    metrics = {name: hint for name, hint in get_type_hints(Metrics).items() if name not in _REPORTED}
    kinds = {**own, **_REPORTED, "settings": str, **metrics, "options": str, "report": str}
    fields = [arrow.field(name, _arrow_type(arrow, hint)) for name, hint in kinds.items()]
    return arrow.schema(fields, metadata={_KEY: VERSION})


def _arrow_type(arrow: Any, hint: Any) -> Any:
    if isinstance(hint, UnionType):
        hint = next(member for member in get_args(hint) if member is not type(None))
    if hint in (bool, int, float):
        return {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64()}[hint]
    if StageMetric in get_args(hint):
        parts = get_type_hints(StageMetric).items()
        return arrow.list_(arrow.struct([arrow.field(name, _arrow_type(arrow, member)) for name, member in parts]))
    return arrow.string()


def _arrow() -> Any:
    try:
        import pyarrow as pa
    except ImportError as error:
        raise UsageError(_MISSING, hint=install_line("bench")) from error
    return pa


__all__ = ["encode_rows", "read_rows", "stored_columns"]
