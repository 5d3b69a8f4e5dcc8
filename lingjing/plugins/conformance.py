"""The conformance kit: what every engine and every policy promises, as checks that anybody can run on theirs.

In a test of your own plug-in:

    case = EngineCase(plugin, instance, city, commands=(…))

    @pytest.mark.parametrize("check", ENGINE_CHECKS, ids=check_name)
    def test_engine(check): check(case)

or `check_engine(plugin, instance, city, …)` for all at once. Each check makes engines of its own from the plug-in's
factory, raises `ConformanceError` with one sentence, and needs nothing but the contract of `lingjing.plugins.engine`.
The commands of a case should be admissible ones that take a while; they are submitted at time 0.
"""

from __future__ import annotations

import asyncio
import hashlib
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from lingjing.errors import PluginError
from lingjing.mission.instance import CameraSpec, Entity, Instance
from lingjing.plugins.engine import Boundary, CaptureRequest, Engine, EnginePlugin, EngineSpec, Frame
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, PolicyPlugin
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt

CaseT = TypeVar("CaseT")

UNKNOWN_VERB = "conformance.noSuchVerb"
UNKNOWN_RESOURCE = "conformance.no_such_resource"


class ConformanceError(PluginError):
    """A plug-in breaks its contract; the message says where and how."""


@dataclass(frozen=True, slots=True)
class EngineCase:
    """What an engine is tried on: an instance with entities of its own, a city, commands it should admit, bodies of
    other engines as mirrors, and for how many seconds."""

    plugin: EnginePlugin
    instance: Instance
    city: City
    commands: tuple[Command, ...] = ()
    mirrors: tuple[BodyState, ...] = ()
    seed: int = 1
    seconds: float = 20.0

    @property
    def owned(self) -> tuple[Entity, ...]:
        """The entities that the engine owns in this case."""
        return tuple(entity for entity in self.instance.entities if entity.engine == self.plugin.name)

    @property
    def spec(self) -> EngineSpec:
        """What the engine is reset with."""
        return EngineSpec(
            engine=self.plugin.name, instance=self.instance, owns=tuple(entity.id for entity in self.owned)
        )

    def times(self) -> tuple[float, ...]:
        """The boundaries to advance to: every macro-step up to `seconds`; sensors go by whole ticks."""
        step = self.instance.clock.tick_s if self.plugin.sensor else self.instance.clock.sync_s
        return tuple(step * number for number in range(1, round(self.seconds / step) + 1))


@dataclass(slots=True)
class Run:
    """All that an engine answered in one run of a case."""

    ready: Boundary
    admissions: tuple[Receipt, ...] = ()
    boundaries: list[Boundary] = field(default_factory=list)


def check_engine(
    plugin: EnginePlugin,
    instance: Instance,
    city: City,
    commands: Sequence[Command] = (),
    *,
    mirrors: Sequence[BodyState] = (),
    seed: int = 1,
    seconds: float = 20.0,
) -> None:
    """Run every check; one `ConformanceError` tells all that failed."""
    case = EngineCase(plugin, instance, city, tuple(commands), tuple(mirrors), seed, seconds)
    _all(f"engine `{plugin.name}`", ENGINE_CHECKS, case)


def check_ready(case: EngineCase) -> None:
    """`reset` answers with every owned entity at time 0, where the instance puts it, and nothing else."""
    with _engine(case) as engine:
        ready = engine.reset(case.spec, case.city, case.seed)
    _boundary(case, ready, 0.0)
    _require(not ready.receipts and not ready.events, "reset: receipts or events before anything happened")
    for entity, state in zip(case.owned, ready.states, strict=True):
        away = math.dist(entity.position[:2], state.position[:2])
        _require(away < 0.01, f"reset: `{entity.id}` stands {away:.2f} m away from where the instance puts it")


