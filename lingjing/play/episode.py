"""One episode from a mission to a score: `run`, and `Session` for several on warm workers.

Works in a plain script, in a worker process and inside a notebook's running loop alike: policies have loops of their
own, and the engines live in processes that end with this one.
"""

from __future__ import annotations

import datetime as dt
import hashlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, Self

import msgspec

from lingjing.analysis.relations import RelationTracker
from lingjing.errors import UsageError
from lingjing.kernel.episode import Progress, play, seat
from lingjing.kernel.staging import Stage
from lingjing.kernel.step import Kernel
from lingjing.kernel.world import open_world
from lingjing.kernel.world.contract import StoredFrame, World
from lingjing.mission.feasibility import prove_instance
from lingjing.mission.instance import AgentSpec, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.numerics import versions, withdrawn
from lingjing.play.folders import claim_run_folder
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import build_policy, load_policy, policy_of, share_arguments
from lingjing.plugins.policy import Policy, PolicyPlugin
from lingjing.scene.city import City
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import AgentBinding, BoundaryRecord, Header, Outcome, TaskEvent
from lingjing.trace.writer import Picture, TraceWriter, gone

if TYPE_CHECKING:
    from lingjing.analysis.incidents import Incident
    from lingjing.analysis.metrics import Metrics

PolicySpec = str | Callable[..., Policy]
"""A policy's name, `FILE.py:CLASS`, or anything that returns a policy object when called."""

NOT_PROMISED = "this digest is not promised on other processors"
PIN_FIRST = "`lingjing.pin()` before numpy is imported, or `lingjing run`, pins what can be pinned"

TRACE_NAME = "trace.mcap"
OVERVIEW_NAME = "overview.png"


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """What came of one episode. `trace` is the MCAP file (a `.part` if the episode was cut short), `scr` the subtask
    completion rate in 0..1, `score` the mission's own with weights and penalties, `detail` the cause of the ending
    where `reason` leaves it open, or what is to be known of a success, and `hint` what to do about an abort."""

    mission: str
    seed: int
    mode: str
    success: bool
    reason: str
    scr: float
    ticks: int
    digest: str
    frames_digest: str
    trace: Path
    folder: Path
    metrics: Metrics = field(repr=False)
    detail: str = ""
    hint: str = ""
    warnings: tuple[str, ...] = ()
    """What a reader of the score should know: replaced answers of policies, an overview that could not be written."""
    attribution: str = ""
    """Whose map was played on; `procedural` for nobody's."""
    score: float = 0.0
    policy_seed: int = 0
    """What the policies' own random streams started from."""
    incidents: tuple[Incident, ...] = ()
    """Who crashed, fell or ran out of energy, in order of time."""
    happened: tuple[TaskEvent, ...] = ()
    """The mission's own events: weather, who came and went."""
    withdrawn: tuple[str, ...] = ()
    """What computed otherwise than the promise of one digest on every processor asks, by process; empty: it holds."""


class EpisodeInterrupted(KeyboardInterrupt):
    """Ctrl-C in the middle of an episode: its partial trace is closed and scored in `result`."""

    def __init__(self, result: EpisodeResult) -> None:
        super().__init__(f"interrupted at tick {result.ticks}; the partial trace is {result.trace}")
        self.result = result


class Session:
    """Plays episodes one after another on the same warm workers. A context manager; `close` ends the workers."""

    def __init__(self, world: Literal["process", "inline"] = "process", host: PluginHost | None = None) -> None:
        if world not in ("process", "inline"):
            raise UsageError(f"world={world!r}", hint='engines run in "process" or "inline"')
        self.host = host or PluginHost()
        self._stage = Stage(self.host)
        self._kind = world
        self._world: World | None = None

    def run(
        self,
        mission: Mission | str | PathLike[str],
        *,
        policy: PolicySpec = "heuristic",
        policies_for: Mapping[str, PolicySpec] | None = None,
        policy_args: Mapping[str, str] | None = None,
        seed: int = 0,
        mode: str | None = None,
        settings: Mapping[str, float] | None = None,
        out: str | Path | None = None,
        policy_seed: int = 0,
        blank_pictures: bool = False,
        overview: bool = True,
        progress: Callable[[Progress], None] | None = None,
    ) -> EpisodeResult:
        """Play one episode; see `lingjing.run` for the arguments and the errors."""
        mission = _mission(mission)
        _check_seed(seed)
        _check_seed(policy_seed)
        instance, city = self._stage.set(instantiate(mission, seed=seed, mode=mode, settings=settings))
        seats = _cast(instance, policy, policies_for or {}, _texts(policy_args or {}), self.host)
        policies = {agent: build_policy(plugin, arguments) for agent, (plugin, arguments) in seats.items()}
        recorder: list[TraceWriter] = []
        relations = RelationTracker(instance)
        kernel = Kernel(
            instance,
            city,
            self._open(),
            privileged=frozenset(agent for agent, (plugin, _) in seats.items() if plugin.privileged),
            record=lambda record, frames: recorder[0].boundary(
                msgspec.structs.replace(record, relations=relations.take(record)), _stored(frames)
            ),
            blank_pictures=blank_pictures,
            policy_seed=policy_seed,
        )
        barrier = seat(kernel, policies)
        folder = Path(out) if out is not None else claim_run_folder(instance.mission, instance.mode, seed)
        writer = _writer(folder, instance, city, seats, policy_seed, barrier.close)
        recorder.append(writer)
        try:
            outcome = play(kernel, barrier, writer, progress)
        except KeyboardInterrupt:
            self.close()
            raise EpisodeInterrupted(_result(writer.part, folder, city, overview=False)) from None
        partial = outcome.reason == "infrastructure-abort"
        result = _result(writer.part if partial else writer.path, folder, city, overview=overview)
        return replace(result, warnings=(*_hopeless(instance), *result.warnings))

    def close(self) -> None:
        """End the workers; the next episode starts new ones."""
        if self._world is not None:
            self._world.close()
            self._world = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _open(self) -> World:
        if self._world is None:
            self._world = open_world(self._kind, host=self.host)
        return self._world


