"""In which modes a guarded declaration can exist: `when mode == star` decided before anything runs.

A guard may also depend on parameters (`when uavs > 1`). Those a caller may still set, so what depends on them stays
open: the declaration can exist, and its guard stays on it to be read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Scope, flag_of
from lingjing.mission.graph.spelling import spell
from lingjing.mission.model import Guard


@dataclass(frozen=True, slots=True)
class Presence:
    """`when` is what is left of the guard to read, `modes` are the modes it can hold in."""

    when: str
    modes: tuple[str, ...]


def presence(guard: Guard | None, modes: tuple[str, ...]) -> Presence | None:
    """Where a declaration exists among `modes`, or None if in none of them. A settled guard has nothing to read."""
    if guard is None:
        return Presence("", modes)
    answers = {mode: _holds(guard.condition, mode) for mode in modes}
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


def _holds(condition: ex.Expr, mode: str) -> bool | None:
    """Whether the condition holds in a mode; None if that depends on more than the mode."""
    match condition:
        case ex.Binary(operator="and", left=left, right=right):
            sides = (_holds(left, mode), _holds(right, mode))
            return False if False in sides else None if None in sides else True
        case ex.Binary(operator="or", left=left, right=right):
            sides = (_holds(left, mode), _holds(right, mode))
            return True if True in sides else None if None in sides else False
        case ex.Unary(operator="not", operand=operand):
            inner = _holds(operand, mode)
            return None if inner is None else not inner
        case _:
            try:
                return flag_of(condition, Scope(mode=mode))
            except MissionError:  # it names a parameter: open until the run
                return None
