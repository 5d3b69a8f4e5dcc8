"""Modes in which a guarded declaration can exist: `when mode == star` is evaluated for each mode.

A guard may also depend on parameters (`when uavs > 1`). Their values may still be set for a run. Such a declaration can
exist, and its guard stays visible on it.
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
    """The modes of a declaration."""

    when: str
    """The guard as text, or "" if it holds in all these modes."""
    modes: tuple[str, ...]
    """The modes in which the guard can hold."""


def presence(guard: Guard | None, modes: tuple[str, ...]) -> Presence | None:
    """The modes of a declaration among `modes`, or None if it exists in none of them."""
    if guard is None:
        return Presence("", modes)
    answers = {mode: truth(guard.condition, {}, _Mode(mode)) for mode in modes}
    possible = tuple(mode for mode, answer in answers.items() if answer is not False)
    if not possible:
        return None
    certain_in_all = all(answer is True for answer in answers.values())
    return Presence("" if certain_in_all else spell(guard.condition), possible)


def either(presences: Iterable[Presence], modes: tuple[str, ...]) -> Presence | None:
    """The modes in which at least one of several declarations exists."""
    each = tuple(presences)
    possible = tuple(mode for mode in modes if any(mode in item.modes for item in each))
    if not possible:
        return None
    guards = tuple(dict.fromkeys(item.when for item in each))
    return Presence("" if "" in guards else " or ".join(guards), possible)


class _Mode(Knowledge):
    """The only known fact before a run is its mode, because parameters may still be set."""

    def __init__(self, mode: str) -> None:
        self._mode = mode

    def name(self, ref: ex.Ref) -> Value:
        """The value of `mode`, or the name of a mode."""
        if ref.kind != "mode":
            return None
        return self._mode if ref.name == "mode" else ref.name
