"""W.Step: one decision boundary, in the order of the paper's Algorithm 2 (operational expansion).

`Kernel` is the world object W = (B, S, G, E, R): the bus, the instance, the registry, the evaluators and the recorder.
`reset` commits boundary 0. `step` takes the collected policy outputs of boundary t to boundary t + 1. All run-time
state is one immutable `KernelState`; `fork` copies it and forks the engines.

Line numbers in comments are those of Algorithm 2.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import msgspec
from msgspec import field
from msgspec.structs import replace

from lingjing.kernel import pictures
from lingjing.kernel.adjudication import Adjudicator, Verdict
from lingjing.kernel.budgets import Budgets
from lingjing.kernel.bus import Bus, MessageRouter
from lingjing.kernel.candidates import normalise_decision
from lingjing.kernel.changing_radio import ChangingRadio
from lingjing.kernel.claims import Claims
from lingjing.kernel.commands import CommandValidator, Resolution
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.evaluation import MissionEvaluator, combine
from lingjing.kernel.imu import Motion
from lingjing.kernel.inspections import Inspections
from lingjing.kernel.mission_events import MissionEvents
from lingjing.kernel.pictures import ReferencePictures
from lingjing.kernel.progress import EpisodeProgress
from lingjing.kernel.recording import inbox_record, observation_record, substitutions
from lingjing.kernel.registry import Registry, Report, initial
from lingjing.kernel.registry_update import RegistryUpdate, update_registry
from lingjing.kernel.subtasks import Subtasks
from lingjing.kernel.supported import check_playable
from lingjing.kernel.swapped_pictures import SwappedPictures
from lingjing.kernel.visibility import Projector
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.mission.instance import Datum, Instance
from lingjing.mission.vocabulary import PHOTO, UNLOCK
from lingjing.plugins.evaluator import Evaluation, Evaluator
from lingjing.plugins.policy import Brief, Inbox, Observation, Privileged
from lingjing.processes.signals import deferring_signals
from lingjing.scene.city import City
from lingjing.trace.digest import START, next_digest, next_frames_digest
from lingjing.trace.records import (
    Absent,
    AdjudicatedEvent,
    BoundaryRecord,
    Command,
    DecisionRecord,
    Envelope,
    Receipt,
    TaskEvent,
)
from lingjing.trace.request_ids import is_request_of, request_id

KERNEL: Literal["kernel"] = "kernel"
"""The sender of the kernel's own commands. Their receipts name hidden entities, so no agent receives them."""

Recorder = Callable[[BoundaryRecord, Sequence[StoredFrame]], None]
"""The recorder R: receives every committed boundary with its pictures."""


class KernelState(msgspec.Struct, frozen=True):
    """The state that changes from boundary to boundary, as one value."""

    registry: Registry
    """G, the shared state."""
    bus: Bus = field(default_factory=Bus)
    """B, the messages in transit."""
    unlocks: tuple[tuple[str, str], ...] = ()
    """(interaction, entity) pairs that the last adjudication allowed; the next step sends them to the engines."""
    adjudicated: tuple[AdjudicatedEvent, ...] = ()
    """Events of the last adjudication; the next observations show them."""
    digest: str = START
    """Chained digest of all boundary records so far."""
    frames_digest: str = START
    """Chained digest of all pictures so far."""
    evaluation: Evaluation = field(default_factory=lambda: Evaluation(0.0, False))
    """Score and termination at the last boundary."""
    scr: float = 0.0
    """Subtask completion rate at the last boundary, 0 to 1."""


Transit = Callable[[int, tuple[Envelope, ...]], tuple[Envelope, ...]]
"""A transformation of admitted edges: receives a boundary and its edges, returns the edges to stage. Branches set
it.
"""


class Published(msgspec.Struct, frozen=True):
    """The boundary output (O_t, I_t, V_t, r_t, d_t) with its record."""

    observations: Mapping[str, Observation]
    """The observation of each agent."""
    inboxes: Mapping[str, Inbox]
    """The inbox of each agent."""
    evaluation: Evaluation
    """Score and termination."""
    record: BoundaryRecord
    """The boundary record that was logged."""
    truths: Mapping[str, Privileged] = field(default_factory=dict)
    """The ground truth of referenced agents, from which a caller computes reference decisions. No policy and no record
    holds it.
    """


