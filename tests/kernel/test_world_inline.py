"""The coupling and its faults, in the caller."""

import numpy as np
import pytest
from msgspec.structs import replace

import tests.kernel.world_toys as toys
from lingjing.errors import InfrastructureError, UsageError
from lingjing.kernel.world.cosimulation import macro_steps, macro_time_s
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.instance import Clock
from lingjing.testing import PluginHost, decode_jpeg
from lingjing.trace.images import quantise_depth
from lingjing.trace.records import Absent


def host(*extra):
    return PluginHost(entry_points=False, extra=extra or (toys.plugin, toys.painter))


@pytest.fixture
def world():
    world = InlineWorld(host())
    yield world
    world.close()


def faulty(fault, at=0.55, **changes):
    return toys.instance(
        toys.entity("ant", "toy_a", 1.0), toys.entity("bee", "toy_b", 2.0, fault=fault, fault_at=at), **changes
    )


def test_times_are_computed_from_integer_steps():
    clock = Clock(tick_s=1.0, sync_s=0.1)
    assert macro_steps(clock) == 10
    assert macro_time_s(clock, 3, 10) == 3.0
    assert macro_time_s(clock, 1_000_000, 7) == 999_999 * 1.0 + 7 * 0.1


def test_a_tick_that_is_no_multiple_of_sync_is_refused(world):
    with pytest.raises(UsageError, match="not a whole number of macro-steps"):
        world.reset(toys.trio(tick_s=1.0, sync_s=0.3), toys.CITY)


def test_reset_returns_boundary_zero_and_a_step_returns_every_macro_step(world):
    ready = world.reset(toys.trio(), toys.CITY)
    assert (ready.tick, ready.time_s, len(ready.snapshots)) == (0, 0.0, 1)
    assert [s.id for s in ready.snapshots[0].states] == ["cat", "ant", "bee", "ape"]
    assert [(e.engine, e.frame) for e in ready.engines] == [("toy_a", 0), ("toy_b", 0), ("toy_c", 0)]
    world.step(1, ())
    second = world.step(2, ())
    assert [s.time_s for s in second.snapshots] == [1.0 + k * 0.1 for k in range(1, 10)] + [2.0]
    assert all([s.id for s in snapshot.states] == ["cat", "ant", "bee", "ape"] for snapshot in second.snapshots)
    assert [(e.engine, e.time_s, e.frame) for e in second.engines] == [
        ("toy_a", 2.0, 20),
        ("toy_b", 2.0, 20),
        ("toy_c", 2.0, 20),
    ]


class Watcher(toys.Toy):
    """An engine that stores the order of calls and the mirrors that it receives."""

    log = []

    def advance(self, until, mirrors):
        self.log.append((self.spec.engine, until, tuple((m.id, m.position[0]) for m in mirrors)))
        return super().advance(until, mirrors)


