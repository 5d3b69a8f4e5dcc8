"""Update: what a boundary adds to the registry before rules are adjudicated.

The kernel knows it while the mission runs, `lingjing.analysis.registries` from a trace; the order in which it is added
is the same for both.
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
    """One boundary's telemetry, requests and answers: `asked` are the agents' admitted commands, `own` the kernel's and
    `missing` the ids of those without an admission receipt; `events` are those of engines alone."""

    tick: int
    time_s: float
    states: Iterable[BodyState]
    unheard: tuple[tuple[str, str], ...]
    progress: EpisodeProgress
    asked: Sequence[Command]
    own: Iterable[Command]
    missing: Container[str]
    receipts: Sequence[Receipt]
    events: Iterable[TaskEvent]
    routes: Iterable[Route]
    frames: Iterable[FrameInfo]
    reports: Sequence[Report]
    messages: Sequence[Envelope]


def updated(registry: Registry, update: RegistryUpdate, instance: Instance) -> Registry:
    """The registry of the boundary before with what this one adds. Reference pictures are no frames of the mission."""
    given = (
        *assignments.from_commands(update.asked, update.receipts),
        *assignments.from_messages(update.messages, instance.agents),
    )
    return (
        registry.with_boundary(update.tick, update.time_s, update.states, update.unheard, update.progress)
        .with_receipts(update.asked, update.receipts)
        .with_lost_unlocks(update.own, update.missing)
        .with_events(update.events)
        .with_routes(update.routes)
        .with_frames([frame for frame in update.frames if frame.camera != REFERENCE], instance)
        .with_reports(update.reports)
        .with_assignments(given)
    )
