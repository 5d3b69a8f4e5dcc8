"""The stages S1 to S5 of last-mile delivery, from reports of the route's ends and waypoints."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import Trace, testing
from lingjing.analysis.last_mile import LastMile, last_mile
from lingjing.mission.instance import Instance
from lingjing.scene.city import City, content_sha256
from lingjing.scene.road_map import RoadWay, read_road_map
from lingjing.testing import mission_file
from lingjing.testing.expressions import Call, Symbol
from lingjing.trace.records import (
    AdjudicatedEvent,
    AgentBinding,
    BodyState,
    BoundaryRecord,
    Envelope,
    Header,
    Outcome,
    Route,
    Snapshot,
    StageChange,
)

GOOD = {"start": (-120.0, -182.0), "target": (255.0, 185.0)}


@cache
def placed(name: str = "ld") -> tuple[Instance, City]:
    mission = lingjing.compile(mission_file(name))
    return testing.placed(mission, seed=1)


def trace(
    *messages: tuple[str, dict], intervention: str = "", arrived: bool = False, won: bool = False, seen: bool = False
) -> Trace:
    instance, city = placed()
    envelopes = tuple(
        Envelope(
            id=f"m1-{number}", tick=1, sender="coordinator", recipient="driver", kind=kind, category="other", body=body,
            bytes=9, deliver_at=1,
        )
        for number, (kind, body) in enumerate(messages, 1)
    )  # fmt: skip
    at = {entity.id: entity.position for entity in instance.entities}
    van = BodyState(id="van", position=at["stop_node"] if arrived else at["van"])
    points = tuple((*point, 0.0) for point in (*shortest().points[1:-1], at["stop_node"][:2]))
    route = Route(entity="van", number=1, waypoints=points, length_m=700.0, duration_s=60.0, time_s=20.0)
    track = tuple(BodyState(id="van", position=point) for point in points) if arrived else ()
    snapshots = tuple(Snapshot(time_s=20.0, states=(state,)) for state in (*track, van))
    record = BoundaryRecord(
        tick=1, time_s=20.0, snapshots=snapshots, routes=(route,), engines=(), task_events=(), frames=(),
        observations=(), inboxes=(),
        decisions=(), commands=(), messages=envelopes, receipts=(),
        events=(AdjudicatedEvent(id="e1", kind="driven", tick=1, time_s=20.0, bindings=("stop_node",)),) * arrived,
        stages=(StageChange(stage="inspect", subject="", tick=1, time_s=20.0),) * seen, reward=0.0, done=True,
    )  # fmt: skip
    arguments = {"intervention": intervention} if intervention else {}
    header = Header(
        instance=instance, bindings=(AgentBinding(agent="coordinator", policy="react", arguments=arguments),),
        fingerprint={}, city_sha256=content_sha256(city),
    )  # fmt: skip
    outcome = Outcome(success=won, reason="success" if won else "budget", scr=0.0, ticks=1, digest="", frames_digest="")
    return Trace(Path("x.mcap"), header, (record,), outcome, complete=True)


def shortest() -> RoadWay:
    """The shortest way of the van on the roads."""
    instance, city = placed()
    at = {entity.id: entity.position[:2] for entity in instance.entities}
    quickest = read_road_map(city.network).way(at["van"], at["stop_node"])
    assert quickest is not None
    return quickest


def way(*shift: tuple[float, float]) -> list[tuple[str, dict]]:
    """Return reports of the junctions of the shortest way, each moved by its `shift`."""
    moves = [*shift, *[(0.0, 0.0)] * 20]
    return [
        ("passing", {"number": float(number), "position": (x + dx, y + dy, 0.0)})
        for number, ((x, y), (dx, dy)) in enumerate(zip(shortest().points[1:-1], moves, strict=False), 1)
    ]


def stages(*messages: tuple[str, dict], **more: object) -> LastMile:
    result = last_mile(trace(*messages, **more))  # type: ignore[arg-type]
    assert result is not None
    return result


def test_the_stages_are_cumulative():
    assert stages().cumulative == 0
    assert stages(seen=True).cumulative == 1
    assert stages(("ends", GOOD), seen=True).cumulative == 2
    assert stages(("ends", GOOD), *way(), seen=True).cumulative == 3
    assert stages(("ends", GOOD), *way(), seen=True, arrived=True).cumulative == 4
    assert stages(("ends", GOOD), *way(), seen=True, arrived=True, won=True).cumulative == 5
    assert (
        stages(seen=True, arrived=True, won=True).cumulative == 1
    )  # the success of the engine does not hide a missing stage


def test_stage_s2_requires_both_ends_near_the_true_ends():
    for wrong in ({**GOOD, "target": (255.0, 140.0)}, {**GOOD, "start": (0.0, 0.0)}):
        assert "S2" not in stages(("ends", wrong)).done


@pytest.mark.parametrize(
    "messages",  # called in the test, because `way` loads a city
    [
        lambda: way((40.0, 40.0)),  # not where the van passes
        lambda: way()[1:],  # a turn is missing
        lambda: list(
            reversed([(kind, {**body, "number": -body["number"] + 100}) for kind, body in way()])
        ),  # backwards
        lambda: [("passing", {"number": 1.0, "position": (-120.0, -182.0)})],  # nothing between the ends
    ],
)
def test_waypoints_that_do_not_form_the_route_do_not_complete_stage_s3(messages: Callable[[], list[tuple[str, dict]]]):
    assert "S3" not in stages(*messages()).done


def test_a_later_report_of_a_waypoint_replaces_the_earlier_one():
    wrong = [("passing", {"number": 1.0, "position": (-300.0, 300.0)})]
    assert "S3" in stages(*wrong, *way()).done
    assert "S3" not in stages(*way(), *wrong).done


@pytest.mark.parametrize(("name", "supplied", "count"), [("A0", (), 1), ("A1", ("S2",), 2), ("A2", ("S2", "S3"), 4)])
def test_stages_supplied_by_an_intervention_count_as_done(name: str, supplied: tuple[str, ...], count: int):
    result = stages(intervention=name, seen=True, arrived=True)
    assert (result.given, result.cumulative) == (supplied, count)


def test_other_missions_have_no_last_mile_stages():
    instance, _ = placed("cr")
    other = trace()
    header = Header(instance=instance, bindings=(), fingerprint={})
    assert last_mile(Trace(Path("x.mcap"), header, other.boundaries, other.outcome, complete=True)) is None


def test_the_inspection_of_another_route_does_not_complete_stage_s1() -> None:
    replace, played = msgspec.structs.replace, trace(seen=True)
    instance, other = played.header.instance, Call("inspected", (Symbol("other"),))
    stages = tuple(replace(stage, condition=other) for stage in instance.stages if stage.name == "inspect")
    header = replace(played.header, instance=replace(instance, stages=stages))
    result = last_mile(Trace(played.path, header, played.boundaries, played.outcome, complete=True))
    assert "S1" in last_mile(played).done and "S1" not in result.done
