"""In which modes a guarded declaration can exist: `when mode == star` decided before anything runs.

A guard may also depend on parameters (`when uavs > 1`). Those a caller may still set, so what depends on them stays
open: the declaration can exist, and its guard stays on it to be read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.mission import expression as ex
from lingjing.mission.certain import Knowledge, truth
from lingjing.mission.expression_text import spell
from lingjing.mission.model import Guard
from lingjing.mission.values import Value


@dataclass(frozen=True, slots=True)
class Presence:
    """`when` is what is left of the guard to read, `modes` are the modes it can hold in."""

    when: str
    modes: tuple[str, ...]


def presence(guard: Guard | None, modes: tuple[str, ...]) -> Presence | None:
    """Where a declaration exists among `modes`, or None if in none of them. A settled guard has nothing to read."""
    if guard is None:
        return Presence("", modes)
    answers = {mode: truth(guard.condition, {}, _Mode(mode)) for mode in modes}
    possible = tuple(mode for mode, answer in answers.items() if answer is not False)
    if not possible:
        return None
    settled = all(answer is True for answer in answers.values())
    return Presence("" if settled else spell(guard.condition), possible)


def either(found: Iterable[Presence], modes: tuple[str, ...]) -> Presence | None:
    """Where at least one of several declarations exists."""
    each = tuple(found)
    possible = tuple(mode for mode in modes if any(mode in one.modes for one in each))
    if not possible:
        return None
    guards = tuple(dict.fromkeys(one.when for one in each))
    return Presence("" if "" in guards else " or ".join(guards), possible)


class _Mode(Knowledge):
    """All that is known before a run is its mode: parameters may still be set."""

    def __init__(self, mode: str) -> None:
        self._mode = mode

    def name(self, ref: ex.Ref) -> Value:
        """`mode`, and the names of modes."""
        if ref.kind != "mode":
            return None
        return self._mode if ref.name == "mode" else ref.name
