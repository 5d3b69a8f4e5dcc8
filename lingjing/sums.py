"""`total`: a sum of numbers that every version of Python computes alike.

From Python 3.12 on, `sum` of floats compensates the rounding of each addition. It then differs from the sum of Python
3.11 in the last bits, and an episode that depends on it has another digest.
"""

from __future__ import annotations

from collections.abc import Iterable


def total(numbers: Iterable[float]) -> float:
    """The numbers added from left to right, each sum rounded to a double; 0.0 without numbers."""
    result = 0.0
    for number in numbers:
        result += number
    return result
