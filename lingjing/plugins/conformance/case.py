"""The inputs of the checks of an engine, and one run of it from boundary to boundary."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from lingjing.errors import ForeignCodeError, LingjingError, PluginError, UsageError
from lingjing.mission.instance import Datum, Entity, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.plugins.building import build_city
from lingjing.plugins.engine import Boundary, Engine, EnginePlugin, EngineSpec
from lingjing.plugins.foreign_errors import kind_of_value, one_line
from lingjing.plugins.host import PluginHost
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt

CaseT = TypeVar("CaseT")
ResultT = TypeVar("ResultT")


class ConformanceError(PluginError):
    """A plug-in that breaks its contract. The message names the place and the fault."""


@dataclass(frozen=True, slots=True)
class EngineCase:
    """The inputs of the checks of an engine."""

    plugin: EnginePlugin
    instance: Instance
    """An instance with entities of the engine."""
    city: City
    commands: tuple[Command, ...] = ()
    """Commands that the engine should admit, submitted at time 0."""
    mirrors: tuple[BodyState, ...] = ()
    """Bodies of other engines at time 0. They move along their velocities."""
    seed: int = 1
    seconds: float = 20.0
    """The duration of a run, seconds of simulation time."""
    placed: bool = True
    """True if entities start at the positions of the instance. A satellite starts at the position of its elements."""

    @property
    def owned(self) -> tuple[Entity, ...]:
        """The entities that the engine owns in this case."""
        return tuple(entity for entity in self.instance.entities if entity.engine == self.plugin.name)

    @property
    def spec(self) -> EngineSpec:
        """The argument of the engine's `reset`."""
        return EngineSpec(
            engine=self.plugin.name, instance=self.instance, owns=tuple(entity.id for entity in self.owned)
        )

    @property
    def step_s(self) -> float:
        """The interval of one `advance`, seconds: a macro-step, or a whole tick for sensors."""
        return self.instance.clock.tick_s if self.plugin.sensor else self.instance.clock.sync_s

    def times(self) -> tuple[float, ...]:
        """Return the times of the boundaries, seconds."""
        return tuple(self.step_s * number for number in range(1, round(self.seconds / self.step_s) + 1))

    def mirrors_at(self, time_s: float) -> tuple[BodyState, ...]:
        """Return the bodies of other engines at the start of an interval."""
        return tuple(_moved(state, time_s) for state in self.mirrors)


def instance_of(mission: Mission, *, seed: int = 1) -> Instance:
    """Return an instance of a mission, for checks that need one."""
    return instantiate(mission, seed=seed)


def case_of(
    plugin: EnginePlugin,
    mission: Mission,
    commands: Mapping[str, tuple[str, Mapping[str, Datum]]],
    *,
    seed: int = 1,
    mirrors: Sequence[BodyState] = (),
    seconds: float = 20.0,
) -> EngineCase:
    """Return a case with a mission's own instance and city. `commands` holds a verb and its arguments by resource."""
    instance = instantiate(mission, seed=seed)
    city = build_city(instance.scene, PluginHost())
    submitted = tuple(
        Command(id=f"c0-{number}", tick=0, sender="conformance", resource=name, verb=verb, arguments=dict(arguments))
        for number, (name, (verb, arguments)) in enumerate(commands.items(), start=1)
    )
    placed = anchor(instance, city, imported=bool(mission.origin.places))
    return EngineCase(plugin, placed, city, submitted, tuple(mirrors), seed, seconds)


@dataclass(slots=True)
class Run:
    """The answers of an engine in one run of a case."""

    ready: Boundary
    admissions: tuple[Receipt, ...] = ()
    boundaries: list[Boundary] = field(default_factory=list)


@contextmanager
def engine_of(case: EngineCase) -> Iterator[Engine]:
    """Yield a new engine, and close it at the end, also after an error."""
    engine = case.plugin.factory()
    try:
        yield engine
    finally:
        engine.close()


