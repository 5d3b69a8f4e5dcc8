"""`ProcessWorld`: motion engines in a world process, the sensor engine in a camera process, both kept between episodes.

The separate processes have four purposes. A hung or killed engine is an abort and not a crash. Deadlines can be
enforced. Pictures are drawn on another core. The world process can be forked. Remote engines run in the caller, which
then drives every macro-step; without them a tick is one round trip.
"""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import msgspec

from lingjing.errors import UsageError
from lingjing.kernel.world.camera import START_S, CameraProcess
from lingjing.kernel.world.contract import StoredFrame, WorldBoundary
from lingjing.kernel.world.cosimulation import CoSimulation, CoupledGroup, macro_steps
from lingjing.kernel.world.engine_group import (
    NO_MOVERS,
    EngineGroup,
    EngineReport,
    Movers,
    close_engines,
    start_engines,
)
from lingjing.kernel.world.extra_plugins import host_with
from lingjing.kernel.world.guarded_calls import OWN_ENGINES, name_plugin, no_episode, no_sensor
from lingjing.kernel.world.handle import ReplyT, Worker
from lingjing.kernel.world.held_cities import packed
from lingjing.kernel.world.held_starts import HeldStarts
from lingjing.kernel.world.launch import WorkerPlace, WorkerSettings
from lingjing.kernel.world.messages import (
    Admitted,
    Advance,
    Begin,
    Prepare,
    Ready,
    Reported,
    Reset,
    Step,
    Stepped,
    Submit,
    TakeEvents,
    WorkerMessage,
    encoded,
)
from lingjing.kernel.world.placed_worlds import world_start
from lingjing.kernel.world.selection import EngineSelection, select_engines, takes_pictures_unasked
from lingjing.kernel.world.times import EngineTimes
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest, Engine
from lingjing.plugins.host import PluginHost
from lingjing.processes.deadlines import OwnDeadline
from lingjing.processes.fork_client import ForkServerClient
from lingjing.scene.city import City
from lingjing.trace.records import Absent, BodyState, Command, Receipt


class _WorldProcessGroup:
    """The world process as one group among others, when the caller drives. Only its own time counts for its budget."""

    def __init__(self, worker: Worker, engines: tuple[str, ...], allowed_s: float, remote: EngineTimes) -> None:
        self.engines = engines
        self._worker = worker
        self._remote = remote
        self._allowed_s = allowed_s
        self._spent_s = 0.0

    def begin(self) -> None:
        """Start a barrier: the whole allowed time is available again."""
        self._spent_s = 0.0

    def reset(self) -> tuple[EngineReport, ...]:
        return self._ask(Begin(), Reported).reports

    def take_events(self, occurrences: Sequence[Occurrence]) -> None:
        self._ask(TakeEvents(occurrences=tuple(occurrences)), Ready)

    def submit(self, commands: Sequence[Command]) -> dict[str, Receipt]:
        return self._ask(Submit(commands=tuple(commands)), Admitted).receipts

    def advance(
        self, until: float, foreign: Sequence[BodyState] = (), ambient: Movers = NO_MOVERS
    ) -> tuple[EngineReport, ...]:
        return self._ask(Advance(until=until, foreign=tuple(foreign), ambient=dict(ambient)), Reported).reports

    def _ask(self, message: WorkerMessage, kind: type[ReplyT]) -> ReplyT:
        self._remote.pause()
        deadline = OwnDeadline(self._worker.pid, self._allowed_s, already_s=self._spent_s)
        reply = self._worker.ask(message, kind, deadline)
        self._spent_s = deadline.spent_s()
        return reply


