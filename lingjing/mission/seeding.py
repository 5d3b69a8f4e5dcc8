"""Named random streams: one seed gives an independent stream for each path.

A stream is a function of (seed, path) alone, so that adding or editing one declaration changes no other draw. Block *n*
of a stream is SHA-256 of its key and *n*; every 64-bit word of a block gives one number. A number takes about a
microsecond, which is slow for a random generator, but it is the same on every machine and with every version of Python
and its libraries. Engines that draw millions of numbers use `generator`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from lingjing.digests import sha256

if TYPE_CHECKING:
    import numpy as np

_WORDS = 4
"""64-bit words of a SHA-256 digest."""
_MANTISSA = 2.0**-53
"""Spacing of 53-bit numbers in [0, 1)."""


def digest(seed: int, path: str) -> bytes:
    """The 32-byte key of the stream `path` under `seed`."""
    return sha256(f"{seed}\n{path}".encode("utf-8", "surrogatepass")).digest()


def integer(seed: int, path: str, bits: int = 53) -> int:
    """A non-negative whole number below 2**bits, for simulators with a seed of their own. `bits` in 1..256, else
    `ValueError`."""
    if not 1 <= bits <= 256:
        raise ValueError(f"bits = {bits} is not in 1..256")
    return int.from_bytes(digest(seed, path), "big") >> (256 - bits)


def redrawn_path(path: str, redraw: int) -> str:
    """The name of the stream of a draw that is repeated for the `redraw`-th time; the path itself for the first
    draw."""
    return f"{path}~{redraw}" if redraw else path


def generator(seed: int, path: str) -> np.random.Generator:
    """A numpy generator for the stream `path` (PCG64). numpy is imported here, because few callers need it."""
    import numpy as np

    return np.random.Generator(np.random.PCG64(integer(seed, path, bits=128)))


class Stream:
    """Numbers of one named stream, in order. Each draw makes its own stream."""

    __slots__ = ("_block", "_key", "_words")

    def __init__(self, seed: int, path: str) -> None:
        self._key = digest(seed, path)
        self._block = 0
        self._words: list[int] = []

    def word(self) -> int:
        """The next 64 bits."""
        if not self._words:
            block = sha256(self._key + self._block.to_bytes(8, "big")).digest()
            self._block += 1
            self._words = [int.from_bytes(block[8 * k : 8 * k + 8], "big") for k in reversed(range(_WORDS))]
        return self._words.pop()

    def unit(self) -> float:
        """The next number in [0, 1), with 53 random bits."""
        return (self.word() >> 11) * _MANTISSA

    def uniform(self, low: float, high: float) -> float:
        """The next number in [low, high]."""
        return min(high, low + (high - low) * self.unit())

    def normal(self, mean: float, deviation: float) -> float:
        """The next normal number (Box and Muller, cosine branch). It uses two words a number, so that a longer sequence
        begins with the shorter one."""
        radius = math.sqrt(-2.0 * math.log(1.0 - self.unit()))
        return mean + deviation * radius * math.cos(2.0 * math.pi * self.unit())

    def below(self, count: int) -> int:
        """The next whole number in 0..count-1, without bias (rejection sampling). Raises `ValueError` if `count` is
        below 1."""
        if count < 1:
            raise ValueError(f"nothing to draw from: count = {count}")
        limit = (1 << 64) - (1 << 64) % count
        while (word := self.word()) >= limit:
            pass
        return word % count
