"""The hash chains: covered values, excluded values, and the detection of changes."""

import os
import subprocess
import sys
import typing
from pathlib import Path

import msgspec
import numpy as np
import pytest

import lingjing
from lingjing import Trace
from lingjing import read as read_trace
from lingjing.errors import InfrastructureError
from lingjing.testing.traces import from_json, to_json
from lingjing.trace import records
from lingjing.trace.digest import (
    START,
    current_digests,
    digest_chain,
    input_digest,
    next_digest,
    next_frames_digest,
    verify,
)
from lingjing.trace.digest_form import FORMS, REQUIRED, current_form, full_form
from lingjing.trace.records import (
    BodyState,
    BoundaryRecord,
    Box,
    Decision,
    DecisionRecord,
    Envelope,
    ObservationRecord,
    Outgoing,
    Receipt,
    Snapshot,
)

replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def rich(trace: Trace) -> BoundaryRecord:
    """A boundary with frames, events and decisions."""
    return next(record for record in trace.boundaries if record.frames and record.events and record.decisions)


def test_wall_clock_and_pixels_do_not_change_the_digest(rich: BoundaryRecord) -> None:
    other = replace(
        rich,
        wall_s=99.0,
        digest="x",
        engines=tuple(replace(engine, wait_wall_s=9.0) for engine in rich.engines),
        decisions=tuple(replace(made, policy_wall_s=9.0) for made in rich.decisions),
        frames=tuple(replace(frame, sha256="y") for frame in rich.frames),
        observations=tuple(replace(seen, sha256="z") for seen in rich.observations),
    )
    assert next_digest("p", other) == next_digest("p", rich)


def test_free_text_does_not_change_the_digest(rich: BoundaryRecord) -> None:
    """A reworded message, a thought and a price change no digest."""
    other = replace(
        rich,
        receipts=(replace(RECEIPT, detail="another wording"),),
        decisions=tuple(
            replace(
                made,
                detail="another wording",
                decision=replace(made.decision, thought="hm", usage=records.Usage(calls=1, cost_usd=9.0)),
            )
            for made in rich.decisions
        ),
    )
    plain = replace(
        rich,
        receipts=(RECEIPT,),
        decisions=tuple(
            replace(made, decision=replace(made.decision, thought="", usage=records.Usage(calls=1)))
            for made in rich.decisions
        ),
    )
    assert next_digest("p", other) == next_digest("p", plain)
    assert next_digest("p", other, 1) != next_digest("p", plain, 1)


def test_default_values_are_not_part_of_the_digest(rich: BoundaryRecord) -> None:
    """A new field with a default changes no digest, because values that equal their default are not written."""
    state = BodyState(id="a", position=(1.0, 2.0, 3.0))
    assert current_form(state) == {"id": "a", "position": (1.0, 2.0, 3.0)}
    assert current_form(replace(state, heading_deg=90.0))["heading_deg"] == 90.0
    assert full_form(state)["heading_deg"] == 0.0


def test_the_form_covers_every_field() -> None:
    """A new field of a record needs a row: it is covered, or it is left out because it is derived."""
    reachable, frontier = set(), {BoundaryRecord}
    while frontier:
        kind = frontier.pop()
        reachable.add(kind)
        fields = msgspec.structs.fields(kind)
        assert {row.name for row in FORMS[kind]} == {field.name for field in fields}, kind
        derived = {row.name for row in FORMS[kind] if row.derived}
        nested = {part for field in fields if field.name not in derived for part in _structs(field.type)}
        assert nested == {row.nested for row in FORMS[kind]} - {None}, kind
        frontier |= nested - reachable
    assert reachable == set(FORMS)


def test_the_deprecated_attribute_unheard_returns_the_unreachable_links(rich: BoundaryRecord) -> None:
    record = replace(rich, unreachable_links=(("uav[1]", "boat"),))
    with pytest.warns(DeprecationWarning, match="unreachable_links"):
        assert record.unheard == (("uav[1]", "boat"),)
    assert b'"unheard":[["uav[1]","boat"]]' in to_json(record)
    assert current_form(record)["unheard"] == (("uav[1]", "boat"),)


def test_the_defaults_of_the_form_are_those_of_the_records() -> None:
    """The form's defaults are frozen. A changed default of a record needs a new version of the digest."""
    for kind, rows in FORMS.items():
        fields = {field.name: field for field in msgspec.structs.fields(kind)}
        for row, field in [(row, fields[row.name]) for row in rows]:
            default = field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory()
            if row.derived or default is msgspec.NODEFAULT:
                continue
            assert row.default is not REQUIRED and row.default == default, (kind, row.key)


