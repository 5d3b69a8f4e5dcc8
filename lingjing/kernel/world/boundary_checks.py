"""Validation of engine boundaries: time, owned entities, finite numbers, plain values, distinct background movers.

Engines may return numpy scalars, lists or integers. They are converted here (`float`, `tuple`), so that a world in the
caller and a world behind a socket report the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from itertools import chain
from typing import Any

import msgspec
import numpy as np

from lingjing.decoding import MsgpackDecoder, msgpack_decoder
from lingjing.kernel.world.guarded_calls import engine_error
from lingjing.plugins.engine import Boundary
from lingjing.trace.records import BodyState, Command, Receipt, Route, TaskEvent

TIME_TOLERANCE_S = 1e-6
"""Largest deviation in seconds between the requested and the reported time. Chosen: above the rounding of summed
steps.
"""


def _plain_hook(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise NotImplementedError(f"an engine cannot return a value of type {type(value).__name__}")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_plain_hook)
_STATE = msgpack_decoder(BodyState)
_RECEIPTS = msgpack_decoder(tuple[Receipt, ...])
_EVENTS = msgpack_decoder(tuple[TaskEvent, ...])
_ROUTES = msgpack_decoder(tuple[Route, ...])
_PAIRS = msgpack_decoder(tuple[tuple[str, str], ...])
_PLAIN_NUMBERS = {float}


def checked_boundary(
    engine: str,
    call: str,
    report: Boundary,
    until: float,
    owns: Sequence[str],
    entities: Container[str] = frozenset(),
) -> Boundary:
    """Return `report` in plain values. Raises `InfrastructureError` if it is not a valid boundary of `engine` at
    `until` (s).

    `owns` are the ids of the engine's entities in order. `entities` are the ids of all entities: background movers must
    not have one of them, unreachable pairs must consist of them.
    """
    try:
        return _checked(engine, call, report, until, owns, entities)
    except (TypeError, AttributeError) as error:
        raise engine_error(engine, call, f"its boundary is malformed: {error}") from error


def check_apart(ambient: Mapping[str, Sequence[BodyState]]) -> None:
    """Raise `InfrastructureError` if two engines (the keys of `ambient`) have a background mover with the same id."""
    if len(ambient) < 2:
        return
    owner: dict[str, str] = {}
    for name, movers in sorted(ambient.items()):
        for mover in movers:
            first = owner.setdefault(mover.id, name)
            if first != name:
                raise engine_error(name, "advance", f"its background mover `{mover.id}` is already one of `{first}`")


def _checked(
    engine: str, call: str, report: Boundary, until: float, owns: Sequence[str], entities: Container[str]
) -> Boundary:
    if not isinstance(report, Boundary):
        raise engine_error(engine, call, f"it returned {type(report).__name__}, not a Boundary")
    if report.engine != engine:
        raise engine_error(engine, call, f"its boundary names the engine `{report.engine}`")
    if not abs(report.time_s - until) <= TIME_TOLERANCE_S:
        raise engine_error(engine, call, f"its boundary is at {report.time_s!r} s instead of {until!r} s")
    return Boundary(
        engine=engine,
        time_s=until,
        states=_checked_states(engine, call, _in_order(engine, call, report.states, owns)),
        receipts=_plain(engine, call, _RECEIPTS, report.receipts) if report.receipts else (),
        events=_plain(engine, call, _EVENTS, report.events) if report.events else (),
        routes=_checked_routes(engine, call, report.routes, owns) if report.routes else (),
        ambient=_checked_movers(engine, call, report.ambient, entities) if report.ambient else (),
        unreachable_links=_checked_pairs(engine, call, report.unreachable_links, entities)
        if report.unreachable_links
        else (),
    )


def checked_admissions(engine: str, commands: Sequence[Command], receipts: Sequence[Receipt]) -> dict[str, Receipt]:
    """Return the valid admission receipt of each command.

    A command is left out if its receipt is missing, duplicated, neither `accepted` nor `rejected`, or addressed to
    another sender or resource. The kernel records it as timed out, and the episode continues.
    """
    answers: dict[str, list[Receipt]] = {}
    for receipt in _plain(engine, "submit", _RECEIPTS, tuple(receipts)):
        answers.setdefault(receipt.request, []).append(receipt)
    return {
        command.id: candidates[0]
        for command in commands
        if len(candidates := answers.get(command.id, [])) == 1 and _answers(candidates[0], command)
    }


def _answers(receipt: Receipt, command: Command) -> bool:
    addressed = receipt.resource == command.resource and receipt.sender == command.sender
    return addressed and receipt.status in ("accepted", "rejected")


def _in_order(engine: str, call: str, states: Sequence[BodyState], owns: Sequence[str]) -> Sequence[BodyState]:
    """Return the states of exactly the owned entities, in the order of `owns`."""
    reported = tuple([state.id for state in states])
    if reported == owns:
        return states
    _check_ownership(engine, call, reported, owns)
    by_id = dict(zip(reported, states, strict=True))
    return [by_id[name] for name in owns]


def _check_ownership(engine: str, call: str, reported: Sequence[str], owns: Sequence[str]) -> None:
    if len(reported) == len(owns) and set(reported) == set(owns):
        return
    missing = [name for name in owns if name not in reported]
    foreign = [name for name in reported if name not in owns]
    doubled = sorted({name for name in reported if reported.count(name) > 1})
    parts = [("no", missing), ("foreign", foreign), ("duplicate", doubled)]
    raise engine_error(engine, call, "its boundary has " + ", ".join(f"{w} {', '.join(n)}" for w, n in parts if n))


def _checked_state(engine: str, call: str, state: BodyState) -> BodyState:
    if not _are_plain((state,)):
        state = _plain(engine, call, _STATE, state)
        if not _are_plain((state,)):
            raise engine_error(engine, call, f"entity `{state.id}` has a number that is not finite: {state}")
    return state


def _checked_movers(
    engine: str, call: str, movers: Sequence[BodyState], entities: Container[str]
) -> tuple[BodyState, ...]:
    """Check the background movers all at once: there may be a thousand at each macro-step."""
    ids = [mover.id for mover in movers]
    if len(set(ids)) != len(ids):
        doubled = next(name for name in ids if ids.count(name) > 1)
        raise engine_error(engine, call, f"its background mover `{doubled}` appears twice")
    for name in ids:
        if name in entities:
            raise engine_error(engine, call, f"its background mover `{name}` has the id of an entity")
    return _checked_states(engine, call, movers)


def _checked_states(engine: str, call: str, states: Sequence[BodyState]) -> tuple[BodyState, ...]:
    """Return the states in plain values. They are converted one by one only if the fast check fails."""
    if _are_plain(states):
        return tuple(states)
    return tuple([_checked_state(engine, call, state) for state in states])


def _are_plain(states: Sequence[BodyState]) -> bool:
    """Return whether all states have the expected shapes, Python floats and finite numbers.

    One sum over all numbers suffices: it is finite only if every term is, since no coordinate comes near the largest
    float.
    """
    numbers: list[float] = []
    try:
        for state in states:
            position, velocity = state.position, state.velocity
            words = type(state.id) is type(state.status) is type(state.kind) is str
            vectors = type(position) is type(velocity) is type(state.joints) is tuple
            if not (words and vectors and len(position) == len(velocity) == 3):
                return False
            numbers += position
            numbers += velocity
            numbers += (state.heading_deg, state.pitch_deg, state.roll_deg)
            if state.joints:
                numbers += state.joints
            if state.resources:
                numbers += state.resources.values()
    except (TypeError, AttributeError):
        return False
    return not states or ({*map(type, numbers)} == _PLAIN_NUMBERS and math.isfinite(sum(numbers)))


def _checked_routes(engine: str, call: str, reported: Sequence[Route], owns: Sequence[str]) -> tuple[Route, ...]:
    routes: tuple[Route, ...] = _plain(engine, call, _ROUTES, tuple(reported))
    for route in routes:
        if route.entity not in owns:
            raise engine_error(engine, call, f"it planned a route for `{route.entity}`, which it does not own")
        numbers = (*chain.from_iterable(route.waypoints), route.length_m, route.duration_s, route.time_s)
        if not route.waypoints or not math.isfinite(sum(numbers)):
            raise engine_error(engine, call, f"its route {route.number} of `{route.entity}` is empty or not finite")
    return routes


def _checked_pairs(
    engine: str, call: str, reported: Sequence[tuple[str, str]], entities: Container[str]
) -> tuple[tuple[str, str], ...]:
    pairs: tuple[tuple[str, str], ...] = _plain(engine, call, _PAIRS, tuple(reported))
    for name in chain.from_iterable(pairs):
        if name not in entities:
            raise engine_error(engine, call, f"it reports `{name}` as out of radio range, but no entity has this id")
    return pairs


def _plain(engine: str, call: str, decoder: MsgpackDecoder[Any], value: object) -> Any:
    try:
        return decoder.decode(_ENCODER.encode(value))
    except (msgspec.ValidationError, NotImplementedError, TypeError, OverflowError) as error:
        raise engine_error(engine, call, f"its answer is malformed: {error}") from error
