"""One episode from a mission to a score: `run`, and `Session` for several with the same workers.

It works in a plain script, in a worker process and inside a notebook's running event loop: policies have event loops of
their own, and the engines run in processes that end with this one.
"""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Literal, Self, Unpack

import msgspec

from lingjing.analysis.agent_notes import agent_notes
from lingjing.analysis.played_city import attribution_of
from lingjing.analysis.relations import RelationTracker
from lingjing.errors import ErrorCollector, UsageError
from lingjing.kernel.ambient_random import generator_states, generators_advanced, load_generators
from lingjing.kernel.barrier import Barrier, PolicyBarrier
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.episode import DecisionSource, Progress, play, reset_policies
from lingjing.kernel.evaluators import build_evaluators
from lingjing.kernel.step import Kernel
from lingjing.kernel.swapped_pictures import SwappedPictures
from lingjing.kernel.world import open_world
from lingjing.kernel.world.contract import StoredFrame, World
from lingjing.mission.draws import redrawn_in_words
from lingjing.mission.feasibility import prove_instance
from lingjing.mission.instance import Instance
from lingjing.mission.model import Mission
from lingjing.mission.salts import salt_fingerprint
from lingjing.numerics import versions
from lingjing.play.folders import claim_run_folder
from lingjing.play.options import Changes, PlayOptions, compiled, deciding_options, options_of
from lingjing.play.outages import ServiceOutages
from lingjing.play.policies import AssignedPolicy
from lingjing.play.policy_processes.servers import NO_WALLS, WALLS_FROM, PolicyServer
from lingjing.play.preparation import Preparation, prepare
from lingjing.play.recorded_calls import EpisodeCalls
from lingjing.play.report import ABORTED, EpisodeReport, report_of
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import build_policy
from lingjing.plugins.policy import PolicyPlugin
from lingjing.processes.fork_client import ForkServerClient
from lingjing.scene.city import City, content_sha256
from lingjing.scene.displacement import displacements, in_words, moved_bodies
from lingjing.scene.surroundings import surroundings
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import AgentBinding, BoundaryRecord, EngineFrame, Header, Outcome, RemoteBinding
from lingjing.trace.writer import PictureParts, TraceWriter, trace_removed_error, trace_tampered_error

NOT_PROMISED = "this digest is not promised on other processors"
"""The warning of a report with `withdrawn` entries: other processors may give another digest."""
PIN_FIRST = "`lingjing.pin()` before numpy is imported, or `lingjing run`, pins what can be pinned"
"""The remedy that follows `NOT_PROMISED`."""

_AMBIENT = (
    "the digest differs in each run: the policy of {} draws from a global random generator, which has no seed here; "
    "draw from a generator with the seed `brief.seed`, or play with `lingjing run`"
)
"""The warning about policies that draw from a global random generator. `{}` is the list of agents."""

BROKEN = "not promised behind these walls"
"""The warning of a report if the walls around its policies were incomplete."""

TRACE_NAME = "trace.mcap"
"""The file name of the trace in a run's folder."""
OVERVIEW_NAME = "overview.png"
"""The file name of the overview picture in a run's folder."""


@dataclass(frozen=True, slots=True)
class OutsideControl:
    """The control of an episode from outside of its policies."""

    change: Callable[[Instance], Instance]
    """Changes the instance before it is placed in its city."""
    source: Callable[[Kernel, Barrier, City], DecisionSource] = lambda kernel, barrier, city: barrier
    """Makes the source of decisions around the barrier of the policies."""
    remote_engines: tuple[RemoteBinding, ...] = ()
    """The engines that foreign sessions play."""
    frames: Callable[[int], Sequence[EngineFrame]] = lambda tick: ()
    """Returns the sessions' frames since its last call, as those before this boundary."""


class _FramesFirst:
    """A recorder of the end that writes the sessions' last frames before the outcome."""

    def __init__(self, writer: TraceWriter, outside: OutsideControl) -> None:
        self._writer, self._outside = writer, outside

    def finish(self, outcome: Outcome) -> object:
        """Write the frames and the outcome, and give the file its final name."""
        self._write(outcome)
        return self._writer.finish(outcome)

    def abandon(self, outcome: Outcome | None) -> object:
        """Write the frames and the outcome, if any, and keep the file recognisable as partial."""
        self._write(outcome)
        return self._writer.abandon(outcome)

    def _write(self, outcome: Outcome | None) -> None:
        self._writer.engine_frames(self._outside.frames(outcome.ticks if outcome is not None else 0))


class EpisodeInterrupted(KeyboardInterrupt):
    """Ctrl-C during an episode. `report` is the report of its partial trace, which is closed."""

    def __init__(self, report: EpisodeReport) -> None:
        super().__init__(f"interrupted at tick {report.ticks}; the partial trace is {report.trace}")
        self.report = report