def test_only_the_listed_fields_are_left_out_of_the_digest() -> None:
    left_out = {f"{kind.__name__}.{row.key}" for kind, rows in FORMS.items() for row in rows if row.derived}
    assert left_out == {
        "BoundaryRecord.digest",
        "BoundaryRecord.relations",
        "BoundaryRecord.wall_s",
        "Decision.thought",
        "DecisionRecord.detail",
        "DecisionRecord.policy_wall_s",
        "EngineStatus.wait_wall_s",
        "CellView.seen",
        "EntityView.assignment",
        "FrameInfo.instance_ids",
        "FrameInfo.others",
        "FrameInfo.channels_sha256",
        "FrameInfo.renderer",
        "FrameInfo.sha256",
        "ObservationRecord.sha256",
        "Receipt.detail",
        "Usage.cost_usd",
        "Usage.unread_boxes",
    }


def _structs(annotation: object) -> set[type]:
    """The record types in an annotation such as `tuple[Receipt, ...]`."""
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return {annotation}
    return {kind for part in typing.get_args(annotation) for kind in _structs(part)}


def test_every_other_field_changes_the_digest(rich: BoundaryRecord) -> None:
    before = next_digest("p", rich)
    assert next_digest("q", rich) != before
    changed = {
        "tick": 999,
        "time_s": 1e6,
        "reward": 7.5,
        "scr": 0.5,
        "done": not rich.done,
        "task_events": (records.TaskEvent(kind="x", entities=(), time_s=0.0),),
    }
    for field in typing.get_type_hints(BoundaryRecord):
        if field in ("digest", "wall_s", "relations"):
            continue
        value = changed.get(field, getattr(rich, field)[1:] if field not in changed else None)
        assert next_digest("p", replace(rich, **{field: value})) != before, field


def test_coordination_relations_do_not_change_the_digest(rich: BoundaryRecord) -> None:
    occurred = (records.RelationRecord(kind="k", source="a", target="b", by="c", tick=1),)
    assert rich.relations != occurred
    assert next_digest("p", replace(rich, relations=occurred)) == next_digest("p", rich)


def test_whole_numbers_and_lists_do_not_change_the_digest(rich: BoundaryRecord) -> None:
    state = rich.snapshots[0].states[0]
    loose = replace(state, heading_deg=90, position=[1, 2, 3])
    strict = replace(state, heading_deg=90.0, position=(1.0, 2.0, 3.0))
    digests = {
        next_digest("", replace(rich, snapshots=(Snapshot(time_s=0, states=(state,)),))) for state in (loose, strict)
    }
    assert len(digests) == 1


