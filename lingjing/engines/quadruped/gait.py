"""The walking policy: what the legs do for a wanted velocity, 50 times a second, all dogs in one call.

A perceptron 45-512-256-128-12 with exponential linear units. It sees, for each dog and in this order: the trunk's
angular velocity (body frame, rad/s, times 0.25), the direction of gravity in the body frame, the wanted velocity
(forward and left m/s, anticlockwise rad/s), the joints' angles less the stance, their speeds (rad/s, times 0.05) and
its own last answer; the layout that the policy was trained with (legged-gym's, see the package's notice). It answers
with offsets of the joints' targets. Its legs are in the order of `LEGS`.

Each layer is summed in double precision and rounded to the 32 bits of the policy's own arithmetic. Sums of 32-bit
floats differ in their last bits with the width of the processor's vectors, and a walk grows such a bit to metres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.engines.quadruped.weights import read_layers

DogRows = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

PERIOD_S = 0.02
"""The policy's period: 50 Hz."""

LEGS = ("FR", "FL", "RR", "RL")
JOINTS = tuple(f"{leg}_{part}_joint" for leg in LEGS for part in ("hip", "thigh", "calf"))
STANCE = np.array((0.0, 0.8, -1.5) * 4)
"""Joint angles of standing, radians, in the order of `JOINTS`."""

_REACH = np.array((0.125, 0.25, 0.25) * 4)
_TURN_SCALE, _SPEED_SCALE, _BOUND = 0.25, 0.05, 100.0


class Gait:
    """The policy over `count` dogs and the memory of what it answered last."""

    def __init__(self, path: Path, count: int) -> None:
        self._layers = tuple((weight.astype(np.float64), bias.astype(np.float64)) for weight, bias in read_layers(path))
        self.answer = np.zeros((count, len(JOINTS)))

    def targets(
        self, who: Indices, turning: DogRows, gravity: DogRows, wanted: DogRows, angles: DogRows, speeds: DogRows
    ) -> DogRows:
        """Joint targets (n, 12) in radians of the n dogs `who`; the rest is (n, 3) and (n, 12) as the module says."""
        seen = np.concatenate(
            (turning * _TURN_SCALE, gravity, wanted, angles - STANCE, speeds * _SPEED_SCALE, self.answer[who]), axis=1
        )
        value = _rounded(np.minimum(np.maximum(seen, -_BOUND), _BOUND))
        for weight, bias in self._layers[:-1]:
            value = _rounded(_product(value, weight) + bias)
            value = _rounded(np.maximum(value, np.expm1(np.minimum(value, 0.0))))
        weight, bias = self._layers[-1]
        last = _rounded(_product(value, weight) + bias)
        answer = np.minimum(np.maximum(last, -_BOUND), _BOUND)
        self.answer[who] = answer
        return np.asarray(STANCE + answer * _REACH)


def _product(rows: DogRows, weight: DogRows) -> DogRows:
    """Matrix product, a row at a time: for a handful of rows that is faster than the library's blocks, and what a dog
    does then does not depend on how many others walk."""
    return np.array([row @ weight for row in rows])


def _rounded(values: DogRows) -> DogRows:
    """To the nearest 32-bit floats, kept as doubles."""
    return values.astype(np.float32).astype(np.float64)