class Session:
    """Plays episodes one after another with the same workers. A context manager; `close` ends the workers.

    >>> with lingjing.Session() as session:
    ...     scores = [session.run("first.ljs", seed=seed, overview=False).score for seed in (0, 1)]
    >>> scores
    [0.0, 0.0]

    `fork_server` forks the workers from a process that has imported their modules; without one they are started anew.
    `policy_server` forks a process for each agent's policy. Without one, and with `world="inline"`, policies run in
    threads of this process.
    """

    def __init__(
        self,
        host: PluginHost | None = None,
        fork_server: ForkServerClient | None = None,
        policy_server: PolicyServer | None = None,
    ) -> None:
        self.host = host or PluginHost()
        self._fork_server = fork_server  # shared by the episodes of a command (ADR 0019)
        self._policy_server = policy_server
        self._cities = CityBuilder(self.host)
        self._worlds: dict[str, World] = {}

    def run(
        self,
        mission: Mission | str | PathLike[str],
        *,
        out: str | Path | None = None,
        progress: Callable[[Progress], None] | None = None,
        **changes: Unpack[Changes],
    ) -> EpisodeReport:
        """Play one episode and return its report. Arguments and errors are those of `lingjing.run`."""
        errors = ErrorCollector()
        options, compiled, loaded = options_of(mission, changes, errors)
        server = self._server_of(options, loaded)
        return self._play(prepare(options, compiled, self.host, loaded, errors, server), options, out, progress, server)

    def play(
        self,
        options: PlayOptions,
        mission: Mission | None = None,
        *,
        out: str | Path | None = None,
        progress: Callable[[Progress], None] | None = None,
        loaded: Mapping[str, PolicyPlugin] | None = None,
        outside: OutsideControl | None = None,
    ) -> EpisodeReport:
        """Play the episode of the options and return its report.

        `mission` is the compiled mission of the options, if the caller has it. `loaded` are loaded policies by their
        names in the options. `outside` controls the episode beside the policies. Raises the errors of `lingjing.run`.
        """
        server = self._server_of(options, loaded or {})
        prepared = prepare(options, mission or compiled(options), self.host, loaded or {}, server=server)
        if outside is not None:
            prepared = replace(prepared, instance=outside.change(prepared.instance))
        return self._play(prepared, options, out, progress, server, outside)

    def _server_of(self, options: PlayOptions, loaded: Mapping[str, PolicyPlugin]) -> PolicyServer | None:
        """Return the server that forks the processes of policies; None if policies run in this process.

        They run here with inline engines. A policy passed as an object runs here too, because it has no name in another
        process.
        """
        server = self._policy_server if options.world == "process" and not loaded else None
        if options.isolate != "no" and (server is None or server.walls is None):
            raise UsageError(NO_WALLS, hint=WALLS_FROM)
        return server

    def _play(
        self,
        prepared: Preparation,
        options: PlayOptions,
        out: str | Path | None,
        progress: Callable[[Progress], None] | None,
        server: PolicyServer | None,
        outside: OutsideControl | None = None,
    ) -> EpisodeReport:
        instance, city = self._cities.place(prepared.instance, imported=bool(prepared.places))
        moves = tuple(displacements(prepared.instance, instance, prepared.places))
        calls = EpisodeCalls(options, instance)
        relations = RelationTracker(instance)
        swapped = self._swapped(prepared, options)
        recorder: list[TraceWriter] = []

        def record_boundary(record: BoundaryRecord, frames: Sequence[StoredFrame]) -> None:
            if outside is not None:
                recorder[0].engine_frames(outside.frames(record.tick))
            recorder[0].boundary(msgspec.structs.replace(record, relations=relations.take(record)), _stored(frames))

        kernel = Kernel(
            instance,
            city,
            self._world(options.world),
            privileged=frozenset(agent for agent, policy in prepared.assigned.items() if policy.privileged),
            record=record_boundary,
            evaluators=build_evaluators(prepared.evaluators, instance, self.host, prepared.evaluator_options),
            blank_pictures=options.blank_pictures,
            swapped=swapped,
            policy_seed=options.policy_seed,
        )
        barrier = _barrier(prepared.assigned, options, instance, city, calls, server, self.host)
        try:
            reset_policies(kernel, barrier)
            chosen = Path(out) if out is not None else claim_run_folder(instance.mission, instance.mode, options.seed)
            folder = chosen.absolute()  # a policy in this process may go to another working folder
            header = _header(instance, city, prepared, options, barrier)
            if outside is not None:
                header = msgspec.structs.replace(header, remote_engines=outside.remote_engines)
            writer = _writer(folder, header, city, prepared.key)
        except BaseException:
            barrier.close()
            if swapped is not None:
                swapped.close()
            raise
        recorder.append(writer)
        calls.keep_in(folder)
        broken = _broken_promises(barrier)
        try:
            source = barrier if outside is None else outside.source(kernel, barrier, city)
            ending = writer if outside is None else _FramesFirst(writer, outside)
            outcome = play(kernel, source, ending, progress)
        except KeyboardInterrupt:
            self.close()
            ended = writer.path if writer.path.exists() else writer.part  # it may be complete
            raise EpisodeInterrupted(_report(ended, options, chosen, city=None, notes_moves=bool(moves))) from None
        finally:
            calls.close()
            if swapped is not None:
                swapped.close()
        path = writer.part if outcome.reason == ABORTED else writer.path
        report = _report(path, options, chosen, city=city if options.overview else None, notes_moves=bool(moves))
        return msgspec.structs.replace(
            report, warnings=(*broken, *_proofs_of_defeat(instance), *moves, *calls.differences(), *report.warnings)
        )

    def close(self) -> None:
        """End the workers; the next episode starts new ones."""
        while self._worlds:
            self._worlds.popitem()[1].close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _swapped(self, prepared: Preparation, options: PlayOptions) -> SwappedPictures | None:
        """Return the pictures of the neighbouring seed, if the options want them."""
        if prepared.swapped is None:
            return None
        instance, city = self._cities.place(prepared.swapped, imported=bool(prepared.places))
        return SwappedPictures(open_world(options.world, host=self.host, fork_server=self._fork_server), instance, city)

    def _world(self, kind: Literal["process", "inline"]) -> World:
        if kind not in self._worlds:
            self._worlds[kind] = open_world(kind, host=self.host, fork_server=self._fork_server)
        return self._worlds[kind]


