"""Every message of an episode that the bus admitted."""

from __future__ import annotations

from lingjing.analysis.memo import once_per_trace
from lingjing.trace.admitted import AdmittedMessage, admitted_at, categories_of
from lingjing.trace.reader import Trace


@once_per_trace
def admitted(trace: Trace) -> tuple[AdmittedMessage, ...]:
    """Every admitted message of a trace, in the order of its boundaries."""
    categories = categories_of(trace.header.instance)
    return tuple(message for record in trace.boundaries for message in admitted_at(record, categories))
