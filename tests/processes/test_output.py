"""The output of processes: what has come is read without waiting, and its end is kept."""

import os

from lingjing.processes.output import OutputPipe, OutputTail


class Pieces(OutputPipe):
    def __init__(self, descriptor: int, most_pieces: int) -> None:
        super().__init__(descriptor, most_pieces)
        self.sizes: list[int] = []

    def _take(self, data: bytes) -> None:
        self.sizes.append(len(data))


def test_the_tail_of_the_output_remains_after_its_writers_have_closed() -> None:
    reading, writing = os.pipe()
    tail = OutputTail(reading)
    for number in range(3000):
        os.write(writing, b"line %d\n" % number)
        tail.drain()
    os.write(writing, b"last \xff")
    assert tail.wait(0.0) and tail.fileno() == reading
    os.close(writing)
    tail.drain()
    assert tail.fileno() == -1 and not tail.wait(0.0)
    assert tail.text().endswith("line 2999\nlast \ufffd")
    assert 16_384 <= len(tail.text()) < 17_000


def test_a_continuous_writer_does_not_block_its_reader() -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    written = os.write(writing, bytes(65_536))
    pipe = Pieces(reading, most_pieces=1)
    pipe.drain()
    assert pipe.sizes == [written]
    os.write(writing, b"more")
    os.close(writing)
    pipe.drain()
    assert pipe.sizes == [written, 4] and pipe.fileno() == reading
    pipe.drain()
    assert pipe.sizes == [written, 4, 0] and pipe.fileno() == -1
