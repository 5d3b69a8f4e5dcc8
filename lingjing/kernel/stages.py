"""Stages over time: when a stage begins for a subject, when it is late, and its weight in the score.

A stage begins when the stages that it depends on are done, for the same subject if both have subjects. A stage without
dependencies begins with the episode. A stage with `ticks` is late if it is not done that many ticks after its
beginning. A stage with a `deadline` is late if it is not done at the first boundary that is not before that time. A
late stage ends the episode, even if success does not need it. A stage of a `serial` counts only at a boundary after
the one at which the stage before it was done. If any stage has a weight, the score is the
weighted share of completed stages, each by the share of its subjects; otherwise the success condition determines the
score.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator
from dataclasses import dataclass

from msgspec.structs import replace

from lingjing.kernel.registry import Registry
from lingjing.mission.conditions.declared_values import deadlines_s
from lingjing.mission.expression import Number
from lingjing.mission.instance import Instance
from lingjing.mission.model import Stage
from lingjing.sums import total

_TOLERANCE_S = 1e-6
"""Tolerance of comparisons of simulated time, seconds (chosen: far below a macro-step)."""

NO_SUBJECT = ""
"""The subject of a stage without subjects."""


@dataclass(frozen=True, slots=True)
class LateStage:
    """A stage that one subject has not completed in time."""

    stage: str
    """The stage's name."""
    subject: str
    """The id of the subject; "" for a stage without subjects."""
    allowed: str
    """The time that it had, in words: `the 3 ticks it had (from tick 2 to tick 5)`."""

    @property
    def name(self) -> str:
        """The stage with its subject in words: "`detect` of victim[1]"."""
        return f"`{self.stage}` of {self.subject}" if self.subject else f"`{self.stage}`"


class Stages:
    """The stages of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._stages = instance.stages
        self._subjects = {stage.name: _subjects(stage, instance) for stage in instance.stages}
        self._needs: dict[str, tuple[str, ...]] = {stage.name: () for stage in instance.stages}
        for relation in instance.relations:
            if relation.kind == "dependency" and relation.target in self._needs:
                self._needs[relation.target] = (*self._needs[relation.target], relation.source)
        self._serial: dict[str, tuple[str, ...]] = {}
        for relation in instance.relations:
            if relation.serial:
                self._serial[relation.target] = (*self._serial.get(relation.target, ()), relation.source)
        self._deadlines_s = deadlines_s(instance)
        self._weights = {stage.name: _number(stage.weight, 1.0) for stage in instance.stages}
        self._ticks = {
            stage.name: int(_number(stage.ticks, 0.0)) for stage in instance.stages if stage.ticks is not None
        }
        self._timed = [part for part in self.parts if part[0] in self._ticks or part in self._deadlines_s]
        self._weighted = any(stage.weight is not None for stage in instance.stages)

    @property
    def parts(self) -> tuple[tuple[str, str], ...]:
        """Every stage with each of its subjects."""
        return tuple((name, subject) for name, subjects in self._subjects.items() for subject in subjects)

    def begin(self, registry: Registry) -> Registry:
        """Return the registry with the stages that have begun by its boundary."""
        if not self._stages:
            return registry
        fresh = {
            (stage.name, subject): registry.tick
            for stage in self._stages
            for subject in self._subjects[stage.name]
            if (stage.name, subject) not in registry.progress.began and self._may_begin(stage, subject, registry)
        }
        if not fresh:
            return registry
        return replace(registry, progress=replace(registry.progress, began={**registry.progress.began, **fresh}))

    def waiting(self, registry: Registry) -> Container[tuple[str, str]]:
        """The (stage, subject) pairs that do not count yet, because a stage before them in a `serial` is not done."""
        return {
            (name, subject)
            for name, sources in self._serial.items()
            for subject in self._subjects.get(name, ())
            if not self._are_done(sources, subject, registry)
        }

    def late(self, registry: Registry) -> Iterator[LateStage]:
        """Yield the stages that have exceeded their ticks without being done, in declaration order."""
        for name, subject in self._timed:
            if (name, subject) in registry.stages:
                continue
            allowed = self._used_up(name, subject, registry) or self._passed(name, subject, registry)
            if allowed:
                yield LateStage(name, subject, allowed)

    def score(self, registry: Registry) -> float | None:
        """Return the weighted share of completed stages, 0 to 1, or None if no stage has a weight."""
        whole = total(self._weights.values()) if self._weighted else 0.0
        if whole <= 0:
            return None
        done = 0.0
        for name, subjects in self._subjects.items():
            share = sum((name, subject) in registry.stages for subject in subjects) / max(1, len(subjects))
            done += self._weights[name] * share
        return done / whole

    def _used_up(self, name: str, subject: str, registry: Registry) -> str:
        """Describe the ticks of a stage if none is left; else ""."""
        allowed, began = self._ticks.get(name), registry.progress.began.get((name, subject))
        if allowed is None or began is None or registry.tick - began < allowed:
            return ""
        plural = "tick" if allowed == 1 else "ticks"
        return f"in the {allowed} {plural} it had (from tick {began} to tick {registry.tick})"

    def _passed(self, name: str, subject: str, registry: Registry) -> str:
        """Describe the deadline of a stage if it has passed; else ""."""
        deadline_s = self._deadlines_s.get((name, subject), math.inf)
        return f"by its deadline, {deadline_s:g} s" if registry.time_s >= deadline_s - _TOLERANCE_S else ""

    def _may_begin(self, stage: Stage, subject: str, registry: Registry) -> bool:
        return self._are_done(self._needs[stage.name], subject, registry)

    def _are_done(self, sources: tuple[str, ...], subject: str, registry: Registry) -> bool:
        """Return whether stages are done, for the subject if they have it."""
        return all((source, each) in registry.stages for source in sources for each in self._of(source, subject))

    def _of(self, source: str, subject: str) -> tuple[str, ...]:
        """Return the subjects for which `source` must be done: `subject` if it is one of them, else all subjects of
        `source`.
        """
        subjects = self._subjects.get(source, ())
        return (subject,) if subject in subjects else subjects


def _subjects(stage: Stage, instance: Instance) -> tuple[str, ...]:
    if not stage.variable or not stage.domain:
        return (NO_SUBJECT,)
    return tuple(entity.id for entity in instance.entities if entity.group == stage.domain)


def _number(value: object, default: float) -> float:
    return value.value if isinstance(value, Number) else default
