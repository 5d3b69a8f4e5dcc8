"""The checks of an engine's commands: admission, rejection, progress, and exactly one end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import msgspec

from lingjing.mission.vocabulary import STOP
from lingjing.plugins.conformance.case import EngineCase, advance, engine_of, of_plugin, play, require, reset
from lingjing.trace.records import Command, Receipt

UNKNOWN_VERB = "conformance.noSuchVerb"
UNKNOWN_RESOURCE = "conformance.no_such_resource"

SENDER = "conformance"


def check_commands(case: EngineCase) -> None:
    """Check that the case's commands are for entities of the engine and for verbs that these have."""
    owned = {entity.id: entity for entity in case.owned}
    for command in case.commands:
        what = f"the case's command {command.id}"
        require(command.resource in owned, f"{what}: the engine owns {', '.join(owned)} and no `{command.resource}`")
        verbs = [verb.name for verb in owned[command.resource].verbs]
        known = command.verb in verbs or command.origin != "agent" or not verbs
        require(known, f"{what}: `{command.resource}` has no verb `{command.verb}`, it has {', '.join(verbs)}")
    with engine_of(case) as engine:
        reset(engine, case)
        receipts = engine.submit(case.commands)
    for receipt in receipts:
        knows = receipt.reason not in ("unknown_verb", "unknown_resource")
        require(knows, f"the case's command {receipt.request} is rejected: {receipt.reason} {receipt.detail}".rstrip())


def check_admission(case: EngineCase) -> None:
    """Check that `submit` returns one `accepted` or `rejected` receipt for each command, in order."""
    with engine_of(case) as engine:
        reset(engine, case)
        receipts = tuple(engine.submit(case.commands))
        require(engine.submit(()) == (), "submit: receipts for no commands")
    require(len(receipts) == len(case.commands), f"submit: {len(receipts)} receipts, {len(case.commands)} commands")
    for command, receipt in zip(case.commands, receipts, strict=True):
        _echo("submit", case, command, receipt)
        require(receipt.status in ("accepted", "rejected"), f"submit: {command.id} is `{receipt.status}`")
        require(receipt.status == "accepted" or receipt.reason != "", f"submit: {command.id} rejected with no reason")


def check_refusals(case: EngineCase) -> None:
    """Check that an unknown verb, a foreign resource and an unknown resource are rejected with a reason."""
    resources = [owned.id for owned in case.owned[:1]]
    resources += [entity.id for entity in case.instance.entities if entity.engine != case.plugin.name][:1]
    strange = [
        Command(id=f"c0-90{number}", tick=0, sender=SENDER, resource=resource, verb=UNKNOWN_VERB)
        for number, resource in enumerate((*resources, UNKNOWN_RESOURCE))
    ]
    # Verbs of own entities, for entities of another engine.
    foreign = resources[1:] if case.owned else []
    strange += [
        msgspec.structs.replace(command, id=f"c0-91{number}", resource=name)
        for number, command in enumerate(case.commands[:1])
        for name in foreign
    ]
    _refused(case, strange)


def check_arguments(case: EngineCase) -> None:
    """Check that arguments that are not finite numbers are rejected with a reason."""
    _refused(case, [spoilt for command in case.commands for spoilt in _spoilt(command)])


def check_busy(case: EngineCase) -> None:
    """Check that a resource with a pending request rejects any other command but `stop` as `busy`.

    The pending request continues as if the command had not been sent.
    """
    first, *rest = case.times()
    with engine_of(case) as engine:
        reset(engine, case)
        engine.submit(case.commands)
        alone = advance(engine, case, 0.0, (first, *rest))
    with engine_of(case) as engine:
        reset(engine, case)
        admitted = {r.request for r in engine.submit(case.commands) if r.status == "accepted"}
        boundaries = advance(engine, case, 0.0, (first,))
        ended = {r.request for r in boundaries[0].receipts if r.status != "running"}
        again = [
            msgspec.structs.replace(command, id=f"c0-92{number}")
            for number, command in enumerate(case.commands)
            if command.id in admitted - ended and command.verb != STOP and command.origin == "agent"
        ]
        for command, receipt in zip(again, engine.submit(again), strict=True):
            what = f"submit: `{command.verb}` for `{command.resource}`, which is busy"
            got = (receipt.status, receipt.reason)
            require(got == ("rejected", "busy"), f"{what}, is {got} instead of rejected: busy")
        boundaries += advance(engine, case, first, rest)
    for before, after in zip(alone, boundaries, strict=True):
        same = before.states == after.states and before.receipts == after.receipts
        require(same, f"a rejected command changed the states at {after.time_s} s")


