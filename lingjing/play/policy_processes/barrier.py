"""`ProcessBarrier`: the policy barrier over processes, one for each agent. The player waits for all of them at once.

A call beyond its deadline is cancelled at its next wait. A process is ended with its children if the cancelled call
goes on, if it exits or crashes, or if it sends an invalid answer. Its agent does nothing at that turn. At the next turn
it starts again with the same options, seeds and brief, and without memory of earlier turns.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import msgspec

from lingjing.errors import ForeignCodeError, InfrastructureError, LingjingError
from lingjing.kernel.barrier import Barrier, OutageCheck, PolicyAnswer, failure, no_outage, usage_fault
from lingjing.play.policy_processes.agent_process import MemoryWatch, PolicyProcess
from lingjing.play.policy_processes.messages import (
    BrokerStart,
    CallFailed,
    ClosePolicy,
    DecisionMade,
    LoadPolicy,
    RaisedError,
    ResetPolicy,
    error_of,
    own_failure,
)
from lingjing.play.policy_processes.observations import request_of
from lingjing.play.policy_processes.pictures import PictureSlot, PictureSlots, part_of
from lingjing.play.policy_processes.servers import PolicyServer
from lingjing.play.policy_processes.turns import RequestList, Turn, wait_for, wait_until_ready
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Picture, Usage
from lingjing.processes.deadlines import OwnDeadline, WallDeadline
from lingjing.processes.walls.report import WallReport

LOAD_VARIABLE = "LINGJING_POLICY_LOAD_S"
"""The environment variable that replaces `LOAD_S`."""
LOAD_S = 60.0
"""The longest time to import and build a policy, seconds of its own time. Chosen; a local model's weights may need
more."""

CLOSE_S = 3.0
"""The longest time for the exit functions of all policies together, seconds of wall clock. Chosen."""


@dataclass(frozen=True, slots=True)
class AgentPolicy:
    """The policy of an agent: the request that loads it, and the record of its model calls."""

    load: LoadPolicy
    calls: ModelCalls


class ProcessBarrier(Barrier):
    """The policies of one episode, each in a process that `server` forks."""

    def __init__(
        self,
        policies: Mapping[str, AgentPolicy],
        limit_s: float,
        server: PolicyServer,
        outage_check: OutageCheck = no_outage,
    ) -> None:
        super().__init__(policies, limit_s, outage_check)
        self._policies = dict(policies)
        self._server = server
        self._processes: dict[str, PolicyProcess] = {}  # one for each agent (ADR 0024)
        self._slots = PictureSlots()
        self._briefs: Mapping[str, Brief] = {}
        self._watch = MemoryWatch(self._processes.values()) if server.walls is not None else None

    def load(self) -> None:
        """Start every process and build its policy.

        Raises the first error, in the order of agents, and ends all processes: `ForeignCodeError` if the code of a file
        fails, the process ends, or the time is up.
        """
        try:
            turns = {name: self._turn(name, [(self._policies[name].load, ())]) for name in self._agents}
            for turn in turns.values():
                turn.deadline = OwnDeadline(turn.process.pid, load_limit_s(), watched=True)
            wait_for(turns.values())
            for name, turn in turns.items():
                self._check_loaded(name, turn)
        except BaseException:
            self._end_all()
            raise

    def _check_loaded(self, name: str, turn: Turn) -> None:
        """Raise the error of a policy that was not loaded.

        The error of a file's code is always a `ForeignCodeError`, and an outage counts only if it is confirmed.
        """
        load = self._policies[name].load
        try:
            check_loaded(turn, f"the policy `{load.spec}` of `{name}`")
        except InfrastructureError as error:
            raise self._outage_check(name, error) or own_failure(error) from error
        except LingjingError as error:
            if load.source:
                raise
            raise own_failure(error) from error

    @property
    def wall_reports(self) -> tuple[WallReport, ...]:
        """The reports of the processes behind walls; empty without walls."""
        reports = (process.wall_report for process in self._processes.values())
        return tuple(report for report in reports if report is not None)

    def reset(self, briefs: Mapping[str, Brief]) -> dict[str, PolicyAnswer]:
        """Send every policy its brief. A failure is an answer with a reason."""
        self._briefs = briefs
        return self._collect({name: [(ResetPolicy(brief=briefs[name]), ())] for name in self._agents})

    def close(self) -> None:
        """Let every policy end, and kill those that have not ended after `CLOSE_S`."""
        for process in self._processes.values():
            if process.is_alive:
                process.send(ClosePolicy())
        deadline = WallDeadline(CLOSE_S)
        waiting = [process for process in self._processes.values() if process.is_alive]
        while waiting and (left_s := deadline.left_s()) > 0.0:
            wait_until_ready(waiting, left_s)
            waiting = [process for process in waiting if not _has_closed(process)]
        self._end_all()

    def _call_policies(self, inputs: Mapping[str, tuple[Observation, Inbox]]) -> dict[str, PolicyAnswer]:
        begun = {name: self._restart_requests(name) for name in inputs}
        filled = self._filled({name: observation.pictures for name, (observation, _) in inputs.items()})
        requests = {}
        for name, (observation, inbox) in inputs.items():
            parts = [(part_of(picture, slot, name), slot.descriptor) for picture, slot in filled[name]]
            act = request_of(observation, inbox, tuple(part for part, _ in parts))
            requests[name] = [*begun[name], (act, [descriptor for part, descriptor in parts if part.is_new])]
        return {name: self._billed(name, answer) for name, answer in self._collect(requests).items()}

    def _billed(self, name: str, answer: PolicyAnswer) -> PolicyAnswer:
        """Return the answer with the usage of the calls that a broker has made, whatever the policy claims of it.

        Budgets and costs follow from the usage.
        """
        if not self._policies[name].load.brokered:
            return answer
        bill = self._processes[name].bill()
        claimed = answer.value.usage if isinstance(answer.value, Decision) else answer.usage
        if not bill.calls and claimed is None:
            return answer
        known = claimed if claimed is not None and not usage_fault(claimed) else Usage()
        usage = msgspec.structs.replace(
            bill, answers=known.answers, valid_answers=known.valid_answers, unread_boxes=known.unread_boxes
        )
        if isinstance(answer.value, Decision):
            return replace(answer, value=msgspec.structs.replace(answer.value, usage=usage))
        return replace(answer, usage=usage)

    def _filled(self, seen: Mapping[str, Sequence[Picture]]) -> dict[str, list[tuple[Picture, PictureSlot]]]:
        """Return each agent's pictures with their slots. A picture that several agents see has one slot."""
        if self._server.walls is not None:  # a memory that two agents share would be a channel between them
            return {
                name: [(picture, self._slots.fill(picture, (name,))) for picture in pictures]
                for name, pictures in seen.items()
            }
        viewers: dict[int, tuple[str, ...]] = {}
        for name, pictures in seen.items():
            for picture in pictures:
                viewers[id(picture)] = (*viewers.get(id(picture), ()), name)
        each = {id(picture): picture for pictures in seen.values() for picture in pictures}
        slots = {key: self._slots.fill(picture, viewers[key]) for key, picture in each.items()}
        return {name: [(picture, slots[id(picture)]) for picture in pictures] for name, pictures in seen.items()}

    def _collect(self, requests: Mapping[str, RequestList]) -> dict[str, PolicyAnswer]:
        deadline = WallDeadline(self._limit_s)
        turns = {name: self._turn(name, each) for name, each in requests.items()}
        for turn in turns.values():
            turn.deadline = deadline
        wait_for(turns.values())
        for name, turn in turns.items():
            if isinstance(turn.answer, DecisionMade | CallFailed):
                self._slots.release(name, turn.answer.kept)
        return {name: self._answer(name, turn) for name, turn in turns.items()}

    def _restart_requests(self, name: str) -> RequestList:
        """Return the requests that must precede any other for an agent without a process; none if it runs."""
        if name in self._processes and self._processes[name].is_alive:
            return []
        self._slots.forget(name)
        return [(self._policies[name].load, ()), (ResetPolicy(brief=self._briefs[name]), ())]

    def _turn(self, name: str, requests: RequestList) -> Turn:
        process = self._processes.get(name)
        if process is None or not process.is_alive:
            policy = self._policies[name]
            process = PolicyProcess(name, self._server, policy.calls, _broker_of(policy.load))
            self._processes[name] = process
            if self._watch is not None:
                self._watch.begin()
        turn = Turn(process, list(requests), WallDeadline(self._limit_s))
        turn.send_next()
        return turn

    def _answer(self, name: str, turn: Turn) -> PolicyAnswer:
        if turn.is_late:
            return self._timeout_answer()
        match turn.answer:
            case DecisionMade(decision=decision):
                return PolicyAnswer(value=decision, wall_s=turn.wall_s)
            case CallFailed(reason="policy_timeout"):
                return self._timeout_answer()
            case CallFailed(reason=reason, detail=detail, usage=usage):
                return PolicyAnswer(reason=reason, detail=detail, wall_s=turn.wall_s, usage=usage)
            case RaisedError():
                error = error_of(turn.answer)
                detail = turn.answer.detail or failure(error, turn.started).detail
                failed = PolicyAnswer(reason="policy_error", detail=detail, wall_s=turn.wall_s)
                return (
                    self._failure_or_outage(name, error, failed) if isinstance(error, InfrastructureError) else failed
                )
            case None:
                return PolicyAnswer(reason="policy_error", detail=turn.ended, wall_s=turn.wall_s)
        return PolicyAnswer(wall_s=turn.wall_s)

    def _end_all(self) -> None:
        if self._watch is not None:
            self._watch.close()
        for process in self._processes.values():
            process.end()
        self._slots.close()


