"""The engines of one process: created by name, reset, commanded and advanced side by side.

Engines are ordered by name. Within one `advance` every engine receives the states of the others at the interval's start
(fixed-step Jacobi), so the order affects only the sequence of receipts and events. These *mirrors* are the other
engines' entities in the instance's order, then their background movers by engine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.boundary_checks import check_apart, checked_admissions, checked_boundary
from lingjing.kernel.world.guarded_calls import Enter, engine_seed, guarded, no_note
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence, Schedule
from lingjing.plugins.engine import Boundary, Engine, EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt

Movers = Mapping[str, tuple[BodyState, ...]]
"""Background movers by the engine that owns them."""

NO_MOVERS: Movers = {}


class EngineReport(msgspec.Struct, frozen=True):
    """A validated boundary of one engine."""

    boundary: Boundary
    """The boundary."""
    wall_s: float
    """Wall-clock seconds of the engine's call."""


def start_engines(host: PluginHost, names: Iterable[str], enter: Enter = no_note) -> dict[str, Engine]:
    """Create an object of each named engine. Its heavy imports happen here, outside the engine barrier."""
    started: dict[str, Engine] = {}
    for name in sorted(names):
        started[name], _ = guarded(enter, name, "start", host.engine(name).factory)
    return started


def close_engines(engines: Mapping[str, Engine], enter: Enter = no_note) -> tuple[str, ...]:
    """Close each engine, even if another one fails. Return the error messages."""
    problems: list[str] = []
    for name, engine in engines.items():
        try:
            guarded(enter, name, "close", engine.close)
        except InfrastructureError as error:
            problems.append(str(error))
    return tuple(problems)


@dataclass(frozen=True, slots=True)
class _Member:
    name: str
    engine: Engine
    owns: tuple[str, ...]
    others: tuple[str, ...]


class EngineGroup:
    """The motion engines of one process, coupled to each other and to states from other processes."""

    def __init__(self, instance: Instance, city: City, engines: Mapping[str, Engine], enter: Enter = no_note) -> None:
        self._instance = instance
        self._city = city
        self._enter = enter
        self._members = tuple(_member(instance, name, engines[name]) for name in sorted(engines))
        self._schedule = Schedule(instance)
        self._entities = frozenset(entity.id for entity in instance.entities)
        self._states: dict[str, BodyState] = {}
        self._ambient: dict[str, tuple[BodyState, ...]] = {}
        self.engines = tuple(member.name for member in self._members)

    def reset(self) -> tuple[EngineReport, ...]:
        """Return READY(0) of every engine."""
        return self._commit([self._reset(member) for member in self._members])

    def take_events(self, occurrences: Sequence[Occurrence]) -> None:
        """Take over all occurrences of the mission's events so far. All engines read the same schedule."""
        self._schedule.update(occurrences)

    def submit(self, commands: Sequence[Command]) -> dict[str, Receipt]:
        """Submit each engine's commands. Return the valid admission receipts by command id, without the commands for
        which an engine returned none.
        """
        admitted: dict[str, Receipt] = {}
        for member in self._members:
            mine = tuple(command for command in commands if command.resource in member.owns)
            if mine:
                admitted.update(self._submit(member, mine))
        return admitted

    def advance(
        self, until: float, foreign: Sequence[BodyState] = (), ambient: Movers = NO_MOVERS
    ) -> tuple[EngineReport, ...]:
        """Advance all engines one macro-step to `until` (s).

        `foreign` are states of entities and `ambient` background movers that live in other processes.
        """
        known = self._states
        known.update((state.id, state) for state in foreign)
        crowds = sorted({**self._ambient, **ambient}.items()) if self._ambient or ambient else ()
        return self._commit([self._advance(member, until, known, crowds) for member in self._members])

    def _reset(self, member: _Member) -> EngineReport:
        spec = EngineSpec(engine=member.name, instance=self._instance, owns=member.owns, events=self._schedule)
        seed = engine_seed(self._instance.seed, member.name)
        report, wall_s = guarded(self._enter, member.name, "reset", lambda: member.engine.reset(spec, self._city, seed))
        return EngineReport(checked_boundary(member.name, "reset", report, 0.0, member.owns, self._entities), wall_s)

    def _submit(self, member: _Member, commands: tuple[Command, ...]) -> dict[str, Receipt]:
        answer, _ = guarded(self._enter, member.name, "submit", lambda: tuple(member.engine.submit(commands)))
        return checked_admissions(member.name, commands, answer)

    def _advance(
        self,
        member: _Member,
        until: float,
        known: Mapping[str, BodyState],
        crowds: Sequence[tuple[str, tuple[BodyState, ...]]],
    ) -> EngineReport:
        mirrors = tuple([known[name] for name in member.others])
        for name, movers in crowds:
            if name != member.name:
                mirrors += movers
        report, wall_s = guarded(self._enter, member.name, "advance", lambda: member.engine.advance(until, mirrors))
        checked = checked_boundary(member.name, "advance", report, until, member.owns, self._entities)
        return EngineReport(checked, wall_s)

    def _commit(self, reports: Sequence[EngineReport]) -> tuple[EngineReport, ...]:
        # Only after the last engine: no engine may receive a state of the interval's end.
        for report in reports:
            boundary = report.boundary
            for state in boundary.states:
                self._states[state.id] = state
            if boundary.ambient or self._ambient:
                keep_movers(self._ambient, boundary)
        check_apart(self._ambient)
        return tuple(reports)


def keep_movers(ambient: dict[str, tuple[BodyState, ...]], boundary: Boundary) -> None:
    """Replace an engine's background movers by those of its boundary; without any, the engine is removed."""
    if boundary.ambient:
        ambient[boundary.engine] = boundary.ambient
    else:
        ambient.pop(boundary.engine, None)


def _member(instance: Instance, name: str, engine: Engine) -> _Member:
    owns = tuple(entity.id for entity in instance.entities if entity.engine == name)
    others = tuple(entity.id for entity in instance.entities if entity.engine != name)
    return _Member(name, engine, owns, others)
