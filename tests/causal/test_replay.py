"""Recorded decisions on fresh engines: the digest is confirmed, or what differs first is named."""

import json
from pathlib import Path

import msgspec
import pytest

from lingjing.analysis.registries import registries
from lingjing.bench.columns import shipped
from lingjing.causal.recorded import RecordedRun
from lingjing.causal.replay import Replay, replay
from lingjing.cli.main import main
from lingjing.dsl.loading.load import load_mission
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.expression import Number
from lingjing.play.episode import run
from lingjing.trace.digest import START, next_digest
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import Action, BoundaryRecord, Decision

replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Twelve ticks of a sea search by an oracle, with pictures."""
    mission = load_mission(next(path for path in shipped() if path.stem == "ssr"))
    short = replace(mission, budget=replace(mission.budget, ticks=Number(value=12.0)))
    folder = tmp_path_factory.mktemp("search") / "episode"
    return read_trace(run(short, policy="oracle", seed=1, out=folder, world="inline", overview=False).trace)


def forged(trace: Trace, tick: int, **changes: object) -> Trace:
    """The trace with a boundary changed, and every digest computed anew."""
    digest, records = START, list[BoundaryRecord]()
    for record in trace.boundaries:
        changed = replace(record, **changes) if record.tick == tick else record  # type: ignore[arg-type]
        digest = next_digest(digest, changed)
        records.append(replace(changed, digest=digest))
    return Trace(trace.path, trace.header, tuple(records), trace.outcome, trace.complete, trace.places)


def differs(trace: Trace) -> tuple[int, str, str]:
    told = replay(trace, world="inline")
    assert told.difference is not None and told.confirmed == told.difference.boundary
    return told.difference.boundary, told.difference.engine, told.difference.field


def test_it_is_confirmed_with_pictures_of_the_trace_and_drawn(search: Trace) -> None:
    assert search.frames
    told = replay(search, world="inline")
    assert told.difference is None and told.confirmed == len(search.boundaries) == told.boundaries
    assert not told.drawn and told.versions == ()
    again = replay(search, world="inline", draw=True)
    assert again.difference is None and again.drawn and again.pixels == ""


def test_a_forged_state_is_named_with_its_engine(search: Trace) -> None:
    record = search.boundaries[5]
    last = record.snapshots[-1]
    moved = tuple(
        replace(state, position=(state.position[0] + 1e-6, *state.position[1:])) if state.id == "boat" else state
        for state in last.states
    )
    changed = forged(search, 5, snapshots=(*record.snapshots[:-1], replace(last, states=moved)))
    tick, engine, field = differs(changed)
    owner = next(entity.engine for entity in search.header.instance.entities if entity.id == "boat")
    assert (tick, engine) == (5, owner) and field.endswith("states[boat].position[0]")


def test_a_forged_decision_leads_elsewhere(search: Trace) -> None:
    record = search.boundaries[2]
    stop = Decision(command=Action(verb="stop"))
    changed = forged(search, 2, decisions=tuple(replace(made, decision=stop) for made in record.decisions))
    assert differs(changed)[0] == 2


def test_forged_scores_boxes_and_outcomes_are_the_kernels_to_deny(search: Trace) -> None:
    assert differs(forged(search, 3, reward=0.9)) == (3, "kernel", "reward")
    assert search.outcome is not None
    won = replace(search.outcome, reason="success", success=True)
    other = Trace(search.path, search.header, search.boundaries, won, True, search.places)
    assert differs_at_the_end(other) == "outcome.reason"
    seen = next(record for record in search.boundaries if record.frames)
    boxes = forged(search, seen.tick, frames=tuple(replace(frame, boxes=()) for frame in seen.frames))
    told = replay(boxes, world="inline", draw=True)
    assert told.difference is not None
    assert (told.difference.boundary, told.difference.engine) == (seen.tick, "camera")
    assert ".boxes" in told.difference.field


def differs_at_the_end(trace: Trace) -> str:
    told: Replay = replay(trace, world="inline")
    assert told.difference is not None and told.confirmed == told.boundaries
    return told.difference.field


def test_another_instance_is_not_this_episode(search: Trace) -> None:
    instance = search.header.instance
    moved = tuple(
        replace(one, position=(one.position[0] + 1.0, *one.position[1:])) if one.id == "boat" else one
        for one in instance.entities
    )
    header = replace(search.header, instance=replace(instance, entities=moved))
    other = Trace(search.path, header, search.boundaries, search.outcome, True, search.places)
    assert differs(other)[0] == 0


def test_a_partial_trace_is_run_to_its_last_boundary(search: Trace) -> None:
    part = Trace(search.path, search.header, search.boundaries[:4], None, False, search.places)
    told = replay(part, world="inline")
    assert told.difference is None and told.confirmed == 4
    with pytest.raises(UsageError, match="holds no boundary"):
        replay(Trace(search.path, search.header, (), None, False), world="inline")


def test_a_city_that_is_gone_is_said(search: Trace) -> None:
    header = replace(search.header, city_sha256="0")
    with pytest.raises(UsageError, match="city of"):
        replay(Trace(search.path, header, search.boundaries, None, False), world="inline")


def test_a_run_goes_on_from_any_boundary_with_other_decisions(search: Trace) -> None:
    with RecordedRun(search, world="inline") as recorded:
        assert recorded.advance_to(3).record.digest == search.boundaries[3].digest
        with pytest.raises(UsageError, match="cannot be reached"):
            recorded.advance_to(3)
        idle = recorded.kernel.step(()).record
        assert idle.tick == 4 and idle.decisions == () and idle.digest != search.boundaries[4].digest
        with pytest.raises(UsageError, match="no decisions at boundary 12"):
            recorded.decisions(len(search.boundaries) - 1)


def test_the_registry_of_every_boundary_follows_from_the_records(search: Trace) -> None:
    """Without engines: adjudication gives the events that the kernel gave."""
    rebuilt = list(registries(search))
    assert all(one.faithful for one in rebuilt) and len(rebuilt) == len(search.boundaries)
    assert any(one.record.events for one in rebuilt)
    with RecordedRun(search, world="inline") as recorded:
        recorded.advance_to(len(search.boundaries) - 1)
        there = recorded.kernel.state.registry
    here = rebuilt[-1].registry
    assert dict(here.achieved) == dict(there.achieved) and here.stages == there.stages
    assert here.pending == there.pending and here.assignments == there.assignments and here.visits == there.visits
    assert here.progress == there.progress and here.sightings == there.sightings and here.emitted == there.emitted


def test_the_verb_says_so(search: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ["replay", "--world", "inline"]
    assert main([*call, str(search.path)]) == ExitCode.OK
    assert f"confirmed: {len(search.boundaries)} boundaries" in capsys.readouterr().out
    assert main([*call, "--output-format", "json", str(search.path), str(tmp_path / "no.mcap")]) == ExitCode.USAGE
    out, err = capsys.readouterr()
    assert json.loads(out)[0]["difference"] is None and "cannot read the trace" in err