class _Inputs(msgspec.Struct, frozen=True):
    """The results of the agent phase, after validation, for the commit of a boundary."""

    decisions: tuple[DecisionRecord, ...] = ()
    """The policy outputs, copied and made plain."""
    resolved: Resolution = field(default_factory=Resolution)
    """Admitted commands and receipts of the command validator."""
    own: tuple[Command, ...] = ()
    """The kernel's own commands."""
    envelopes: tuple[Envelope, ...] = ()
    """Admitted edges of messages."""
    reports: tuple[Report, ...] = ()
    """Admitted messages as values that rules range over."""
    receipts: tuple[Receipt, ...] = ()
    """Receipts of the bus, the validator and substituted decisions."""
    progress: EpisodeProgress = field(default_factory=EpisodeProgress)
    """Counts with the consumption of this tick."""
    started: float = field(default_factory=time.perf_counter)
    """`time.perf_counter()` at the start of the step, for the record's wall time."""


Pictures = tuple[StoredFrame | Absent, ...]
"""The pictures of a boundary, one answer per request."""


class Kernel:
    """W for one episode. Raises `InfrastructureError` where the algorithm returns an infrastructure abort."""

    def __init__(
        self,
        instance: Instance,
        city: City,
        world: World,
        *,
        privileged: frozenset[str] = frozenset(),
        evaluators: Sequence[Evaluator[RuntimeContext]] = (),
        record: Recorder | None = None,
        blank_pictures: bool = False,
        swapped: SwappedPictures | None = None,
        policy_seed: int = 0,
        referenced: frozenset[str] = frozenset(),
    ) -> None:
        """`privileged`: agents with the ground truth in their observations. `referenced`: agents with a ground truth
        that is published beside their observations. `swapped`: the pictures that agents receive in place of their own.
        """
        check_playable(instance)
        self.instance = instance
        self.world = world
        self._city = city
        self._privileged = privileged
        self._referenced = referenced
        self._record = record
        self.transit: Transit | None = None
        self.removed_ids: frozenset[str] = frozenset()
        self._blank = blank_pictures
        self._swapped = swapped
        self._router = MessageRouter(instance)
        self._validator = CommandValidator(instance, city)
        self._adjudicator = Adjudicator(instance, lambda: city)
        self._projector = Projector(instance, policy_seed, city)
        self._subtasks = Subtasks(instance, self._adjudicator)
        self._budgets = Budgets(instance)
        self._claims = Claims(instance)
        self._radio = ChangingRadio(instance)
        self._inspections = Inspections(instance)
        self._mission_events = MissionEvents(instance)
        self._reference_pictures = ReferencePictures(instance)
        self._evaluators = tuple(evaluators) or (MissionEvaluator(instance),)
        self.state = KernelState(registry=initial(instance))

    def reset(self) -> Published:
        """Lines 1 to 19: reset every engine, commit and publish boundary 0."""
        self.state = KernelState(registry=initial(self.instance))
        return self._commit(self.world.reset(self.instance, self._city), _Inputs())

    def step(self, decisions: Sequence[DecisionRecord]) -> Published:
        """Lines 28 to 53: take the collected policy outputs to the next boundary.

        `decisions` are in declaration order, one for each active agent; missing agents count as no-ops. They are
        copied, so later changes of a caller's or policy's objects have no effect.
        """
        started = time.perf_counter()
        decisions = tuple(normalise_decision(made) for made in decisions)
        registry, tick = self.state.registry, self.state.registry.tick + 1
        tally = self._budgets.tally(registry)
        envelopes, about_messages = self._router.expand(  # line 29: ValidateAndExpand
            [(made.agent, made.decision.messages) for made in decisions],
            tick,
            registry.frames,
            tally,
            registry.unreachable_links,
            self.removed_ids,
            self._radio.at(registry),
        )
        if self.transit is not None:
            envelopes = self.transit(tick, envelopes)
        resolved = self._validator.resolve(  # line 30: ValidateAndResolve
            [(made.agent, made.decision.command) for made in decisions],
            registry,
            tick,
            tally=tally,
            at=self._adjudicator.context_at(registry, registry.states, registry.time_s),
        )
        progress = self._budgets.spend(tally.applied_to(registry.progress), decisions)
        self.state = replace(self.state, bus=self.state.bus.stage(envelopes))  # line 31
        motion = tuple(command for command in resolved.commands if command.verb != PHOTO)
        reports, progress = self._claims.admit(_reports(decisions, about_messages), progress)
        own = self._own_commands(tick, reports)
        boundary = self.world.step(tick, own + motion, registry.occurrences)  # lines 32 to 42
        receipts = about_messages + resolved.receipts + substitutions(decisions, tick, registry.time_s)
        return self._commit(
            boundary, _Inputs(decisions, resolved, own, envelopes, reports, receipts, progress, started)
        )

    def fork(self, record: Recorder | None = None) -> Kernel:
        """Return a kernel that continues independently from this boundary, with forked engines and its own recorder."""
        other = Kernel.__new__(Kernel)
        other.__dict__.update(self.__dict__)
        other.world = self.world.fork()
        other._record = record
        return other

    def exhausted(self) -> dict[str, str]:
        """Return the agents that have spent their allowances, with the reason. They are not called any more."""
        return self._budgets.exhausted(self.state.registry.progress, [agent.id for agent in self.instance.agents])

    def _own_commands(self, tick: int, reports: Sequence[Report]) -> tuple[Command, ...]:
        """Return the kernel's own commands: interactions that the last boundary allowed, and requested routes."""
        wanted: list[tuple[str, str, dict[str, Datum]]] = [
            (entity, f"{UNLOCK}{interaction}", {}) for interaction, entity in self.state.unlocks
        ]
        for asset, verb, (east, north) in self._inspections.route_requests(tick, reports):
            wanted.append((asset, verb, {"x": east, "y": north}))
        return tuple(
            Command(
                id=request_id("kernel command", tick, number),
                tick=tick,
                sender=KERNEL,
                resource=resource,
                verb=verb,
                arguments=arguments,
                origin=KERNEL,
            )
            for number, (resource, verb, arguments) in enumerate(wanted, 1)
        )

    def _commit(self, boundary: WorldBoundary, inputs: _Inputs) -> Published:
        before = self.state.registry
        bus, delivered = self.state.bus.commit().deliver(boundary.tick)  # line 43
        answers, shown = self._capture(boundary, inputs.resolved.commands, before)
        frames = tuple(answer for answer in answers if isinstance(answer, StoredFrame))
        receipts = inputs.receipts + self._engine_receipts(boundary, inputs, answers)  # lines 44 and 45
        inboxes = self._inboxes(delivered, receipts)  # lines 46 and 47
        registry = self._update(before, boundary, inputs, receipts, frames)  # line 48: Update
        verdict = self._adjudicator.adjudicate(before, registry, boundary.snapshots)  # line 50: Adjudicate
        latched, occurred = self._mission_events.occur(verdict.registry, self._adjudicator.context_of)
        happened = occurred + boundary.events
        # Line 49 (ProjectVisible): observations show the events of this boundary, but no verdict of it.
        seen = replace(registry, occurrences=latched.occurrences) if occurred else registry
        observations, truths = self._observe(seen, happened, shown, _last_step(before, boundary))
        standing = self._adjudicator.context_at(latched, latched.states, latched.time_s)
        evaluation = combine([each.evaluate(standing, verdict.events) for each in self._evaluators])  # line 51
        record = self._draft(
            boundary, happened, inputs, receipts, frames, verdict, latched, evaluation, observations, inboxes
        )
        digest = next_digest(self.state.digest, record)
        record = _with_digest(record, digest, inputs.started)
        state = KernelState(
            registry=latched,
            bus=bus,
            unlocks=verdict.unlocks,
            adjudicated=verdict.events,
            digest=digest,
            frames_digest=next_frames_digest(self.state.frames_digest, record.frames),
            evaluation=evaluation,
            scr=record.scr,
        )
        self._log(state, record, frames)  # line 52: Log
        return Published(observations, inboxes, evaluation, record, truths)

    def _log(self, state: KernelState, record: BoundaryRecord, frames: Sequence[StoredFrame]) -> None:
        """Store the new state and hand it to the recorder. No signal interrupts between the two: a trace must hold its
        outcome.
        """
        if self._record is None:
            self.state = state
            return
        with deferring_signals():
            self.state = state
            self._record(record, frames)

    def _capture(
        self, boundary: WorldBoundary, commands: Sequence[Command], before: Registry
    ) -> tuple[Pictures, Pictures]:
        """Return the pictures of a boundary, and those that agents receive."""
        wanted = pictures.requests(self.instance, commands, boundary.tick, boundary.time_s)
        wanted += self._reference_pictures.requests(boundary.tick, boundary.time_s)
        now = boundary.snapshots[-1]
        answers: Pictures = ()
        if wanted:
            answers = self.world.capture(boundary.tick, wanted, now.states + now.ambient, before.occurrences)
        return answers, answers if self._swapped is None else self._swapped.take(boundary.tick, wanted, now.states)

    def _engine_receipts(
        self, boundary: WorldBoundary, inputs: _Inputs, answers: Sequence[StoredFrame | Absent]
    ) -> tuple[Receipt, ...]:
        """C^E: admission receipts, later receipts of long requests, and receipts of pictures.

        A missing admission receipt counts as timed out (lines 35 to 38).
        """
        commands = inputs.resolved.commands
        if not (commands or boundary.missing or boundary.admissions):
            return boundary.receipts
        sent = {command.id: command for command in inputs.own + commands}
        missing = tuple(
            sent[name].receipt(
                "kernel", "timed_out", boundary.time_s, "no_receipt", "the engine gave no admission receipt"
            )
            for name in boundary.missing
        )
        photos = pictures.receipts(commands, answers, self.instance, boundary.time_s)
        admissions = tuple(_clipped(receipt, inputs.resolved.clipped) for receipt in boundary.admissions + missing)
        return admissions + boundary.receipts + photos

    def _inboxes(self, delivered: Sequence[Envelope], receipts: Sequence[Receipt]) -> dict[str, Inbox]:
        """DeliveredTo and VisibleReceiptsFor: the inbox of each agent.

        An agent receives the messages addressed to it. It receives the receipts of its own requests, of all requests or
        of none, as the mission's `comms` declare. Every recipient gets its own copy of a body, so that changes reach
        neither peers nor the adjudicator.
        """
        shown = self.instance.comms.receipts
        answers = [
            self._projector.redacted(receipt)
            for receipt in receipts
            if shown != "none" and not is_request_of("kernel command", receipt.request)
        ]
        return {
            agent.id: Inbox(
                messages=tuple(
                    msgspec.structs.replace(edge, body=dict(edge.body))
                    for edge in delivered
                    if edge.recipient == agent.id
                ),
                receipts=tuple(receipt for receipt in answers if shown == "all" or receipt.sender == agent.id),
            )
            for agent in self.instance.agents
        }

    def _update(
        self,
        registry: Registry,
        boundary: WorldBoundary,
        inputs: _Inputs,
        receipts: Sequence[Receipt],
        frames: Sequence[StoredFrame],
    ) -> Registry:
        update = RegistryUpdate(
            tick=boundary.tick,
            time_s=boundary.time_s,
            states=boundary.snapshots[-1].states,
            unreachable_links=boundary.unreachable_links,
            progress=inputs.progress,
            agent_commands=inputs.resolved.commands,
            kernel_commands=inputs.own,
            missing=boundary.missing,
            receipts=receipts,
            events=boundary.events,
            routes=boundary.routes,
            frames=[frame.info for frame in frames],
            reports=inputs.reports,
            messages=inputs.envelopes,
        )
        return self._inspections.advance(registry, update_registry(registry, update, self.instance), boundary.snapshots)

    def _observe(
        self,
        registry: Registry,
        happened: Sequence[TaskEvent],
        answers: Sequence[StoredFrame | Absent],
        motion: Motion | None,
    ) -> tuple[dict[str, Observation], dict[str, Privileged]]:
        frames = [answer for answer in answers if isinstance(answer, StoredFrame)]
        shown = [pictures.policy_picture(frame, blank=self._blank) for frame in frames]
        absent = [answer for answer in answers if isinstance(answer, Absent)]
        at = self._adjudicator.context_at(registry, registry.states, registry.time_s)
        out, truths = {}, {}
        for agent in self.instance.agents:
            observation = self._projector.observe(
                agent,
                registry,
                pictures=shown,
                absent=absent,
                task_events=happened,
                adjudicated=self.state.adjudicated,
                motion=motion,
            )
            revealed = self._reference_pictures.pictures_for(agent, shown)
            missed = self._reference_pictures.absent_for(agent, absent)
            if revealed or missed:
                observation = dataclasses.replace(
                    observation, pictures=observation.pictures + revealed, absent=observation.absent + missed
                )
            if agent.id in self._privileged or agent.id in self._referenced:
                mine = {picture.frame for picture in observation.pictures}
                truth = self._projector.privileged(
                    registry,
                    [frame.info for frame in frames if frame.info.id in mine],
                    forbidden=self._validator.forbidden(at),
                    city=self._city,
                )
                if agent.id in self._privileged:
                    observation = dataclasses.replace(observation, privileged=truth)
                if agent.id in self._referenced:
                    truths[agent.id] = truth
            out[agent.id] = observation
        return out, truths

    def _draft(
        self,
        boundary: WorldBoundary,
        happened: tuple[TaskEvent, ...],
        inputs: _Inputs,
        receipts: Sequence[Receipt],
        frames: Sequence[StoredFrame],
        verdict: Verdict,
        latched: Registry,
        evaluation: Evaluation,
        observations: Mapping[str, Observation],
        inboxes: Mapping[str, Inbox],
    ) -> BoundaryRecord:
        infos = {frame.info.id: frame.info for frame in frames}
        return BoundaryRecord(
            tick=boundary.tick,
            time_s=boundary.time_s,
            snapshots=boundary.snapshots,
            engines=boundary.engines,
            task_events=happened,
            frames=tuple(infos.values()),
            observations=tuple(
                observation_record(observations[agent.id], inboxes[agent.id], infos, blank=self._blank)
                for agent in self.instance.agents
            ),
            inboxes=tuple(inbox_record(agent.id, inboxes[agent.id]) for agent in self.instance.agents),
            decisions=inputs.decisions,
            commands=inputs.own + inputs.resolved.commands,
            messages=inputs.envelopes,
            receipts=tuple(receipts),
            events=verdict.events,
            stages=verdict.stages,
            reward=evaluation.reward,
            done=evaluation.done,
            scr=self._subtasks.share(latched),
            routes=boundary.routes,
            unreachable_links=boundary.unreachable_links,
        )

    def briefs(self) -> dict[str, Brief]:
        """Return the brief of every agent. Its `classes` are the types of all entities."""
        classes = tuple(dict.fromkeys(entity.type for entity in self.instance.entities))
        return {agent.id: self._projector.brief(agent, classes) for agent in self.instance.agents}


