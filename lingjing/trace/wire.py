"""Assembly of Protocol Buffers messages from encoded parts.

The protobuf library needs about a microsecond per field, which is too slow for the vertices of a city. Encoded parts of
a message may be concatenated, because a parser merges them (Protocol Buffers, Encoding, "Last One Wins").
"""

from __future__ import annotations


def field(number: int, data: bytes) -> bytes:
    """Return a length-delimited field: tag, length, bytes."""
    return field_head(number, len(data)) + data


def field_head(number: int, length: int) -> bytes:
    """Return what precedes the bytes of a length-delimited field: tag and length."""
    return _varint(number << 3 | 2) + _varint(length)


def _varint(value: int) -> bytes:
    """Return a non-negative integer as a base-128 varint: seven bits per byte, the lowest first."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


DOUBLE = 1
"""The wire type of a `double` field: eight bytes, little-endian."""


def tag(number: int, kind: int) -> int:
    """Return the one-byte tag of a field with a number from 1 to 15 and the wire type `kind`."""
    return number << 3 | kind
