"""From wanted to commanded velocity: what the walking policy is told so that the dog goes as fast as it should.

The policy alone falls short of what it is told, more so when told little, and drifts to one side. The command follows
the wish no faster than a dog can change its pace, and an integral of the remaining error is added to it.
"""

from __future__ import annotations

import numpy as np

from lingjing.engines.quadruped.gait import PERIOD_S, DogRows, Indices

_CHANGE = np.array((2.5, 2.0, 6.0)) * PERIOD_S
"""Most that forward, sideways (m/s) and turning (rad/s) may change in a period."""

_GAIN = np.array((1.5, 1.5, 2.0)) * PERIOD_S
_MOST = np.array((0.45, 0.35, 0.6))
_FILTER_S = 0.25


class VelocityCommand:
    """Commands of `count` dogs; rows are (forward m/s, left m/s, anticlockwise rad/s) in the dog's heading frame."""

    def __init__(self, count: int) -> None:
        self.wish = np.zeros((count, 3))
        self.trim = np.zeros((count, 3))
        self.seen = np.zeros((count, 3))

    def command(self, who: Indices, wanted: DogRows, measured: DogRows) -> DogRows:
        """One period: what to tell the policy about the n dogs `who`, (n, 3) as the arguments."""
        wish, seen = self.wish[who], self.seen[who]
        wish += _within(wanted - wish, _CHANGE)
        seen += PERIOD_S / (_FILTER_S + PERIOD_S) * (measured - seen)
        trim = _within(self.trim[who] + _GAIN * (wish - seen), _MOST)
        self.wish[who], self.seen[who], self.trim[who] = wish, seen, trim
        return wish + trim

    def ease(self, dog: int) -> None:
        """Drop the correction of the speed, which was learnt at another one, and keep that of the heading."""
        self.trim[dog, :2] = 0.0

    def rest(self, dog: int) -> None:
        """Forget what was learnt: the dog stands."""
        self.wish[dog] = self.trim[dog] = self.seen[dog] = 0.0


def _within(values: DogRows, most: DogRows) -> DogRows:
    """Limited to ±`most`; a quarter of the price of `numpy.clip` for so few numbers."""
    return np.minimum(np.maximum(values, -most), most)
