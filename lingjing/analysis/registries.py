"""The kernel's registry at every boundary of a trace, computed from its records.

Adjudication is a function of the instance, the admitted messages and commands, and the reports of engines. The trace
contains all of these. The registry can therefore be computed again without engines or pictures, and any condition can
be evaluated at any boundary. The city is built again only for a line of sight; if it cannot be built here, lines of
sight have no value. If the computed events differ from the recorded ones, `RebuiltBoundary.faithful` is False.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.analysis.played_city import city_of
from lingjing.kernel.adjudication import Adjudicator
from lingjing.kernel.budgets import Budgets
from lingjing.kernel.claims import Claims
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.inspections import Inspections
from lingjing.kernel.mission_events import MissionEvents
from lingjing.kernel.registry import Registry, Report, initial
from lingjing.kernel.registry_update import RegistryUpdate, update_registry
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord


@dataclass(frozen=True, slots=True)
class RebuiltBoundary:
    """A boundary with the kernel's registry."""

    record: BoundaryRecord
    registry: Registry
    at: RuntimeContext
    """The context for the evaluation of conditions at this boundary."""
    faithful: bool
    """True if adjudication yields the recorded events."""


def registries(trace: Trace) -> Iterator[RebuiltBoundary]:
    """Yield the registry of each boundary in order.

    Raises `MissionError` for an instance that this version cannot adjudicate.
    """
    instance = trace.header.instance
    adjudicator = Adjudicator(instance, lambda: city_of(trace))
    budgets, claims = Budgets(instance), Claims(instance)
    inspections, events = Inspections(instance), MissionEvents(instance)
    registry = initial(instance)
    for record in trace.boundaries:
        after = update_registry(registry, _update(registry, record, budgets, claims), instance)
        after = inspections.advance(registry, after, record.snapshots)
        verdict = adjudicator.adjudicate(registry, after, record.snapshots)
        registry, _ = events.occur(verdict.registry, adjudicator.context_of)
        at = adjudicator.context_at(registry, registry.states, registry.time_s)
        yield RebuiltBoundary(record, registry, at, verdict.events == record.events)


def _update(registry: Registry, record: BoundaryRecord, budgets: Budgets, claims: Claims) -> RegistryUpdate:
    """Return the change that a recorded boundary made to the kernel's registry."""
    own = [command for command in record.commands if command.origin == "kernel"]
    commands = [command for command in record.commands if command.origin == "agent"]
    receipts = (receipt for receipt in record.receipts if receipt.by == "kernel")
    missing = {receipt.request for receipt in receipts if receipt.reason == "no_receipt"}
    reports = _reports_of(record)
    tally = budgets.tally(registry)
    for report in reports:
        tally.count_message(report.sender, report.kind)
    for command in commands:
        tally.count_command(command.resource, command.verb)
    progress = budgets.spend(tally.applied_to(registry.progress), record.decisions)
    reports, progress = claims.admit(reports, progress)
    return RegistryUpdate(
        tick=record.tick,
        time_s=record.time_s,
        states=record.snapshots[-1].states if record.snapshots else tuple(registry.states.values()),
        unreachable_links=record.unreachable_links,
        progress=progress,
        agent_commands=commands,
        kernel_commands=own,
        missing=missing,
        receipts=record.receipts,
        events=[event for event in record.task_events if not event.name],
        routes=record.routes,
        frames=record.frames,
        reports=reports,
        messages=record.messages,
    )


def _reports_of(record: BoundaryRecord) -> tuple[Report, ...]:
    """Return the boundary's admitted messages as reports for rules. The bus issues one receipt per candidate."""
    candidates = [(entry.agent, message) for entry in record.decisions for message in entry.decision.messages]
    receipts = [receipt for receipt in record.receipts if receipt.by == "bus"]
    return tuple(
        Report(receipt.request, message.kind, sender, receipt.tick, message.body)
        for (sender, message), receipt in zip(candidates, receipts, strict=False)
        if receipt.status == "accepted"
    )
