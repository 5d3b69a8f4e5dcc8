"""An episode of the kernel, boundary by boundary: a test makes the decisions and reads what each boundary shows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from lingjing.analysis.relations import RelationTracker
from lingjing.kernel.evaluators import build_evaluators
from lingjing.kernel.step import Kernel, Published
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.instance import Entity, Instance
from lingjing.plugins.host import PluginHost
from lingjing.plugins.policy import Inbox, Observation
from lingjing.scene.city import City
from lingjing.testing.missions import MissionSource, placed
from lingjing.testing.stand_ins import Stage, StandIns
from lingjing.trace.records import (
    AdjudicatedEvent,
    BodyState,
    Decision,
    DecisionRecord,
    Receipt,
    RelationRecord,
)


@dataclass
class Episode:
    """An episode under way. Its lists hold the records of all boundaries so far, in order."""

    kernel: Kernel
    stage: Stage
    """The inputs of the stand-ins; without effect if the engines are real."""
    instance: Instance
    published: Published
    """The output of the last boundary."""
    all: list[Published] = field(default_factory=list)
    """The outputs of all boundaries."""
    events: list[AdjudicatedEvent] = field(default_factory=list)
    """The rules that came true."""
    relations: list[RelationRecord] = field(default_factory=list)
    """The relations between agents that took place."""
    receipts: list[Receipt] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._tracker = RelationTracker(self.instance)
        self._record()

    def do(self, decisions: Mapping[str, Decision] | None = None) -> Published:
        """Play to the next boundary with one decision for each agent id, and return its output; an absent agent does
        nothing. Raises `ValueError` for an unknown agent.
        """
        made = decisions or {}
        unknown = sorted(set(made) - {agent.id for agent in self.instance.agents})
        if unknown:
            raise ValueError(f"the mission has no agent {', '.join(unknown)}")
        self.published = self.kernel.step(
            tuple(
                DecisionRecord(agent=agent.id, decision=made[agent.id])
                for agent in self.instance.agents
                if agent.id in made
            )
        )
        self._record()
        return self.published

    def wait(self, ticks: int) -> None:
        """Play without decisions for at most this number of ticks; a decided episode does not go on."""
        for _ in range(ticks):
            if not self.done:
                self.do()

    def observation(self, agent: str) -> Observation:
        """Return the observation of an agent at the last boundary."""
        return self.published.observations[agent]

    def inbox(self, agent: str) -> Inbox:
        """Return the messages and receipts of an agent at the last boundary."""
        return self.published.inboxes[agent]

    def state(self, entity: str) -> BodyState:
        """Return the state of a body at the last boundary."""
        return next(state for state in self.published.record.snapshots[-1].states if state.id == entity)

    def entity(self, name: str) -> Entity:
        """Return an entity of the instance."""
        return next(entity for entity in self.instance.entities if entity.id == name)

    def put(self, name: str, target: str, east: float = 0.0, north: float = 0.0) -> None:
        """Set the place of a stand-in body beside the start of an entity; `east` and `north` are metres."""
        x, y, z = self.entity(target).position
        self.stage.places[name] = (x + east, y + north, z)

    def kinds(self) -> list[tuple[str, ...]]:
        """Return the rules that came true as (rule, bound entities), without the ids of reports."""
        names = {entity.id for entity in self.instance.entities}
        return [(event.kind, *(name for name in event.bindings if name in names)) for event in self.events]

    def emitted(self) -> list[str]:
        """Return the task events of the engines as `kind entity`."""
        return [f"{event.kind} {event.entities[0]}" for boundary in self.all for event in boundary.record.task_events]

    def reasons(self, agent: str) -> list[tuple[str, str]]:
        """Return (status, reason) of the receipts of one agent."""
        return [(receipt.status, receipt.reason) for receipt in self.receipts if receipt.sender == agent]

    def stages(self) -> list[str]:
        """Return the completed stages as `stage subject`."""
        return [f"{stage.stage} {stage.subject}".strip() for boundary in self.all for stage in boundary.record.stages]

    @property
    def done(self) -> bool:
        """True if the evaluators have ended the episode."""
        return self.published.evaluation.done

    @property
    def success(self) -> bool:
        """True if the episode is won."""
        return self.published.evaluation.reason == "success"

    def _record(self) -> None:
        record = self.published.record
        self.all.append(self.published)
        self.events.extend(record.events)
        self.relations.extend(self._tracker.take(record))
        self.receipts.extend(record.receipts)


@contextmanager
def episode(
    source: MissionSource | tuple[Instance, City],
    *,
    seed: int = 0,
    mode: str | None = None,
    settings: Mapping[str, float] | None = None,
    plugins: Iterable[object] = (),
    evaluators: Sequence[str] = (),
    stage: Stage | None = None,
    real: tuple[str, ...] = ("city",),
    privileged: frozenset[str] = frozenset(),
) -> Iterator[Episode]:
    """Yield an episode at boundary 0, with all engines in this process; they are closed at the end.

    `source`, `seed`, `mode` and `settings` are those of `placed`; a pair of instance and city is played as it is.
    `plugins` are modules or objects with hooks, `evaluators` names of evaluators (none: the mission's own rules).
    With a `stage`, stand-ins replace the camera and every motion engine that is not in `real`. `privileged` are the
    agents with the truth in their observations.
    """
    extra = (*plugins,) if stage is None else (*plugins, StandIns(stage, real))
    host = PluginHost(entry_points=stage is None, extra=extra)
    if isinstance(source, tuple):
        instance, city = source
    else:
        instance, city = placed(source, seed=seed, mode=mode, settings=settings)
    built: tuple[Any, ...] = build_evaluators([host.evaluator(name) for name in evaluators], instance, host)
    world = InlineWorld(host)
    try:
        kernel = Kernel(instance, city, world, privileged=privileged, evaluators=built)
        yield Episode(kernel, stage or Stage(), instance, kernel.reset())
    finally:
        world.close()


__all__ = ["Episode", "episode"]
