"""The same world in two worker processes: equality, deadlines, deaths, forks, leaks, orphans."""

import gc
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import tests.kernel.world_toys as toys
from lingjing.errors import InfrastructureError, UsageError
from lingjing.testing.worlds import open_world
from lingjing.trace.records import Absent

starts_interpreters = pytest.mark.usefixtures("workers_are_interpreters_once")
"""For tests of the start and the end of workers. The others fork them."""

ROOT = str(Path(__file__).parents[2])
TOYS = ("tests.kernel.world_toys:plugin", "tests.kernel.world_toys:painter")


def opened(kind="process"):
    return open_world(kind, plugins=TOYS, installed=False)


@pytest.fixture
def world():
    world = opened()
    yield world
    world.close()


def pids(world):
    workers = world._workers
    return [worker.pid for worker in (workers.world, workers.camera.worker if workers.camera else None) if worker]


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state not in "ZX"


def exists(pid):
    return Path(f"/proc/{pid}").exists()


def await_gone(ended, timeout_s=600.0):
    deadline = time.monotonic() + timeout_s
    while any(is_running(pid) for pid in ended):
        assert time.monotonic() < deadline, f"{ended} still run after {timeout_s} s"
        time.sleep(0.02)


def open_descriptors():
    return len(os.listdir("/proc/self/fd"))


def without_waits(boundary):
    engines = tuple((status.engine, status.time_s, status.frame) for status in boundary.engines)
    return replace(boundary, engines=engines)


def faulty(fault, at=0.55, **changes):
    return toys.instance(
        toys.entity("ant", "toy_a", 1.0), toys.entity("bee", "toy_b", 2.0, fault=fault, fault_at=at), **changes
    )


def photographed(fault, at=0.0, capture_s=20.0, released=""):
    ant = toys.entity(
        "ant", "toy_a", cameras=(toys.camera(),), fault=fault, fault_at=at, fault_in="camera", released=str(released)
    )
    return toys.instance(ant, capture_s=capture_s)


def script(tick):
    verbs = {1: "go", 2: "refuse", 3: "silent"}
    return [toys.command(f"c{tick}-1", "ant", verbs[tick]), toys.command(f"c{tick}-2", "cat")]


def played(world, instance):
    """Return three ticks with commands and a picture, without wall-clock measurements."""
    boundaries = [world.reset(instance, toys.CITY)]
    frames = []
    for tick in (1, 2, 3):
        boundaries.append(world.step(tick, script(tick)))
        frames += world.capture(tick, [toys.request(tick)], boundaries[-1].snapshots[-1].states)
    pictures = [(f.info, f.jpeg, f.depth.tobytes(), f.semantic.tobytes()) for f in frames]
    return [without_waits(boundary) for boundary in boundaries], pictures


def with_remote(**changes):
    far = toys.entity("far", "toy_remote", 4.0)
    return toys.instance(*toys.trio().entities, far, **changes)


@pytest.mark.parametrize("instance", [toys.trio(), with_remote()], ids=["local", "remote"])
def test_the_inline_and_the_process_world_report_the_same(world, instance):
    inline = opened("inline")
    assert played(inline, instance) == played(world, instance)
    inline.close()


def test_an_instance_with_only_remote_engines_needs_no_world_process(world):
    only = toys.instance(toys.entity("far", "toy_remote", 4.0))
    world.reset(only, toys.CITY)
    assert world.step(1, [toys.command("c1-1", "far")]).admissions[0].status == "accepted"
    assert pids(world) == []
    with pytest.raises(UsageError, match=r"remote engines \(toy_remote\) cannot be forked"):
        world.fork()


def test_the_next_episode_runs_on_the_same_workers(world):
    first = played(world, toys.trio())
    before = pids(world)
    assert played(world, toys.trio()) == first
    assert pids(world) == before


def test_an_instance_without_a_camera_starts_no_camera_process(world):
    world.reset(faulty("none", 99.0), toys.CITY)
    assert len(pids(world)) == 1
    with pytest.raises(UsageError, match="no installed engine draws pictures"):
        world.capture(0, [toys.request(0)], ())


@starts_interpreters
def test_the_world_process_has_one_thread_and_loads_no_graphics_libraries(world):
    world.reset(toys.trio(), toys.CITY)
    pid = pids(world)[0]
    assert len(os.listdir(f"/proc/{pid}/task")) == 1
    maps = Path(f"/proc/{pid}/maps").read_text()
    assert not [name for name in ("cv2", "libEGL", "libGL.", "moderngl", "_imaging") if name in maps]
    environment = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    assert {b"OPENBLAS_NUM_THREADS=1", b"OMP_NUM_THREADS=1"} <= set(environment)


