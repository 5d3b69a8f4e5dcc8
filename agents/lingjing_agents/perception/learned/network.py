"""A convolutional network in whole numbers: its output has the same bits on every processor.

It has five convolutions of 3 by 3 (the first two halve the picture) and one of 1 by 1. Weights are int8 and activations
whole numbers from 0 to 255, so every sum in a convolution is a whole number below 2**24. float32 holds each exactly,
and the order of a BLAS's additions, which differs by processor, has no effect. Between layers each value is multiplied
once, rounded and clipped, element by element, which IEEE 754 defines to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing_agents.perception.images import ByteImage

STRIDES = (2, 2, 1, 1, 1)
"""Stride of each 3 by 3 convolution."""
DILATIONS = (1, 1, 1, 2, 4)
"""Dilation of each 3 by 3 convolution."""
CELL_PX = 4
"""Pixels of the picture per cell of the output."""

MIDDLE = 128
"""Value that is subtracted from each pixel before the first layer; pixels outside the picture count as this grey."""

TOP = 255
"""The highest activation."""

EXACT = 2**24
"""Bound below which float32 holds every whole number."""

BAND_ROWS = 64
"""Rows of cells that are computed at a time, so that the data stay in a processor's cache."""

HALO_ROWS = 1 + 1 + 2 + 4
"""Rows of cells beside a band on which its output depends."""


@dataclass(frozen=True, slots=True)
class IntegerLayer:
    """One convolution with integer weights."""

    weights: npt.NDArray[np.float32]
    """(taps × channels in, channels out), whole numbers."""
    bias: npt.NDArray[np.float32]
    """(channels out,), whole numbers."""
    scale: npt.NDArray[np.float32]
    """(channels out,), the factors of the sums."""

    def __post_init__(self) -> None:
        """Raise `ValueError` for weights with sums that float32 may not hold exactly."""
        most = float(np.abs(self.weights).sum(axis=0).max()) * TOP + float(np.abs(self.bias).max())
        if not np.array_equal(self.weights, np.rint(self.weights)) or not most < EXACT:
            raise ValueError(f"sums may reach {most:.0f}, and whole numbers are exact below {EXACT}")


@dataclass(frozen=True, slots=True)
class IntegerNetwork:
    """The layers of one network; the last is the 1 by 1 convolution."""

    layers: tuple[IntegerLayer, ...]

    def answer(self, picture: ByteImage) -> npt.NDArray[np.float32]:
        """Return (rows, columns, 5) for a picture (height, width, 3).

        For each cell: the evidence that it is the centre of a target, and the distances from there to the target's
        left, top, right and bottom edge, in pixels.
        """
        height, width = picture.shape[:2]
        rows = -(-height // CELL_PX)
        out = np.empty((rows, -(-width // CELL_PX), 5), np.float32)
        for first in range(0, rows, BAND_ROWS):
            last = min(first + BAND_ROWS, rows)
            above = max(0, first - HALO_ROWS)
            band = picture[above * CELL_PX : min(rows, last + HALO_ROWS) * CELL_PX]
            out[first:last] = self._of_band(band)[first - above : last - above]
        return out

    def _of_band(self, picture: ByteImage) -> npt.NDArray[np.float32]:
        values = picture[np.newaxis].astype(np.float32) - np.float32(MIDDLE)
        for layer, stride, dilation in zip(self.layers, STRIDES, DILATIONS, strict=False):
            sums = taps(values, stride, dilation) @ layer.weights + layer.bias
            values = np.clip(np.rint(sums * layer.scale), np.float32(0), np.float32(TOP))
        top = self.layers[-1]
        answer: npt.NDArray[np.float32] = ((values @ top.weights + top.bias) * top.scale)[0]
        return answer


def taps(values: npt.NDArray[np.float32], stride: int, dilation: int) -> npt.NDArray[np.float32]:
    """Return the input of a 3 by 3 convolution at each of its cells: (pictures, rows, columns, 9 × channels)."""
    count, height, width, channels = values.shape
    rows, columns = -(-height // stride), -(-width // stride)
    padded = np.pad(values, ((0, 0), (dilation, dilation), (dilation, dilation), (0, 0)))
    seen = np.empty((count, rows, columns, 9 * channels), np.float32)
    for tap in range(9):
        top, left = tap // 3 * dilation, tap % 3 * dilation
        down = slice(top, top + stride * (rows - 1) + 1, stride)
        across = slice(left, left + stride * (columns - 1) + 1, stride)
        seen[..., tap * channels : (tap + 1) * channels] = padded[:, down, across]
    return seen
