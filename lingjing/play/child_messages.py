"""What a child that plays episodes tells its parent through a pipe, and what the parent tells it.

A message is JSON behind its length. The other way there is one signal.
"""

from __future__ import annotations

import json
import os
import signal
import struct
from collections.abc import Iterator

import msgspec

from lingjing.play.report import EpisodeReport

INTERRUPT = getattr(signal, "SIGRTMIN", 34) + 3
"""What the parent tells the child to stop with: none that a terminal, a shell or `timeout` sends to a whole group."""

_HEADER = struct.Struct("<Q")


class EpisodeBegan(msgspec.Struct, frozen=True, tag=True):
    """The child begins an episode."""

    seed: int
    folder: str


class EpisodePlayed(msgspec.Struct, frozen=True, tag=True):
    """What came of it."""

    report: EpisodeReport


class ChildFailed(msgspec.Struct, frozen=True, tag=True):
    """The child was given something wrong, or has a fault; the later episodes would fail as well."""

    code: int
    message: str
    hint: str = ""
    trace: str = ""


class ChildRefused(msgspec.Struct, frozen=True, tag=True):
    """The system refused the child something, as a place to write to."""

    number: int
    message: str
    file: str


class ChildSpoilt(msgspec.Struct, frozen=True, tag=True):
    """The process can play no more; its episode is an abort."""

    detail: str


ChildMessage = EpisodeBegan | EpisodePlayed | ChildFailed | ChildRefused | ChildSpoilt


def tell(pipe: int, message: ChildMessage) -> None:
    """Write a message into the pipe, whole. `OSError` if nobody reads it any more."""
    text = json.dumps(msgspec.to_builtins(message)).encode()  # names of files may be no text: JSON escapes them
    rest = memoryview(_HEADER.pack(len(text)) + text)
    while rest:
        rest = rest[os.write(pipe, rest) :]


def taken_out(buffer: bytearray) -> Iterator[ChildMessage]:
    """The whole messages at the beginning of the buffer, which they leave."""
    while len(buffer) >= _HEADER.size:
        (size,) = _HEADER.unpack_from(buffer)
        if len(buffer) < _HEADER.size + size:
            return
        text = bytes(buffer[_HEADER.size : _HEADER.size + size])
        del buffer[: _HEADER.size + size]
        yield msgspec.convert(json.loads(text), ChildMessage)
