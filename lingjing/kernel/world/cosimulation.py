"""Fixed-step co-simulation of the motion engines of an episode: one decision tick is a whole number of macro-steps.

It couples *groups*, each the engines of one process: an `EngineGroup` in this process or the far end of a socket. It
uses no wall clock. With several groups (a remote engine in the caller beside the world process), each receives the
others' states at the interval's start, as engines do within a group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import msgspec

from lingjing.errors import UsageError
from lingjing.kernel.world.boundary_checks import check_apart
from lingjing.kernel.world.contract import WorldBoundary
from lingjing.kernel.world.engine_group import NO_MOVERS, EngineReport, Movers, keep_movers
from lingjing.kernel.world.stocks import Stocks
from lingjing.mission.instance import Clock, Instance
from lingjing.mission.schedule import Occurrence
from lingjing.trace.records import BodyState, Command, EngineStatus, Receipt, Route, Snapshot, TaskEvent


class CoupledGroup(Protocol):
    """The engines of one process; see `EngineGroup` for the meaning of the calls."""

    @property
    def engines(self) -> tuple[str, ...]:
        """The names of the engines."""
        ...

    def reset(self) -> tuple[EngineReport, ...]:
        """Return READY(0) of every engine."""
        ...

    def take_events(self, occurrences: Sequence[Occurrence]) -> None:
        """Take over all occurrences of the mission's events so far."""
        ...

    def submit(self, commands: Sequence[Command]) -> dict[str, Receipt]:
        """Return admission receipts by command id."""
        ...

    def advance(
        self, until: float, foreign: Sequence[BodyState] = (), ambient: Movers = NO_MOVERS
    ) -> tuple[EngineReport, ...]:
        """Advance one macro-step to `until` (s)."""
        ...


def macro_steps(clock: Clock) -> int:
    """Return the number of macro-steps in a tick. Raises `UsageError` if `tick` is not a whole multiple of `sync`."""
    count = round(clock.tick_s / clock.sync_s)
    if count < 1 or abs(count * clock.sync_s - clock.tick_s) > 1e-9 * clock.tick_s:
        raise UsageError(f"the tick of {clock.tick_s} s is not a whole number of macro-steps of {clock.sync_s} s")
    return count


def macro_time_s(clock: Clock, tick: int, step: int) -> float:
    """Return the time of macro-step `step` (from 1) of `tick`, from integers: no error accumulates, ticks meet
    exactly.
    """
    if step == macro_steps(clock):
        return tick * clock.tick_s
    return (tick - 1) * clock.tick_s + step * clock.sync_s


@dataclass(frozen=True, slots=True)
class _OwnedGroup:
    part: CoupledGroup
    resources: frozenset[str]
    foreign: tuple[str, ...]


