"""Deadlines in a worker's own time: a wait for a processor does not count; sleeping and spinning do.

The queue is real: the worker and spinning processes share one processor. Nothing here asserts how long anything takes.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import tests.kernel.world_toys as toys
from lingjing.errors import InfrastructureError
from lingjing.processes import deadlines
from lingjing.testing.worlds import open_world
from lingjing.trace.records import Absent

TOYS = ("tests.kernel.world_toys:plugin", "tests.kernel.world_toys:painter")
ENGINE_S = 1.5

pytestmark = pytest.mark.skipif(not deadlines.is_counted(), reason="this kernel does not count waits in run queues")


@pytest.fixture
def crowd():
    """Let a process share one processor with three spinning processes, each of which gets as much time as it does."""
    one = {min(os.sched_getaffinity(0))}
    started = []

    def join(pid):
        spin = [sys.executable, "-S", "-c", "import os; os.write(1, b'.')\nwhile True: pass"]
        while len(started) < 3:
            started.append(subprocess.Popen(spin, stdout=subprocess.PIPE))
            started[-1].stdout.read(1)
            os.sched_setaffinity(started[-1].pid, one)
        for task in os.listdir(f"/proc/{pid}/task"):
            os.sched_setaffinity(int(task), one)

    yield join
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture(params=["process", "inline"])
def kind(request):
    return request.param


@pytest.fixture
def world():
    world = open_world("process", plugins=TOYS, installed=False)
    yield world
    world.close()


def faulty(fault, *, engine_s=ENGINE_S):
    bee = toys.entity("bee", "toy_b", 2.0, fault=fault, fault_at=0.05)
    return toys.instance(toys.entity("ant", "toy_a", 1.0), bee, engine_s=engine_s)


def test_the_wait_of_an_engine_for_a_processor_does_not_count(world, crowd):
    """It computes for eight tenths of a second in ten macro-steps, with a quarter of a processor: three on the wall."""
    world.reset(faulty("burn"), toys.CITY)
    pid = world._workers.world.pid
    crowd(pid)
    own = deadlines.OwnDeadline(pid, 3600.0, watched=True)
    assert world.step(1, ()).tick == 1
    spent = own.spent_s()
    assert own._last[str(pid)].waited_ns > own._first[str(pid)].waited_ns  # it did stand in the queue
    assert 10 * toys.BURNS_S["burn"] <= spent  # and what it ran was counted


def test_a_spinning_engine_on_a_shared_processor_is_killed(world, crowd):
    world.reset(faulty("spin", engine_s=0.3), toys.CITY)
    crowd(world._workers.world.pid)
    with pytest.raises(InfrastructureError, match=r"`toy_b` .*\(advance\) did not answer within 0.3 s") as caught:
        world.step(1, ())
    assert caught.value.cause == ""


def test_a_stopped_worker_is_killed(world, crowd):
    world.reset(faulty("none", engine_s=0.3), toys.CITY)
    pid = world._workers.world.pid
    crowd(pid)
    os.kill(pid, signal.SIGSTOP)
    with pytest.raises(InfrastructureError, match=r"the world process did not answer within 0.3 s") as caught:
        world.step(1, ())
    assert caught.value.cause == "world-process"


def test_a_picture_drawn_on_a_shared_processor_is_not_late(world, crowd):
    ant = toys.entity("ant", "toy_a", cameras=(toys.camera(),), fault="burn_much", fault_at=0.0, fault_in="camera")
    ready = world.reset(toys.instance(ant, capture_s=ENGINE_S), toys.CITY)
    camera = world._workers.camera.worker.pid
    crowd(camera)
    states = ready.snapshots[-1].states
    (answer,) = world.capture(0, [toys.request(0, "f")], states)
    assert not isinstance(answer, Absent), answer.reason


def test_a_wait_for_a_processor_is_recognised_before_it_ends(monkeypatch):
    """The counters change when a wait ends. Until then the only sign of it is a runnable thread that does not run."""
    looks = iter([(5, 0), *[(5, 0)] * 6, (6, 10**18)])
    seen = [(5, 0)]

    def threads(pid):
        seen[0] = next(looks, seen[0])
        return {"7": deadlines._Thread(*seen[0])}

    monkeypatch.setattr(deadlines, "_threads", threads)
    monkeypatch.setattr(deadlines, "_is_runnable", lambda pid, thread: True)
    own = deadlines.OwnDeadline(7, 0.02, watched=True)
    lefts = []
    while not lefts or (lefts[-1] > 0.0 and len(lefts) < 50):
        lefts.append(own.left_s())
        toys.time.sleep(0.02)
    assert len(lefts) == 50  # it has waited for a processor during the whole time


def test_the_sleep_of_a_process_counts():
    sleeper = subprocess.Popen(["sleep", "3600"])
    try:
        own = deadlines.OwnDeadline(sleeper.pid, 0.1)
        while own.left_s() > 0.0:
            pass
        assert own.spent_s() >= 0.1
    finally:
        sleeper.kill()
        sleeper.wait()


@pytest.mark.parametrize("fault", ["hang", "spin"])
def test_the_error_names_the_engine_that_used_the_time(world, fault):
    """`toy_a` uses nearly all of the time; the deadline passes during `toy_b`."""
    instance = toys.instance(
        toys.entity("ant", "toy_a", 1.0, fault="burn_more", fault_at=0.05),
        toys.entity("bee", "toy_b", 2.0, fault=fault, fault_at=0.95),
        engine_s=3.0,
    )
    world.reset(instance, toys.CITY)
    message = (
        r"engine `toy_a` .*took \S+ of 3 s, so that engine `toy_b` \(advance\) had no time left; the world process"
    )
    with pytest.raises(InfrastructureError, match=message):
        world.step(1, ())


def test_the_preparation_of_the_camera_counts_towards_no_budget(kind):
    ant = toys.entity("ant", "toy_a", cameras=(toys.camera(),), fault="slow_reset", fault_in="camera")
    world = open_world(kind, plugins=TOYS, installed=False)
    try:
        ready = world.reset(toys.instance(ant, engine_s=1.0), toys.CITY)
        assert ready.tick == 0
    finally:
        world.close()


def test_the_error_names_only_the_slow_remote_engine(world, monkeypatch):
    """The time of the caller's own engines does not count for the world process, which is called in between."""
    usual = toys.Toy.advance

    def slow(self, until, mirrors):
        if self.spec.engine == "toy_remote":
            toys.time.sleep(0.08)
        return usual(self, until, mirrors)

    monkeypatch.setattr(toys.Toy, "advance", slow)
    far = toys.entity("far", "toy_remote", 4.0)
    world.reset(toys.instance(*toys.trio().entities, far, engine_s=0.7), toys.CITY)
    with pytest.raises(InfrastructureError, match=r"of 0.7 s for one boundary; the slowest was engine `toy_remote` .*"):
        world.step(1, ())