def check_receipts(case: EngineCase) -> None:
    """Check the receipts after admission.

    They belong to accepted requests and end once. `running` comes at most once a call, with progress that never falls.
    """
    run = play(case)
    commands = {command.id: command for command in case.commands}
    live = {receipt.request for receipt in run.admissions if receipt.status == "accepted"}
    reached: dict[str, float] = {}
    start = 0.0
    for until, boundary in zip(case.times(), run.boundaries, strict=True):
        seen: set[str] = set()
        for receipt in boundary.receipts:
            what = f"advance: receipt `{receipt.status}` of {receipt.request}"
            require(receipt.request in live, f"{what}: the request is unknown, was not accepted or has ended")
            _echo("advance", case, commands[receipt.request], receipt)
            require(receipt.status in ("running", "completed", "rejected"), f"{what} has a wrong status")
            require(start - 1e-9 <= receipt.time_s <= until + 1e-9, f"{what} at {receipt.time_s} s, not in this call")
            require(receipt.status != "rejected" or receipt.reason != "", f"{what} has no reason")
            if receipt.progress is not None:
                require(0.0 <= receipt.progress <= 1.0, f"{what}: progress is not in 0..1")
                fell = receipt.progress < reached.get(receipt.request, 0.0)
                require(not fell, f"{what}: progress fell to {receipt.progress}")
                reached[receipt.request] = receipt.progress
            if receipt.status == "running":
                require(receipt.request not in seen, f"{what} twice in one call")
                seen.add(receipt.request)
            else:
                live.discard(receipt.request)
        start = until


def check_preemption(case: EngineCase) -> None:
    """Check that `stop` ends a pending request as `rejected: preempted`, on entities that have the verb."""
    stoppable = {entity.id for entity in case.owned if any(verb.name == STOP for verb in entity.verbs)}
    for command in case.commands:
        if command.resource in stoppable and command.verb != STOP:
            _preempt(case, command)


def _refused(case: EngineCase, commands: list[Command]) -> None:
    receipts = _submitted(case, commands)
    require(len(receipts) == len(commands), f"submit: {len(receipts)} receipts, {len(commands)} commands")
    for command, receipt in zip(commands, receipts, strict=True):
        what = _worded(command)
        require(receipt.status == "rejected", f"submit: {what} is `{receipt.status}` instead of rejected")
        require(receipt.reason != "", f"submit: {what} is rejected with no reason")


def _submitted(case: EngineCase, commands: list[Command]) -> tuple[Receipt, ...]:
    """Return the receipts of commands at time 0. If `submit` raises, the error names the command for which it does."""
    with engine_of(case) as engine:
        reset(engine, case)
        try:
            return tuple(engine.submit(commands))
        except (Exception, SystemExit):
            for command in commands:
                reset(engine, case)
                of_plugin(f"submit: {_worded(command)}", partial(engine.submit, (command,)))
            raise


def _worded(command: Command) -> str:
    return f"`{command.verb}` {command.arguments or ''} for `{command.resource}`"


def _spoilt(command: Command) -> Iterator[Command]:
    """Return the command with each number replaced by a value that is not a finite number."""
    number = 0
    for name, value in command.arguments.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        for wrong in (math.nan, math.inf, "far"):
            number += 1
            arguments = {**command.arguments, name: wrong}
            yield msgspec.structs.replace(command, id=f"{command.id}-{number}", arguments=arguments)


def _echo(where: str, case: EngineCase, command: Command, receipt: Receipt) -> None:
    got = (receipt.request, receipt.tick, receipt.sender, receipt.resource, receipt.by)
    wanted = (command.id, command.tick, command.sender, command.resource, case.plugin.name)
    require(got == wanted, f"{where}: a receipt has (request, tick, sender, resource, by) = {got}, not {wanted}")


def _preempt(case: EngineCase, command: Command) -> None:
    stop = Command(id="c0-903", tick=0, sender=command.sender, resource=command.resource, verb=STOP)
    first, second = case.times()[:2]
    with engine_of(case) as engine:
        reset(engine, case)
        accepted = engine.submit((command,))[0].status == "accepted"
        (boundary,) = advance(engine, case, 0.0, (first,))
        ended = {r.request for r in boundary.receipts if r.status != "running"}
        if not accepted or command.id in ended:
            return  # no pending request to pre-empt
        require(engine.submit((stop,))[0].status == "accepted", f"submit: `stop` of {command.id} is not accepted")
        (boundary,) = advance(engine, case, first, (second,))
        later = [r for r in boundary.receipts if r.request == command.id]
    ends = [(receipt.status, receipt.reason) for receipt in later if receipt.status != "running"]
    require(ends == [("rejected", "preempted")], f"after `stop`, {command.id} ends as {ends}, not rejected: preempted")


__all__ = [
    "SENDER", "UNKNOWN_RESOURCE", "UNKNOWN_VERB", "check_admission", "check_arguments", "check_busy",
    "check_commands", "check_preemption", "check_receipts", "check_refusals",
]  # fmt: skip