class CoSimulation:
    """Advances the engine groups of one episode from boundary to boundary."""

    def __init__(self, instance: Instance, parts: Sequence[CoupledGroup]) -> None:
        self._clock = instance.clock
        self._order = tuple(entity.id for entity in instance.entities)
        self._groups = tuple(_owned_group(instance, part) for part in parts)
        self._states: dict[str, BodyState] = {}
        self._stocks = Stocks(instance)
        self._ambient: dict[str, tuple[BodyState, ...]] = {}
        self._unreachable: dict[str, tuple[tuple[str, str], ...]] = {}
        self._frames: dict[str, int] = {}
        self._macro_steps = macro_steps(instance.clock)
        self.tick = 0

    def reset(self) -> WorldBoundary:
        """Reset all groups. Boundary 0 holds one snapshot, at time 0."""
        reports = _by_engine([report for group in self._groups for report in group.part.reset()])
        snapshot = self._commit(reports, 0.0)
        return WorldBoundary(
            tick=0,
            time_s=0.0,
            snapshots=(self._with_movers(snapshot),),
            receipts=_receipts(reports),
            events=_events(reports),
            engines=self._status(reports, 0.0),
            routes=_routes(reports),
            unreachable_links=self._unreachable_links(),
        )

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence] = ()) -> WorldBoundary:
        """Submit `commands`, then run every macro-step of `tick`. Raises `ValueError` if `tick` does not follow the
        last one.
        """
        if tick != self.tick + 1:
            raise ValueError(f"boundary {tick} does not follow boundary {self.tick}")
        if occurrences:
            for group in self._groups:
                group.part.take_events(occurrences)
        admitted = self._submit(commands)
        snapshots: list[Snapshot] = []
        reports: list[EngineReport] = []
        for step in range(1, self._macro_steps + 1):
            until = macro_time_s(self._clock, tick, step)
            latest = self._advance(until)
            snapshots.append(self._commit(latest, until))
            reports.extend(latest)
        self.tick = tick
        snapshots[-1] = self._with_movers(snapshots[-1])
        return WorldBoundary(
            tick=tick,
            time_s=snapshots[-1].time_s,
            snapshots=tuple(snapshots),
            admissions=tuple(admitted[command.id] for command in commands if command.id in admitted),
            missing=tuple(command.id for command in commands if command.id not in admitted),
            receipts=_receipts(reports),
            events=_events(reports),
            engines=self._status(reports, snapshots[-1].time_s),
            routes=_routes(reports),
            unreachable_links=self._unreachable_links(),
        )

    def _submit(self, commands: Sequence[Command]) -> dict[str, Receipt]:
        for command in commands:
            if command.resource not in self._states:
                raise ValueError(f"command {command.id} is for `{command.resource}`, which no engine owns")
        admitted: dict[str, Receipt] = {}
        for group in self._groups:
            mine = [command for command in commands if command.resource in group.resources]
            if mine:
                admitted.update(group.part.submit(mine))
        return admitted

    def _advance(self, until: float) -> Sequence[EngineReport]:
        if len(self._groups) == 1:
            return self._groups[0].part.advance(until)
        states = self._states
        return _by_engine(
            [
                report
                for group in self._groups
                for report in group.part.advance(until, [states[name] for name in group.foreign], self._around(group))
            ]
        )

    def _commit(self, reports: Sequence[EngineReport], time_s: float) -> Snapshot:
        for report in reports:
            boundary = report.boundary
            self._frames[boundary.engine] = self._frames.get(boundary.engine, -1) + 1
            for state in boundary.states:
                self._states[state.id] = state
            if boundary.ambient or self._ambient:
                keep_movers(self._ambient, boundary)
            if boundary.unreachable_links or self._unreachable:
                self._unreachable[boundary.engine] = boundary.unreachable_links
        if len(self._groups) > 1:
            check_apart(self._ambient)
        kept = self._stocks.kept(self._states)
        return Snapshot(time_s=time_s, states=tuple([kept.get(name) or self._states[name] for name in self._order]))

    def _around(self, group: _OwnedGroup) -> Movers:
        """Return the background movers of the other groups' engines."""
        if len(self._groups) == 1:
            return NO_MOVERS
        return {name: movers for name, movers in self._ambient.items() if name not in group.part.engines}

    def _with_movers(self, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot of a decision boundary, with the background movers."""
        if not self._ambient:
            return snapshot
        movers = tuple([mover for _, movers in sorted(self._ambient.items()) for mover in movers])
        return msgspec.structs.replace(snapshot, ambient=movers)

    def _unreachable_links(self) -> tuple[tuple[str, str], ...]:
        """Return the pairs that any engine reports as out of radio range."""
        if not self._unreachable:
            return ()
        return tuple(dict.fromkeys(pair for _, pairs in sorted(self._unreachable.items()) for pair in pairs))

    def _status(self, reports: Sequence[EngineReport], time_s: float) -> tuple[EngineStatus, ...]:
        waits: dict[str, float] = {}
        for report in reports:
            waits[report.boundary.engine] = waits.get(report.boundary.engine, 0.0) + report.wall_s
        return tuple(
            [
                EngineStatus(engine=name, time_s=time_s, frame=self._frames[name], wait_wall_s=waits[name])
                for name in sorted(waits)
            ]
        )


def _owned_group(instance: Instance, part: CoupledGroup) -> _OwnedGroup:
    mine = [entity.id for entity in instance.entities if entity.engine in part.engines]
    foreign = tuple(entity.id for entity in instance.entities if entity.engine not in part.engines)
    return _OwnedGroup(part, frozenset(mine), foreign)


def _by_engine(reports: list[EngineReport]) -> list[EngineReport]:
    return sorted(reports, key=lambda report: report.boundary.engine)


def _receipts(reports: Sequence[EngineReport]) -> tuple[Receipt, ...]:
    return tuple([receipt for report in reports for receipt in report.boundary.receipts])


def _events(reports: Sequence[EngineReport]) -> tuple[TaskEvent, ...]:
    return tuple([event for report in reports for event in report.boundary.events])


def _routes(reports: Sequence[EngineReport]) -> tuple[Route, ...]:
    return tuple([route for report in reports for route in report.boundary.routes])
