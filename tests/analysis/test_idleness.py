"""The idle fraction, compared with counts by hand."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lingjing import Trace
from lingjing.analysis.idleness import idle_fraction
from lingjing.mission.instance import AgentSpec, Entity, InteractionSpec
from lingjing.testing.declarations import Stage
from lingjing.testing.expressions import Flag, Quantified
from lingjing.trace.records import (
    BoundaryRecord,
    Command,
    Decision,
    DecisionRecord,
    Envelope,
    Receipt,
    StageChange,
    TaskEvent,
)

replace = msgspec.structs.replace
PATH = Path("trace.mcap")
EXTINGUISH = InteractionSpec(name="extinguish", by="road", within_m=30.0)
AGENTS = {"hub": (), "pilot": ("uav",), "driver": ("truck",)}


@pytest.fixture
def header(trace: Trace):  # type: ignore[no-untyped-def]
    """A header with a hub, a UAV and a truck that extinguishes fires within 30 m. Success requires one fire."""

    def thing(name: str, role: str, engine: str, **properties: object) -> Entity:
        return Entity(
            id=name, group=name.partition("[")[0], index=1, role=role, type=name, engine=engine,  # type: ignore[arg-type]
            position=(0.0, 0.0, 0.0), properties=properties,  # type: ignore[arg-type]
        )  # fmt: skip

    agents = tuple(
        AgentSpec(id=name, name=name, index=1, role=name, controls=body, commands=body, observes=())
        for name, body in AGENTS.items()
    )
    fire = replace(thing("fire", "target", "city"), interactions=(EXTINGUISH,))
    entities = (fire, thing("uav", "asset", "multirotor"), thing("truck", "asset", "road"))
    instance = replace(trace.header.instance, agents=agents, entities=entities, rules=(), unlocks=(), stages=())
    return replace(trace.header, instance=instance)


@pytest.fixture
def idle(trace: Trace, header):  # type: ignore[no-untyped-def]
    """A function that returns the idle fraction of an episode with the given boundaries."""

    def of(*records: BoundaryRecord) -> float | None:
        return idle_fraction(Trace(trace.path, header, records, trace.outcome, True))

    return of


def step(tick: int, **fields: object) -> BoundaryRecord:
    """Return a boundary with a decision of all three agents."""
    names = [field.name for field in msgspec.structs.fields(BoundaryRecord) if field.required]
    empty: dict[str, object] = dict.fromkeys(names, ())
    made = tuple(DecisionRecord(agent=agent, decision=Decision()) for agent in AGENTS)
    empty.update(tick=tick, time_s=10.0 * tick, reward=0.0, done=False, decisions=made)
    return BoundaryRecord(**{**empty, **fields})  # type: ignore[arg-type]


def command(number: int, resource: str) -> Command:
    return Command(id=f"c{number}", tick=number, sender="x", resource=resource, verb="go")


def answer(number: int, resource: str, status: str) -> Receipt:
    return Receipt(request=f"c{number}", tick=number, sender="x", resource=resource, status=status)  # type: ignore[arg-type]


def order(tick: int, assignee: str, kind: str = "assignment", **body: object) -> Envelope:
    return Envelope(
        id=f"m{tick}", tick=tick, sender="hub", recipient=assignee, kind=kind, category=kind,
        body={"assignee": assignee, **body}, bytes=9, deliver_at=tick + 1,  # type: ignore[arg-type]
    )  # fmt: skip


def test_steps_without_actions_are_idle_and_a_hub_alone_has_no_idle_fraction(idle) -> None:  # type: ignore[no-untyped-def]
    assert idle(step(1), step(2)) == 1.0
    only_hub = step(1, decisions=(DecisionRecord(agent="hub", decision=Decision()),))
    assert idle(only_hub) is None


def test_a_command_is_active_until_it_ends(idle) -> None:  # type: ignore[no-untyped-def]
    """The UAV flies in steps 1 to 3. The truck does nothing. 1 + 4 of 8 steps are idle."""
    first = step(1, commands=(command(1, "uav"),), receipts=(answer(1, "uav", "accepted"), answer(1, "uav", "running")))
    third = step(3, receipts=(answer(1, "uav", "completed"),))
    assert idle(first, step(2), third, step(4)) == 5 / 8


def test_a_command_that_ends_within_its_step_is_an_action(idle) -> None:  # type: ignore[no-untyped-def]
    """A picture is requested and taken in one step: 1 + 2 of 4 steps are idle."""
    photo = step(
        1, commands=(command(1, "uav"),), receipts=(answer(1, "uav", "accepted"), answer(1, "uav", "completed"))
    )
    assert idle(photo, step(2)) == 3 / 4


@pytest.mark.parametrize("status", ["rejected", "timed_out"])
def test_a_rejected_command_is_no_action(idle, status: str) -> None:  # type: ignore[no-untyped-def]
    assert idle(step(1, commands=(command(1, "uav"),), receipts=(answer(1, "uav", status),))) == 1.0


def test_a_target_is_assigned_until_it_is_completed(header) -> None:  # type: ignore[no-untyped-def]
    """The truck serves the fire from step 1 until the stage of step 3. The UAV is idle 4 times, the truck once."""
    out = Stage(name="out", condition=Flag(value=False), variable="f", domain="fire")
    success = Quantified("forall", "f", "fire", Flag(value=False))
    with_stage = replace(header, instance=replace(header.instance, stages=(out,), success=success))
    done = StageChange(stage="out", subject="fire", tick=3, time_s=30.0)
    steps = (step(1, messages=(order(1, "driver", what="fire"),)), step(2), step(3, stages=(done,)), step(4))
    assert idle_fraction(Trace(PATH, with_stage, steps, None, True)) == 5 / 8
    again = (*steps, step(5, messages=(order(5, "driver", what="fire"),)))
    assert idle_fraction(Trace(PATH, with_stage, again, None, True)) == 7 / 10, "the fire is out already"


def test_an_errand_is_open_until_its_first_command_ends(idle) -> None:  # type: ignore[no-untyped-def]
    """The UAV is sent to a cell in step 1, leaves in step 2, arrives in step 3: it is idle once, the truck 4 times."""
    steps = (
        step(1, messages=(order(1, "pilot", cell="cells-1-1"),)),
        step(2, commands=(command(2, "uav"),), receipts=(answer(2, "uav", "accepted"),)),
        step(3, receipts=(answer(2, "uav", "completed"),)),
        step(4),
    )
    assert idle(*steps) == 5 / 8


def test_an_errand_ends_when_its_agent_reports_it_as_done(idle) -> None:  # type: ignore[no-untyped-def]
    message = replace(order(2, "hub", kind="target_status", state="done"), sender="pilot")
    assert idle(step(1, messages=(order(1, "pilot", cell="x"),)), step(2, messages=(message,)), step(3)) == (1 + 3) / 6


def test_an_event_of_an_unknown_entity_changes_nothing(idle) -> None:  # type: ignore[no-untyped-def]
    assert idle(step(1, task_events=(TaskEvent(kind="arrived", entities=("uav",), time_s=1.0),))) == 1.0
