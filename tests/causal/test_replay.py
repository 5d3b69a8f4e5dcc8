"""Recorded decisions on fresh engines: the digest is confirmed, or the first difference is named."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from lingjing import Trace, replay, run
from lingjing import read as read_trace
from lingjing.analysis.registries import registries
from lingjing.causal.recorded import RecordedRun
from lingjing.causal.replay import Replay
from lingjing.cli.replay import sentence
from lingjing.errors import ExitCode, UsageError
from lingjing.plugins.hookspecs import ScenePlugin, hookimpl
from lingjing.scene.city import content_sha256
from lingjing.testing import PluginHost, does, mission_file, run_command, shortened
from lingjing.testing import rescue as kit
from lingjing.testing.traces import START, next_digest
from lingjing.trace.records import Action, BoundaryRecord, Decision, DecisionRecord, Header
from tests.scene.osm_maps import square, town

replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Nine ticks of a sea search by an oracle, with pictures."""
    short = shortened(mission_file("ssr"), 9)
    folder = tmp_path_factory.mktemp("search") / "episode"
    options: dict[str, Any] = {"seed": 1, "settings": {"uavs": 1}, "world": "inline", "overview": False}
    return read_trace(run(short, policy="oracle", out=folder, **options).trace)


def forged(trace: Trace, tick: int, **changes: object) -> Trace:
    """Return the trace with a boundary changed and all digests recomputed."""
    digest, records = START, list[BoundaryRecord]()
    for record in trace.boundaries:
        changed = replace(record, **changes) if record.tick == tick else record  # type: ignore[arg-type]
        digest = next_digest(digest, changed)
        records.append(replace(changed, digest=digest))
    return Trace(trace.path, trace.header, tuple(records), trace.outcome, trace.complete, trace.places)


def differs(trace: Trace) -> tuple[int, str, str]:
    result = replay(trace, world="inline")
    assert result.difference is not None and result.confirmed == result.difference.boundary
    return result.difference.boundary, result.difference.engine, result.difference.field


def test_an_unchanged_trace_is_confirmed_with_recorded_and_with_rendered_pictures(search: Trace) -> None:
    assert search.frames
    result = replay(search, world="inline")
    assert result.difference is None and result.confirmed == len(search.boundaries) == result.boundaries
    assert not result.drawn and result.versions == ()
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


def test_a_field_that_is_missing_in_the_record_is_named(search: Trace) -> None:
    """Only the replayed boundary has the field, a key of a mapping."""
    record = search.boundaries[5]
    last = record.snapshots[-1]
    empty = tuple(replace(state, resources={}) if state.resources else state for state in last.states)
    assert empty != last.states
    changed = forged(search, 5, snapshots=(*record.snapshots[:-1], replace(last, states=empty)))
    tick, engine, field = differs(changed)
    first = next(state for state in last.states if state.resources)
    owner = next(entity.engine for entity in search.header.instance.entities if entity.id == first.id)
    assert (tick, engine) == (5, owner) and f"states[{first.id}].resources." in field


def test_a_forged_decision_gives_a_difference_at_its_boundary(search: Trace) -> None:
    record = search.boundaries[2]
    stop = Decision(command=Action(verb="stop"))
    changed = forged(search, 2, decisions=tuple(replace(made, decision=stop) for made in record.decisions))
    assert differs(changed)[0] == 2


def test_forged_rewards_outcomes_and_boxes_are_detected(search: Trace) -> None:
    assert differs(forged(search, 3, reward=0.9)) == (3, "kernel", "reward")
    assert search.outcome is not None
    won = replace(search.outcome, reason="success", success=True)
    other = Trace(search.path, search.header, search.boundaries, won, True, search.places)
    assert differs_at_the_end(other) == "outcome.reason"
    seen = next(record for record in search.boundaries if record.frames)
    boxes = forged(search, seen.tick, frames=tuple(replace(frame, boxes=()) for frame in seen.frames))
    result = replay(boxes, world="inline", draw=True)
    assert result.difference is not None
    assert (result.difference.boundary, result.difference.engine) == (seen.tick, "camera")
    assert ".boxes" in result.difference.field


def differs_at_the_end(trace: Trace) -> str:
    result: Replay = replay(trace, world="inline")
    assert result.difference is not None and result.confirmed == result.boundaries
    return result.difference.field


def test_an_edited_command_is_detected_by_the_state_of_its_body(search: Trace) -> None:
    """With recorded and with recomputed digests."""
    tick = next(record.tick for record in search.boundaries if any(_sent(made) for made in record.decisions))
    decisions = tuple(_elsewhere(made) for made in search.boundaries[tick].decisions)
    changed = forged(search, tick, decisions=decisions)
    records = tuple(
        replace(record, digest=old.digest) for record, old in zip(changed.boundaries, search.boundaries, strict=True)
    )
    bare = Trace(search.path, search.header, records, search.outcome, True, search.places)
    for trace in (changed, bare):
        at, engine, field = differs(trace)
        assert (at, engine) == (tick, "multirotor") and ".states[uav[" in field