def run(
    mission: Mission | str | PathLike[str],
    *,
    out: str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
    **changes: Unpack[Changes],
) -> EpisodeReport:
    """Play `mission` once and return its report.

    >>> report = lingjing.run("first.ljs", seed=1, policy="random", overview=False)
    >>> report.success, report.metrics["messages"] >= 0
    (False, True)

    `mission` is what `lingjing.compile` returns, the name of a file, or that of a shipped mission (`"ssr"`).
    `out` is a new or empty folder (default: a new one under `runs/`) that receives `trace.mcap` and `overview.png`;
    `progress` is called at every boundary. The other arguments are the fields of `lingjing.PlayOptions`, with its
    defaults; `policy` and the values of `policies_for` may also be a class, or a function that makes a policy.

    Policies are trusted here: they run in threads of this process and can end or ruin it. The command line gives each a
    process of its own.

    Raises `UsageError` for wrong arguments and unwritable folders, `MissionError` for a mission that cannot be
    instantiated, `PluginError` for a plug-in that breaks its contract, `EpisodeInterrupted` on Ctrl-C,
    `InfrastructureError` if the trace was removed meanwhile. An engine or evaluator that fails is no exception: the
    report's `reason` is `infrastructure-abort` and `detail` says which one and why.
    """
    with Session() as session:
        return session.run(mission, out=out, progress=progress, **changes)


def _barrier(
    assigned: Mapping[str, AssignedPolicy],
    options: PlayOptions,
    instance: Instance,
    city: City,
    calls: EpisodeCalls,
    server: PolicyServer | None,
    host: PluginHost,
) -> Barrier:
    """Return the built policies in the order of their agents: in processes that `server` forks, or in this process."""
    limit_s, outages = instance.budget.policy_s, ServiceOutages(assigned, calls)
    if server is not None:
        from lingjing.play.policy_processes.barrier import ProcessBarrier
        from lingjing.play.policy_processes.loading import agent_policies

        barrier = ProcessBarrier(agent_policies(assigned, options, instance, city, calls), limit_s, server, outages)
        barrier.load()
        return barrier
    load_generators()
    built, agents_drawing = {}, set()
    for agent, policy in assigned.items():
        if policy.plugin is not None:
            before = generator_states()
            built[agent] = build_policy(policy.plugin, policy.arguments, calls.of(agent), host)
            agents_drawing |= {agent} if generators_advanced(before, generator_states()) else set()
    return PolicyBarrier(built, limit_s, outages, agents_drawing)


def _proofs_of_defeat(instance: Instance) -> tuple[str, ...]:
    """Return a warning for each proof that no policy could win this instance.

    Such an instance is played all the same, because a study may demonstrate it.
    """
    return tuple(f"this could not be won ({proof.code}): {proof.message}" for proof in prove_instance(instance))


def _stored(frames: Sequence[StoredFrame]) -> list[PictureParts]:
    return [(frame.info, frame.jpeg, frame.depth, frame.semantic, frame.instance) for frame in frames]


