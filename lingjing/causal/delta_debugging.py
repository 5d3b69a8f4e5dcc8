"""Delta debugging (Zeller and Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002).

Candidates of one granularity are tried in order, several in parallel. The first failing candidate is taken, so the
result does not depend on the number of parallel trials.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from itertools import pairwise
from typing import TypeVar

PartT = TypeVar("PartT", bound=Hashable)
"""A part of the input."""

FirstFailing = Callable[[Sequence[tuple[PartT, ...]]], int | None]
"""Returns the index of the first candidate that still fails, or None. A candidate holds the kept parts."""


def minimize(parts: Sequence[PartT], first_failing: FirstFailing[PartT]) -> tuple[PartT, ...]:
    """Return a 1-minimal failing subset of the parts: no single part of it can be removed. All parts together must
    fail.

    This is `ddmin` with complements only: removable parts are searched in halves, quarters and so on. Removing all
    parts is tried first.
    """
    kept = tuple(parts)
    if kept and first_failing([()]) is not None:
        return ()
    pieces = 2
    while len(kept) >= 2:
        pieces = min(pieces, len(kept))
        candidates = [_without(kept, piece) for piece in _pieces(kept, pieces)]
        failing = first_failing(candidates)
        if failing is not None:
            kept, pieces = candidates[failing], max(pieces - 1, 2)
        elif pieces < len(kept):
            pieces = 2 * pieces
        else:
            break
    return kept


def _pieces(kept: Sequence[PartT], count: int) -> list[tuple[PartT, ...]]:
    """Return the parts in `count` pieces of nearly equal length."""
    edges = [round(number * len(kept) / count) for number in range(count + 1)]
    return [tuple(kept[low:high]) for low, high in pairwise(edges)]


def _without(kept: Sequence[PartT], piece: Sequence[PartT]) -> tuple[PartT, ...]:
    left_out = set(piece)
    return tuple(part for part in kept if part not in left_out)