def _sent(made: DecisionRecord) -> bool:
    command = made.decision.command
    return made.agent.startswith("scout") and command is not None and "x" in command.arguments


def _elsewhere(made: DecisionRecord) -> DecisionRecord:
    command = made.decision.command
    if command is None or not _sent(made):
        return made
    return replace(
        made, decision=replace(made.decision, command=replace(command, arguments={**command.arguments, "x": 0.0}))
    )


def test_foreign_reordered_and_duplicate_decisions_are_detected(search: Trace) -> None:
    first, *others = search.boundaries[3].decisions
    for decisions in ((replace(first, agent="nobody"), *others), (*others, first), (first, first, *others)):
        assert differs(forged(search, 3, decisions=decisions)) == (3, "kernel", "decisions")


def test_removed_and_added_decisions_are_detected(search: Trace) -> None:
    """Also if they had no effect, so that everything else is equal."""
    for agent in {made.agent for made in search.boundaries[3].decisions}:
        left = tuple(made for made in search.boundaries[3].decisions if made.agent != agent)
        assert differs(forged(search, 3, decisions=left)) == (3, "kernel", "decisions")
    assert differs(forged(search, 0, decisions=search.boundaries[3].decisions)) == (0, "kernel", "decisions")


def test_missing_and_duplicate_boundaries_are_detected(search: Trace) -> None:
    records = search.boundaries
    for some in (records[:5] + records[6:], records[:5] + records[4:], records[1:]):
        other = replay(Trace(search.path, search.header, some, search.outcome, True, search.places), world="inline")
        assert other.difference is not None and other.confirmed < other.boundaries
        assert (other.difference.engine, other.difference.field) == ("kernel", "tick")


def test_changed_weather_missing_bindings_and_missing_pictures_are_detected(search: Trace) -> None:
    header = search.header
    weather = replace(header.instance.weather, wind_mps=header.instance.weather.wind_mps + 1.0)
    headers = {
        "observations[scout[1]].weather.wind_mps": replace(header, instance=replace(header.instance, weather=weather)),
        "observations[scout[1]].privileged": replace(header, bindings=()),
    }
    for field, other in headers.items():
        edited = Trace(search.path, other, search.boundaries, search.outcome, True, search.places)
        assert differs(edited) == (0, "kernel", field)
    seen = next(record for record in search.boundaries if record.frames)
    assert differs(forged(search, seen.tick, frames=()))[0] == seen.tick


def test_other_library_versions_are_reported_even_if_the_trace_is_confirmed(search: Trace) -> None:
    header = replace(search.header, fingerprint={**search.header.fingerprint, "jsbsim": "0.0.1"})
    result = replay(Trace(search.path, header, search.boundaries, search.outcome, True, search.places), world="inline")
    assert result.difference is None
    assert "confirmed, although recorded with other libraries: jsbsim 0.0.1 (here " in sentence(result)


