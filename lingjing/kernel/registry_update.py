"""Update: the values that a boundary adds to the registry before rules are adjudicated.

The kernel applies it while a mission runs, and `lingjing.analysis.registries` applies it to a trace. Both use the same
order.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

import msgspec

from lingjing.kernel import assignments
from lingjing.kernel.progress import EpisodeProgress
from lingjing.kernel.registry import Registry, Report
from lingjing.mission.instance import Instance
from lingjing.plugins.policy import REFERENCE
from lingjing.trace.records import BodyState, Command, Envelope, FrameInfo, Receipt, Route, TaskEvent


class RegistryUpdate(msgspec.Struct, frozen=True, kw_only=True):
    """The telemetry, requests and receipts of one boundary."""

    tick: int
    """The boundary's number, from 0."""
    time_s: float
    """Simulated time of the boundary, in seconds."""
    states: Iterable[BodyState]
    """The state of every entity at the boundary."""
    unreachable_links: tuple[tuple[str, str], ...]
    """Pairs of entities that radio does not connect."""
    progress: EpisodeProgress
    """Counts of budgets, inspections, stages and constraints up to the boundary before, with this tick's
    consumption.
    """
    agent_commands: Sequence[Command]
    """Admitted commands of agents."""
    kernel_commands: Iterable[Command]
    """Commands of the kernel itself."""
    missing: Container[str]
    """Ids of commands without an admission receipt."""
    receipts: Sequence[Receipt]
    """All receipts of the boundary, of validators and engines."""
    events: Iterable[TaskEvent]
    """Task events of engines; the mission's scheduled events are not among them."""
    routes: Iterable[Route]
    """Routes planned since the boundary before."""
    frames: Iterable[FrameInfo]
    """Pictures taken at the boundary, reference pictures included."""
    reports: Sequence[Report]
    """Admitted messages, one for each message id."""
    messages: Sequence[Envelope]
    """Admitted edges, one for each recipient of a message."""


def update_registry(registry: Registry, update: RegistryUpdate, instance: Instance) -> Registry:
    """Return the registry of the boundary before with the values of this one. Reference pictures are left out."""
    commanded = tuple(assignments.from_commands(update.agent_commands, update.receipts))
    sent = assignments.from_messages(update.messages, instance.agents)
    return (
        registry.with_boundary(update.tick, update.time_s, update.states, update.unreachable_links, update.progress)
        .with_receipts(update.agent_commands, update.receipts)
        .with_lost_unlocks(update.kernel_commands, update.missing)
        .with_events(update.events)
        .with_routes(update.routes)
        .with_frames([frame for frame in update.frames if frame.camera != REFERENCE], instance)
        .with_reports(update.reports)
        .with_assignments((*commanded, *sent))
        .with_destinations(commanded)
    )