def _reports(decisions: Sequence[DecisionRecord], receipts: Sequence[Receipt]) -> tuple[Report, ...]:
    """Return the admitted messages as rules range over them. The router issues one receipt per candidate, in order."""
    candidates = [(made.agent, message) for made in decisions for message in made.decision.messages]
    return tuple(
        Report(receipt.request, message.kind, sender, receipt.tick, message.body)
        for (sender, message), receipt in zip(candidates, receipts, strict=True)
        if receipt.status == "accepted"
    )


def _clipped(receipt: Receipt, clipped: Mapping[str, str]) -> Receipt:
    """Return an engine's receipt with a note on arguments that the kernel clipped before submission."""
    note = clipped.get(receipt.request)
    if note is None:
        return receipt
    detail = f"{receipt.detail} ({note})" if receipt.detail else note
    return msgspec.structs.replace(receipt, reason=receipt.reason or "clipped", detail=detail)


def _last_step(before: Registry, boundary: WorldBoundary) -> Motion | None:
    """Return the last macro-step before a boundary; None at boundary 0."""
    if not before.states:
        return None
    last = boundary.snapshots[-1]
    after = {state.id: state for state in last.states}
    if len(boundary.snapshots) == 1:
        return Motion(before.states, after, last.time_s - before.time_s)
    earlier = boundary.snapshots[-2]
    return Motion({state.id: state for state in earlier.states}, after, last.time_s - earlier.time_s)


def _with_digest(record: BoundaryRecord, digest: str, started: float) -> BoundaryRecord:
    return msgspec.structs.replace(record, digest=digest, wall_s=time.perf_counter() - started)
