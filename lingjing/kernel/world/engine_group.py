"""The engines that one process hosts: created by name, reset, commanded and advanced side by side.

Order is by engine name. Within one `advance` every engine sees the others as they were at the interval's start
(fixed-step Jacobi), so the order decides nothing but the sequence of receipts and events. Mirrors
are the entities of the others in the instance's order, then their background movers by engine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.boundary_checks import check_apart, checked_admissions, checked_boundary
from lingjing.kernel.world.guarded_calls import Enter, engine_seed, guarded, ignore
from lingjing.mission.instance import Instance
from lingjing.plugins.engine import Boundary, Engine, EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt

Movers = Mapping[str, tuple[BodyState, ...]]
"""Background movers by the engine that brings them."""

NO_MOVERS: Movers = {}


class EngineReport(msgspec.Struct, frozen=True):
    """A checked boundary of one engine and the wall-clock seconds its call took."""

    boundary: Boundary
    wall_s: float


def start_engines(host: PluginHost, names: Iterable[str], enter: Enter = ignore) -> dict[str, Engine]:
    """A fresh object of each named engine. Its heavy imports happen here, outside the engine barrier."""
    started: dict[str, Engine] = {}
    for name in sorted(names):
        started[name], _ = guarded(enter, name, "start", host.engine(name).factory)
    return started


def close_engines(engines: Mapping[str, Engine], enter: Enter = ignore) -> tuple[str, ...]:
    """Close each engine, also when another one fails; returns what went wrong, by engine."""
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
    """The motion engines of one process, coupled among themselves and to states from other places: `foreign` entities
    and `ambient` background movers."""

    def __init__(self, instance: Instance, city: City, engines: Mapping[str, Engine], enter: Enter = ignore) -> None:
        self._instance = instance
        self._city = city
        self._enter = enter
        self._members = tuple(_member(instance, name, engines[name]) for name in sorted(engines))
        self._entities = frozenset(entity.id for entity in instance.entities)
        self._states: dict[str, BodyState] = {}
        self._ambient: dict[str, tuple[BodyState, ...]] = {}
        self.engines = tuple(member.name for member in self._members)

    def reset(self) -> tuple[EngineReport, ...]:
        """READY(0) of every engine."""
        return self._commit([self._reset(member) for member in self._members])

    def submit(self, commands: Sequence[Command]) -> dict[str, Receipt]:
        """Hand each engine its commands; the valid admission receipts by command id (those missing are left out)."""
        admitted: dict[str, Receipt] = {}
        for member in self._members:
            mine = tuple(command for command in commands if command.resource in member.owns)
            if mine:
                admitted.update(self._submit(member, mine))
        return admitted

    def advance(
        self, until: float, foreign: Sequence[BodyState] = (), ambient: Movers = NO_MOVERS
    ) -> tuple[EngineReport, ...]:
        """One macro-step of all engines to `until` (s), each with the others' states at the interval's start."""
        known = self._states
        known.update((state.id, state) for state in foreign)
        crowds = sorted({**self._ambient, **ambient}.items()) if self._ambient or ambient else ()
        return self._commit([self._advance(member, until, known, crowds) for member in self._members])

    def _reset(self, member: _Member) -> EngineReport:
        spec = EngineSpec(engine=member.name, instance=self._instance, owns=member.owns)
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
        # Only after the last engine: nobody may see a state of the interval's end.
        for report in reports:
            boundary = report.boundary
            for state in boundary.states:
                self._states[state.id] = state
            if boundary.ambient or self._ambient:
                keep_movers(self._ambient, boundary)
        check_apart(self._ambient)
        return tuple(reports)


def keep_movers(ambient: dict[str, tuple[BodyState, ...]], boundary: Boundary) -> None:
    """Put the background movers of a boundary in the place of their engine's before; without any it is not listed."""
    if boundary.ambient:
        ambient[boundary.engine] = boundary.ambient
    else:
        ambient.pop(boundary.engine, None)


def _member(instance: Instance, name: str, engine: Engine) -> _Member:
    owns = tuple(entity.id for entity in instance.entities if entity.engine == name)
    others = tuple(entity.id for entity in instance.entities if entity.engine != name)
    return _Member(name, engine, owns, others)
