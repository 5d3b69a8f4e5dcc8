"""A convolutional network in whole numbers: what it answers has the same bits on every processor.

Five convolutions of 3 by 3 (the first two halve the picture) and one of 1 by 1 on top. Weights are int8 and activations
whole numbers from 0 to 255, so every sum in a convolution is a whole number below 2**24: float32 holds each of them
exactly, and the order in which a BLAS adds them up, which differs by processor, changes nothing. Between the layers
each value is multiplied once, rounded and clipped, element by element, which IEEE 754 defines to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing_agents.perception.images import ByteImage

STRIDES = (2, 2, 1, 1, 1)
DILATIONS = (1, 1, 1, 2, 4)
CELL_PX = 4
"""Pixels of the picture from one cell of the answer to the next."""

MIDDLE = 128
"""What is taken from a pixel's value before the first layer; what lies outside of the picture counts as this grey."""

TOP = 255
"""The highest activation."""

EXACT = 2**24
"""Up to here float32 holds every whole number."""

BAND_ROWS = 64
"""Rows of cells that are computed at a time: what they take stays in a processor's cache."""

HALO_ROWS = 1 + 1 + 2 + 4
"""Rows of cells beside a band that its answer hangs on."""


@dataclass(frozen=True, slots=True)
class IntegerLayer:
    """One convolution: `weights` (taps × channels in, channels out) and `bias` are whole numbers; a sum times `scale`,
    one for each channel out, is what the layer says."""

    weights: npt.NDArray[np.float32]
    bias: npt.NDArray[np.float32]
    scale: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        """Raise `ValueError` for weights whose sums float32 might not hold exactly."""
        most = float(np.abs(self.weights).sum(axis=0).max()) * TOP + float(np.abs(self.bias).max())
        if not np.array_equal(self.weights, np.rint(self.weights)) or not most < EXACT:
            raise ValueError(f"sums may reach {most:.0f}, and whole numbers are exact below {EXACT}")


@dataclass(frozen=True, slots=True)
class IntegerNetwork:
    """The layers of one network, the last of which is the 1 by 1."""

    layers: tuple[IntegerLayer, ...]

    def answer(self, picture: ByteImage) -> npt.NDArray[np.float32]:
        """(rows, columns, 5) for a picture (height, width, 3): for each cell the evidence that it is the middle of a
        target, and how far the target reaches to the left, up, right and down from there, in pixels."""
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
    """What a 3 by 3 convolution sees around each of its cells: (pictures, rows, columns, 9 × channels)."""
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