def check_admission(case: EngineCase) -> None:
    """`submit` answers each command once, in order, with `accepted` or `rejected`."""
    with _engine(case) as engine:
        engine.reset(case.spec, case.city, case.seed)
        receipts = tuple(engine.submit(case.commands))
        _require(engine.submit(()) == (), "submit: receipts for no commands")
    _require(len(receipts) == len(case.commands), f"submit: {len(receipts)} receipts, {len(case.commands)} commands")
    for command, receipt in zip(case.commands, receipts, strict=True):
        _echo("submit", case, command, receipt)
        _require(receipt.status in ("accepted", "rejected"), f"submit: {command.id} is `{receipt.status}`")
        _require(receipt.status == "accepted" or receipt.reason != "", f"submit: {command.id} rejected with no reason")


def check_refusals(case: EngineCase) -> None:
    """A verb that nobody has and a resource that the engine does not own are rejected with a reason."""
    strange = [
        Command(id="c0-901", tick=0, sender="conformance", resource=owned.id, verb=UNKNOWN_VERB)
        for owned in case.owned[:1]
    ]
    strange.append(Command(id="c0-902", tick=0, sender="conformance", resource=UNKNOWN_RESOURCE, verb=UNKNOWN_VERB))
    with _engine(case) as engine:
        engine.reset(case.spec, case.city, case.seed)
        receipts = tuple(engine.submit(strange))
    _require(len(receipts) == len(strange), f"submit: {len(receipts)} receipts, {len(strange)} commands")
    for command, receipt in zip(strange, receipts, strict=True):
        what = f"`{command.verb}` for `{command.resource}`"
        _require(receipt.status == "rejected", f"submit: {what} is `{receipt.status}` instead of rejected")
        _require(receipt.reason != "", f"submit: {what} is rejected with no reason")


def check_advance(case: EngineCase) -> None:
    """`advance` reaches the time asked for, with every owned entity and events of that interval only."""
    run, start = _play(case), 0.0
    for until, boundary in zip(case.times(), run.boundaries, strict=True):
        _boundary(case, boundary, until)
        for event in boundary.events:
            inside = start - 1e-9 <= event.time_s <= until + 1e-9
            _require(inside, f"advance: event `{event.kind}` at {event.time_s} s, outside of {start}..{until} s")
            _require(bool(event.entities), f"advance: event `{event.kind}` names no entity")
        start = until


def check_receipts(case: EngineCase) -> None:
    """Receipts after admission belong to accepted requests, end once, and say `running` once a call at most."""
    run = _play(case)
    commands = {command.id: command for command in case.commands}
    live = {receipt.request for receipt in run.admissions if receipt.status == "accepted"}
    start = 0.0
    for until, boundary in zip(case.times(), run.boundaries, strict=True):
        seen: set[str] = set()
        for receipt in boundary.receipts:
            what = f"advance: receipt `{receipt.status}` of {receipt.request}"
            _require(receipt.request in live, f"{what}: the request is unknown, was not accepted or has ended")
            _echo("advance", case, commands[receipt.request], receipt)
            _require(receipt.status in ("running", "completed", "rejected"), f"{what} may not come from here")
            _require(start - 1e-9 <= receipt.time_s <= until + 1e-9, f"{what} at {receipt.time_s} s, not in this call")
            _require(receipt.progress is None or 0.0 <= receipt.progress <= 1.0, f"{what}: progress is not in 0..1")
            _require(receipt.status != "rejected" or receipt.reason != "", f"{what} has no reason")
            if receipt.status == "running":
                _require(receipt.request not in seen, f"{what} twice in one call")
                seen.add(receipt.request)
            else:
                live.discard(receipt.request)
        start = until


def check_preemption(case: EngineCase) -> None:
    """`stop` ends a pending request as `rejected: preempted`; tried on entities that have the verb."""
    stoppable = {entity.id for entity in case.owned if any(verb.name == "stop" for verb in entity.verbs)}
    for command in case.commands:
        if command.resource in stoppable and command.verb != "stop":
            _preempt(case, command)