def test_engines_advance_in_order_of_name_with_mirrors_from_the_start_of_the_step(monkeypatch):
    monkeypatch.setattr(toys, "Toy", Watcher)
    Watcher.log = []
    world = InlineWorld(host())
    ready = world.reset(toys.trio(tick_s=0.2, sync_s=0.1), toys.CITY)
    boundary = world.step(1, ())
    assert [(name, until) for name, until, _ in Watcher.log] == [
        (name, until) for until in (0.1, 0.2) for name in ("toy_a", "toy_b", "toy_c")
    ]
    starts = [ready.snapshots[0], boundary.snapshots[0]]
    for index, (name, _, mirrors) in enumerate(Watcher.log):
        own = {"toy_a": {"ant", "ape"}, "toy_b": {"bee"}, "toy_c": {"cat"}}[name]
        assert mirrors == tuple((s.id, s.position[0]) for s in starts[index // 3].states if s.id not in own)


def test_commands_go_to_the_owner_and_admissions_come_back_in_order(world):
    world.reset(toys.trio(), toys.CITY)
    commands = [
        toys.command("c1-1", "cat"),
        toys.command("c1-2", "ape", "refuse"),
        toys.command("c1-3", "bee", sender="kernel"),
        toys.command("c1-4", "ant"),
    ]
    boundary = world.step(1, commands)
    assert [(r.request, r.status, r.by) for r in boundary.admissions] == [
        ("c1-1", "accepted", "toy_c"),
        ("c1-2", "rejected", "toy_a"),
        ("c1-3", "accepted", "toy_b"),
        ("c1-4", "accepted", "toy_a"),
    ]
    assert boundary.missing == ()
    assert [(r.request, r.status) for r in boundary.receipts] == [
        ("c1-4", "completed"),
        ("c1-3", "completed"),
        ("c1-1", "completed"),
    ]
    assert [e.entities for e in boundary.events] == [("ant",), ("bee",), ("cat",)]


@pytest.mark.parametrize("verb", ["silent", "twice", "misaddressed"])
def test_a_missing_admission_is_reported_and_the_tick_goes_on(world, verb):
    world.reset(toys.trio(), toys.CITY)
    boundary = world.step(1, [toys.command("c1-1", "ant", verb), toys.command("c1-2", "cat")])
    assert boundary.missing == ("c1-1",)
    assert [r.request for r in boundary.admissions] == ["c1-2"]
    assert boundary.time_s == 1.0


def test_a_command_for_an_unknown_entity_raises_value_error(world):
    world.reset(toys.trio(), toys.CITY)
    with pytest.raises(ValueError, match="`ghost`, which no engine owns"):
        world.step(1, [toys.command("c1-1", "ghost")])


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("raise", "engine `toy_b` of plug-in `toys` failed in advance: ValueError: the toy is broken"),
        ("exit", "engine `toy_b` of plug-in `toys` failed in advance: SystemExit: 3"),
        ("nan", "engine `toy_b` of plug-in `toys` failed in advance: entity `bee` has a number that is not finite"),
        ("inf_battery", "not finite"),
        ("missing", "engine `toy_b` of plug-in `toys` failed in advance: its boundary has no bee"),
        ("foreign", "its boundary has foreign stranger"),
        ("doubled", "its boundary has duplicate bee"),
        ("late_clock", r"engine `toy_b` .*failed in advance: its boundary is at 0\.60\d* s instead of 0\.6\d* s"),
        ("signature", "its boundary names the engine `somebody`"),
        ("none", "it returned NoneType, not a Boundary"),
        ("malformed", "its answer is malformed"),
    ],
)
def test_an_incoherent_boundary_names_engine_and_call(world, fault, message):
    world.reset(faulty(fault), toys.CITY)
    with pytest.raises(InfrastructureError, match=message):
        world.step(1, ())
    with pytest.raises(UsageError, match="no episode is running"):
        world.step(2, ())
    assert world.reset(toys.trio(), toys.CITY).tick == 0


def test_submit_that_raises_is_an_abort(world):
    world.reset(faulty("bad_submit", 0.0), toys.CITY)
    with pytest.raises(InfrastructureError, match=r"engine `toy_b` .*failed in submit: RuntimeError: no commands"):
        world.step(1, [toys.command("c1-1", "bee")])


def test_a_fault_at_reset_names_reset(world):
    with pytest.raises(InfrastructureError, match=r"engine `toy_b` .*failed in reset: its boundary is at"):
        world.reset(faulty("late_clock", 0.0), toys.CITY)


def test_a_late_boundary_is_an_abort_that_names_the_slowest_engine(world):
    with pytest.raises(InfrastructureError, match=r"the slowest was engine `toy_.` of plug-in `toys`"):
        world.reset(toys.trio(engine_s=1e-9), toys.CITY)


def test_engine_values_become_plain(world):
    world.reset(faulty("numpy", 0.0), toys.CITY)
    bee = world.step(1, ()).snapshots[-1].states[1]
    assert type(bee.position) is tuple
    assert {type(v) for v in (*bee.position, bee.heading_deg, bee.pitch_deg)} == {float}


def test_an_unknown_engine_is_a_usage_error(world):
    with pytest.raises(UsageError, match="no engine is called `warp`"):
        world.reset(toys.instance(toys.entity("ant", "warp")), toys.CITY)