def test_a_truncated_file_is_replayed_to_its_last_readable_boundary(search: Trace, tmp_path: Path) -> None:
    whole, part = search.path.read_bytes(), tmp_path / "trace.mcap"
    part.write_bytes(whole[: 6 * len(whole) // 10])
    result = replay(read_trace(part), world="inline")
    assert result.difference is None and 1 < result.confirmed == result.boundaries < len(search.boundaries)


def test_a_changed_instance_differs_at_the_first_boundary(search: Trace) -> None:
    instance = search.header.instance
    moved = tuple(
        replace(entity, position=(entity.position[0] + 1.0, *entity.position[1:])) if entity.id == "boat" else entity
        for entity in instance.entities
    )
    header = replace(search.header, instance=replace(instance, entities=moved))
    other = Trace(search.path, header, search.boundaries, search.outcome, True, search.places)
    assert differs(other)[0] == 0


def test_a_partial_trace_is_run_to_its_last_boundary(search: Trace) -> None:
    part = Trace(search.path, search.header, search.boundaries[:4], None, False, search.places)
    result = replay(part, world="inline")
    assert result.difference is None and result.confirmed == 4 and not result.ends
    assert "\n  the rest is not confirmed: the file has no outcome; " in sentence(result)
    with pytest.raises(UsageError, match="holds no boundary"):
        replay(Trace(search.path, search.header, (), None, False), world="inline")


def test_a_city_with_another_hash_is_a_usage_error(search: Trace) -> None:
    header = replace(search.header, city_sha256="0")
    with pytest.raises(UsageError, match="the result differs from the city"):
        replay(Trace(search.path, header, search.boundaries, None, False), world="inline")


MAPPED = """
ljs 1
use std.air { quadrotor }
mission mapped "In a town" {
  goal "Go there."
  scene map { file = "town.osm" }
  clock { tick = 5 s, sync = 500 ms }
  budget { ticks <= 9 }
  region corner = box((0 m, 90 m), (20 m, 110 m))
  asset uav : quadrotor { position = (300 m, -300 m, 20 m), band = 10 m..60 m, actions { setDestination } }
  agent pilot as pilot controls uav { observes uav.* }
  success when uav in corner
}
"""


def test_a_city_from_a_map_is_rebuilt_and_a_changed_or_missing_map_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    town().write(tmp_path / "town.osm")
    (tmp_path / "mapped.ljs").write_text(MAPPED)
    trace = read_trace(run("mapped.ljs", policy="random", seed=1, out="episode", world="inline", overview=False).trace)
    assert replay(trace, world="inline").difference is None
    more = town()
    more.way(square(-300.0, 40.0, 30.0), {"building": "yes"})
    more.write(tmp_path / "town.osm")
    with pytest.raises(UsageError, match="the result differs from the city"):
        replay(trace, world="inline")
    (tmp_path / "town.osm").unlink()
    with pytest.raises(UsageError, match=r"cannot be built here: .*town\.osm"):
        replay(trace, world="inline")


class _Scene:
    """The kit's city as a plug-in offers it."""

    @hookimpl
    def lingjing_scenes(self) -> list[ScenePlugin]:
        return [ScenePlugin(name="kit", build=lambda spec: kit.CITY)]


class _Faster(kit.PointMasses):
    """Another version of the engine, which moves a little farther for each command."""

    def advance(self, until, mirrors):  # type: ignore[no-untyped-def]
        made = super().advance(until, mirrors)
        states = tuple(
            replace(state, position=(state.position[0] + 1e-6 * self.time_s, *state.position[1:]))
            for state in made.states
        )
        return replace(made, states=states)


def test_an_engine_of_a_plug_in_is_confirmed_and_another_version_of_it_is_named() -> None:
    instance, records = kit.instance(), list[BoundaryRecord]()
    kernel = kit.kernel(instance)
    records.append(kernel.reset().record)
    idle = {"scout_1": Decision(), "scout_2": Decision(), "skipper": does("go", x=50.0, y=0.0)}
    records += [kernel.step(kit.decisions(**idle)).record for _ in range(3)]
    header = Header(instance=instance, bindings=(), fingerprint={}, city_sha256=content_sha256(kit.CITY))
    trace = Trace(Path("kit.mcap"), header, tuple(records), None, False)
    result = replay(trace, world="inline", host=PluginHost(extra=(_Scene(), kit.RescueEngines())))
    assert result.difference is None and result.confirmed == 4
    other = replay(
        trace, world="inline", host=PluginHost(extra=(_Scene(), kit.RescueEngines(glider=_Faster)))
    ).difference
    assert other is not None and (other.boundary, other.engine) == (1, "glider")
    assert other.field.endswith(".states[uav[1]].position[0]")
    with pytest.raises(UsageError, match="no engine is called `glider`"):
        replay(trace, world="inline", host=PluginHost(extra=(_Scene(),)))


def test_a_run_goes_on_from_any_boundary_with_other_decisions(search: Trace) -> None:
    with RecordedRun(search, world="inline") as recorded:
        assert recorded.advance_to(3).record.digest == search.boundaries[3].digest
        with pytest.raises(UsageError, match="cannot be reached"):
            recorded.advance_to(3)
        idle = recorded.kernel.step(()).record
        assert idle.tick == 4 and idle.decisions == () and idle.digest != search.boundaries[4].digest
        with pytest.raises(UsageError, match="no decisions at boundary 9"):
            recorded.decisions(len(search.boundaries) - 1)


def test_the_registry_of_every_boundary_follows_from_the_records(search: Trace) -> None:
    """Without engines: adjudication gives the events that the kernel gave."""
    rebuilt = list(registries(search))
    assert all(boundary.faithful for boundary in rebuilt) and len(rebuilt) == len(search.boundaries)
    assert any(boundary.record.events for boundary in rebuilt)
    with RecordedRun(search, world="inline") as recorded:
        recorded.advance_to(len(search.boundaries) - 1)
        there = recorded.kernel.state.registry
    here = rebuilt[-1].registry
    assert dict(here.achieved) == dict(there.achieved) and here.stages == there.stages
    assert here.pending == there.pending and here.assignments == there.assignments and here.visits == there.visits
    assert here.progress == there.progress and here.sightings == there.sightings and here.emitted == there.emitted


def test_the_command_reports_a_confirmed_trace_and_an_unreadable_trace(
    search: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["replay", "--world", "inline"]
    assert run_command([*call, str(search.path)]) == ExitCode.OK
    assert f"confirmed: {len(search.boundaries)} boundaries" in capsys.readouterr().out
    assert (
        run_command([*call, "--output-format", "json", str(search.path), str(tmp_path / "no.mcap")]) == ExitCode.USAGE
    )
    out, err = capsys.readouterr()
    assert json.loads(out)[0]["difference"] is None and "cannot read the trace" in err