def check_repeatable(case: EngineCase) -> None:
    """Same inputs, same answers: in a second engine, and in the first one after another reset."""
    with _engine(case) as engine:
        first = _digest(_drive(engine, case))
        again = _digest(_drive(engine, case))
    _require(first == again, "an engine that is reset a second time answers differently")
    _require(first == _digest(_play(case)), "two engines with the same inputs answer differently")


def check_values(case: EngineCase) -> None:
    """Boundaries survive the way between processes (msgpack) unchanged."""
    run = _play(case)
    for boundary in (run.ready, *run.boundaries):
        packed = msgspec.msgpack.encode(boundary)
        _require(msgspec.msgpack.decode(packed, type=Boundary) == boundary, "a boundary changes when it is packed")


def check_fork(case: EngineCase) -> None:
    """An engine of a world process goes on identically in a fork of its process."""
    if case.plugin.place != "world" or not hasattr(os, "fork"):
        return
    times = case.times()
    half = len(times) // 2
    with _engine(case) as engine:
        engine.reset(case.spec, case.city, case.seed)
        engine.submit(case.commands)
        for until in times[:half]:
            engine.advance(until, case.mirrors)
        forked = _in_fork(lambda: _rest(engine, case, times[half:]))
        _require(forked == _rest(engine, case, times[half:]), "a forked engine answers differently from its parent")


def check_capture(case: EngineCase) -> None:
    """`capture` returns one picture a request, in order, as declared; an engine without sensors returns ()."""
    mounts = [(entity, camera) for entity in case.instance.entities for camera in entity.cameras]
    with _engine(case) as engine:
        engine.reset(case.spec, case.city, case.seed)
        until = case.times()[0]
        engine.advance(until, case.mirrors)
        requests = tuple(
            CaptureRequest(
                frame=f"f1-{entity.id}-{camera.name}", entity=entity.id, camera=camera.name, tick=1, time_s=until
            )
            for entity, camera in mounts
        )
        frames = engine.capture(requests) if case.plugin.sensor else engine.capture(())
    _require(len(frames) == (len(requests) if case.plugin.sensor else 0), f"capture: {len(frames)} pictures")
    for request, frame, (_, camera) in zip(requests, frames, mounts, strict=False):
        _frame(request, frame, camera)


def check_close(case: EngineCase) -> None:
    """`close` works after a run and on an engine that never came to life."""
    with _engine(case):
        pass
    with _engine(case) as engine:
        engine.reset(case.spec, case.city, case.seed)


ENGINE_CHECKS: tuple[Callable[[EngineCase], None], ...] = (
    check_ready,
    check_admission,
    check_refusals,
    check_advance,
    check_receipts,
    check_preemption,
    check_repeatable,
    check_values,
    check_fork,
    check_capture,
    check_close,
)
"""Every check of an engine, in the order of the contract."""


@dataclass(frozen=True, slots=True)
class PolicyCase:
    """What a policy is tried on. `deterministic` is for policies that promise the same answers for the same inputs
    (a chat model does not); `arguments` are its `--policy-arg` pairs."""

    plugin: PolicyPlugin
    brief: Brief
    observations: tuple[Observation, ...]
    deterministic: bool = True
    arguments: tuple[tuple[str, str], ...] = ()


def check_policy(
    plugin: PolicyPlugin,
    brief: Brief,
    observations: Sequence[Observation] = (),
    *,
    deterministic: bool = True,
    arguments: dict[str, str] | None = None,
) -> None:
    """Run every check of a policy; without observations it is shown three empty ones."""
    shown = tuple(observations) or tuple(
        Observation(agent=brief.agent, tick=tick, time_s=tick * brief.tick_s) for tick in range(3)
    )
    pairs = tuple(sorted((arguments or {}).items()))
    _all(f"policy `{plugin.name}`", POLICY_CHECKS, PolicyCase(plugin, brief, shown, deterministic, pairs))


