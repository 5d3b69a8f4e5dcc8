"""The channel between two processes: packets of bytes over a Unix stream socket, each with a few file descriptors.

A packet is a header (length, count of descriptors, place of the payload) and a payload. The payload is in the stream,
or in a memory: its descriptor is then the first one. A packet with a memory is so short that its sender never waits
for a reader, and that several processes can send through one socket. Both directions take a deadline (None: no limit).
A packet that has arrived in part at the deadline is kept, and a later call reads the rest.
"""

from __future__ import annotations

import math
import os
import select
import socket
import stat
import struct
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from lingjing.processes.deadlines import Deadline, WallDeadline

_HEADER = struct.Struct("<QB?")
"""Bytes in the stream after the header, count of descriptors, True if the payload is in the first of them."""

MAX_DESCRIPTORS = 250
"""The most descriptors of one packet, a memory included: Linux passes 253 at most (`SCM_MAX_FD`, unix(7))."""


class ChannelClosedError(Exception):
    """The other end is closed."""


class NoMemoryError(Exception):
    """The system has no memory, or no descriptor, for a payload."""


class Drain(Protocol):
    """Another source to read during a wait, so that its writer never blocks."""

    def fileno(self) -> int:
        """Return the descriptor to wait on; -1 at the end of the source."""
        ...

    def drain(self) -> None:
        """Read the available data."""
        ...


@dataclass(frozen=True, slots=True)
class Packet:
    """A payload with its descriptors. The receiver closes them."""

    payload: bytes | bytearray
    descriptors: tuple[int, ...] = ()

    def close(self) -> None:
        """Close the descriptors."""
        for descriptor in self.descriptors:
            os.close(descriptor)


class Channel:
    """One end of a socket pair.

    `most_bytes` is for an untrusted process at the other end: a longer packet, or one with descriptors, closes the
    channel. The kernel closes such descriptors, so that they do not use up those of this process.
    """

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
        """Send one packet. Raises `TimeoutError` past the deadline, `ChannelClosedError` if the other end is closed."""
        header = _HEADER.pack(len(payload), len(descriptors), False)
        self._send([memoryview(header), memoryview(payload)], descriptors, deadline, also)

    def send_in_memory(self, payload: bytes, descriptors: Sequence[int] = ()) -> None:
        """Send one packet with its payload in a memory, without waiting for a reader.

        Raises `ChannelClosedError` if the other end is closed or the channel is full, `NoMemoryError` if the system has
        no memory.
        """
        try:
            memory = _filled_memory(payload)
        except OSError as error:
            raise NoMemoryError(error.strerror) from error
        try:
            header = _HEADER.pack(0, 1 + len(descriptors), True)
            self._send([memoryview(header)], (memory, *descriptors), WallDeadline(0.0), None)
        except TimeoutError as error:
            raise ChannelClosedError("the other end does not read") from error
        finally:
            os.close(memory)

    def _send(
        self,
        rest: list[memoryview],
        descriptors: Sequence[int],
        deadline: Deadline | None,
        also: Drain | None,
    ) -> None:
        rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", descriptors))] if descriptors else []
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
        """Return the next packet. Raises `TimeoutError` past the deadline, `ChannelClosedError` at the end."""
        while (packet := self._pull()) is None:
            self._wait(select.POLLIN, deadline, also)
        return packet

    def fileno(self) -> int:
        """The descriptor of this end."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close this end and the descriptors of an incomplete packet."""
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
        length, count, in_memory = _HEADER.unpack(self._header)
        if self._most_bytes is not None and (length > self._most_bytes or in_memory):
            raise ChannelClosedError(f"a packet has {length} bytes, at most {self._most_bytes} are allowed")
        if self._most_bytes is not None and count:
            raise ChannelClosedError(f"a packet has {count} descriptors, and none are allowed")
        if self._payload is None:
            self._payload, self._filled = bytearray(length), 0
        while self._filled < length:
            got = self._socket.recv_into(memoryview(self._payload)[self._filled :])
            if not got:
                raise ChannelClosedError("the other end closed within a packet")
            self._filled += got
        packet = Packet(self._payload, tuple(self._descriptors))
        self._header, self._payload, self._descriptors = bytearray(), None, []
        if len(packet.descriptors) != count:
            packet.close()
            raise ChannelClosedError(f"{len(packet.descriptors)} descriptors came instead of {count}")
        return _read_memory(packet) if in_memory else packet

    def _read_header(self, size: int) -> bytes:
        # Descriptors travel with a packet's first byte and are made close-on-exec as they arrive.
        flags = socket.MSG_CMSG_CLOEXEC
        if self._most_bytes is not None:
            data = self._socket.recv(size)
            if not data:
                raise ChannelClosedError("the other end closed")
            return data
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
            raise TimeoutError  # no packet has arrived before the deadline
        if also is not None and any(descriptor == also.fileno() for descriptor, _ in ready):
            also.drain()


def _filled_memory(payload: bytes) -> int:
    """Return the descriptor of a new memory with these bytes. Raises `OSError`."""
    memory = os.memfd_create("lingjing-packet", os.MFD_CLOEXEC)
    try:
        done, rest = 0, memoryview(payload)
        while done < len(rest):
            done += os.pwrite(memory, rest[done:], done)
    except BaseException:
        os.close(memory)
        raise
    return memory


def _read_memory(packet: Packet) -> Packet:
    """Return the packet with the payload of its first descriptor. Raises `ChannelClosedError` if it is not a memory."""
    try:
        memory, *others = packet.descriptors
        size = os.fstat(memory).st_size
        if not stat.S_ISREG(os.fstat(memory).st_mode):
            raise OSError("no memory")
        payload = bytearray(size)
        done = 0
        while done < size and (count := os.preadv(memory, [memoryview(payload)[done:]], done)):
            done += count
    except (OSError, ValueError) as error:
        packet.close()
        raise ChannelClosedError(f"a packet's memory cannot be read: {error}") from error
    os.close(memory)
    return Packet(payload, tuple(others))


def _after(parts: list[memoryview], sent: int) -> list[memoryview]:
    """Return the parts without their first `sent` bytes."""
    rest = []
    for part in parts:
        skipped = min(sent, len(part))
        sent -= skipped
        if skipped < len(part):
            rest.append(part[skipped:])
    return rest


__all__ = ["MAX_DESCRIPTORS", "Channel", "ChannelClosedError", "Drain", "NoMemoryError", "Packet"]
