"""Caching of results that several metrics of one trace need."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, cast

from lingjing.trace.reader import Trace

ResultT = TypeVar("ResultT")


def cache_by_trace(function: Callable[[Trace], ResultT]) -> Callable[[Trace], ResultT]:
    """Decorate a pure function of a trace so that its result is stored with the trace and freed with it.

    Callers must not modify the result.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def cached(trace: Trace) -> ResultT:
        results = vars(trace).setdefault("_computed", {})
        if name not in results:
            results[name] = function(trace)
        return cast("ResultT", results[name])

    return cached