def check_decisions(case: PolicyCase) -> None:
    """`act` answers with a `Decision` that commands and says only what the brief allows."""
    for decision in _decide(case):
        _require(isinstance(decision, Decision), f"act: a {type(decision).__name__} instead of a Decision")
        _command(case.brief, decision)
        kinds = {message.kind: message for message in case.brief.messages}
        for message in decision.messages:
            _require(
                message.kind in kinds, f"act: a message `{message.kind}`, allowed are {', '.join(kinds) or 'none'}"
            )
            needed = {part.name for part in kinds[message.kind].fields if not part.optional}
            missing = sorted(needed - set(message.body))
            _require(not missing, f"act: a `{message.kind}` without {', '.join(missing)}")
            _require(set(message.to) <= {peer.id for peer in case.brief.peers}, "act: a message to an unknown agent")


def check_same_decisions(case: PolicyCase) -> None:
    """Two objects with one brief and the same observations decide the same."""
    if case.deterministic:
        _require(_decide(case) == _decide(case), "two policies with the same brief and observations decide differently")


POLICY_CHECKS: tuple[Callable[[PolicyCase], None], ...] = (check_decisions, check_same_decisions)
"""Every check of a policy."""


def check_name(check: Callable[..., None]) -> str:
    """A check's short name, for test ids."""
    return check.__name__.removeprefix("check_")


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ConformanceError(message)


def _all(who: str, checks: Iterable[Callable[[CaseT], None]], case: CaseT) -> None:
    faults = []
    for check in checks:
        try:
            check(case)
        except ConformanceError as fault:
            faults.append(f"{check_name(check)}: {fault}")
    if faults:
        raise ConformanceError(
            f"{who} breaks its contract: {'; '.join(faults)}", hint="see lingjing.plugins.conformance"
        )


@contextmanager
def _engine(case: EngineCase) -> Iterator[Engine]:
    engine = case.plugin.factory()
    try:
        yield engine
    finally:
        engine.close()


def _play(case: EngineCase) -> Run:
    with _engine(case) as engine:
        return _drive(engine, case)


def _drive(engine: Engine, case: EngineCase) -> Run:
    run = Run(ready=engine.reset(case.spec, case.city, case.seed), admissions=tuple(engine.submit(case.commands)))
    run.boundaries += [engine.advance(until, case.mirrors) for until in case.times()]
    return run


def _rest(engine: Engine, case: EngineCase, times: Sequence[float]) -> bytes:
    return hashlib.sha256(msgspec.msgpack.encode([engine.advance(until, case.mirrors) for until in times])).digest()


def _digest(run: Run) -> bytes:
    return hashlib.sha256(msgspec.msgpack.encode((run.ready, run.admissions, run.boundaries))).digest()


def _boundary(case: EngineCase, boundary: Boundary, until: float) -> None:
    _require(boundary.engine == case.plugin.name, f"a boundary of `{boundary.engine}`, not `{case.plugin.name}`")
    _require(abs(boundary.time_s - until) < 1e-9, f"a boundary at {boundary.time_s} s instead of {until} s")
    wanted, got = sorted(case.spec.owns), sorted(state.id for state in boundary.states)
    _require(wanted == got, f"the boundary at {until} s has {got} instead of the owned {wanted}")
    for state in boundary.states:
        numbers = (*state.position, *state.velocity, state.heading_deg, state.pitch_deg, state.roll_deg)
        finite = all(math.isfinite(number) for number in (*numbers, *state.resources.values()))
        _require(finite, f"`{state.id}` at {until} s holds a number that is not finite")
        _require(
            0.0 <= state.heading_deg < 360.0, f"`{state.id}` at {until} s: heading {state.heading_deg} not in 0..360"
        )