def test_an_engine_that_does_not_close_is_a_warning():
    world = InlineWorld(host())
    world.reset(faulty("bad_close", 0.0), toys.CITY)
    with pytest.warns(RuntimeWarning, match="engine `toy_b` failed in close: RuntimeError: it does not close"):
        world.close()
    world.close()


def test_episodes_of_equal_seeds_are_equal_and_those_of_other_seeds_differ(world):
    first = [world.reset(toys.trio(), toys.CITY), world.step(1, ())][1]
    again = [world.reset(toys.trio(), toys.CITY), world.step(1, ())][1]
    other = [world.reset(toys.trio(seed=8), toys.CITY), world.step(1, ())][1]
    assert first.snapshots == again.snapshots
    assert first.snapshots != other.snapshots


def test_a_picture_is_stored_as_its_jpeg(world):
    world.reset(toys.trio(), toys.CITY)
    states = world.step(1, ()).snapshots[-1].states
    (frame,) = world.capture(1, [toys.request(1, "f1-ant-nadir")], states)
    assert frame.info.id == "f1-ant-nadir"
    assert frame.info.boxes[0].pixels == 5
    assert decode_jpeg(frame.jpeg).shape == (48, 64, 3)
    assert frame.depth.dtype == np.float32
    drawn_m = np.float32(sum(sum(s.position) for s in states))
    assert np.all(frame.depth == quantise_depth(np.array([drawn_m])))
    assert np.all(frame.semantic == 7)
    assert len(frame.info.sha256) == 64


def photographed(fault, at=0.0, capture_s=20.0):
    ant = toys.entity("ant", "toy_a", cameras=(toys.camera(),), fault=fault, fault_at=at, fault_in="camera")
    return toys.instance(ant, capture_s=capture_s)


def test_pictures_that_come_late_are_absent(world):
    ready = world.reset(photographed("slow_once", capture_s=0.8), toys.CITY)
    answers = world.capture(0, [toys.request(0, "f1"), toys.request(0, "f2")], ready.snapshots[-1].states)
    assert answers == (Absent(entity="ant", camera="nadir", tick=0, reason="late"),) * 2
    (frame,) = world.capture(0, [toys.request(0, "f3")], ready.snapshots[-1].states)
    assert frame.info.id == "f3"


def test_a_picture_that_was_not_drawn_is_absent(world):
    ready = world.reset(photographed("empty"), toys.CITY)
    (answer,) = world.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    assert answer == Absent(entity="ant", camera="nadir", tick=0, reason="not_drawn")


def test_a_wrong_array_names_the_layer(world):
    ready = world.reset(photographed("bad_array"), toys.CITY)
    with pytest.raises(InfrastructureError, match=r"engine `camera` .*failed in capture: `rgb` is uint8"):
        world.capture(0, [toys.request(0)], ready.snapshots[-1].states)


def test_a_capture_without_a_camera_engine_is_a_usage_error():
    world = InlineWorld(host(toys.plugin))
    ready = world.reset(toys.trio(), toys.CITY)
    with pytest.raises(UsageError, match="no installed engine draws pictures"):
        world.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    world.close()


def test_the_inline_world_rejects_a_fork(world):
    world.reset(toys.trio(), toys.CITY)
    with pytest.raises(UsageError) as caught:
        world.fork()
    assert "process" in caught.value.hint


def test_calls_between_episodes_are_refused(world):
    with pytest.raises(UsageError, match="no episode is running"):
        world.step(1, ())
    with pytest.raises(UsageError, match="no episode is running"):
        world.capture(0, [], ())


def test_remote_engines_are_coupled_like_any_other(world):
    here = toys.instance(toys.entity("ant", "toy_a", 1.0), toys.entity("far", "toy_remote", 2.0))
    world.reset(here, toys.CITY)
    boundary = world.step(1, ())
    assert [s.id for s in boundary.snapshots[-1].states] == ["ant", "far"]


def test_only_the_waits_of_engines_depend_on_the_wall_clock(world):
    def played():
        world.reset(toys.trio(), toys.CITY)
        boundary = world.step(1, [toys.command("c1-1", "ant")])
        return replace(boundary, engines=())

    assert played() == played()
