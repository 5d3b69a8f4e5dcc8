"""Delta debugging (Zeller and Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002): `minimize`.

Candidates of one granularity are tried in order, several at a time; the first that fails counts, however many were
tried beside it, so the result does not depend on how many are tried at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from itertools import pairwise
from typing import TypeVar

PartT = TypeVar("PartT", bound=Hashable)

FirstFailing = Callable[[Sequence[tuple[PartT, ...]]], int | None]
"""Which of several candidates is the first that still fails, as its number; None if none does. A candidate is what is
kept of the parts."""


def minimize(parts: Sequence[PartT], first_failing: FirstFailing[PartT]) -> tuple[PartT, ...]:
    """A 1-minimal subset of the parts that still fails: no single part of it can be left out. All parts must fail.

    `ddmin` with complements alone: a part that can be left out is looked for in halves, quarters and so on. Leaving
    out all of them is tried first.
    """
    kept = tuple(parts)
    if kept and first_failing([()]) is not None:
        return ()
    pieces = 2
    while len(kept) >= 2:
        pieces = min(pieces, len(kept))
        candidates = [_without(kept, piece) for piece in _pieces(kept, pieces)]
        found = first_failing(candidates)
        if found is not None:
            kept, pieces = candidates[found], max(pieces - 1, 2)
        elif pieces < len(kept):
            pieces = 2 * pieces
        else:
            break
    return kept


def _pieces(kept: Sequence[PartT], count: int) -> list[tuple[PartT, ...]]:
    """The parts in `count` pieces of nearly equal length."""
    edges = [round(number * len(kept) / count) for number in range(count + 1)]
    return [tuple(kept[low:high]) for low, high in pairwise(edges)]


def _without(kept: Sequence[PartT], piece: Sequence[PartT]) -> tuple[PartT, ...]:
    left_out = set(piece)
    return tuple(part for part in kept if part not in left_out)
