"""The channel between two processes: complete packets in order, in the stream or in memory, also from an untrusted
process."""

import os
import socket
import struct
import threading
from array import array
from collections.abc import Iterator

import pytest

from lingjing.processes.channel import MAX_DESCRIPTORS, Channel, ChannelClosedError
from lingjing.processes.deadlines import WallDeadline

HEADER = struct.Struct("<QB?")
"""Bytes that follow, descriptors, True if the payload lies in the first of them."""


@pytest.fixture
def ends() -> Iterator[tuple[Channel, Channel]]:
    ours, theirs = map(Channel, socket.socketpair())
    yield ours, theirs
    ours.close()
    theirs.close()


def test_packets_come_whole_and_in_order_with_their_descriptors(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    reading, writing = os.pipe()
    ours.send(b"first", (writing,))
    ours.send_in_memory(b"second" * 100_000, (writing, reading))
    ours.send(b"")
    os.close(writing)
    os.close(reading)
    packets = [theirs.receive(WallDeadline(10.0)) for _ in range(3)]
    assert [bytes(packet.payload) for packet in packets] == [b"first", b"second" * 100_000, b""]
    assert [len(packet.descriptors) for packet in packets] == [1, 2, 0]
    os.write(packets[0].descriptors[0], b"through it")
    assert os.read(packets[1].descriptors[1], 20) == b"through it"
    for packet in packets:
        packet.close()


def test_a_packet_that_the_socket_cannot_hold_is_received_while_it_is_sent(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    payload = os.urandom(1 << 20) * 8
    sender = threading.Thread(target=ours.send, args=(payload,))
    sender.start()
    assert theirs.receive().payload == payload
    sender.join()


def test_sending_memory_does_not_wait_for_the_reader_until_the_socket_is_full(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    ours.send_in_memory(b"x" * 10_000_000)
    count = 1
    with pytest.raises(ChannelClosedError, match="the other end does not read"):
        while True:
            ours.send_in_memory(count.to_bytes(4, "little"))
            count += 1
    assert count > 10
    received = [theirs.receive(WallDeadline(10.0)).payload for _ in range(count)]
    assert [int.from_bytes(payload, "little") for payload in received[1:]] == list(range(1, count))


def test_several_processes_may_send_memory_through_one_socket(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    others = [Channel(socket.socket(fileno=os.dup(ours.fileno()))) for _ in range(3)]

    def send(number: int) -> None:
        for _ in range(20):
            others[number].send_in_memory(bytes([number]) * 5_000)

    senders = [threading.Thread(target=send, args=(number,)) for number in range(3)]
    for sender in senders:
        sender.start()
    received = [bytes(theirs.receive(WallDeadline(60.0)).payload) for _ in range(60)]
    for sender in senders:
        sender.join()
    assert sorted(received) == sorted(bytes([number]) * 5_000 for number in range(3) for _ in range(20))
    for other in others:
        other.close()


def test_a_packet_that_arrives_in_parts_is_read_completely_after_timeouts() -> None:
    ours, theirs = socket.socketpair()
    channel = Channel(ours)
    header = HEADER.pack(6, 0, False)
    theirs.sendall(header[:4])
    with pytest.raises(TimeoutError):
        channel.receive(WallDeadline(0.0))
    theirs.sendall(header[4:] + b"who")
    with pytest.raises(TimeoutError):
        channel.receive(WallDeadline(0.0))
    theirs.sendall(b"le")
    theirs.sendall(b"!")
    assert channel.receive(WallDeadline(10.0)).payload == b"whole!"
    theirs.close()
    with pytest.raises(ChannelClosedError):
        channel.receive()
    channel.close()


@pytest.mark.parametrize("in_memory", [False, True])
def test_an_untrusted_process_may_send_only_small_packets_and_no_memory(in_memory: bool) -> None:
    ours, theirs = socket.socketpair()
    channel, other = Channel(ours, most_bytes=100), Channel(theirs)
    other.send(b"x" * 100)
    assert len(channel.receive(WallDeadline(10.0)).payload) == 100
    if in_memory:
        other.send_in_memory(b"x")
    else:
        other.send(b"x" * 101)
    before = set(os.listdir("/proc/self/fd"))
    with pytest.raises(ChannelClosedError, match="at most 100 are allowed"):
        channel.receive(WallDeadline(10.0))
    channel.close()
    other.close()
    assert len(set(os.listdir("/proc/self/fd")) - before) == 0


def test_a_process_that_is_not_trusted_uses_up_no_descriptors() -> None:
    """Each byte of a header can bring 250 of them, before the packet is whole and can be refused."""
    ours, theirs = socket.socketpair()
    channel = Channel(ours, most_bytes=100)
    before = set(os.listdir("/proc/self/fd"))
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [theirs.fileno()] * 50))]
    header = HEADER.pack(4, 250, False)
    for at in range(len(header)):
        theirs.sendmsg([header[at : at + 1]], rights)
        if at < len(header) - 1:
            with pytest.raises(TimeoutError):
                channel.receive(WallDeadline(0.0))
        assert set(os.listdir("/proc/self/fd")) == before
    with pytest.raises(ChannelClosedError, match="250 descriptors"):
        channel.receive(WallDeadline(10.0))
    channel.close()
    theirs.close()


def test_a_descriptor_that_is_no_memory_ends_the_channel(ends: tuple[Channel, Channel]) -> None:
    _, theirs = ends
    ours = socket.socket(fileno=os.dup(ends[0].fileno()))
    reading, writing = os.pipe()  # reading it would wait for ever
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [reading]))]
    ours.sendmsg([HEADER.pack(0, 1, True)], rights)
    with pytest.raises(ChannelClosedError, match="memory cannot be read"):
        theirs.receive(WallDeadline(10.0))
    ours.close()
    os.close(reading)
    os.close(writing)


def test_a_packet_can_carry_the_maximum_number_of_descriptors_of_linux(ends: tuple[Channel, Channel]) -> None:
    ours, theirs = ends
    reading, writing = os.pipe()
    ours.send(b"many", (reading,) * MAX_DESCRIPTORS)
    packet = theirs.receive(WallDeadline(10.0))
    assert len(packet.descriptors) == MAX_DESCRIPTORS
    packet.close()
    os.close(reading)
    os.close(writing)