def _header(instance: Instance, city: City, prepared: Preparation, options: PlayOptions, barrier: Barrier) -> Header:
    return Header(
        instance=instance,
        bindings=tuple(
            AgentBinding(agent=agent, policy=policy.name, privileged=policy.privileged, arguments=policy.arguments)
            for agent, policy in prepared.assigned.items()
        ),
        fingerprint=dict(versions())
        | _policy_fingerprints(prepared)
        | _walls_fingerprint(barrier)
        | salt_fingerprint(options.salt, options.seed),
        city_sha256=content_sha256(city),
        attribution=attribution_of(city, instance),
        started_wall=dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        policy_seed=options.policy_seed,
        evaluators=options.evaluators,
        evaluator_options=prepared.evaluator_options,
        moved=moved_bodies(prepared.instance, instance),
        options=deciding_options(options),
    )


def _walls_fingerprint(barrier: Barrier) -> dict[str, str]:
    """Return the weakest walls around the policies, in words; nothing without walls."""
    reports = sorted(barrier.wall_reports, key=lambda report: len(report.guards))
    return {"walls": reports[0].in_words()} if reports else {}


def _broken_promises(barrier: Barrier) -> tuple[str, ...]:
    """Return a warning for the promises that the walls around the policies break on this kernel."""
    broken = dict.fromkeys(promise for report in barrier.wall_reports for promise in report.broken)
    return (f"{BROKEN}: {'; '.join(broken)}; `lingjing doctor` says why",) if broken else ()


def _policy_fingerprints(prepared: Preparation) -> dict[str, str]:
    """Return the values that decide behaviour beside the policies' options, such as a prompt's SHA-256."""
    return {name: value for policy in prepared.assigned.values() for name, value in policy.fingerprint.items()}


def _writer(folder: Path, header: Header, city: City, key: bytes) -> TraceWriter:
    """Return the writer of the trace in its folder. Raises `UsageError` if the folder or file cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return TraceWriter(folder / TRACE_NAME, header, key, surroundings(city, header.instance))
    except OSError as error:
        raise UsageError(f"cannot write to `{folder}`: {error.strerror}", hint="choose another folder") from error


def _report(path: Path, options: PlayOptions, folder: Path, city: City | None, *, notes_moves: bool) -> EpisodeReport:
    """Return the report of the trace's episode, and draw the overview if `city` is not None.

    `folder` is the trace's folder as the caller named it. `notes_moves`: the caller reports moved bodies itself, by
    their places in the mission's document.
    """
    if not path.is_file():
        raise trace_removed_error(path)
    try:
        trace = read_trace(path)
    except UsageError as error:
        raise trace_tampered_error(path, str(error)) from error
    report = report_of(trace, options.policy)
    moved = () if notes_moves else in_words(trace.header.moved)
    moved += redrawn_in_words(trace.header.instance.redrawn)
    warnings = (*moved, *_warnings(trace, report.withdrawn), *(_draw_overview(trace, city) if city is not None else ()))
    return msgspec.structs.replace(report, warnings=warnings, trace=str(folder / path.name))


def _draw_overview(trace: Trace, city: City) -> tuple[str, ...]:
    """Draw the overview and return warnings. A failure is a warning: the trace and the score remain valid."""
    from lingjing.analysis.overview import draw_overview

    try:
        return draw_overview(trace, trace.path.with_name(OVERVIEW_NAME), city)
    except UsageError as error:
        return (f"no overview: {error}",)


def _warnings(trace: Trace, deviations: Sequence[str]) -> tuple[str, ...]:
    """Return the warnings of a report, one line each.

    Reported are a success without an action, replaced policy answers with the first one's detail, unseeded random
    draws, the notes in the agents' thoughts if the episode is lost, and `deviations` from numbers that every processor
    reproduces.
    """
    warnings, outcome = [], trace.outcome
    if outcome is not None and outcome.success and outcome.detail:
        warnings.append(outcome.detail)
    replaced = [decision for record in trace.boundaries for decision in record.decisions if decision.substituted]
    if replaced:
        first, kinds = replaced[0], Counter(decision.substituted for decision in replaced)
        reasons = ", ".join(f"{kind} {number}" for kind, number in sorted(kinds.items()))
        answers = sum(len(record.decisions) for record in trace.boundaries)
        replacement = f"{len(replaced)} of {answers} policy answers were replaced by doing nothing ({reasons})"
        warnings.append(f"{replacement}; the first was `{first.agent}`: {first.detail}")
    if outcome is not None and outcome.ambient_random:
        warnings.append(_AMBIENT.format(", ".join(f"`{agent}`" for agent in outcome.ambient_random)))
    if outcome is not None and not outcome.success:
        warnings += agent_notes(trace)
    if deviations:
        warnings.append(f"{NOT_PROMISED}: {'; '.join(deviations)}; {PIN_FIRST}")
    return tuple(warnings)
