"""Episodes whose result is open, and the entrants that have any.

A lost episode has no result. An episode that was played again because its entrant's own service was gone has one, and a
service that goes away only when its policy loses would choose it. So would a policy that ends a process of the harness
or takes its trace away: it shares the machine with them. Such a result counts in the rates; the worst case takes it for
a failure. It is beyond doubt if another entrant was aborted by the same cause at the same time: then it was the
network, the machine or a service that both use.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import UNRESOLVED
from lingjing.play.outages import SERVICE_GONE
from lingjing.play.report import SERVER_KILLED

AT_ONCE_S = 300.0
"""Within how many seconds two aborts count as simultaneous. Chosen: `react` reports an outage after three ticks, each
of which waits up to 90 s for the model."""


_WITHIN_REACH = (
    SERVICE_GONE,
    "its process ",
    SERVER_KILLED,
    "the process that starts others ",
    "the trace ",
    "the world process died",
    "the camera process died",
)
"""The beginnings of the details of aborts that a policy can cause: by its service, or by the processes and files on its
machine. An error of an engine is not among them."""


def open_rows(rows: Iterable[SuiteRow]) -> list[SuiteRow]:
    """The lost episodes, and the aborted tries that only their entrant may have caused."""
    aborts = [row for row in rows if row.standing != "counted"]
    return [row for row in aborts if row.standing == "lost" or _is_alone(row, aborts)]


def unresolved_entrants(rows: Iterable[SuiteRow]) -> frozenset[str]:
    """The names of the entrants that have open episodes: they are not ranked."""
    return frozenset(row.entrant for row in open_rows(rows))


def with_marked_names(rows: Sequence[SuiteRow], unresolved: frozenset[str]) -> list[SuiteRow]:
    """The rows, with `UNRESOLVED` behind the names of these entrants, so that no table takes them for the best."""
    return [
        msgspec.structs.replace(row, entrant=f"{row.entrant} {UNRESOLVED}") if row.entrant in unresolved else row
        for row in rows
    ]


def _is_alone(row: SuiteRow, aborts: Sequence[SuiteRow]) -> bool:
    """True if the entrant may have caused the abort and no other entrant had such a one at the same time."""
    cause = _cause(row)
    others = (other for other in aborts if other.entrant != row.entrant and _cause(other) == cause)
    return bool(cause) and not any(_is_at_once(row, other) for other in others)


def _cause(row: SuiteRow) -> str:
    """The beginning of the detail of an abort that a policy can cause; "" for any other."""
    return next((cause for cause in _WITHIN_REACH if row.report.detail.startswith(cause)), "")


def _is_at_once(one: SuiteRow, other: SuiteRow) -> bool:
    """True if both rows say when their episodes ended, and these are near each other."""
    if not (one.ended_unix_s and other.ended_unix_s):
        return False
    return abs(one.ended_unix_s - other.ended_unix_s) <= AT_ONCE_S


__all__ = ["AT_ONCE_S", "open_rows", "unresolved_entrants", "with_marked_names"]