def _broker_of(load: LoadPolicy) -> BrokerStart | None:
    """Return the start of the broker of a policy's model calls; None if the policy makes them itself."""
    if not load.brokered:
        return None
    return BrokerStart(spec=load.spec, arguments=load.arguments, replaying=load.replaying, capped=load.capped)


def load_limit_s() -> float:
    """Return the longest time to import and build a policy, seconds: `LINGJING_POLICY_LOAD_S`, or `LOAD_S`."""
    with suppress(ValueError):
        limit_s = float(os.environ.get(LOAD_VARIABLE, LOAD_S))
        return limit_s if 0.0 < limit_s < math.inf else LOAD_S
    return LOAD_S


def check_loaded(turn: Turn, what: str, done: str = "loaded") -> None:
    """Raise the error of a policy that was not loaded.

    `what` is the policy in words. `done` is the participle of the failed step, for the message ("loaded").
    """
    if isinstance(turn.answer, RaisedError):
        raise error_of(turn.answer)
    if turn.is_late:
        hint = f"correct what its file or its class does, or give it more time with {LOAD_VARIABLE}=SECONDS"
        raise ForeignCodeError(f"{what} was not {done} within {load_limit_s():g} s", hint=hint)
    if turn.ended:
        hint = "correct what its file or its class does"
        raise ForeignCodeError(f"{what} could not be {done}: {turn.ended}", hint=hint)


def _has_closed(process: PolicyProcess) -> bool:
    """Return True if the process has ended. Messages that it still sends are dropped."""
    try:
        process.receive()
    except EOFError:
        return True
    return False