def test_a_city_larger_than_a_socket_buffer_arrives(world):
    assert world.reset(toys.trio(), toys.big_city()).tick == 0


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("raise", "engine `toy_b` of plug-in `toys` failed in advance: ValueError: the toy is broken"),
        ("exit", "engine `toy_b` of plug-in `toys` failed in advance: SystemExit: 3"),
        ("nan", "engine `toy_b` of plug-in `toys` failed in advance: entity `bee` has a number that is not finite"),
        ("missing", "engine `toy_b` of plug-in `toys` failed in advance: its boundary has no bee"),
        ("late_clock", "engine `toy_b` of plug-in `toys` failed in advance: its boundary is at"),
        ("crash", r"the world process died \(SIGSEGV\) while engine `toy_b` of plug-in `toys` was in advance\n"),
        ("kill", r"the world process died \(SIGKILL\) while engine `toy_b` of plug-in `toys` was in advance"),
    ],
)
def test_a_broken_engine_is_named_and_the_world_starts_afresh(world, fault, message):
    world.reset(faulty(fault), toys.CITY)
    (before,) = pids(world)
    with pytest.raises(InfrastructureError, match=message):
        world.step(1, ())
    await_gone([before])
    with pytest.raises(UsageError, match="no episode is running"):
        world.step(2, ())
    assert world.reset(toys.trio(), toys.CITY).tick == 0
    assert world.step(1, ()).tick == 1


@starts_interpreters
def test_the_error_of_a_killed_worker_shows_its_last_output(world):
    world.reset(faulty("kill"), toys.CITY)
    with pytest.raises(InfrastructureError, match="last words of the toy"):
        world.step(1, ())


@starts_interpreters
def test_the_stack_of_a_crashed_worker_is_a_note(world):
    world.reset(faulty("crash"), toys.CITY)
    with pytest.raises(InfrastructureError) as caught:
        world.step(1, ())
    assert "Segmentation fault" in caught.value.__notes__[0]
    assert "world_toys.py" in caught.value.__notes__[0]


def test_an_engines_traceback_is_a_note(world):
    world.reset(faulty("raise"), toys.CITY)
    with pytest.raises(InfrastructureError) as caught:
        world.step(1, ())
    assert "world_toys.py" in caught.value.__notes__[0]


def test_a_hung_engine_is_killed_within_the_deadline(world):
    world.reset(faulty("hang", engine_s=2.0), toys.CITY)
    (before,) = pids(world)
    with pytest.raises(InfrastructureError, match=r"engine `toy_b` .*\(advance\) did not answer within 2 s") as caught:
        world.step(1, ())
    assert "in act" in "\n".join(caught.value.__notes__)
    assert not is_running(before)
    assert world.reset(toys.trio(), toys.CITY).tick == 0


def test_an_engine_that_hangs_at_reset_is_killed(world):
    instance = photographed("hang", 99.0, capture_s=1.0)
    world.reset(instance, toys.CITY)
    bad = toys.instance(
        toys.entity("bee", "toy_b", fault="at_reset"), toys.entity("fly", "toy_b", fault="hang"), engine_s=1.0
    )
    with pytest.raises(InfrastructureError, match=r"engine `toy_b` .*\(reset\) did not answer within 1 s"):
        world.reset(bad, toys.CITY)
    assert world.reset(instance, toys.CITY).tick == 0


def test_an_engine_that_writes_a_lot_does_not_block(world):
    world.reset(faulty("chatter", 0.0), toys.CITY)
    assert world.step(1, ()).tick == 1


def test_a_tick_out_of_sequence_raises_value_error(world):
    world.reset(toys.trio(), toys.CITY)
    with pytest.raises(ValueError, match="boundary 3 does not follow boundary 0"):
        world.step(3, ())
    assert world.step(1, ()).tick == 1


