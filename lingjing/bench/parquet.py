"""Rows of a suite as Parquet files, which pandas, DuckDB, Polars and R read: one column a field or metric.

The columns `options` and `report` hold, as JSON, all there is to know of an episode; a row is read back from them, and
the other columns are there to be queried. Only here is pyarrow imported, when a file is read or written.
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
from lingjing.errors import UsageError
from lingjing.installation import install_line

if TYPE_CHECKING:
    import pyarrow as pa

VERSION = b"1"
"""The version of the columns that are read back, in the file's metadata."""

_KEY = b"lingjing.results"
_AS_JSON = ("options", "report")
_REPORTED = {
    "success": bool, "reason": str, "scr": float, "score": float, "ticks": int, "digest": str, "frames_digest": str,
    "detail": str, "trace": str, "attribution": str, "family": str,
}  # fmt: skip
_MISSING = "the results of suites need pyarrow"


def encode_rows(rows: Iterable[SuiteRow]) -> bytes:
    """The rows as a Parquet file, sorted by their keys: equal rows give equal bytes."""
    arrow = _arrow()
    import pyarrow.parquet as parquet

    table = arrow.Table.from_pylist(
        [_flat(row) for row in sorted(rows, key=lambda row: row.key)], schema=_schema(arrow)
    )
    buffer = io.BytesIO()
    parquet.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def read_rows(file: Path) -> list[SuiteRow]:
    """The rows of a file that `encode_rows` made. Raises `UsageError` for anything else, and for other versions."""
    arrow = _arrow()
    import pyarrow.parquet as parquet

    try:
        data = file.read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read {file}: {error.strerror}") from error
    try:
        # no threads of Arrow's: one that is left when the interpreter ends aborts the process
        table = parquet.ParquetFile(io.BytesIO(data), pre_buffer=False).read(use_threads=False)
    except (arrow.ArrowInvalid, OSError) as error:
        said = str(error).splitlines()[0]
        raise UsageError(f"`{file}` holds no results of a suite: {said}", hint="it may be half a file") from error
    version = (table.schema.metadata or {}).get(_KEY, b"")
    if version != VERSION:
        told = f"it has form {version.decode(errors='replace')}" if version else "nothing says that it is one"
        hint = f"this is lingjing {lingjing.__version__}, which reads form {VERSION.decode()}"
        raise UsageError(f"`{file}` holds no results that this version reads: {told}", hint=hint)
    return list(_decoded(table, file))


def _decoded(table: pa.Table, file: Path) -> Iterator[SuiteRow]:
    wanted = [name for name in SuiteRow.__struct_fields__ if name in table.schema.names]
    for at, plain in enumerate(table.select(wanted).to_pylist()):
        try:
            whole = {name: json.loads(value) if name in _AS_JSON else value for name, value in plain.items()}
            yield msgspec.convert(whole, SuiteRow)
        except (msgspec.ValidationError, ValueError, TypeError) as error:
            made = f"lingjing {plain.get('version') or 'of an unknown version'}, code {str(plain.get('code'))[:12]}"
            hint = (
                f"it was made by {made}; this is lingjing {lingjing.__version__}: read it with the one that made it, "
                "or score its traces, where they are kept, with this one: lingjing report FOLDER/runs"
            )
            raise UsageError(f"row {at} of `{file}` cannot be read: {error}", hint=hint) from error


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
        "report": json.dumps(msgspec.to_builtins(row.report)),  # names of files may be no text: JSON escapes them
    }


def _texted(value: object) -> object:
    """A value as a column takes it: bytes in a file's name that are no text are spelled out."""
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value


def _schema(arrow: Any) -> pa.Schema:
    """One column for each field of a row, of its report that tables need, and of its metrics."""
    own = {name: hint for name, hint in get_type_hints(SuiteRow).items() if name not in _AS_JSON}
    metrics = {name: hint for name, hint in get_type_hints(Metrics).items() if name not in _REPORTED}
    kinds = {**own, **_REPORTED, "settings": str, **metrics, "options": str, "report": str}
    fields = [arrow.field(name, _arrow_type(arrow, hint)) for name, hint in kinds.items()]
    return arrow.schema(fields, metadata={_KEY: VERSION})


def _arrow_type(arrow: Any, hint: Any) -> Any:
    if isinstance(hint, UnionType):
        hint = next(one for one in get_args(hint) if one is not type(None))
    if hint in (bool, int, float):
        return {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64()}[hint]
    if StageMetric in get_args(hint):
        parts = get_type_hints(StageMetric).items()
        return arrow.list_(arrow.struct([arrow.field(name, _arrow_type(arrow, one)) for name, one in parts]))
    return arrow.string()


def _arrow() -> Any:
    try:
        import pyarrow as pa
    except ImportError as error:
        raise UsageError(_MISSING, hint=install_line("bench")) from error
    return pa


__all__ = ["encode_rows", "read_rows"]
