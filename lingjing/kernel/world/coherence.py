"""What makes a boundary coherent: the right time, exactly the owned entities, finite numbers, plain values.

Engines may hand over numpy scalars, lists or integers; they are made plain here (`float`, `tuple`) so that the world
in the caller and the world behind a socket report the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from lingjing.kernel.world.calling import broken
from lingjing.plugins.engine import Boundary
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent

TIME_TOLERANCE_S = 1e-6


def _plain_hook(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise NotImplementedError(f"a value of type {type(value).__name__} cannot leave an engine")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_plain_hook)
_STATE = msgspec.msgpack.Decoder(BodyState)
_RECEIPTS = msgspec.msgpack.Decoder(tuple[Receipt, ...])
_EVENTS = msgspec.msgpack.Decoder(tuple[TaskEvent, ...])
_PLAIN_NUMBERS = {float}


def checked_boundary(engine: str, call: str, report: Boundary, until: float, owns: Sequence[str]) -> Boundary:
    """`report` made plain, or `InfrastructureError` if it is not the coherent boundary of `engine` at `until`."""
    try:
        return _checked(engine, call, report, until, owns)
    except (TypeError, AttributeError) as error:
        raise broken(engine, call, f"its boundary is malformed: {error}") from error


def _checked(engine: str, call: str, report: Boundary, until: float, owns: Sequence[str]) -> Boundary:
    if not isinstance(report, Boundary):
        raise broken(engine, call, f"it answered {type(report).__name__}, not a Boundary")
    if report.engine != engine:
        raise broken(engine, call, f"its boundary is signed `{report.engine}`")
    if not abs(report.time_s - until) <= TIME_TOLERANCE_S:
        raise broken(engine, call, f"it stands at {report.time_s!r} s instead of {until!r} s")
    states = {state.id: state for state in report.states}
    _check_ownership(engine, call, [state.id for state in report.states], owns)
    return Boundary(
        engine=engine,
        time_s=until,
        states=tuple(_checked_state(engine, call, states[name]) for name in owns),
        receipts=_plain(engine, call, _RECEIPTS, report.receipts) if report.receipts else (),
        events=_plain(engine, call, _EVENTS, report.events) if report.events else (),
    )


def checked_admissions(engine: str, commands: Sequence[Command], receipts: Sequence[Receipt]) -> dict[str, Receipt]:
    """The admission receipt of each command that has exactly one that is addressed to it.

    A receipt that is missing, doubled, neither `accepted` nor `rejected`, or meant for another sender or resource
    leaves its command out: the kernel records it as timed out and the episode goes on.
    """
    answers: dict[str, list[Receipt]] = {}
    for receipt in _plain(engine, "submit", _RECEIPTS, tuple(receipts)):
        answers.setdefault(receipt.request, []).append(receipt)
    return {
        command.id: found[0]
        for command in commands
        if len(found := answers.get(command.id, [])) == 1 and _answers(found[0], command)
    }


def _answers(receipt: Receipt, command: Command) -> bool:
    addressed = receipt.resource == command.resource and receipt.sender == command.sender
    return addressed and receipt.status in ("accepted", "rejected")


def _check_ownership(engine: str, call: str, reported: Sequence[str], owns: Sequence[str]) -> None:
    if len(reported) == len(owns) and set(reported) == set(owns):
        return
    missing = [name for name in owns if name not in reported]
    foreign = [name for name in reported if name not in owns]
    doubled = sorted({name for name in reported if reported.count(name) > 1})
    parts = [("without", missing), ("with foreign", foreign), ("with doubled", doubled)]
    raise broken(engine, call, "its boundary comes " + ", ".join(f"{w} {', '.join(n)}" for w, n in parts if n))


def _checked_state(engine: str, call: str, state: BodyState) -> BodyState:
    try:
        numbers = _numbers(state)
        plain = {*map(type, numbers)} == _PLAIN_NUMBERS and _is_shaped(state)
    except TypeError:
        plain = False
    if not plain:
        state = _plain(engine, call, _STATE, state)
        numbers = _numbers(state)
    # One test for all: a sum is finite only if every term is (no coordinate comes near the largest float).
    if not math.isfinite(sum(numbers)):
        raise broken(engine, call, f"entity `{state.id}` has a number that is not finite: {state}")
    return state


def _numbers(state: BodyState) -> tuple[float, ...]:
    angles = (state.heading_deg, state.pitch_deg, state.roll_deg)
    return (*state.position, *state.velocity, *angles, *state.resources.values())


def _is_shaped(state: BodyState) -> bool:
    vectors = (state.position, state.velocity)
    return all(type(v) is tuple and len(v) == 3 for v in vectors) and type(state.status) is str


def _plain(engine: str, call: str, decoder: msgspec.msgpack.Decoder[Any], value: object) -> Any:
    try:
        return decoder.decode(_ENCODER.encode(value))
    except (msgspec.ValidationError, NotImplementedError, TypeError, OverflowError) as error:
        raise broken(engine, call, f"its answer is malformed: {error}") from error