@starts_interpreters
def test_a_worker_that_cannot_be_started_is_an_abort(world, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    before = open_descriptors()
    with pytest.raises(InfrastructureError, match=r"the \w+ process cannot be started: .*/nowhere/python"):
        world.reset(toys.trio(), toys.CITY)
    assert open_descriptors() == before


@starts_interpreters
def test_the_error_of_a_worker_that_fails_to_start_gives_the_cause(tmp_path):
    (tmp_path / "msgspec.py").write_text('raise RuntimeError("a broken installation")\n')
    world = open_world("process", plugins=TOYS, paths=(str(tmp_path),), installed=False)
    with pytest.raises(InfrastructureError, match=r"(?s)process died \(exit code 1\); .*a broken installation"):
        world.reset(toys.trio(), toys.CITY)


def test_an_unloadable_plugin_is_named():
    from lingjing.errors import PluginError

    with pytest.raises(PluginError, match="plug-in `nowhere:plugin` cannot be loaded"):
        open_world("process", plugins=("nowhere:plugin",), installed=False)


def test_an_engine_that_does_not_close_is_a_warning(world):
    world.reset(faulty("bad_close", 0.0), toys.CITY)
    with pytest.warns(RuntimeWarning, match="engine `toy_b` failed in close: RuntimeError: it does not close"):
        world.reset(faulty("bad_close", 0.0), toys.CITY)
    with pytest.warns(RuntimeWarning, match="it does not close"):
        world.close()


# Pictures


def test_a_late_picture_is_absent_and_the_camera_goes_on(world, tmp_path, monkeypatch):
    monkeypatch.setattr("lingjing.kernel.world.camera._PATIENCE", 10_000)
    ready = world.reset(photographed("held_first", capture_s=0.8, released=tmp_path / "released"), toys.CITY)
    states = ready.snapshots[-1].states
    before = pids(world)
    answers = world.capture(0, [toys.request(0, "f1"), toys.request(0, "f2")], states)
    assert answers == (Absent(entity="ant", camera="nadir", tick=0, reason="late"),) * 2
    (tmp_path / "released").touch()
    frame = answers[0]
    while isinstance(frame, Absent):  # until the late ones are done
        (frame,) = world.capture(0, [toys.request(0, "f3")], states)
    assert frame.info.id == "f3"
    assert pids(world) == before


def test_pictures_before_the_late_one_are_kept(world, tmp_path, monkeypatch):
    monkeypatch.setattr("lingjing.kernel.world.camera._PATIENCE", 10_000)
    ready = world.reset(photographed("held_second", capture_s=2.0, released=tmp_path / "released"), toys.CITY)
    first, second = world.capture(0, [toys.request(0, "f1"), toys.request(0, "f2")], ready.snapshots[-1].states)
    assert first.info.id == "f1"
    assert second.reason == "late"


def test_a_hung_camera_is_killed_after_three_deadlines(world):
    ready = world.reset(photographed("hang", capture_s=0.2), toys.CITY)
    states = ready.snapshots[-1].states
    before = pids(world)
    (late,) = world.capture(0, [toys.request(0)], states)
    assert late.reason == "late"
    with pytest.raises(InfrastructureError, match=r"engine `camera` .*\(advance\) did not answer within 0.6 s"):
        for _ in range(4):
            world.capture(0, [toys.request(0)], states)
    assert not is_running(before[1])
    assert world.reset(toys.trio(), toys.CITY).tick == 0
    assert pids(world)[0] == before[0]


def test_a_camera_still_busy_at_reset_is_replaced(world):
    ready = world.reset(photographed("hang", capture_s=0.1), toys.CITY)
    before = pids(world)
    world.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    assert played(world, toys.trio())[1]
    assert pids(world)[0] == before[0]
    assert pids(world)[1] != before[1]


def test_a_dead_camera_is_an_abort(world):
    ready = world.reset(toys.trio(), toys.CITY)
    os.kill(pids(world)[1], signal.SIGKILL)
    with pytest.raises(InfrastructureError, match=r"the camera process died \(SIGKILL\)"):
        world.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    assert played(world, toys.trio())[1]


def test_a_camera_engine_that_raises_is_an_abort(world):
    ready = world.reset(photographed("raise"), toys.CITY)
    with pytest.raises(
        InfrastructureError, match=r"engine `camera` .*failed in advance: ValueError: the toy is broken"
    ):
        world.capture(0, [toys.request(0)], ready.snapshots[-1].states)


def test_large_pictures_arrive_bit_for_bit(world):
    camera = toys.camera(1920, 1080)
    instance = toys.instance(toys.entity("ant", "toy_a", 3.0, cameras=(camera,)))
    ready = world.reset(instance, toys.CITY)
    (frame,) = world.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    assert frame.depth.shape == frame.semantic.shape == (1080, 1920)
    assert np.all(frame.depth == np.float32(3.0))
    assert np.all(frame.semantic == 7)
    assert not frame.depth.flags.writeable


@starts_interpreters
def test_fifty_episodes_and_captures_leave_no_descriptors_open(world):
    instance = toys.trio(tick_s=0.2)
    ready = world.reset(instance, toys.CITY)
    world.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    gc.collect()
    before, theirs = open_descriptors(), [len(os.listdir(f"/proc/{pid}/fd")) for pid in pids(world)]
    kept = []
    for _ in range(50):
        ready = world.reset(instance, toys.CITY)
        kept += world.capture(0, [toys.request(0)] * 2, ready.snapshots[-1].states)
        world.fork().close()
    assert len(kept) == 100
    assert open_descriptors() == before
    assert [len(os.listdir(f"/proc/{pid}/fd")) for pid in pids(world)] == theirs


@starts_interpreters
def test_opening_and_closing_leaves_no_descriptor_and_no_zombie():
    before = open_descriptors()
    for _ in range(3):
        world = opened()
        world.reset(toys.trio(), toys.CITY)
        seen = pids(world)
        world.close()
        world.close()
        await_gone(seen)
        assert not [pid for pid in seen if exists(pid) and not await_reaped(pid)]
    assert open_descriptors() == before


def await_reaped(pid):
    deadline = time.monotonic() + 600
    while exists(pid):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


# Forks


def test_a_fork_is_a_bit_exact_copy(world):
    world.reset(toys.trio(), toys.CITY)
    unforked = [without_waits(world.step(tick, script(tick))) for tick in (1, 2, 3)]
    world.reset(toys.trio(), toys.CITY)
    world.step(1, script(1))
    twin = world.fork()
    ours = [without_waits(world.step(tick, script(tick))) for tick in (2, 3)]
    theirs = [without_waits(twin.step(tick, script(tick))) for tick in (2, 3)]
    assert ours == theirs == unforked[1:]
    twin.close()


def test_forks_with_other_commands_do_not_affect_each_other(world):
    world.reset(toys.trio(), toys.CITY)
    inline = opened("inline")
    inline.reset(toys.trio(), toys.CITY)
    twin = world.fork()
    grandchild = twin.fork()
    twin.step(1, [toys.command("c1-1", "ant")])
    assert without_waits(world.step(1, ())) == without_waits(inline.step(1, ()))
    assert grandchild.step(1, ()).events == ()
    for each in (twin, grandchild, inline):
        each.close()


def test_a_fork_and_its_original_share_the_camera_and_close_apart(world):
    world.reset(toys.trio(), toys.CITY)
    twin = world.fork()
    grandchild = twin.fork()
    seen = {*pids(world), *pids(twin), *pids(grandchild)}
    assert len(seen) == 4
    world.close()
    twin.close()
    states = grandchild.step(1, ()).snapshots[-1].states
    assert grandchild.capture(1, [toys.request(1)], states)[0].info.id == "f"
    grandchild.close()
    await_gone(seen)
    assert all(await_reaped(pid) for pid in seen)


def test_closed_forks_are_reaped_while_the_original_lives(world):
    world.reset(toys.trio(), toys.CITY)
    ended = []
    for _ in range(5):
        twin = world.fork()
        ended.append(pids(twin)[0])
        twin.close()
    assert all(await_reaped(pid) for pid in ended)
    assert world.step(1, ()).tick == 1


def test_a_fork_that_fails_does_not_affect_the_original(world):
    world.reset(faulty("hang", 1.5, engine_s=2.0), toys.CITY)
    world.step(1, ())
    twin = world.fork()
    with pytest.raises(InfrastructureError, match=r"engine `toy_b` of plug-in `toys` \(advance\) did not answer"):
        twin.step(2, ())
    twin.close()
    extra = world.fork()
    extra.close()


def test_a_fork_can_begin_an_episode_of_its_own(world):
    expected = played(world, toys.trio())
    world.reset(toys.trio(seed=9), toys.CITY)
    twin = world.fork()
    assert played(twin, toys.trio()) == expected
    assert world.step(1, ()).tick == 1
    twin.close()


def test_an_engine_with_threads_cannot_be_forked_and_plays_on(world):
    world.reset(faulty("threads", 0.0), toys.CITY)
    with pytest.raises(InfrastructureError, match=r"the world process has [23] threads and cannot be forked"):
        world.fork()
    assert world.step(1, ()).tick == 1


# The end of the caller


@starts_interpreters
def test_a_world_survives_the_thread_that_started_it(world):
    starter = threading.Thread(target=lambda: world.reset(toys.trio(), toys.CITY))
    starter.start()
    starter.join()
    time.sleep(0.2)
    assert world.step(1, ()).tick == 1


@starts_interpreters
def test_workers_ignore_ctrl_c(world):
    world.reset(toys.trio(), toys.CITY)
    twin = world.fork()
    for pid in {*pids(world), *pids(twin)}:
        os.kill(pid, signal.SIGINT)
    states = world.step(1, ()).snapshots[-1].states
    assert world.capture(1, [toys.request(1)], states)[0].info.id == "f"
    assert twin.step(1, ()).tick == 1
    twin.close()


def test_a_shared_camera_that_died_is_an_abort_for_both(world):
    ready = world.reset(toys.trio(), toys.CITY)
    twin = world.fork()
    os.kill(pids(world)[1], signal.SIGKILL)
    for each in (world, twin):
        with pytest.raises(InfrastructureError, match="the camera process"):
            each.capture(0, [toys.request(0)], ready.snapshots[-1].states)
    assert played(world, toys.trio()) == played(twin, toys.trio())
    twin.close()


def test_forks_of_a_killed_world_are_an_abort(world):
    world.reset(toys.trio(), toys.CITY)
    twin = world.fork()
    os.kill(pids(world)[0], signal.SIGKILL)
    with pytest.raises(InfrastructureError, match=r"the world process died \(SIGKILL\)"):
        world.step(1, ())
    with pytest.raises(InfrastructureError, match="the world process died"):
        twin.step(1, ())
    assert played(world, toys.trio()) == played(twin, toys.trio())
    twin.close()


def test_an_interrupt_in_a_step_leaves_no_stale_answer(world):
    world.reset(faulty("hang", engine_s=3600.0), toys.CITY)
    seen = pids(world)
    progress = world._workers.world._progress

    def interrupt():
        while progress.read().call != "advance":
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        threading.Thread(target=interrupt).start()
        world.step(1, ())
    await_gone(seen)
    assert world.reset(toys.trio(), toys.CITY).tick == 0


CALLER = """
import sys, time
sys.path.insert(0, {root!r})
import tests.kernel.world_toys as toys
from lingjing.testing.worlds import open_world
world = open_world("process", plugins={toys!r}, installed=False)
world.reset({instance}, toys.CITY)
twin = world.fork()
workers = [world._workers.world, world._workers.camera.worker if world._workers.camera else world._workers.world]
print(*{{w.pid for w in [*workers, twin._workers.world]}}, flush=True)
{then}
"""


def caller(then, instance="toys.trio()"):
    code = textwrap.dedent(CALLER).format(root=ROOT, toys=TOYS, then=then, instance=instance)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    return process, [int(word) for word in process.stdout.readline().split()]


def test_no_worker_outlives_a_killed_caller():
    process, workers = caller("time.sleep(3600)")
    assert len(workers) == 3
    assert all(is_running(pid) for pid in workers)
    process.kill()
    process.wait()
    process.stdout.close()
    await_gone(workers)


def test_no_worker_outlives_a_killed_caller_even_in_a_hung_engine():
    hanging = 'toys.instance(toys.entity("bee", "toy_b", fault="hang", fault_at=0.5))'
    process, workers = caller("twin.step(1, ())", hanging)
    time.sleep(0.3)
    process.kill()
    process.wait()
    process.stdout.close()
    await_gone(workers)


def test_a_caller_that_ends_without_closing_its_world_leaves_no_workers():
    process, workers = caller("world.step(1, ())")
    assert process.wait(900) == 0
    process.stdout.close()
    await_gone(workers)


@starts_interpreters
def test_the_workers_of_a_garbage_collected_world_end():
    world = opened()
    world.reset(toys.trio(), toys.CITY)
    seen = pids(world)
    del world
    gc.collect()
    await_gone(seen)


@starts_interpreters
def test_closing_the_world_in_a_fork_of_the_caller_does_not_end_the_workers(world):
    world.reset(toys.trio(), toys.CITY)
    child = os.fork()
    if child == 0:
        world.close()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert world.step(1, ()).tick == 1


def test_memory_does_not_grow_with_pictures(world):
    camera = toys.camera(960, 540)
    ready = world.reset(toys.instance(toys.entity("ant", "toy_a", cameras=(camera,))), toys.CITY)
    states = ready.snapshots[-1].states
    world.capture(0, [toys.request(0)], states)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        world.capture(0, [toys.request(0)], states)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 500_000
