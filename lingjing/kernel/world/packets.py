"""Framing over a Unix stream socket: length-prefixed packets, each with a few file descriptors if need be.

Both directions take a deadline (None: for ever). A packet that has come in part when the
deadline passes is kept, so a late answer is read whole afterwards.
"""

from __future__ import annotations

import math
import os
import select
import socket
import struct
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from lingjing.kernel.world.deadlines import Deadline

_HEADER = struct.Struct("<QB")
MAX_DESCRIPTORS = 250
"""Of one packet: Linux passes 253 at most (`SCM_MAX_FD`, unix(7))."""


class ChannelClosedError(Exception):
    """The other end is gone."""


class Drain(Protocol):
    """Something else to read while waiting, so that who writes it never blocks."""

    def fileno(self) -> int:
        """The descriptor to wait on, or -1 when there is nothing more to come."""
        ...

    def drain(self) -> None:
        """Read what is there."""
        ...


@dataclass(frozen=True, slots=True)
class Packet:
    """A payload and the descriptors that came with it; who receives it owns them."""

    payload: bytearray
    descriptors: tuple[int, ...] = ()

    def close(self) -> None:
        """Close the descriptors."""
        for descriptor in self.descriptors:
            os.close(descriptor)


class PacketSocket:
    """One end of a socket pair. `most_bytes` bounds what is received as one packet: from a process that is not trusted
    a longer one is the end of the channel."""

    def __init__(self, end: socket.socket, most_bytes: int | None = None) -> None:
        end.setblocking(False)
        self._socket = end
        self._most_bytes = most_bytes
        self._header = bytearray()
        self._payload: bytearray | None = None
        self._filled = 0
        self._descriptors: list[int] = []

    def send(
        self,
        payload: bytes,
        descriptors: Sequence[int] = (),
        deadline: Deadline | None = None,
        also: Drain | None = None,
    ) -> None:
        """Send one packet; `TimeoutError` past the deadline, `ChannelClosedError` if nobody reads."""
        rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", descriptors))] if descriptors else []
        rest = [memoryview(_HEADER.pack(len(payload), len(descriptors))), memoryview(payload)]
        while rest:
            try:
                sent = self._socket.sendmsg(rest, rights)
            except BlockingIOError:
                self._wait(select.POLLOUT, deadline, also)
            except OSError as error:
                raise ChannelClosedError(str(error)) from error
            else:
                rights = []
                rest = _after(rest, sent)

    def receive(self, deadline: Deadline | None = None, also: Drain | None = None) -> Packet:
        """The next packet; `TimeoutError` past the deadline, `ChannelClosedError` at the end."""
        while (packet := self._pull()) is None:
            self._wait(select.POLLIN, deadline, also)
        return packet

    def fileno(self) -> int:
        """The descriptor of this end."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close this end and any descriptors of an unfinished packet."""
        self._socket.close()
        while self._descriptors:
            os.close(self._descriptors.pop())

    def _pull(self) -> Packet | None:
        try:
            return self._read()
        except BlockingIOError:
            return None
        except OSError as error:
            raise ChannelClosedError(str(error)) from error

    def _read(self) -> Packet:
        while len(self._header) < _HEADER.size:
            self._header += self._read_header(_HEADER.size - len(self._header))
        length, count = _HEADER.unpack(self._header)
        if self._most_bytes is not None and length > self._most_bytes:
            raise ChannelClosedError(f"a packet of {length} bytes came, at most {self._most_bytes} are due")
        if self._payload is None:
            self._payload, self._filled = bytearray(length), 0
        while self._filled < length:
            got = self._socket.recv_into(memoryview(self._payload)[self._filled :])
            if not got:
                raise ChannelClosedError("the other end closed in mid-packet")
            self._filled += got
        packet = Packet(self._payload, tuple(self._descriptors))
        self._header, self._payload, self._descriptors = bytearray(), None, []
        if len(packet.descriptors) != count:
            packet.close()
            raise ChannelClosedError(f"{len(packet.descriptors)} descriptors came instead of {count}")
        return packet

    def _read_header(self, size: int) -> bytes:
        # Descriptors travel with a packet's first byte and are made close-on-exec as they arrive.
        flags = socket.MSG_CMSG_CLOEXEC
        data, descriptors, _, _ = socket.recv_fds(self._socket, size, MAX_DESCRIPTORS, flags)
        self._descriptors += descriptors
        if not data:
            raise ChannelClosedError("the other end closed")
        return data

    def _wait(self, event: int, deadline: Deadline | None, also: Drain | None) -> None:
        poller = select.poll()
        poller.register(self._socket, event)
        if also is not None and also.fileno() >= 0:
            poller.register(also.fileno(), select.POLLIN)
        left = None if deadline is None else max(0.0, deadline.left_s())
        # Rounded up: a poll of 0 ms would spin through the last millisecond.
        ready = poller.poll(None if left is None else math.ceil(left * 1000))
        if left == 0.0 and not any(descriptor == self._socket.fileno() for descriptor, _ in ready):
            raise TimeoutError  # nothing has come while the caller was away either
        if also is not None and any(descriptor == also.fileno() for descriptor, _ in ready):
            also.drain()


def _after(parts: list[memoryview], sent: int) -> list[memoryview]:
    rest = []
    for part in parts:
        skipped = min(sent, len(part))
        sent -= skipped
        if skipped < len(part):
            rest.append(part[skipped:])
    return rest