@dataclass(slots=True)
class _Driver:
    """The state of an episode with remote engines, which the caller drives."""

    cosimulation: CoSimulation
    """The coupling of all groups."""
    far: _WorldProcessGroup | None
    """The group of the world process; None if all engines are remote."""
    times: EngineTimes
    """The times of the remote engines."""
    allowed_s: float
    """The engine budget of one barrier, in seconds."""

    def reset(self) -> WorldBoundary:
        """Return boundary 0."""
        return self._within_budget(self.cosimulation.reset)

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence]) -> WorldBoundary:
        """Return boundary `tick`."""
        return self._within_budget(lambda: self.cosimulation.step(tick, commands, occurrences))

    def _within_budget(self, barrier: Callable[[], WorldBoundary]) -> WorldBoundary:
        """Run a barrier. Remote engines cannot be killed, so their time is checked afterwards."""
        self.times.clear()
        if self.far is not None:
            self.far.begin()
        boundary = barrier()
        self.times.check(self.allowed_s)
        return boundary


@dataclass(slots=True)
class _Episode:
    instance: Instance
    cast: EngineSelection
    tick: int = 0
    driver: _Driver | None = None


class _Workers:
    """The workers and remote engines of a world. A finalizer can end them without a reference to the world."""

    def __init__(
        self, world: Worker | None = None, camera: CameraProcess | None = None, starts: HeldStarts | None = None
    ) -> None:
        self.world = world
        self.camera = camera
        self.remote: dict[str, Engine] = {}
        self.starts = starts
        self.original: Worker | None = None

    def end_all(self) -> None:
        """End everything. Idempotent."""
        self.return_to_original()
        if self.starts is not None:
            self.starts.clear()
        world, camera, remote = self.world, self.camera, self.remote
        self.world, self.camera, self.remote = None, None, {}
        if camera is not None:
            _release_camera(camera)
        if world is not None:
            world.release()
        _warn(close_engines(remote))

    def play_in(self, copy: Worker) -> None:
        """Play an episode in a copy; the original waits for an instance that was not played before."""
        self.original, self.world = self.world, copy

    def return_to_original(self) -> None:
        """End the copy after its episode."""
        if self.original is not None:
            copy, self.world, self.original = self.world, self.original, None
            if copy is not None:
                copy.release()

    def abandon_world(self) -> None:
        """Kill the world process: its state is unknown."""
        if self.world is not None:
            self.world.kill()
            self.world = None