def play(case: EngineCase, times: Sequence[float] | None = None) -> Run:
    """Return one run of a case in a new engine."""
    with engine_of(case) as engine:
        return drive(engine, case, times)


def reset(engine: Engine, case: EngineCase) -> Boundary:
    """Reset the engine, and return READY(0)."""
    return _sound("reset", engine.reset(case.spec, case.city, case.seed))


def drive(engine: Engine, case: EngineCase, times: Sequence[float] | None = None) -> Run:
    """Reset the engine, submit the case's commands, and advance to each time."""
    run = Run(ready=reset(engine, case), admissions=tuple(engine.submit(case.commands)))
    run.boundaries += advance(engine, case, 0.0, case.times() if times is None else times)
    return run


def advance(engine: Engine, case: EngineCase, start: float, times: Sequence[float]) -> list[Boundary]:
    """Advance from `start` to each time in turn, and return the boundaries."""
    boundaries = []
    for until in times:
        boundaries.append(_sound("advance", engine.advance(until, case.mirrors_at(start))))
        start = until
    return boundaries


def require_finite(state: BodyState, time_s: float) -> None:
    """Raise `ConformanceError` unless all numbers of a body are finite."""
    numbers = (*state.position, *state.velocity, state.heading_deg, state.pitch_deg, state.roll_deg)
    finite = all(math.isfinite(number) for number in (*numbers, *state.resources.values(), *state.joints))
    require(finite, f"`{state.id}` at {time_s} s holds a number that is not finite")


def _sound(call: str, boundary: object) -> Boundary:
    """Return a boundary that comparisons can use. NaN is unequal to itself, so that equal boundaries would differ."""
    require(isinstance(boundary, Boundary), f"{call}: it returned {kind_of_value(boundary)}, not a Boundary")
    assert isinstance(boundary, Boundary)
    for state in (*boundary.states, *boundary.ambient):
        require_finite(state, boundary.time_s)
    return boundary


def require(condition: bool, message: str) -> None:
    """Raise `ConformanceError` unless the condition holds."""
    if not condition:
        raise ConformanceError(message)


def of_plugin(what: str, call: Callable[[], ResultT]) -> ResultT:
    """Return the result of a plug-in's code. Raises `ConformanceError` for every exception, with the line of the code.

    An error of this project passes: it is the plug-in's own way to report wrong options or a missing file.
    """
    try:
        return call()
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise ConformanceError(f"{what}: {one_line(error)}") from error


def run_all(who: str, checks: Iterable[Callable[[CaseT], None]], case: CaseT) -> None:
    """Run every check. Raises one `ConformanceError` that lists all failed checks, also those in which the plug-in
    raises."""
    faults: dict[str, list[str]] = {}
    causes: list[BaseException] = []
    for check in checks:
        try:
            check(case)
        except ConformanceError as fault:
            faults.setdefault(str(fault), []).append(check_name(check))
        except (Exception, SystemExit) as error:
            if isinstance(error, UsageError) and not isinstance(error, ForeignCodeError):
                raise  # the options or the files of the case are wrong
            causes.append(error)
            faults.setdefault(one_line(error), []).append(check_name(check))
    if faults:
        listed = [f"{', '.join(names)}: {fault}" for fault, names in faults.items()]
        raise ConformanceError(
            f"{who} breaks its contract: {'; '.join(listed)}", hint="see lingjing.plugins.conformance"
        ) from (causes[0] if causes else None)


def check_name(check: Callable[..., None]) -> str:
    """Return a check's short name, for test ids."""
    return check.__name__.removeprefix("check_")


def _moved(state: BodyState, seconds: float) -> BodyState:
    x, y, z = (here + seconds * rate for here, rate in zip(state.position, state.velocity, strict=True))
    return msgspec.structs.replace(state, position=(x, y, z))


__all__ = [
    "ConformanceError", "EngineCase", "Run", "advance", "case_of", "check_name", "drive", "engine_of", "instance_of",
    "of_plugin", "play", "require", "require_finite", "reset", "run_all",
]  # fmt: skip
