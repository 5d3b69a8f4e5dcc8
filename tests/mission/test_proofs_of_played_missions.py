"""No moment of a proof is later than what really happened, and nothing is proved of a mission that was won.

A played episode is a witness: every fact in its trace happened at some time, and the earliest moment of the proofs
must not lie after it. The same episode with its own times as deadlines is a mission that can be won.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import Trace
from lingjing import read as read_trace
from lingjing.analysis.registries import registries
from lingjing.kernel.rules import holds
from lingjing.mission.conditions.outline import of_instance
from lingjing.mission.feasibility import prove_instance
from lingjing.mission.feasibility.milestones import Milestones
from lingjing.mission.instance import CountedSpec, Instance, LimitSpec, PermitSpec
from lingjing.testing import compile_text
from lingjing.testing import expressions as ex
from lingjing.testing.declarations import Constraint
from lingjing.trace.records import BodyState, BoundaryRecord
from tests.mission.language_cases import CLOCKS, STATES, WINNABLE, Variant, success

NAMES = (
    "permit boat.moveTo when photographed(uav)",
    "permit boat.moveTo when exists r: matched(victim, r)",
    "hard distance_xy(boat, victim) >= 40 m",
    "hard not boat in search",
    "limit limit z <= 3 counts uav.*, boat.*",
    "failure rescued(victim)",
    "failure distance_xy(boat, victim) <= 50 m",
    "event event g at 10 tick { appear victim }",
    "stage stage s { done when photographed(uav), limit z <= 0 counts boat.moveTo }",
    "in-sight-by-itself",
    "count-of-two",
    "drifts-in",
)
"""Variants that the oracle plays. A lost episode is a witness too: its trace shows how early each fact can happen."""


def played(variant: Variant, folder: Path, session: lingjing.Session) -> Trace:
    """The trace of one episode of the oracle."""
    file = folder / "mission.ljs"
    file.write_text(variant.text)
    return read_trace(session.run(str(file), policy="oracle", seed=0, overview=False, out=folder / "run").trace)


def moments_are_early(trace: Trace) -> None:
    """Assert that every fact of a trace happened at its earliest moment or later, and every state within its bounds."""
    on = Milestones(of_instance(trace.header.instance))
    on.settle(lambda: None)
    for record in trace.boundaries:
        for fact, time_s in facts(record, trace.header.instance):
            step = on.moment(fact).step
            assert step <= on.clock.last and on.clock.time_s(step) <= time_s + 1e-6, (fact, step, time_s)
        for snapshot in record.snapshots:
            states = [state for state in snapshot.states if state.id in on.outline.bodies]
            for state in states:
                assert_within_bounds(state, on)
            for first, second in itertools.combinations(states, 2):
                assert_near_in_time(first, second, snapshot.time_s, on)


def facts(record: BoundaryRecord, instance: Instance) -> Iterator[tuple[tuple[str, ...], float]]:
    """The facts of one boundary, each with its time in seconds."""
    entities = {entity.id: entity for entity in instance.entities}
    rules = {rule.name for rule in instance.rules}
    for command in record.commands:
        if command.origin == "agent":
            yield ("command", command.resource, command.verb), max(0, record.tick - 1) * instance.clock.tick_s
    for frame in record.frames:
        carrier = entities.get(frame.entity)
        if carrier is not None and frame.camera in {camera.name for camera in carrier.cameras}:
            yield ("photo", frame.entity, frame.camera), record.time_s
            yield from ((("picture", box.entity), record.time_s) for box in frame.boxes if box.entity in entities)
    for event in record.events:
        if event.kind in rules:
            bound = [name if name in entities else "" for name in event.bindings]
            yield ("achieved", event.kind, *bound), event.time_s
    for event in record.task_events:
        target = entities.get(event.entities[0]) if event.entities else None
        if target is not None and event.kind in {spec.name for spec in target.interactions}:
            yield ("performed", event.kind, target.id), event.time_s


def assert_within_bounds(state: BodyState, on: Milestones) -> None:
    """Assert that a state lies within the bounds of the episode."""
    body = on.outline.bodies[state.id]
    for axis in range(3):
        bounds = on.knowledge.coordinate(body, axis)
        assert bounds.low <= state.position[axis] <= bounds.high, (state.id, axis, state.position)
    words = on.knowledge.status_words(body)
    assert words is None or state.status in words, (state.id, state.status)
    heading = on.knowledge.amount(body, "heading_deg")
    assert heading.low <= state.heading_deg <= heading.high
    for spec in body.entity.state:
        bounds = on.knowledge.amount(body, spec.field)
        value = state.resources.get(spec.field, state.resources.get(spec.name))
        assert bounds is None or value is None or bounds.low <= value <= bounds.high, (state.id, spec.field, value)


def assert_near_in_time(first: BodyState, second: BodyState, time_s: float, on: Milestones) -> None:
    """Assert that two bodies were not nearer to each other than the proofs allow at that time."""
    apart = math.dist(first.position[:2], second.position[:2])
    bodies = on.outline.bodies[first.id], on.outline.bodies[second.id]
    step = on.near(*bodies, apart + 1e-6).step
    assert on.clock.time_s(step) <= time_s + on.clock.sync_s, (first.id, second.id, apart, time_s)
    assert apart <= on.apart(*bodies)


def with_its_own_times(trace: Trace) -> list[Instance]:
    """The played instance with deadlines, permits and limits that the episode itself kept."""
    instance, end_s = trace.header.instance, trace.boundaries[-1].time_s
    now, end = ex.Ref("now", "clock"), ex.Number(end_s, "s")
    replace = msgspec.structs.replace
    firsts: dict[tuple[str, str], float] = {}
    counts: dict[tuple[str, str], int] = {}
    for record in trace.boundaries:
        for command in record.commands:
            if command.origin == "agent":
                key = command.resource, command.verb
                firsts.setdefault(key, (record.tick - 1) * instance.clock.tick_s)
                counts[key] = counts.get(key, 0) + 1
    permits = tuple(
        PermitSpec(resource=body, verb=verb, condition=ex.Binary(">=", now, ex.Number(time_s, "s")))
        for (body, verb), time_s in firsts.items()
    )
    limits = tuple(
        LimitSpec(name=f"limit{n}", most=count, counts=(CountedSpec(kind="command", resource=body, name=verb),))
        for n, ((body, verb), count) in enumerate(counts.items())
    )
    in_time = ex.Binary("<=", now, end)
    kept = Constraint(name="kept", kind="hard", condition=in_time)
    return [
        replace(instance, budget=replace(instance.budget, ticks=trace.boundaries[-1].tick)),
        replace(instance, success=ex.Binary("and", instance.success, in_time)),
        replace(instance, success=ex.Binary("and", instance.success, ex.Binary(">=", now, end))),
        replace(instance, failure=ex.Binary(">=", now, end)),
        replace(instance, constraints=(*instance.constraints, kept)),
        replace(instance, permits=(*instance.permits, *permits)),
        replace(instance, limits=(*instance.limits, *limits)),
    ]


def check(variant: Variant, folder: Path, session: lingjing.Session) -> bool:
    """Compare proofs with one played episode. True if it was won."""
    trace = played(variant, folder, session)
    moments_are_early(trace)
    won = trace.outcome is not None and trace.outcome.success
    if won:
        assert [proof for instance in with_its_own_times(trace) for proof in prove_instance(instance)] == []
    return won


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory, session: lingjing.Session) -> Trace:
    """The trace of the base mission, which the oracle wins."""
    return played(Variant("base"), tmp_path_factory.mktemp("base"), session)


@pytest.mark.slow
def test_no_moment_of_a_proof_is_later_than_in_a_played_episode(trace: Trace) -> None:
    assert trace.outcome is not None and trace.outcome.success
    moments_are_early(trace)
    assert [proof for instance in with_its_own_times(trace) for proof in prove_instance(instance)] == []


ATOMS = (
    *CLOCKS,
    *STATES,
    *("rescued(victim)", "emitted(rescue, victim)", "exists r: matched(victim, r)", "now > 50 s", "now < 100 s"),
    *("exists r: matched(victim, r) and r.confidence < 0.95", "forall r in detection: r.confidence > 0.1"),
    *("boat.position.north > -1200 m", "boat.position.east in -50 m..100 m", "boat.heading > 180 deg"),
    *("uav.position.elevation in 20 m..80 m", "distance_xy(boat, victim) in 30 m..200 m", "uav.status == moving"),
    *("count(rescued(v) for v in victim) >= 1", "count(r.confidence > 0.5 for r in detection) == 0"),
    *("distance(uav, boat) > 60 m", "distance(boat, victim) in 30 m..200 m", "speed(boat) > 1 m/s"),
    *("uav.battery < 90 %", "line_of_sight(uav, boat)", "exists r in detection: r.sent > 40 s and r.role == searcher"),
    *("max(now, 100 s) > 150 s", "abs(boat.position.north) > 1200 m", "victim.status == adrift", "1 == 1"),
)


def parsed(text: str) -> ex.Expr:
    """A condition of the base mission."""
    mission = compile_text(Variant("", success(f"rescued(victim) or ({text})")).text).mission
    assert mission is not None and isinstance(mission.success, ex.Binary)
    return mission.success.right


def composed(draws: random.Random, atoms: list[ex.Expr], depth: int) -> ex.Expr:
    """A random condition."""
    if depth == 0 or draws.random() < 0.2:
        return draws.choice(atoms)
    operator = draws.choices(("not", "and", "or"), (1, 2, 1))[0]
    if operator == "not":
        return ex.Unary("not", composed(draws, atoms, depth - 1))
    sides = (composed(draws, atoms, depth - 1) for _ in range(2))
    return ex.Binary("and" if operator == "and" else "or", *sides)


@pytest.mark.slow
def test_random_conditions_that_held_in_a_played_episode_are_not_proved_infeasible(trace: Trace) -> None:
    """As success, a condition that held at some boundary; as failure, one that held at none before the last."""
    boundaries, atoms = list(registries(trace)), [parsed(text) for text in ATOMS]
    draws, instance, replace = random.Random(0), trace.header.instance, msgspec.structs.replace
    witnessed = 0
    for _ in range(250):
        condition = composed(draws, atoms, 3)
        times = [boundary.record.tick for boundary in boundaries if holds(condition, {}, boundary.at)]
        variants = [replace(instance, success=condition)] if times else []
        if all(tick == boundaries[-1].record.tick for tick in times):
            variants.append(replace(instance, failure=condition))
        if len(times) == len(boundaries):
            permit = PermitSpec(resource="boat", condition=condition)
            variants.append(replace(instance, permits=(permit,)))
        for variant in variants:
            witnessed += 1
            assert prove_instance(variant) == (), condition
    assert witnessed > 200


@pytest.mark.episodes
@pytest.mark.parametrize("name", NAMES)
def test_no_moment_of_a_proof_is_later_than_in_a_played_variant(
    name: str, tmp_path: Path, session: lingjing.Session
) -> None:
    check(next(variant for variant in WINNABLE if variant.name == name), tmp_path, session)


@pytest.mark.episodes
@pytest.mark.parametrize("name", ["bi", "cd", "cr", "idf", "ld", "queue", "ssr", "ufr", "upr", "vdn"])
def test_no_moment_of_a_proof_is_later_than_in_a_shipped_mission(name: str, tmp_path: Path) -> None:
    trace = read_trace(lingjing.run(name, policy="oracle", seed=1, overview=False, out=tmp_path / "run").trace)
    moments_are_early(trace)
