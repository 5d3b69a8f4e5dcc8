"""Records as JSON: the same bytes for the same record.

The keys of mappings are sorted, numpy scalars become plain numbers, and a lone surrogate in a text (language models
produce them) becomes U+FFFD. NaN and infinity have no JSON spelling and are written as null, which only a `Datum`
may hold: `settled` is where a record with one elsewhere is refused.
"""

from __future__ import annotations

import numbers
from typing import Any, TypeVar

import msgspec

from lingjing.errors import InfrastructureError

RecordT = TypeVar("RecordT", bound=msgspec.Struct)


def to_json(record: msgspec.Struct) -> bytes:
    """One record as compact UTF-8 JSON. Raises `TypeError` for a value that is not plain data."""
    try:
        return _ENCODER.encode(record)
    except UnicodeEncodeError:
        return _ENCODER.encode(_mended(msgspec.to_builtins(record, enc_hook=_plain, order="deterministic")))


def from_json(data: bytes, kind: type[RecordT]) -> RecordT:
    """The record back. Raises `msgspec.ValidationError` or `msgspec.DecodeError`."""
    return msgspec.json.decode(data, type=kind)


def settled(record: RecordT) -> RecordT:
    """The record as a reader will see it: whole numbers in float fields are floats, sequences are tuples.

    Raises `InfrastructureError` if it would not come back, because an engine reported a number that is not finite.
    """
    try:
        return from_json(to_json(record), type(record))
    except (msgspec.ValidationError, TypeError) as error:
        raise InfrastructureError(
            f"a {type(record).__name__} holds a value that cannot be kept: {error}",
            hint="an engine or a plug-in reported a number that is not finite, or not a plain value",
        ) from error


def _plain(value: object) -> object:
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    raise TypeError(f"a {type(value).__name__} cannot stand in a trace record")


def _mended(value: Any) -> Any:
    """`value` with every lone surrogate replaced."""
    if isinstance(value, str):
        return "".join("\ufffd" if "\ud800" <= letter <= "\udfff" else letter for letter in value)
    if isinstance(value, dict):
        return {_mended(key): _mended(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_mended(item) for item in value]
    return value


_ENCODER = msgspec.json.Encoder(order="deterministic", enc_hook=_plain)