def test_the_error_names_the_slow_engine_of_the_inline_world():
    world = open_world("inline", plugins=TOYS, installed=False)
    world.reset(faulty("burn", engine_s=0.5), toys.CITY)
    with pytest.raises(InfrastructureError, match=r"of 0.5 s .*; the slowest was engine `toy_b` .*with"):
        world.step(1, ())


def test_the_wait_for_a_processor_does_not_count_in_the_inline_world(crowd):
    """The engines run in a separate process, because the crowd shares the processor of the process that hosts them."""
    here = Path(__file__).parents[2]
    code = f"""
import sys
sys.path.insert(0, {str(here)!r})
import tests.kernel.world_toys as toys
from lingjing.testing.worlds import open_world
world = open_world("inline", plugins={TOYS!r}, installed=False)
bee = toys.entity("bee", "toy_b", 2.0, fault="burn", fault_at=0.05)
world.reset(toys.instance(bee, engine_s={ENGINE_S}), toys.CITY)
print("ready", flush=True)
sys.stdin.readline()
print(world.step(1, ()).tick)
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    crowd(process.pid)
    assert process.communicate("go\n")[0] == "1\n"


def test_without_run_queue_counters_the_deadline_uses_the_wall_clock(monkeypatch):
    monkeypatch.setattr(deadlines, "_threads", lambda pid: {})
    assert not deadlines.is_counted()
    own = deadlines.OwnDeadline(os.getpid(), 0.02, watched=True)
    while own.left_s() > 0.0:
        pass
    assert own.spent_s() >= 0.02


def test_the_clock_of_a_thread_counts_computation_before_and_after_a_fork():
    before = deadlines.own_now_s()
    toys.burn(0.02)
    assert deadlines.own_now_s() - before >= 0.019
    child = os.fork()
    if child == 0:
        started = deadlines.own_now_s()
        toys.burn(0.02)
        os._exit(0 if deadlines.own_now_s() - started >= 0.019 else 1)
    assert os.waitpid(child, 0)[1] == 0
