"""Occurrences of the five coordination relations at boundaries."""

from __future__ import annotations

import pytest

from lingjing.analysis.relations import RelationTracker
from lingjing.kernel.registry import Registry, Report
from lingjing.testing import does, together
from lingjing.testing import rescue as kit
from lingjing.testing.declarations import Relation
from lingjing.trace.records import BodyState, Envelope


def tracker(relation: Relation, mode: str = "broadcast") -> RelationTracker:
    return RelationTracker(kit.instance(mode=mode, relations=(relation,)))


def at(tick: int, **more: object) -> Registry:
    places = {"uav[1]": (100.0, 0.0), "uav[2]": (-100.0, 0.0), "boat": (0.0, -100.0), "victim[1]": (100.0, 0.0)}
    places.update(more.pop("places", {}))
    states = {name: BodyState(id=name, position=(x, y, 0.0)) for name, (x, y) in places.items()}
    return Registry(tick=tick, states=states, **more)


def edge(sender: str, recipient: str, kind: str, **body: object) -> Envelope:
    return Envelope(
        id="m3-1", tick=3, sender=sender, recipient=recipient, kind=kind, category="assignment", body=body, bytes=1,
        deliver_at=3,
    )  # fmt: skip


def relations_between(relation: Relation, before: Registry, after: Registry, *edges: Envelope, mode: str = "broadcast"):
    records = tracker(relation, mode).occurrences(before, after, edges, (), ())
    return [(record.kind, record.source, record.target, record.by) for record in records]


@pytest.mark.parametrize("place, handed_over", [((90.0, 1.0), True), ((90.5, 0.0), True), ((95.0, 0.0), False)])
def test_a_hub_forwards_a_message_with_the_same_position(place, handed_over):
    relation = Relation(kind="information_handoff", source="searcher", target="rescuer", carries="detection")
    report = Report("m2-1", "detection", "scout[2]", 2, {"position": (90.0, 0.0)})
    before = at(2)
    before = before.with_reports((report,))
    records = relations_between(
        relation, before, at(3), edge("commander", "skipper", "order", position=place), mode="star"
    )
    assert records == ([("information_handoff", "scout[2]", "skipper", "m3-1")] if handed_over else [])


def test_a_message_that_no_hub_forwards_is_no_handoff():
    relation = Relation(kind="information_handoff", source="searcher", target="rescuer", carries="detection")
    before = at(2).with_reports((Report("m2-1", "detection", "scout[2]", 2, {"position": (90.0, 0.0)}),))
    assert relations_between(relation, before, at(3), edge("scout[1]", "skipper", "order", position=(90.0, 0.0))) == []


def test_two_roles_cooperate_when_one_enters_a_region_with_the_other_inside():
    relation = Relation(kind="cooperation", source="searcher", target="rescuer", mutual=True, over="search")
    outside, inside = at(4, places={"boat": (0.0, -301.0)}), at(5)
    assert relations_between(relation, outside, inside) == [
        ("cooperation", "skipper", "scout[1]", "search"),
        ("cooperation", "skipper", "scout[2]", "search"),
    ]
    assert relations_between(relation, inside, at(6)) == []
    assert relations_between(relation, outside, at(5, places={"uav[1]": (900.0, 0.0), "uav[2]": (900.0, 0.0)})) == []


@pytest.mark.parametrize("north, competes", [(50.0, True), (50.1, False)])
def test_an_agent_near_a_target_that_another_agent_gets_competes_for_it(north, competes):
    relation = Relation(kind="competition", source="searcher", target="searcher", mutual=True, over="victim")
    before = at(4)
    after = at(5, places={"uav[2]": (100.0, north)}, emitted={("fetch", ("victim[1]", "uav[1]")): 50.0})
    expected = [("competition", "scout[2]", "victim[1]", "scout[1]")] if competes else []
    assert relations_between(relation, before, after) == expected
    assert relations_between(relation, after, after) == []


FRAME = "f1-uav[1]-nadir"


def test_relations_are_detected_in_records_of_the_kernel():
    kernel = kit.kernel()
    tracked = RelationTracker(kernel.instance)
    assert tracked.take(kernel.reset().record) == ()
    assert tracked.take(kernel.step(kit.decisions(scout_1=does("takePhoto"))).record) != ()
    second = kernel.step(
        kit.decisions(
            scout_1=together(kit.report(FRAME), does("go", "boat", x=90.0, y=0.0)),
            scout_2=does("go", "boat", x=80.0, y=0.0),
            skipper=does("go", x=100.0, y=0.0),
        )
    ).record
    assert [(r.kind, r.source, r.target) for r in tracked.take(second)] == [
        ("information_handoff", "scout[1]", "skipper"),
        ("competition", "scout[2]", "boat"),  # the skipper is refused too, but competition is between searchers
    ]
    later = [relation for _ in range(3) for relation in tracked.take(kernel.step(kit.decisions()).record)]
    assert [(r.kind, r.by) for r in later] == [("dependency", "victim[1]")]


def test_idle_boundaries_have_no_relations():
    kernel = kit.kernel()
    tracked = RelationTracker(kernel.instance)
    records = [kernel.reset().record, kernel.step(kit.decisions()).record]
    assert [tracked.take(record) for record in records] == [(), ()]