def test_key_order_does_not_change_the_digest(rich: BoundaryRecord) -> None:
    first, second = {"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0}
    digests = {next_digest("", replace(rich, messages=(replace(ENVELOPE, body=body),))) for body in (first, second)}
    assert len(digests) == 1


def test_a_number_that_is_not_finite_is_an_infrastructure_error(rich: BoundaryRecord) -> None:
    bad = Snapshot(time_s=0.0, states=(BodyState(id="a", position=(float("nan"), 0.0, 0.0)),))
    with pytest.raises(InfrastructureError, match="BoundaryRecord holds a value that cannot be kept"):
        next_digest("", replace(rich, snapshots=(bad,)))


def test_odd_values_of_policies_are_encoded(rich: BoundaryRecord) -> None:
    """Real policies return lone surrogates, numpy scalars and infinities."""
    body = {"text": "\ud83d", "big": 2**70, "far": float("inf"), "x": np.float64(1.5), "n": np.int64(3)}
    decision = Decision(thought="\udc00 hm", messages=(Outgoing(kind="note", body=body),))
    record = replace(rich, decisions=(DecisionRecord(agent="a", decision=decision),))
    back = from_json(to_json(record), BoundaryRecord).decisions[0].decision
    assert back.thought == "\ufffd hm"
    assert back.messages[0].body == {"text": "\ufffd", "big": 2**70, "far": None, "x": 1.5, "n": 3}
    assert next_digest("", record) == next_digest("", from_json(to_json(record), BoundaryRecord))


def test_tampering_is_detected(trace: Trace) -> None:
    for index in (0, len(trace.boundaries) // 2, len(trace.boundaries) - 1):
        forged = list(trace.boundaries)
        forged[index] = replace(forged[index], reward=42.0)
        fault = verify(_with(trace, tuple(forged)))
        assert fault is not None and f"boundary {index}" in fault
    assert "boundary 1" in (verify(_with(trace, trace.boundaries[1:])) or "")
    assert "outcome" in (verify(_with(trace, trace.boundaries[:-1])) or "")


def test_swapped_pixels_are_detected(trace: Trace) -> None:
    first, second = [name for name, frame in trace.frames.items() if frame.entity == "uav[1]"][:2]
    places = {**trace.places, first: trace.places[second]}
    forged = Trace(trace.path, trace.header, trace.boundaries, trace.outcome, True, places)
    assert verify(forged) is None
    assert first in (verify(forged, pixels=True) or "")


def test_frames_digest_covers_the_pixels(rich: BoundaryRecord) -> None:
    assert next_frames_digest(START, ()) == START
    before = next_frames_digest(START, rich.frames)
    assert next_frames_digest(START, (replace(rich.frames[0], sha256="0"), *rich.frames[1:])) != before
    step = START
    for frame in rich.frames:
        step = next_frames_digest(step, (frame,))
    assert step == before


ENVELOPE = Envelope(
    id="m1-1", tick=1, sender="a", recipient="b", kind="k", category="other", body={"x": 1.0}, bytes=9, deliver_at=2
)
RECEIPT = Receipt(request="c1-1", tick=1, sender="a", resource="r", status="accepted")


def test_the_input_digest_covers_the_inputs_of_a_policy_and_no_hidden_values(rich: BoundaryRecord) -> None:
    seen = ObservationRecord(agent="scout[1]", frames=("f",))
    frame = rich.frames[0]
    before = input_digest(seen, (ENVELOPE,), (RECEIPT,), (frame,))
    truth = Box(entity="victim[9]", cls="person_in_water", box=(0.0, 0.0, 1.0, 1.0), pixels=3)
    assert input_digest(seen, (ENVELOPE,), (RECEIPT,), (replace(frame, boxes=(truth,)),)) == before
    assert input_digest(replace(seen, sha256="x"), (ENVELOPE,), (RECEIPT,), (frame,)) == before
    others = {
        input_digest(replace(seen, agent="scout[2]"), (ENVELOPE,), (RECEIPT,), (frame,)),
        input_digest(seen, (), (RECEIPT,), (frame,)),
        input_digest(seen, (ENVELOPE,), (), (frame,)),
        input_digest(seen, (ENVELOPE,), (RECEIPT,), (replace(frame, sha256="x"),)),
        input_digest(seen, (ENVELOPE,), (RECEIPT,), (replace(frame, channels_sha256="depth"),)),
    }
    assert before not in others and len(others) == 5


def test_the_chain_is_the_same_under_another_hash_seed() -> None:
    code = "from lingjing.testing import sea_rescue\nprint([record.digest for record, _ in sea_rescue.episode(12)][-1])"
    digests = {
        subprocess.run(
            [sys.executable, "-c", code],
            check=True,
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(digests) == 1


FIRST_VERSION = Path(__file__).parent / "data" / "digest-version-1.mcap"
"""A trace that was written before digests had a version: a UAV, a dog, a van, traffic and two pictures."""


def test_a_trace_of_the_first_version_still_verifies() -> None:
    trace = read_trace(FIRST_VERSION)
    assert trace.header.digest_version == 1
    assert verify(trace, pixels=True) is None
    assert lingjing.verify(FIRST_VERSION).state == "ok"
    forged = replace(trace.boundaries[3], receipts=(RECEIPT,))
    assert "boundary 3" in (verify(_with(trace, (*trace.boundaries[:3], forged, *trace.boundaries[4:]))) or "")


def test_an_older_trace_is_compared_in_the_current_version() -> None:
    trace = read_trace(FIRST_VERSION)
    digests = current_digests(trace)
    assert digests == tuple(digest_chain(trace.boundaries, 2))
    assert not set(digests) & {record.digest for record in trace.boundaries}
    assert digests[-1] == "c22a5e26b24ead196b84782f9f25d33f11029da4d0c0e2f469f69cae87a693d1"


def test_the_header_has_the_version_of_the_digests(trace: Trace) -> None:
    assert trace.header.digest_version == 2
    assert current_digests(trace) == tuple(record.digest for record in trace.boundaries)
    mislabelled = Trace(trace.path, replace(trace.header, digest_version=1), trace.boundaries, trace.outcome, True, {})
    assert "boundary 0" in (verify(mislabelled) or "")


def _with(trace: Trace, boundaries: tuple[BoundaryRecord, ...]) -> Trace:
    return Trace(trace.path, trace.header, boundaries, trace.outcome, True, trace.places)
