"""The messages of an episode that the bus admitted."""

from __future__ import annotations

from lingjing.analysis.memo import cache_by_trace
from lingjing.trace.admitted_messages import AdmittedMessage, admitted_at, categories_of
from lingjing.trace.reader import Trace


@cache_by_trace
def admitted_messages(trace: Trace) -> tuple[AdmittedMessage, ...]:
    """Return the admitted messages of a trace, each once, in the order of its boundaries."""
    categories = categories_of(trace.header.instance)
    return tuple(message for record in trace.boundaries for message in admitted_at(record, categories))