def run(
    mission: Mission | str | PathLike[str],
    *,
    policy: PolicySpec = "heuristic",
    policies_for: Mapping[str, PolicySpec] | None = None,
    policy_args: Mapping[str, str] | None = None,
    seed: int = 0,
    mode: str | None = None,
    settings: Mapping[str, float] | None = None,
    out: str | Path | None = None,
    world: Literal["process", "inline"] = "process",
    policy_seed: int = 0,
    blank_pictures: bool = False,
    overview: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> EpisodeResult:
    """Play `mission` once and return its score.

    `mission` is what `lingjing.compile` returns, the name of a file, or that of a shipped mission (`"ssr"`).
    `policy` plays every agent; `policies_for` overrides it by role or agent id; `policy_args` go to every policy
    that takes them. `seed` draws the instance, `policy_seed` starts the policies' own random streams and tells them
    nothing about it. `mode` and `settings` default to the mission's. `out` is a new or empty folder (default:
    a new one under `runs/`) that receives `trace.mcap` and `overview.png`. `blank_pictures` hands policies black
    pictures. `progress` is called at every boundary.

    Policies are trusted here: they run in this process and can end or ruin it. The command line plays them in a child
    that it watches over.

    Raises `UsageError` for wrong arguments and unwritable folders, `MissionError` for a mission that cannot be
    instantiated, `EpisodeInterrupted` on Ctrl-C, `InfrastructureError` if the trace was removed meanwhile. An engine
    that fails is no exception: the result's `reason` is `infrastructure-abort` and `detail` says which engine and why.
    """
    with Session(world) as session:
        return session.run(
            mission,
            policy=policy,
            policies_for=policies_for,
            policy_args=policy_args,
            seed=seed,
            mode=mode,
            settings=settings,
            out=out,
            policy_seed=policy_seed,
            blank_pictures=blank_pictures,
            overview=overview,
            progress=progress,
        )


Seat = tuple[PolicyPlugin, dict[str, str]]


def _cast(
    instance: Instance,
    default: PolicySpec,
    chosen: Mapping[str, PolicySpec],
    arguments: Mapping[str, str],
    host: PluginHost,
) -> dict[str, Seat]:
    """Who plays whom. An override for a role or agent that the mission does not have is a `UsageError`."""
    roles = dict.fromkeys(agent.role for agent in instance.agents)
    names = dict.fromkeys((*roles, *(name for agent in instance.agents for name in (agent.name, agent.id))))
    for name in chosen:
        if name not in names:
            raise UsageError(
                f"no role or agent is called `{name}` in {instance.mode} mode", hint=f"there are: {', '.join(names)}"
            )
    loaded: dict[str, PolicyPlugin] = {}

    def plugin_for(agent: AgentSpec) -> PolicyPlugin:
        spec = next((chosen[name] for name in (agent.id, agent.name, agent.role) if name in chosen), default)
        if not isinstance(spec, str):
            return _plugin(spec)
        if spec not in loaded:
            loaded[spec] = load_policy(spec, host)
        return loaded[spec]

    plugins = {agent.id: plugin_for(agent) for agent in instance.agents}
    shares = share_arguments(plugins.values(), arguments)
    return {agent: (plugin, shares[plugin.name]) for agent, plugin in plugins.items()}


def _texts(arguments: Mapping[str, object]) -> dict[str, str]:
    """Options as the trace keeps them and the command line gives them; from Python they may be numbers."""
    return {name: str(value) for name, value in arguments.items()}


def _plugin(factory: Callable[..., Policy]) -> PolicyPlugin:
    """A class or function given from Python; its attribute `privileged` counts as its declaration."""
    if not callable(factory):
        raise UsageError(
            f"{factory!r} is not a policy",
            hint="give a policy's name, FILE.py:CLASS, a class, or a function that makes one",
        )
    return policy_of(factory, getattr(factory, "__qualname__", type(factory).__name__))


def _hopeless(instance: Instance) -> tuple[str, ...]:
    """Proofs that this instance could not be won. It is played all the same: a study may mean to show just that."""
    return tuple(f"this could not be won ({proof.code}): {proof.message}" for proof in prove_instance(instance))


def _mission(given: Mission | str | PathLike[str]) -> Mission:
    """The mission, compiled if a file or a shipped name is given; `UsageError` if it is something else."""
    if isinstance(given, Mission):
        return given
    if not isinstance(given, str | PathLike):
        raise UsageError(
            f"a mission is due, this is {type(given).__name__!r}",
            hint="give what `lingjing.compile` returns, a file's name, or a shipped mission's",
        )
    from lingjing.dsl.loading.load import load_mission

    return load_mission(given)


def _check_seed(seed: object) -> None:
    """`UsageError` for what is no whole number from 0 to 2**63 - 1."""
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
        raise UsageError(f"{seed!r} is not a seed", hint="a seed is a whole number from 0 to 2**63 - 1")


def _stored(frames: Sequence[StoredFrame]) -> list[Picture]:
    return [(frame.info, frame.jpeg, frame.depth, frame.semantic) for frame in frames]


def _writer(
    folder: Path, instance: Instance, city: City, seats: Mapping[str, Seat], policy_seed: int, undo: Callable[[], None]
) -> TraceWriter:
    header = Header(
        instance=instance,
        bindings=tuple(
            AgentBinding(agent=agent, policy=plugin.name, privileged=plugin.privileged, arguments=arguments)
            for agent, (plugin, arguments) in seats.items()
        ),
        fingerprint=versions(),
        city_sha256=city.sha256 or hashlib.sha256(msgspec.json.encode(city)).hexdigest(),
        attribution=city.attribution,
        started_wall=dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        policy_seed=policy_seed,
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return TraceWriter(folder / TRACE_NAME, header)
    except OSError as error:
        undo()
        raise UsageError(f"cannot write to `{folder}`: {error.strerror}", hint="choose another folder") from error
    except BaseException:
        undo()
        raise


def _result(path: Path, folder: Path, city: City, *, overview: bool) -> EpisodeResult:
    from lingjing.analysis.incidents import incidents
    from lingjing.analysis.metrics import metrics
    from lingjing.analysis.overview import draw_overview

    if not path.is_file():
        raise gone(path)
    trace = read_trace(path)
    warnings = _at_start(trace) + _warnings(trace)
    outcome = trace.outcome or _unknown(trace)
    deviations = withdrawn(outcome.processes)
    if deviations:
        warnings += (f"{NOT_PROMISED}: {'; '.join(deviations)}; {PIN_FIRST}",)
    if overview:
        try:
            draw_overview(trace, folder / OVERVIEW_NAME, city)
        except UsageError as error:  # the trace holds everything; a score is not lost for want of its picture
            warnings += (f"no overview: {error}",)
    instance = trace.header.instance
    return EpisodeResult(
        mission=instance.mission,
        seed=instance.seed,
        policy_seed=trace.header.policy_seed,
        mode=instance.mode,
        success=outcome.success,
        reason=outcome.reason,
        scr=outcome.scr,
        score=outcome.score,
        ticks=outcome.ticks,
        digest=outcome.digest,
        frames_digest=outcome.frames_digest,
        trace=path,
        folder=folder,
        metrics=metrics(trace),
        detail=outcome.detail,
        hint=outcome.hint,
        warnings=warnings,
        attribution=trace.header.attribution,
        incidents=incidents(trace),
        withdrawn=deviations,
        happened=tuple(event for record in trace.boundaries for event in record.task_events if event.name),
    )


def _warnings(trace: Trace) -> tuple[str, ...]:
    """One line on the answers that policies failed to give, with the first failure's own words."""
    replaced = [made for record in trace.boundaries for made in record.decisions if made.substituted]
    if not replaced:
        return ()
    first, kinds = replaced[0], Counter(made.substituted for made in replaced)
    reasons = ", ".join(f"{kind} {number}" for kind, number in sorted(kinds.items()))
    asked = sum(len(record.decisions) for record in trace.boundaries)
    counted = f"{len(replaced)} of {asked} policy answers were replaced by doing nothing ({reasons})"
    return (f"{counted}; the first was `{first.agent}`: {first.detail}",)


def _at_start(trace: Trace) -> tuple[str, ...]:
    """That nobody had to do anything for this success."""
    outcome = trace.outcome
    return (outcome.detail,) if outcome is not None and outcome.success and outcome.detail else ()


def _unknown(trace: Trace) -> Outcome:
    last: BoundaryRecord | None = trace.boundaries[-1] if trace.boundaries else None
    return Outcome(
        success=False,
        reason="interrupted",
        scr=last.scr if last else 0.0,
        score=last.reward if last else 0.0,
        ticks=last.tick if last else 0,
        digest=last.digest if last else "",
        frames_digest="",
    )
