"""Faults in a worker and the rest of the episode: an abort, its partial trace, a clean next episode."""

import os
import signal
import threading
import time
from pathlib import Path

import msgspec
import pytest

import tests.kernel.world_toys as toys
from lingjing import read as read_trace
from lingjing.kernel.episode import play, policy_barrier
from lingjing.kernel.step import Kernel
from lingjing.mission.instance import AgentSpec, ChannelSpec, Entity, InteractionSpec, StateSpec, VerbSpec
from lingjing.testing import TraceWriter, bare_instance
from lingjing.testing.traces import verify
from lingjing.testing.worlds import open_world
from lingjing.trace.records import Action, Decision, Header

TICKS = 4
ROOT = str(Path(__file__).parents[2])
TOYS = ("tests.kernel.world_toys:plugin", "tests.kernel.world_toys:painter")


class Goer:
    """A policy that moves its entity at every boundary and sometimes takes a picture."""

    async def reset(self, brief):
        self.resource = brief.resources[0].id

    async def act(self, observation, inbox):
        verb = "takePhoto" if observation.tick % 2 else "go"
        return Decision(command=Action(verb=verb))


def episode(fault="nothing", at=2.05, fault_in="toy_b", engine_s=20.0, capture_s=20.0, **more):
    """Return an instance with two movers, one with a camera and a policy; `fault` occurs in one engine from `at` on."""
    verbs = (VerbSpec(name="go"), VerbSpec(name="takePhoto"))
    faults = {"fault": fault, "fault_at": at, "fault_in": fault_in, **more}
    ant = toys.entity("ant", "toy_a", 1.0, cameras=(toys.camera(),), **faults)
    instance = toys.instance(
        msgspec.structs.replace(ant, verbs=verbs),
        toys.entity("bee", "toy_b", 2.0),
        engine_s=engine_s,
        capture_s=capture_s,
    )
    mind = AgentSpec(
        id="mind",
        name="mind",
        index=0,
        role="r",
        controls=("ant",),
        commands=("ant",),
        observes=(ChannelSpec(source="entity", name="ant"),),
    )
    budget = msgspec.structs.replace(instance.budget, ticks=TICKS, policy_s=20.0)
    return msgspec.structs.replace(
        instance, agents=(mind,), budget=budget, success=bare_instance((), won=False).success
    )


@pytest.fixture
def world():
    world = open_world(
        "process",
        plugins=("tests.kernel.world_toys:plugin", "tests.kernel.world_toys:painter"),
        paths=(ROOT,),
        installed=False,
    )
    yield world
    world.close()


def played(world, instance, folder, progress=None):
    """Return the outcome and the trace of one episode."""
    folder.mkdir()
    writer = TraceWriter(folder / "trace.mcap", Header(instance=instance, bindings=(), fingerprint={}))

    def record(boundary, frames):
        writer.boundary(boundary, [(frame.info, frame.jpeg, frame.depth, frame.semantic) for frame in frames])

    kernel = Kernel(instance, toys.CITY, world, record=record)
    outcome = play(kernel, policy_barrier(kernel, {"mind": Goer()}), writer, progress)
    whole = writer.path.exists()
    return outcome, read_trace(writer.path if whole else writer.part), whole


def workers(world):
    workers = world._workers
    return [worker.pid for worker in (workers.world, workers.camera.worker if workers.camera else None) if worker]


def children():
    """Return the running child processes of this one."""
    mine, children_found = str(os.getpid()), []
    for entry in Path("/proc").iterdir():
        try:
            state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
        except (OSError, ValueError):
            continue
        if parent == mine and state not in "ZX":
            children_found.append(int(entry.name))
    return set(children_found)


FAULTS = [
    ("raise", "toy_b", "engine `toy_b` of plug-in `toys` failed in advance: ValueError: the toy is broken"),
    ("kill", "toy_b", "the world process died (SIGKILL) while engine `toy_b` of plug-in `toys` was in advance"),
    ("nan", "toy_a", "engine `toy_a` of plug-in `toys` failed in advance: entity `ant` has a number that"),
    ("stale", "toy_b", "engine `toy_b` of plug-in `toys` failed in advance: its boundary is at 2.0 s instead of 2.1"),
    ("hang", "toy_b", "engine `toy_b` of plug-in `toys` (advance) did not answer within 2 s; the world"),
    ("kill", "camera", "the camera process died (SIGKILL) while engine `camera` of plug-in `painter` was in advance"),
]


