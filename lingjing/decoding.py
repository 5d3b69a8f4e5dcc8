"""Typed values from JSON, msgpack and plain Python values: msgspec, with the types built under one lock.

msgspec (0.22) builds its description of a type at the first use, in several steps, and keeps the unfinished description
on the type. A second thread that uses the type meanwhile reads it, and the process dies of a segmentation fault: four
threads that loaded a mission together did in eleven of twelve runs, and two calls of `lingjing.arun` did too. So this
module is the only one that decodes with msgspec; ruff refuses the functions elsewhere.
"""

from __future__ import annotations

import os
import threading
from typing import Any, TypeVar, overload

import msgspec

T = TypeVar("T")

MsgpackDecoder = msgspec.msgpack.Decoder
"""The type of `msgpack_decoder(T)`: `MsgpackDecoder[T]`."""

_LOCK = threading.RLock()
# A fork waits for a type that another thread builds: the copy would have it unfinished, and the lock taken for ever.
os.register_at_fork(before=_LOCK.acquire, after_in_parent=_LOCK.release, after_in_child=_LOCK.release)
_JSON: dict[Any, msgspec.json.Decoder[Any]] = {}
_MSGPACK: dict[Any, msgspec.msgpack.Decoder[Any]] = {}


@overload
def from_json(data: bytes | bytearray | memoryview | str, kind: type[T], *, strict: bool = True) -> T: ...
@overload
def from_json(data: bytes | bytearray | memoryview | str, kind: Any = Any, *, strict: bool = True) -> Any: ...
def from_json(data: bytes | bytearray | memoryview | str, kind: Any = Any, *, strict: bool = True) -> Any:
    """Return the value of a JSON text, of the type `kind`; without `strict` a text may stand for a number.

    Raises `msgspec.DecodeError`, and `msgspec.ValidationError` for a value of another type.
    """
    return json_decoder(kind, strict=strict).decode(data)


@overload
def from_msgpack(data: bytes | bytearray | memoryview, kind: type[T]) -> T: ...
@overload
def from_msgpack(data: bytes | bytearray | memoryview, kind: Any = Any) -> Any: ...
def from_msgpack(data: bytes | bytearray | memoryview, kind: Any = Any) -> Any:
    """Return the value of a msgpack text, of the type `kind`. Raises the errors of `from_json`."""
    return msgpack_decoder(kind).decode(data)


@overload
def converted(value: object, kind: type[T], **options: Any) -> T: ...
@overload
def converted(value: object, kind: Any, **options: Any) -> Any: ...
def converted(value: object, kind: Any, **options: Any) -> Any:
    """Return a plain value as one of the type `kind`; `options` are those of `msgspec.convert`.

    Raises `msgspec.ValidationError`.
    """
    json_decoder(kind)  # builds the type
    return msgspec.convert(value, kind, **options)


def json_decoder(kind: Any, *, strict: bool = True) -> msgspec.json.Decoder[Any]:
    """Return the decoder of a type."""
    decoder = _JSON.get((kind, strict))
    if decoder is None:
        with _LOCK:
            decoder = _JSON.setdefault((kind, strict), msgspec.json.Decoder(kind, strict=strict))
    return decoder


def msgpack_decoder(kind: Any) -> msgspec.msgpack.Decoder[Any]:
    """Return the decoder of a type."""
    decoder = _MSGPACK.get(kind)
    if decoder is None:
        with _LOCK:
            decoder = _MSGPACK.setdefault(kind, msgspec.msgpack.Decoder(kind))
    return decoder
