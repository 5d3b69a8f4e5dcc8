"""`once_per_trace`: what several figures ask of one trace is computed once, and forgotten with the trace."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, cast

from lingjing.trace.reader import Trace

FoundT = TypeVar("FoundT")


def once_per_trace(function: Callable[[Trace], FoundT]) -> Callable[[Trace], FoundT]:
    """A pure function of a trace that keeps its result with the trace. The result must not be changed by callers."""
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def remembered(trace: Trace) -> FoundT:
        kept = vars(trace).setdefault("_computed", {})
        if name not in kept:
            kept[name] = function(trace)
        return cast("FoundT", kept[name])

    return remembered
