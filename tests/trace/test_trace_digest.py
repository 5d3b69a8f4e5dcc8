"""The hash chains: what they cover, what they leave out, and that a change anywhere is found."""

import os
import subprocess
import sys
import typing
from types import ModuleType

import msgspec
import numpy as np
import pytest

from lingjing.errors import InfrastructureError
from lingjing.trace import records
from lingjing.trace.digest import START, input_digest, next_digest, next_frames_digest, timeless, verify
from lingjing.trace.encoding import from_json, to_json
from lingjing.trace.reader import Trace
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
    """A boundary with everything in it."""
    return next(record for record in trace.boundaries if record.frames and record.events and record.decisions)


def test_wall_clock_and_pixels_do_not_count(rich: BoundaryRecord) -> None:
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


def test_every_wall_clock_field_is_blanked() -> None:
    """A field added to the records later must be blanked too."""
    names = {"wall_s", "digest", "sha256"}
    found = set()
    for record in vars(records).values():
        if isinstance(record, type) and issubclass(record, records.TraceRecord):
            for field in msgspec.structs.fields(record):
                if field.encode_name in names or field.encode_name.endswith("_wall_s"):
                    found.add((record.__name__, field.encode_name))
    found -= {("Outcome", "digest"), ("Outcome", "wall_s"), ("BranchOrigin", "digest")}  # none is in a boundary
    assert found == {
        ("BoundaryRecord", "wall_s"),
        ("BoundaryRecord", "digest"),
        ("EngineStatus", "wait_wall_s"),
        ("FrameInfo", "sha256"),
        ("ObservationRecord", "sha256"),
        ("DecisionRecord", "policy_wall_s"),
    }


def test_every_other_field_counts(rich: BoundaryRecord) -> None:
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


def test_coordination_relations_do_not_count(rich: BoundaryRecord) -> None:
    occurred = (records.RelationRecord(kind="k", source="a", target="b", by="c", tick=1),)
    assert rich.relations != occurred
    assert next_digest("p", replace(rich, relations=occurred)) == next_digest("p", rich)


def test_whole_numbers_and_lists_do_not_change_it(rich: BoundaryRecord) -> None:
    state = rich.snapshots[0].states[0]
    loose = replace(state, heading_deg=90, position=[1, 2, 3])
    strict = replace(state, heading_deg=90.0, position=(1.0, 2.0, 3.0))
    digests = {
        next_digest("", replace(rich, snapshots=(Snapshot(time_s=0, states=(one,)),))) for one in (loose, strict)
    }
    assert len(digests) == 1


def test_key_order_does_not_change_it(rich: BoundaryRecord) -> None:
    first, second = {"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0}
    digests = {next_digest("", replace(rich, messages=(replace(ENVELOPE, body=body),))) for body in (first, second)}
    assert len(digests) == 1


def test_a_number_that_is_not_finite_is_an_engine_fault(rich: BoundaryRecord) -> None:
    bad = Snapshot(time_s=0.0, states=(BodyState(id="a", position=(float("nan"), 0.0, 0.0)),))
    with pytest.raises(InfrastructureError, match="BoundaryRecord holds a value that cannot be kept"):
        next_digest("", replace(rich, snapshots=(bad,)))


def test_what_policies_say_survives(rich: BoundaryRecord) -> None:
    """Lone surrogates, numpy scalars and infinities come out of real policies."""
    body = {"text": "\ud83d", "big": 2**70, "far": float("inf"), "x": np.float64(1.5), "n": np.int64(3)}
    said = Decision(thought="\udc00 hm", messages=(Outgoing(kind="note", body=body),))
    record = replace(rich, decisions=(DecisionRecord(agent="a", decision=said),))
    back = from_json(to_json(record), BoundaryRecord).decisions[0].decision
    assert back.thought == "\ufffd hm"
    assert back.messages[0].body == {"text": "\ufffd", "big": 2**70, "far": None, "x": 1.5, "n": 3}
    assert next_digest("", record) == next_digest("", from_json(to_json(record), BoundaryRecord))


def test_tampering_is_found(trace: Trace) -> None:
    for index in (0, len(trace.boundaries) // 2, len(trace.boundaries) - 1):
        forged = list(trace.boundaries)
        forged[index] = replace(forged[index], reward=42.0)
        fault = verify(_with(trace, tuple(forged)))
        assert fault is not None and f"boundary {index}" in fault
    assert "boundary 1" in (verify(_with(trace, trace.boundaries[1:])) or "")
    assert "outcome" in (verify(_with(trace, trace.boundaries[:-1])) or "")


def test_swapped_pixels_are_found(trace: Trace) -> None:
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


def test_input_digest_covers_what_a_policy_sees_and_nothing_hidden(rich: BoundaryRecord) -> None:
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


def test_the_chain_is_the_same_under_another_hash_seed(synthetic: ModuleType) -> None:
    code = (
        "import importlib.util, sys\n"
        "spec = importlib.util.spec_from_file_location('synthetic_episode', sys.argv[1])\n"
        "module = importlib.util.module_from_spec(spec); sys.modules[spec.name] = module\n"
        "spec.loader.exec_module(module)\n"
        "print([record.digest for record, _ in module.episode(12)][-1])"
    )
    said = {
        subprocess.run(
            [sys.executable, "-c", code, synthetic.__file__],
            check=True,
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(said) == 1


def testtimeless_keeps_the_rest(rich: BoundaryRecord) -> None:
    assert timeless(rich).snapshots == rich.snapshots and timeless(rich).messages == rich.messages


def _with(trace: Trace, boundaries: tuple[BoundaryRecord, ...]) -> Trace:
    return Trace(trace.path, trace.header, boundaries, trace.outcome, True, trace.places)
