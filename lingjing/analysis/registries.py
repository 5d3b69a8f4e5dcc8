"""`registries`: the kernel's registry at every boundary of a trace, from its records alone.

Adjudication is a function of the instance, the admitted messages and commands, and what engines said. All of them
are in the trace, so the registry is computed again without engines, city or pictures, and any condition can be
evaluated at any boundary. The events that come out must be those that the trace holds; `Rebuilt.faithful` says
whether they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.kernel import assignments
from lingjing.kernel.adjudication import Adjudicator
from lingjing.kernel.budgets import Budgets
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.inspections import Inspections
from lingjing.kernel.registry import Registry, Report, initial
from lingjing.plugins.policy import REFERENCE
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
        updated = inspections.follow(registry, _updated(registry, record, trace, budgets), record.snapshots)
        verdict = adjudicator.adjudicate(registry, updated, record.snapshots)
        registry = verdict.registry
        at = adjudicator.instant(registry, registry.states, registry.time_s)
        yield Rebuilt(record, registry, at, verdict.events == record.events)


def _updated(registry: Registry, record: BoundaryRecord, trace: Trace, budgets: Budgets) -> Registry:
    """What the kernel adds to its registry before it adjudicates, in its order."""
    instance = trace.header.instance
    own = [command for command in record.commands if command.origin == "kernel"]
    asked = [command for command in record.commands if command.origin == "agent"]
    missing = {one.request for one in record.receipts if one.reason == "no_receipt" and one.by == "kernel"}
    reports = reports_of(record)
    tally = budgets.tally(registry)
    for report in reports:
        tally.take_message(report.sender, report.kind)
    for command in asked:
        tally.take_command(command.resource, command.verb)
    progress = budgets.spend(tally.onto(registry.progress), record.decisions)
    states = record.snapshots[-1].states if record.snapshots else tuple(registry.states.values())
    return (
        registry.with_boundary(record.tick, record.time_s, states, record.unheard, progress)
        .with_receipts(asked, record.receipts)
        .with_lost_unlocks(own, missing)
        .with_events([event for event in record.task_events if not event.name])
        .with_routes(record.routes)
        .with_frames([frame for frame in record.frames if frame.camera != REFERENCE], instance)
        .with_reports(reports)
        .with_assignments(
            (
                *assignments.from_commands(asked, record.receipts),
                *assignments.from_messages(record.messages, instance.agents),
            )
        )
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