def _echo(where: str, case: EngineCase, command: Command, receipt: Receipt) -> None:
    got = (receipt.request, receipt.tick, receipt.sender, receipt.resource, receipt.by)
    wanted = (command.id, command.tick, command.sender, command.resource, case.plugin.name)
    _require(got == wanted, f"{where}: a receipt says (request, tick, sender, resource, by) = {got}, not {wanted}")


def _preempt(case: EngineCase, command: Command) -> None:
    stop = Command(id="c0-903", tick=0, sender=command.sender, resource=command.resource, verb="stop")
    first, second = case.times()[:2]
    with _engine(case) as engine:
        engine.reset(case.spec, case.city, case.seed)
        accepted = engine.submit((command,))[0].status == "accepted"
        ended = {r.request for r in engine.advance(first, case.mirrors).receipts if r.status != "running"}
        if not accepted or command.id in ended:
            return  # nothing was pending that could be pre-empted
        _require(engine.submit((stop,))[0].status == "accepted", f"submit: `stop` of {command.id} is not accepted")
        later = [r for r in engine.advance(second, case.mirrors).receipts if r.request == command.id]
    ends = [(receipt.status, receipt.reason) for receipt in later if receipt.status != "running"]
    _require(ends == [("rejected", "preempted")], f"after `stop`, {command.id} ends as {ends}, not rejected: preempted")


def _in_fork(work: Callable[[], bytes]) -> bytes:
    read, write = os.pipe()
    child = os.fork()
    if child == 0:  # the child says its piece and is gone, whatever happens
        try:
            os.write(write, work())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    return answer


def _frame(request: CaptureRequest, frame: Frame, camera: CameraSpec) -> None:
    what, info = f"capture: picture {request.frame}", frame.info
    got = (info.id, info.entity, info.camera, info.tick)
    _require(got == (request.frame, request.entity, request.camera, request.tick), f"{what} answers {got}")
    size = (camera.height, camera.width)
    _require(frame.rgb.shape == (*size, 3) and frame.rgb.dtype == "uint8", f"{what}: rgb is no uint8 {size} picture")
    _require((frame.depth is not None) == ("depth" in camera.channels), f"{what}: depth is not as declared")
    _require((frame.semantic is not None) == ("semantic" in camera.channels), f"{what}: semantic is not as declared")
    _require(frame.depth is None or frame.depth.shape == size, f"{what}: depth has another size")
    _require(frame.semantic is None or frame.semantic.shape == size, f"{what}: semantic has another size")
    for box in info.boxes:
        left, top, right, bottom = box.box
        ordered = 0.0 <= left < right <= 1.0 and 0.0 <= top < bottom <= 1.0
        _require(ordered and box.pixels > 0, f"{what}: the box of `{box.entity}` is {box.box} with {box.pixels} pixels")


def _command(brief: Brief, decision: Decision) -> None:
    command = decision.command
    if command is None:
        return
    resources = {resource.id: resource for resource in brief.resources}
    name = command.resource or next((resource.id for resource in brief.resources if resource.embodied), "")
    _require(name in resources, f"act: a command to `{name}`, which the agent may not command")
    verbs = {verb.name: verb for verb in resources[name].verbs}
    _require(command.verb in verbs, f"act: `{name}` has no verb `{command.verb}`; it has {', '.join(verbs)}")
    known = {argument.name for argument in verbs[command.verb].arguments}
    strange = sorted(set(command.arguments) - known)
    _require(not strange, f"act: `{command.verb}` takes no {', '.join(strange)}")


def _decide(case: PolicyCase) -> list[Decision]:
    async def play() -> list[Decision]:
        policy = case.plugin.factory(**dict(case.arguments))
        await policy.reset(case.brief)
        return [await policy.act(observation, Inbox()) for observation in case.observations]

    with ThreadPoolExecutor(max_workers=1) as worker:  # as in an episode: a thread and a loop of its own
        return worker.submit(lambda: asyncio.run(play())).result()
