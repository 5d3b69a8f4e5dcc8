"""Open episodes, that is, episodes without a certain result, and the entrants that have them.

A lost episode has no result. An episode that was played again after a failure of its entrant's own service has a
result that the entrant could choose: the service could fail only when the policy loses. The same holds for a policy
that ends a process of the harness or removes its trace, because it runs on the same machine. Such a result counts in
the rates, and the worst case counts it as a failure. It is certain if another entrant was aborted by the same cause at
the same time: then the cause was the network, the machine or a common service. An entrant with code or a service of its
own proves nothing of that, because one person may bring several.

An aborted try without a later result is open too: else a defeat that is called an abort would leave the table.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import UNRESOLVED
from lingjing.play.policy_files import is_file

AT_ONCE_S = 300.0
"""Seconds within which two aborts count as simultaneous. Chosen: `react` reports an outage after three ticks, each of
which waits up to 90 s for the model.
"""


SERVICE_OPTIONS = ("base_url", "base_url_env", "client", "models")
"""The options of a policy that name the service of its model."""


def open_rows(rows: Iterable[SuiteRow]) -> list[SuiteRow]:
    """Return the lost episodes, the aborted tries without a later result, and those that only their entrant may have
    caused.
    """
    rows = list(rows)
    over = {(*row.cell, row.seed) for row in rows if row.standing != "aborted"}
    aborts = [row for row in rows if row.standing != "counted"]
    return [
        row for row in aborts if row.standing == "lost" or (*row.cell, row.seed) not in over or _is_alone(row, aborts)
    ]


def unresolved_entrants(rows: Iterable[SuiteRow]) -> frozenset[str]:
    """Return the names of the entrants with open episodes; they are not ranked."""
    return frozenset(row.entrant for row in open_rows(rows))


def with_marked_names(rows: Sequence[SuiteRow], unresolved: frozenset[str]) -> list[SuiteRow]:
    """Return the rows with `UNRESOLVED` after the names of these entrants, so that no table marks them as best."""
    return [
        msgspec.structs.replace(row, entrant=f"{row.entrant} {UNRESOLVED}") if row.entrant in unresolved else row
        for row in rows
    ]


def _is_alone(row: SuiteRow, aborts: Sequence[SuiteRow]) -> bool:
    """Return whether the entrant may have caused the abort and no trusted one was aborted so at the same time."""
    cause = row.report.cause
    if cause == "service" and _has_own_service(row):
        return True
    others = (
        other for other in aborts if other.entrant != row.entrant and other.report.cause == cause and _is_trusted(other)
    )
    return bool(cause) and not any(_is_at_once(row, other) for other in others)


def _is_trusted(row: SuiteRow) -> bool:
    """Return whether the entrant plays this project's code and has no service of its own: then its author cannot
    cause its abort.
    """
    policies = (row.options.policy, *row.options.policies_for.values())
    return not row.foreign and not any(map(is_file, policies)) and not _has_own_service(row)


def _has_own_service(row: SuiteRow) -> bool:
    """Return whether the options name the address of the model's service, which may be the entrant's own."""
    return any(row.options.policy_args.get(name) for name in SERVICE_OPTIONS)


def _is_at_once(row: SuiteRow, other: SuiteRow) -> bool:
    """Return whether both rows hold the end of their episodes and these are simultaneous."""
    if not (row.ended_unix_s and other.ended_unix_s):
        return False
    return abs(row.ended_unix_s - other.ended_unix_s) <= AT_ONCE_S


__all__ = ["AT_ONCE_S", "SERVICE_OPTIONS", "open_rows", "unresolved_entrants", "with_marked_names"]