@pytest.mark.parametrize(("fault", "where", "message"), FAULTS, ids=[f"{f}-{w}" for f, w, _ in FAULTS])
def test_an_abort_leaves_a_partial_trace_no_process_and_an_unaffected_next_episode(
    world, tmp_path, fault, where, message
):
    before = children()
    good, _, whole = played(world, episode(), tmp_path / "good")
    assert (good.reason, good.ticks, whole) == ("budget", TICKS, True)
    used = set(workers(world))
    limit_s = 2.0 if fault == "hang" else 20.0
    outcome, trace, whole = played(world, episode(fault, fault_in=where, engine_s=limit_s), tmp_path / "bad")
    assert outcome.reason == "infrastructure-abort"
    assert message in outcome.detail
    assert outcome.cause == ("" if fault != "kill" else "camera-process" if where == "camera" else "world-process")
    assert not whole
    # The partial trace has every committed boundary, a valid chain of digests, and the reason for the end.
    assert [record.tick for record in trace.boundaries] == list(range(outcome.ticks + 1))
    assert verify(trace, pixels=True) is None
    assert trace.outcome == outcome
    assert outcome.digest == trace.boundaries[-1].digest
    # The abort leaves no process, and the next episode equals the one before it.
    deadline = time.monotonic() + 600
    while (left := (children() - before) - set(workers(world))) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not left
    again, trace, _ = played(world, episode(), tmp_path / "again")
    assert (again.reason, again.digest, again.frames_digest) == (good.reason, good.digest, good.frames_digest)
    assert used != set(workers(world))  # the broken one was replaced


def test_a_late_picture_is_absent_and_the_episode_ends_normally(world, tmp_path, monkeypatch):
    monkeypatch.setattr("lingjing.kernel.world.camera._PATIENCE", 10_000)
    released = tmp_path / "released"

    def release(progress):
        if any(seen.absent for seen in progress.record.observations):
            released.touch()

    instance = episode("held_first", 1.0, "camera", capture_s=2.0, released=str(released))
    outcome, trace, whole = played(world, instance, tmp_path / "late", release)
    assert released.exists()
    assert (outcome.reason, whole) == ("budget", True)
    absent = [item for record in trace.boundaries for seen in record.observations for item in seen.absent]
    assert [(item.entity, item.reason) for item in absent][:1] == [("ant", "late")]
    assert verify(trace, pixels=True) is None


def test_a_world_killed_from_outside_in_mid_tick_is_an_abort(world, tmp_path):
    """`kill -9` at a random moment while an engine is at work."""
    instance = episode("hang", at=2.05, engine_s=3600.0)

    def kill(progress):
        if progress.tick == 2:
            pid = workers(world)[0]
            threading.Timer(0.3, os.kill, (pid, signal.SIGKILL)).start()

    outcome, trace, _ = played(world, instance, tmp_path / "shot", kill)
    assert outcome.reason == "infrastructure-abort"
    assert "died (SIGKILL)" in outcome.detail
    assert len(trace.boundaries) == 3
    assert played(world, episode(), tmp_path / "next")[0].reason == "budget"


def fire(number):
    return Entity(
        id=f"fire[{number}]",
        group="fire",
        index=number,
        role="target",
        type="building_fire",
        engine="city",
        position=(10.0 * number, 0.0, 0.0),
        properties={"heat": 1.0},
        interactions=(InteractionSpec(name="extinguish", by="toy_a", within_m=5.0),),
        state=(StateSpec(name="heat"),),
    )


def test_five_hundred_resets_leave_memory_flat():
    """New engines each time in the same workers: memory after the warm-up must not grow."""
    world = open_world("process", plugins=("tests.kernel.world_toys:plugin",), paths=(ROOT,))
    crowd = {"crowd": 20.0}
    bare = toys.instance(toys.entity("ant", "toy_a"), *(fire(n) for n in range(1, 9)), tick_s=0.2, **crowd)
    instance = msgspec.structs.replace(bare, comms=msgspec.structs.replace(bare.comms, range_m=100.0))
    try:
        samples = []
        for number in range(501):
            world.reset(instance, toys.CITY)
            world.step(1, ())
            if number % 100 == 0:
                samples.append(_memory_kb(workers(world)[0]))
        assert len(set(workers(world))) == 1
    finally:
        world.close()
    assert samples[-1] - samples[1] < 1_000, samples


def _memory_kb(pid):
    status = Path(f"/proc/{pid}/status").read_text()
    return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))
