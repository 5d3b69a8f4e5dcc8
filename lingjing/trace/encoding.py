"""Deterministic JSON of records: equal records have equal bytes.

The keys of mappings are sorted. Numpy scalars become plain numbers. A lone surrogate in a text, which language models
can produce, becomes U+FFFD. JSON has no NaN and no infinity, so these are written as null, which only a `Datum` may
hold. `normalise` rejects a record that has them elsewhere.
"""

from __future__ import annotations

import numbers
from typing import Any, TypeVar

import msgspec

from lingjing.articles import with_article
from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError

RecordT = TypeVar("RecordT", bound=msgspec.Struct)


def to_json(record: msgspec.Struct) -> bytes:
    """Return a record as compact UTF-8 JSON. Raises `TypeError` for a value that is not plain data."""
    try:
        return _ENCODER.encode(record)
    except UnicodeEncodeError:
        plain = msgspec.to_builtins(record, enc_hook=_plain, order="deterministic")
        return _ENCODER.encode(_without_surrogates(plain))


def normalise(record: RecordT) -> RecordT:
    """Return the record as a reader decodes it: whole numbers in float fields are floats, sequences are tuples.

    Raises `InfrastructureError` if the record cannot be decoded, because an engine or a plug-in reported a number that
    is not finite or a value that is not plain.
    """
    try:
        return from_json(to_json(record), type(record))
    except (msgspec.ValidationError, TypeError) as error:
        raise InfrastructureError(
            f"{with_article(type(record).__name__)} holds a value that cannot be kept: {error}",
            hint="an engine or a plug-in reported a number that is not finite, or not a plain value",
        ) from error


def _plain(value: object) -> object:
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    raise TypeError(f"a trace record cannot contain {with_article(type(value).__name__)}")


def _without_surrogates(value: Any) -> Any:
    """Return `value` with every lone surrogate replaced by U+FFFD."""
    if isinstance(value, str):
        return "".join("\ufffd" if "\ud800" <= letter <= "\udfff" else letter for letter in value)
    if isinstance(value, dict):
        return {_without_surrogates(key): _without_surrogates(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_surrogates(item) for item in value]
    return value


_ENCODER = msgspec.json.Encoder(order="deterministic", enc_hook=_plain)
