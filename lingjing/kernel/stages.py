"""Stages over time: when one begins for a subject, when it is late, what it is worth.

A stage begins when the stages it depends on are done, for the same subject where both have subjects; one that depends
on nothing begins with the episode. A stage with `ticks` that is not done that many ticks after its beginning is late,
which ends the episode, whether success needs the stage or not. Where any stage has a weight, the score is the weighted
share of the stages that are done, each by the share of its subjects; otherwise it is that of the success condition.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from msgspec.structs import replace

from lingjing.kernel.registry import Registry
from lingjing.mission.expression import Number
from lingjing.mission.instance import Instance
from lingjing.mission.model import Stage

NOBODY = ""
"""The subject of a stage that has none."""


@dataclass(frozen=True, slots=True)
class LateStage:
    """A stage that one subject has not done in the `ticks` it had since the tick at which it `began`."""

    stage: str
    subject: str
    ticks: int
    began: int

    @property
    def name(self) -> str:
        """`detect` of victim[1], in words."""
        return f"`{self.stage}` of {self.subject}" if self.subject else f"`{self.stage}`"


class Stages:
    """The stages of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._stages = instance.stages
        self._subjects = {stage.name: _subjects(stage, instance) for stage in instance.stages}
        self._needs: dict[str, tuple[str, ...]] = {stage.name: () for stage in instance.stages}
        for relation in instance.relations:
            if relation.kind == "dependency" and relation.target in self._needs:
                self._needs[relation.target] = (*self._needs[relation.target], relation.source)
        self._weights = {stage.name: _number(stage.weight, 1.0) for stage in instance.stages}
        self._weighted = any(stage.weight is not None for stage in instance.stages)

    @property
    def parts(self) -> tuple[tuple[str, str], ...]:
        """Every stage with each of its subjects."""
        return tuple((name, subject) for name, subjects in self._subjects.items() for subject in subjects)

    def begin(self, registry: Registry) -> Registry:
        """The registry that knows which stages have begun by its boundary."""
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

    def late(self, registry: Registry) -> Iterator[LateStage]:
        """What has passed its own bound of ticks without being done, in declaration order."""
        for stage in self._stages:
            if stage.ticks is None:
                continue
            most = int(_number(stage.ticks, 0.0))
            for subject in self._subjects[stage.name]:
                began = registry.progress.began.get((stage.name, subject))
                if began is not None and registry.tick - began >= most and (stage.name, subject) not in registry.stages:
                    yield LateStage(stage.name, subject, most, began)

    def score(self, registry: Registry) -> float | None:
        """The weighted share of what is done, 0..1; None if no stage has a weight."""
        whole = sum(self._weights.values()) if self._weighted else 0.0
        if whole <= 0:
            return None
        done = 0.0
        for name, subjects in self._subjects.items():
            share = sum((name, subject) in registry.stages for subject in subjects) / max(1, len(subjects))
            done += self._weights[name] * share
        return done / whole

    def _may_begin(self, stage: Stage, subject: str, registry: Registry) -> bool:
        return all(
            (source, one) in registry.stages for source in self._needs[stage.name] for one in self._of(source, subject)
        )

    def _of(self, source: str, subject: str) -> tuple[str, ...]:
        """The subjects for which the source must be done: the same one if it has it, else all of its own."""
        subjects = self._subjects.get(source, ())
        return (subject,) if subject in subjects else subjects


def _subjects(stage: Stage, instance: Instance) -> tuple[str, ...]:
    if not stage.variable or not stage.domain:
        return (NOBODY,)
    return tuple(entity.id for entity in instance.entities if entity.group == stage.domain)


def _number(value: object, default: float) -> float:
    return value.value if isinstance(value, Number) else default
