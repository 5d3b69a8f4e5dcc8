"""Letters: requests to a policy's process that are passed on as memory, so that sending waits for no reader.

The packet itself is empty and fits into a socket that is not read from. The payload lies in a memory whose descriptor
comes with it, before any others.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.deadlines import WallDeadline
from lingjing.kernel.world.packets import ChannelClosedError, Packet, PacketSocket


def send_letter(channel: PacketSocket, payload: bytes, others: Sequence[int] = ()) -> None:
    """Send a payload with descriptors. `ChannelClosedError` if the other end is gone or has stopped to read,
    `InfrastructureError` if there is no memory."""
    try:
        letter = os.memfd_create("lingjing-letter", os.MFD_CLOEXEC)
    except OSError as error:
        raise _unsent(error) from error
    try:
        done, rest = 0, memoryview(payload)
        while done < len(rest):
            done += os.pwrite(letter, rest[done:], done)
        channel.send(b"", (letter, *others), WallDeadline(0.0))
    except TimeoutError as error:
        raise ChannelClosedError("the other end does not read") from error
    except OSError as error:
        raise _unsent(error) from error
    finally:
        os.close(letter)


def open_letter(packet: Packet) -> tuple[bytes, tuple[int, ...]]:
    """The payload of a packet, and the other descriptors, which are the caller's to close."""
    letter, *others = packet.descriptors
    with open(letter, "rb", buffering=0) as file:  # noqa: PTH123 - a descriptor
        file.seek(0)
        return file.readall(), tuple(others)


def _unsent(error: OSError) -> InfrastructureError:
    return InfrastructureError(
        f"a request to the process of a policy cannot be sent: {error.strerror}",
        hint="memory or file descriptors of this machine or container have run out",
    )
