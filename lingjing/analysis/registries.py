"""`registries`: the kernel's registry at every boundary of a trace, from its records alone.

Adjudication is a function of the instance, the admitted messages and commands, and what engines said. All of them
are in the trace, so the registry is computed again without engines, city or pictures, and any condition can be
evaluated at any boundary. The events that come out must be those that the trace holds; `Rebuilt.faithful` says
whether they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.kernel.adjudication import Adjudicator
from lingjing.kernel.budgets import Budgets
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.inspections import Inspections
from lingjing.kernel.registry import Registry, Report, initial
from lingjing.kernel.registry_update import RegistryUpdate, updated
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord


@dataclass(frozen=True, slots=True)
class Rebuilt:
    """A boundary with the registry that the kernel had there; `faithful` if adjudication gave its events."""

    record: BoundaryRecord
    registry: Registry
    at: RuntimeContext
    faithful: bool


def registries(trace: Trace) -> Iterator[Rebuilt]:
    """The registry of each boundary in order. Raises `MissionError` for an instance that this version cannot judge."""
    instance = trace.header.instance
    adjudicator, budgets, inspections = Adjudicator(instance), Budgets(instance), Inspections(instance)
    registry = initial(instance)
    for record in trace.boundaries:
        after = updated(registry, _update(registry, record, budgets), instance)
        after = inspections.follow(registry, after, record.snapshots)
        verdict = adjudicator.adjudicate(registry, after, record.snapshots)
        registry = verdict.registry
        at = adjudicator.instant(registry, registry.states, registry.time_s)
        yield Rebuilt(record, registry, at, verdict.events == record.events)


def _update(registry: Registry, record: BoundaryRecord, budgets: Budgets) -> RegistryUpdate:
    """What a recorded boundary added to the kernel's registry."""
    own = [command for command in record.commands if command.origin == "kernel"]
    asked = [command for command in record.commands if command.origin == "agent"]
    missing = {one.request for one in record.receipts if one.reason == "no_receipt" and one.by == "kernel"}
    reports = reports_of(record)
    tally = budgets.tally(registry)
    for report in reports:
        tally.take_message(report.sender, report.kind)
    for command in asked:
        tally.take_command(command.resource, command.verb)
    return RegistryUpdate(
        tick=record.tick,
        time_s=record.time_s,
        states=record.snapshots[-1].states if record.snapshots else tuple(registry.states.values()),
        unheard=record.unreachable_links,
        progress=budgets.spend(tally.onto(registry.progress), record.decisions),
        asked=asked,
        own=own,
        missing=missing,
        receipts=record.receipts,
        events=[event for event in record.task_events if not event.name],
        routes=record.routes,
        frames=record.frames,
        reports=reports,
        messages=record.messages,
    )


def reports_of(record: BoundaryRecord) -> tuple[Report, ...]:
    """The boundary's admitted messages as rules range over them: the bus answers each candidate with one receipt."""
    candidates = [(made.agent, message) for made in record.decisions for message in made.decision.messages]
    answers = [receipt for receipt in record.receipts if receipt.by == "bus"]
    return tuple(
        Report(answer.request, message.kind, sender, answer.tick, message.body)
        for (sender, message), answer in zip(candidates, answers, strict=False)
        if answer.status == "accepted"
    )
