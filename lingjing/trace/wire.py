"""Protocol Buffers messages put together from encoded parts, for what is too much to be handed over value by value.

The library takes a microsecond for each field. Encoded messages may be joined end to end: a parser merges the parts
(Protocol Buffers, Encoding, "Last One Wins").
"""

from __future__ import annotations


def field(number: int, data: bytes) -> bytes:
    """A length-delimited field: tag, length, bytes."""
    return varint(number << 3 | 2) + varint(len(data)) + data


def varint(value: int) -> bytes:
    """A whole number from 0 on, seven bits a byte."""
    made = bytearray()
    while value > 0x7F:
        made.append(value & 0x7F | 0x80)
        value >>= 7
    made.append(value)
    return bytes(made)


DOUBLE = 1
"""The wire type of a `double` field: eight bytes, little-endian."""


def tag(number: int, kind: int) -> int:
    """The tag of one of the fields from 1 to 15."""
    return number << 3 | kind
