"""The walking policy: targets of the joints for a demanded velocity, 50 times a second, for all dogs in one call.

The policy is a perceptron 45-512-256-128-12 with exponential linear units. Its input for each dog is, in this order:
angular velocity of the trunk (body frame, rad/s, times 0.25); direction of gravity in the body frame; demanded velocity
(forward and left m/s, anticlockwise rad/s); joint angles minus the stance; joint speeds (rad/s, times 0.05); its own
last output. This is the layout of its training (legged-gym's, see the package's notice). Its output is an offset of
each joint's target. Its legs are in the order of `LEGS`.

Each layer is summed in double precision and rounded to the 32 bits of the policy's own arithmetic. Sums of 32-bit
floats differ in their last bits with the width of the processor's vectors, and a walk amplifies such a bit to metres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.engines.quadruped.weights import read_layers

DogRows = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

PERIOD_S = 0.02
"""Period of the policy: 50 Hz, as in its training."""

LEGS = ("FR", "FL", "RR", "RL")
"""Legs in the policy's order: front right, front left, rear right, rear left."""
JOINTS = tuple(f"{leg}_{part}_joint" for leg in LEGS for part in ("hip", "thigh", "calf"))
STANCE = np.array((0.0, 0.8, -1.5) * 4)
"""Joint angles of the stance, radians, in the order of `JOINTS`."""

_REACH = np.array((0.125, 0.25, 0.25) * 4)
"""Offset of a joint's target for an output of 1, radians (from the policy's training)."""

_TURN_SCALE, _SPEED_SCALE, _BOUND = 0.25, 0.05, 100.0
"""Scales of angular velocity and joint speeds, and limit of inputs and outputs (from the policy's training)."""


class Gait:
    """The policy for `count` dogs, with its last outputs."""

    def __init__(self, path: Path, count: int) -> None:
        self._layers = tuple((weight.astype(np.float64), bias.astype(np.float64)) for weight, bias in read_layers(path))
        self.answer = np.zeros((count, len(JOINTS)))

    def targets(
        self, dogs: Indices, turning: DogRows, gravity: DogRows, wanted: DogRows, angles: DogRows, speeds: DogRows
    ) -> DogRows:
        """Return the joint targets (n, 12) in radians of the n dogs `dogs`.

        The other arguments have the shapes (n, 3) and (n, 12) and the units of the module's docstring.
        """
        inputs = np.concatenate(
            (turning * _TURN_SCALE, gravity, wanted, angles - STANCE, speeds * _SPEED_SCALE, self.answer[dogs]), axis=1
        )
        value = _rounded(np.minimum(np.maximum(inputs, -_BOUND), _BOUND))
        for weight, bias in self._layers[:-1]:
            value = _rounded(_product(value, weight) + bias)
            value = _rounded(np.maximum(value, np.expm1(np.minimum(value, 0.0))))
        weight, bias = self._layers[-1]
        last = _rounded(_product(value, weight) + bias)
        answer = np.minimum(np.maximum(last, -_BOUND), _BOUND)
        self.answer[dogs] = answer
        return np.asarray(STANCE + answer * _REACH)


def _product(rows: DogRows, weight: DogRows) -> DogRows:
    """Return the matrix product, computed row by row.

    For a handful of rows this is faster than the library's blocks. The result of one dog then does not depend on the
    number of other dogs.
    """
    return np.array([row @ weight for row in rows])


def _rounded(values: DogRows) -> DogRows:
    """Round to the nearest 32-bit floats, stored as doubles."""
    return values.astype(np.float32).astype(np.float64)
