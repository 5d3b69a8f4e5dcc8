"""MessagePack-RPC: requests `[0, id, method, arguments]`, notifications `[2, method, arguments]`, and their answers.

See https://github.com/msgpack-rpc/msgpack-rpc/blob/master/spec.md. A client's bytes are read with limits on every
length. A frame that breaks the protocol raises `ProtocolError`, after which the stream cannot be read on.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgpack

MOST_BYTES = 4_000_000
"""Most bytes of one frame of a client (chosen: a path of 10,000 points takes 0.4 MB)."""

_MOST_ITEMS = 100_000
"""Most members of one array or map of a client (chosen)."""

_LONGEST_METHOD = 100
"""Most letters of a method's name (chosen; the longest of the client has 40)."""

_MOST_ID = 2**32 - 1
"""Largest id of a request (the specification: 32 bits)."""

_REQUEST, _RESPONSE, _NOTIFICATION = 0, 1, 2


class ProtocolError(Exception):
    """A frame that is no MessagePack-RPC request, in words for the client."""


class Request(NamedTuple):
    """A request or a notification."""

    id: int | None
    """The client's number of the request; None for a notification, which is not answered."""
    method: str
    """Name of the method."""
    arguments: list[Any]
    """Arguments in their order."""


class FrameReader:
    """The requests in the bytes of one connection."""

    def __init__(self) -> None:
        self._unpacker = msgpack.Unpacker(
            raw=False,
            strict_map_key=True,
            max_buffer_size=MOST_BYTES,
            max_array_len=_MOST_ITEMS,
            max_map_len=_MOST_ITEMS,
        )

    def feed(self, data: bytes) -> Iterator[Request]:
        """Return the requests that the bytes complete. Raises `ProtocolError`."""
        try:
            self._unpacker.feed(data)
        except msgpack.BufferFull:
            raise ProtocolError(f"a frame may have at most {MOST_BYTES:,} bytes") from None
        while True:
            try:
                frame = next(self._unpacker)
            except StopIteration:
                return
            except (ValueError, TypeError, RecursionError, msgpack.UnpackException) as error:
                raise ProtocolError(f"this is no MessagePack: {error or type(error).__name__}") from None
            yield _request(frame)


def response(number: int, error: str | None, result: object) -> bytes:
    """Return the frame of an answer."""
    frame: bytes = msgpack.packb([_RESPONSE, number, error, result], use_bin_type=True)
    return frame


def _request(frame: object) -> Request:
    if not isinstance(frame, list) or not frame:
        raise ProtocolError("a frame must be a request: [0, id, method, arguments]")
    kind = frame[0]
    if kind == _REQUEST and type(kind) is int and len(frame) == 4:
        number, method, arguments = frame[1:]
        if type(number) is not int or not 0 <= number <= _MOST_ID:
            raise ProtocolError("the id of a request must be a whole number of 32 bits")
    elif kind == _NOTIFICATION and type(kind) is int and len(frame) == 3:
        number, (method, arguments) = None, frame[1:]
    else:
        raise ProtocolError("a frame must be a request: [0, id, method, arguments]")
    if not isinstance(method, str) or len(method) > _LONGEST_METHOD or not method.isprintable():
        raise ProtocolError(f"the method of a request must be a name of at most {_LONGEST_METHOD} letters")
    if not isinstance(arguments, list):
        raise ProtocolError("the arguments of a request must be an array")
    return Request(number, method, arguments)
