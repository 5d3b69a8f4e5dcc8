"""The content of a page: hidden targets only on request, and no harmful texts."""

from __future__ import annotations

import json
from collections.abc import Callable

import msgspec

from lingjing import Trace
from lingjing.mission.instance import Instance
from lingjing.trace.records import BoundaryRecord, Decision, DecisionRecord, Snapshot
from lingjing.viewer.page_content import PageContent, page_json
from lingjing.viewer.steps import LONGEST_TEXT, SAMPLES, STILL_DEG, STILL_M, shorten


def hidden(instance: Instance) -> set[str]:
    return {entity.id for entity in instance.entities if entity.role == "target" and "position" in entity.hidden}


def moved(snapshot: Snapshot, names: set[str]) -> Snapshot:
    """Return the macro-step with the named entities at other positions."""
    states = tuple(
        msgspec.structs.replace(state, position=(state.position[0] + 37.0, state.position[1] - 41.0, state.position[2]))
        if state.id in names
        else state
        for state in snapshot.states
    )
    return msgspec.structs.replace(snapshot, states=states)


def test_undiscovered_hidden_targets_do_not_affect_a_page(trace: Trace, written: Callable[..., Trace]) -> None:
    names = hidden(trace.header.instance)
    first = min(record.tick for record in trace.boundaries if record.events)
    until = [record for record in trace.boundaries if record.tick < first]
    assert names and len(until) > 2
    other = [
        msgspec.structs.replace(
            record,
            snapshots=tuple(moved(item, names) for item in record.snapshots),
            frames=tuple(msgspec.structs.replace(frame, boxes=()) for frame in record.frames),
        )
        for record in until
    ]
    instance = trace.header.instance
    entities = tuple(
        msgspec.structs.replace(item, position=(1.0, 2.0, 3.0)) if item.id in names else item
        for item in instance.entities
    )
    header = msgspec.structs.replace(trace.header, instance=msgspec.structs.replace(instance, entities=entities))
    whole = written(other, header, finish=False)
    content, content_other = (PageContent(item, truth=False) for item in (shortened(trace, until), whole))
    assert page_json(content.steps) == page_json(content_other.steps)
    assert page_json(content.details) == page_json(content_other.details)
    assert page_json(content.head) == page_json(content_other.head)
    shown, shown_other = (PageContent(item, truth=True) for item in (shortened(trace, until), whole))
    assert page_json(shown.steps) != page_json(shown_other.steps)


def shortened(trace: Trace, records: list[BoundaryRecord]) -> Trace:
    return Trace(trace.path, trace.header, tuple(records), None, False, trace.places)


def test_a_target_appears_when_it_is_found(trace: Trace) -> None:
    first = min(record.tick for record in trace.boundaries if record.events)
    steps = PageContent(trace, truth=False).steps
    names = hidden(trace.header.instance)
    cards = {card.id: step.tick for step in steps for card in step.cards}
    assert names <= set(cards)
    assert min(cards[name] for name in names) == first
    steps = PageContent(trace, truth=True).steps
    assert {card.id for card in steps[0].cards} >= names
    assert {steps[0].sights[name] for name in names} == {"truth"}


def test_true_boxes_and_the_explanation_are_shown_only_with_the_truth(trace: Trace) -> None:
    plain, full = (PageContent(trace, truth=truth) for truth in (False, True))
    assert any(frame.boxes for frame in trace.frames.values())
    assert not any(picture.truth for step in plain.steps for picture in step.pictures)
    assert any(picture.truth for step in full.steps for picture in step.pictures)
    assert plain.ending().why == "" and "ended by" in full.ending().why
    assert plain.ending().line == full.ending().line != ""


def test_a_page_has_reported_boxes_and_their_matches(trace: Trace) -> None:
    steps = PageContent(trace, truth=False).steps
    reports = {report.id: report for step in steps for report in step.reports}
    matched = {report: target for step in steps for report, target in step.matched.items()}
    assert matched and set(matched) <= set(reports)
    assert {reports[name].frame for name in matched} <= set(trace.frames)
    assert set(matched.values()) <= hidden(trace.header.instance)


def test_the_samples_of_an_entity_end_at_its_last_position(trace: Trace) -> None:
    steps = PageContent(trace, truth=True).steps
    record = trace.boundaries[-1]
    for state in record.snapshots[-1].states:
        samples = [sample for step in steps for sample in step.moves.get(state.id, ())]
        times = [sample[0] for sample in samples]
        assert times == sorted(times)
        assert abs(samples[-1][1] - state.position[0]) < 0.3
        assert abs(samples[-1][2] - state.position[1]) < 0.3


def test_an_entity_at_rest_has_one_sample_until_it_moves_or_turns(trace: Trace, written: Callable[..., Trace]) -> None:
    """A UAV stays at one place, except for motions of the size of rounding errors. It turns before the last boundary.
    All other entities move as in the trace.
    """
    records = trace.boundaries[:8]
    (rest,) = (state for state in records[0].snapshots[-1].states if state.id == "uav[1]")
    east, north, up = rest.position

    def resting(snapshot: Snapshot, number: int, tick: int) -> Snapshot:
        heading = rest.heading_deg + (STILL_DEG + 1.0 if tick == records[-1].tick else 0.0)
        place = (east + 0.4 * STILL_M * (number % 3), north, up)
        uav = msgspec.structs.replace(rest, position=place, heading_deg=heading)
        states = tuple(uav if state.id == uav.id else state for state in snapshot.states)
        return msgspec.structs.replace(snapshot, states=states)

    made = [
        msgspec.structs.replace(
            record, snapshots=tuple(resting(item, n, record.tick) for n, item in enumerate(record.snapshots))
        )
        for record in records
    ]
    usual = [step.moves for step in PageContent(shortened(trace, list(records)), truth=True).steps]
    moves = [step.moves for step in PageContent(written(made, trace.header, finish=False), truth=True).steps]
    assert [len(samples.get("uav[1]", ())) for samples in moves] == [1, 0, 0, 0, 0, 0, 0, 1]
    assert sum(len(samples.get("uav[1]", ())) for samples in usual) > 8
    assert max(len(of_entity) for samples in usual for of_entity in samples.values()) == SAMPLES
    for samples in (*moves, *usual):
        samples.pop("uav[1]", None)
    assert moves == usual


def test_texts_are_shortened_and_control_characters_are_removed() -> None:
    assert shorten("plain") == "plain"
    long = shorten("x" * 10_000)
    assert long.startswith("x" * LONGEST_TEXT) and long.endswith("(6000 characters more)")
    assert "\u202e" not in shorten("abc\u202ecba") and "\x1b" not in shorten("\x1b[31m")


def test_packed_json_cannot_end_a_script(trace: Trace, written: Callable[..., Trace]) -> None:
    evil = "</script><script>alert(1)</script><!-- & \u2028"
    record = trace.boundaries[1]
    made = DecisionRecord(agent=record.decisions[0].agent, decision=Decision(thought=evil))
    content = PageContent(
        written([trace.boundaries[0], msgspec.structs.replace(record, decisions=(made,))], trace.header, finish=False),
        truth=False,
    )
    data = page_json(content.details)
    assert not set(b"<>&") & set(data) and "\u2028".encode() not in data
    thoughts = [
        note["thought"]
        for detail in json.loads(data)
        for note in detail.get("agents", {}).values()
        if "thought" in note
    ]
    assert thoughts and thoughts[0].startswith("</script><script>alert(1)</script><!-- & ")