class ProcessWorld:
    """A `World` of two worker processes. See `World` for the methods, `open_world` for the parameters."""

    def __init__(
        self,
        *,
        plugins: tuple[str, ...] = (),
        paths: tuple[str, ...] = (),
        installed: bool = True,
        host: PluginHost | None = None,
        fork_server: ForkServerClient | None = None,
        hold_starts: bool = False,
    ) -> None:
        self._fork_server = fork_server
        self._settings = WorkerSettings(plugins, paths, installed)
        self._host = host if host is not None else host_with(plugins, installed=installed)
        self._episode: _Episode | None = None
        self._runtimes: Mapping[str, Mapping[str, str]] = {}
        self._keep(_Workers(starts=HeldStarts() if hold_starts else None))

    @property
    def processes(self) -> Mapping[str, Mapping[str, str]]:
        """The runtime fingerprint of each worker; the camera process from its first picture on."""
        camera = self._workers.camera
        drawing = {"camera": camera.runtime} if camera is not None and camera.runtime else {}
        return {**self._runtimes, **drawing}

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Start an episode on the present workers, or on new ones."""
        roles = select_engines(instance, self._host)
        macro_steps(instance.clock)
        self._episode = None
        carried = packed(city)
        try:
            self._start_workers(roles, instance, carried)
            if self._workers.camera is not None and roles.sensor is not None:
                drawn = Reset(instance=instance, city=carried, coupled=False)
                self._workers.camera.begin(roles.sensor, drawn, at_once=takes_pictures_unasked(instance))
            return self._placed(_Episode(instance, roles), city, carried)
        except BaseException as error:
            name_plugin(error, self._host)
            self._workers.abandon_world()
            self._abandon_camera()
            raise

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence] = ()) -> WorldBoundary:
        """Advance to boundary `tick` within `budget.engine_s`."""
        episode = self._playing()
        if tick != episode.tick + 1:
            raise ValueError(f"boundary {tick} does not follow boundary {episode.tick}")
        try:
            boundary = self._step(episode, tick, tuple(commands), tuple(occurrences))
        except BaseException as error:
            name_plugin(error, self._host)
            self._episode = None
            self._workers.abandon_world()
            raise
        episode.tick = tick
        return boundary

    def capture(
        self,
        tick: int,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
    ) -> tuple[StoredFrame | Absent, ...]:
        """Draw the pictures of boundary `tick` in one round trip, within `budget.capture_s` for all of them."""
        episode = self._playing()
        if not requests:
            return ()
        if self._workers.camera is None or episode.cast.sensor is None:
            raise no_sensor()
        time_s = tick * episode.instance.clock.tick_s
        try:
            return self._workers.camera.capture(
                time_s, requests, states, occurrences, episode.instance.budget.capture_s
            )
        except BaseException as error:
            name_plugin(error, self._host)
            self._episode = None
            self._abandon_camera()
            raise

    def fork(self) -> ProcessWorld:
        """Return a world in a forked copy of the world process; the camera is shared. Closing one leaves the other
        intact.
        """
        episode = self._playing()
        if self._workers.world is None or episode.driver is not None:
            names = ", ".join(episode.cast.remote) or "none"
            raise UsageError(f"a world with remote engines ({names}) cannot be forked")
        world = self._workers.world
        copy = world.fork(world.deadline(episode.instance.budget.engine_s))
        twin = ProcessWorld(
            plugins=self._settings.plugins,
            paths=self._settings.paths,
            installed=self._settings.installed,
            host=self._host,
            fork_server=self._fork_server,
        )
        camera = self._workers.camera
        if camera is not None:
            camera.worker.share()
        twin._keep(_Workers(copy, camera))
        twin._episode = _Episode(episode.instance, episode.cast, episode.tick)
        twin._runtimes = self._runtimes
        return twin

    def close(self) -> None:
        """End the workers and the remote engines. Forks of this world continue. Idempotent."""
        self._episode = None
        self._workers.end_all()

    def _keep(self, workers: _Workers) -> None:
        self._workers = workers
        weakref.finalize(self, workers.end_all)

    def _playing(self) -> _Episode:
        if self._episode is None:
            raise no_episode()
        return self._episode

    def _start_workers(self, roles: EngineSelection, instance: Instance, city: msgspec.Raw) -> None:
        """Start the workers that this episode needs, in parallel."""
        workers = self._workers
        workers.return_to_original()
        workers.world = self._fit(workers.world)
        if roles.local and workers.world is None:
            may_be_placed = self._fork_server is not None and not roles.remote
            start = world_start(roles.local, instance, city).key if may_be_placed else b""
            workers.world = self._start("world", start)
        camera = workers.camera
        if camera is not None and (not camera.worker.alive or camera.busy or camera.worker.users > 1):
            _release_camera(camera)
            workers.camera = None
        if roles.sensor is not None and workers.camera is None:
            workers.camera = CameraProcess(self._start("camera"))

    def _fit(self, worker: Worker | None) -> Worker | None:
        """Return the worker if it can play another episode, that is, if it is alive and neither a copy nor forked."""
        copies = len(self._workers.starts) if self._workers.starts is not None else 0
        if worker is None or (worker.alive and worker.parent is None and worker.users == 1 + copies):
            return worker
        if self._workers.starts is not None:
            self._workers.starts.clear()  # forks end with their parent process
        worker.release()
        return None

    def _start(self, place: WorkerPlace, start: bytes = b"") -> Worker:
        return Worker.start(place, self._settings, self._fork_server, start)

    def _placed(self, episode: _Episode, city: City, carried: msgspec.Raw) -> WorldBoundary:
        """Return boundary 0, from a copy of a world that stands there or from engines that are reset."""
        workers, roles = self._workers, episode.cast
        starts = workers.starts if self._may_hold(roles) else None
        key = world_start(roles.local, episode.instance, carried).key if starts is not None else b""
        kept = starts.fork_of(key) if starts is not None else None
        if kept is not None:
            copy, start = kept
            workers.play_in(copy)
            self._episode, self._runtimes = episode, start.runtimes
            return start.boundary
        self._prepare(roles)
        boundary = self._reset(episode, city, carried)
        if starts is not None and workers.world is not None:
            starts.hold(key, workers.world, boundary, self._runtimes)
        return boundary

    def _may_hold(self, roles: EngineSelection) -> bool:
        """Return whether all engines are the project's own, which a fork copies bit by bit."""
        own = all(self._host.sources.get(("lingjing_engines", name)) == OWN_ENGINES for name in roles.local)
        return own and bool(roles.local) and not roles.remote

    def _prepare(self, roles: EngineSelection) -> None:
        workers = self._workers
        old, workers.remote = workers.remote, {}
        _warn(close_engines(old))
        preparing = None
        if workers.world is not None:
            preparing = _sent(workers.world, Prepare(engines=roles.local))
        workers.remote = start_engines(self._host, roles.remote)
        if preparing is not None:
            worker, deadline = preparing
            _warn(worker.expect(Ready, deadline).problems)

    def _reset(self, episode: _Episode, city: City, carried: msgspec.Raw) -> WorldBoundary:
        workers, roles, instance = self._workers, episode.cast, episode.instance
        coupled = not roles.remote and bool(roles.local)
        reset = Reset(instance=instance, city=carried, coupled=coupled)
        processes: dict[str, dict[str, str]] = {}
        if workers.world is not None and roles.local:
            worker, deadline = _sent(workers.world, reset)
            processes["world"] = worker.expect(Ready, deadline).runtime
        if coupled and workers.world is not None:
            boundary = workers.world.ask(Begin(), Stepped, workers.world.deadline(instance.budget.engine_s)).boundary
        else:
            episode.driver = self._driver(episode, city)
            boundary = episode.driver.reset()
        self._episode, self._runtimes = episode, processes
        return boundary

    def _driver(self, episode: _Episode, city: City) -> _Driver:
        world, roles, instance = self._workers.world, episode.cast, episode.instance
        allowed_s, times = instance.budget.engine_s, EngineTimes()
        parts: list[CoupledGroup] = [EngineGroup(instance, city, self._workers.remote, times.enter)]
        far = None
        if roles.local and world is not None:
            far = _WorldProcessGroup(world, roles.local, allowed_s, times)
            parts.append(far)
        return _Driver(CoSimulation(instance, parts), far, times, allowed_s)

    def _step(
        self, episode: _Episode, tick: int, commands: tuple[Command, ...], occurrences: tuple[Occurrence, ...]
    ) -> WorldBoundary:
        if episode.driver is not None:
            return episode.driver.step(tick, commands, occurrences)
        world = self._workers.world
        if world is None:
            raise no_episode()
        deadline = world.deadline(episode.instance.budget.engine_s)
        return world.ask(Step(tick=tick, commands=commands, occurrences=occurrences), Stepped, deadline).boundary

    def _abandon_camera(self) -> None:
        camera, self._workers.camera = self._workers.camera, None
        if camera is None:
            return
        if camera.worker.users == 1:
            camera.worker.kill()
        else:
            camera.worker.release()


def _sent(worker: Worker, message: WorkerMessage) -> tuple[Worker, OwnDeadline]:
    """Send a request outside the budgets. Return the worker and the deadline of the reply."""
    deadline = worker.deadline(START_S)
    worker.send(encoded(message), deadline)
    return worker, deadline


def _warn(problems: Sequence[str]) -> None:
    for problem in problems:
        warnings.warn(problem, RuntimeWarning, stacklevel=3)


def _release_camera(camera: CameraProcess) -> None:
    # A camera that still draws late pictures would delay the caller until it has finished: kill it.
    if camera.busy and camera.worker.users == 1:
        camera.worker.kill()
    else:
        camera.worker.release()
