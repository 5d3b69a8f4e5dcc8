"""Reports of episodes: of one, and of several seeds together."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec

from lingjing.analysis.behaviour import ActionCounts, actions, count_by_tercile
from lingjing.analysis.detection import PerceptionCounts, detect
from lingjing.analysis.families import FailureFamily, attribute
from lingjing.analysis.incidents import Incident, incidents
from lingjing.analysis.metrics import Metrics, metrics
from lingjing.errors import AbortCause
from lingjing.mission.salts import public_seed
from lingjing.numerics import withdrawn
from lingjing.trace.reader import Trace
from lingjing.trace.records import MovedBody, Outcome, TaskEvent

ABORTED = "infrastructure-abort"
"""The reason of an episode that an error of engine, service or machine has ended."""
INTERRUPTED = "interrupted"
"""The reason of an episode that the user has interrupted."""
POLICY_FAILED = "policy-failure"
"""The reason of an episode that did not begin, because its policy failed when it was loaded, built or received its
brief. The episode counts as lost and has no trace."""

SIGNALLED = "its process was interrupted by another process"
"""The detail of an abort by a signal that the command itself has not sent."""
SERVER_KILLED = "the process that it was forked from was killed"
"""The detail of an abort after the end of the fork server."""


class EpisodeReport(msgspec.Struct, frozen=True, kw_only=True):
    """The report of one episode: printed by `lingjing run --json`, returned by `lingjing.run`, a row of a study.

    >>> report = lingjing.run("first.ljs", overview=False)
    >>> report.mission, report.reason, report.metrics["scr"] == report.scr
    ('first', 'budget', True)
    >>> lingjing.read(report.trace).complete
    True
    """

    mission: str
    """The mission's name."""
    seed: int
    """The seed of the instance."""
    mode: str
    """The communication mode."""
    policy: str
    """The default policy of the options."""
    success: bool
    """True if the mission was won."""
    reason: str
    """The reason for the end."""
    scr: float
    """The subtask completion rate, 0 to 1."""
    ticks: int
    """The number of the last boundary."""
    digest: str
    """The SHA-256 over the boundaries, hex."""
    trace: str
    """The path of the MCAP file: a `.part` for an incomplete episode, "" for one that did not begin."""
    metrics: Metrics | None
    """The metrics; None if the episode's process left no trace to count."""
    frames_digest: str = ""
    """The SHA-256 over the pictures, hex."""
    detail: str = ""
    """The cause where the reason leaves it open: the late stage, the failed engine."""
    hint: str = ""
    """The remedy for an abort or a failed policy."""
    cause: AbortCause = ""
    """The thing that was lost in an abort that a policy can cause; "" for any other ending."""
    warnings: tuple[str, ...] = ()
    """Warnings about the score, one line each: replaced policy answers, an overview that could not be written."""
    attribution: str = ""
    """The attribution of the map's data, `procedural` for a generated city, and of models of others."""
    policy_seed: int = 0
    """The seed of the policies' random streams."""
    score: float = 0.0
    """The mission's own score with its weights and penalties, 0 to 1."""
    incidents: tuple[Incident, ...] = ()
    """Crashes, falls and empty batteries."""
    happened: tuple[TaskEvent, ...] = ()
    """The mission's own events."""
    moved: tuple[MovedBody, ...] = ()
    """The entities that begin farther from their declared places than they are long."""
    withdrawn: tuple[str, ...] = ()
    """Deviations of processes from the environment in which every processor gives the same digest."""
    family: FailureFamily | None = None
    """The failure family of a lost episode; None for any other."""
    terciles: tuple[ActionCounts, ...] = ()
    """The counts of the agents' actions in the first, second and last third of the episode."""
    perceived: PerceptionCounts | None = None
    """The counts of which rates of perception over several episodes are computed."""
    ambient_random: tuple[str, ...] = ()
    """The agents with calls that drew from a global random generator without a seed."""
    privileged: bool = False
    """True if a policy received the truth."""
    tier: int = 0
    """The tier of the mission (`lingjing.mission.tiers`)."""
    language: str = "en"
    """The language of the mission's texts (`lingjing.mission.languages`)."""

    @property
    def folder(self) -> Path:
        """The folder that holds the trace and the overview."""
        return Path(self.trace).parent

    def __repr__(self) -> str:
        """One line; `msgspec.json.encode` writes the complete report."""
        end = f"{self.reason}, SCR {self.scr:.2f}, score {self.score:.2f}, {self.ticks} ticks"
        return f"<EpisodeReport {self.mission}-{self.mode} seed {self.seed}, {self.policy}: {end}, {self.trace}>"

    def _repr_html_(self) -> str:
        """Return the result and the metrics as a table, with the overview picture, for notebooks."""
        from lingjing.notebook_tables import html_table

        values: dict[str, object] = {"policy": self.policy, "detail": self.detail, "digest": self.digest[:16]}
        for name, value in self.metrics.items() if self.metrics is not None else ():
            if value is not None and not isinstance(value, tuple):
                number = f"{value:g}" if isinstance(value, float) else value
                values[name] = f"{number} {Metrics.unit(name)}".strip()
        return html_table(f"{self.mission}-{self.mode}, seed {self.seed}: {self.reason}", values, self._repr_png_())

    def _repr_png_(self) -> bytes | None:
        """Return the overview picture beside the trace; None if there is none."""
        from lingjing.notebook_tables import bytes_of

        return bytes_of(self.folder / "overview.png") if self.trace else None


class EpisodeError(msgspec.Struct, frozen=True, kw_only=True):
    """The error of an episode's process without a report: the process prints it instead of one."""

    message: str
    hint: str
    cause: AbortCause
    """The cause of an `InfrastructureError`; "" for any other error."""


class SeedsReport(msgspec.Struct, frozen=True, kw_only=True):
    """Several seeds of one mission, as `lingjing run --seeds A-B --json` prints them."""

    mission: str
    seed: str
    """The seeds as the user wrote them."""
    mode: str
    policy: str
    success: bool
    """True if every episode succeeded."""
    reason: str
    """Each reason with its count."""
    scr: float
    """The mean over the episodes that were neither aborted nor interrupted."""
    ticks: int
    """The sum of ticks."""
    digest: str
    """The SHA-256 over the digests of the episodes in order, hex."""
    trace: str
    """The folder that holds the episodes."""
    metrics: dict[str, float]
    """The means over the episodes of `scr`."""
    tsr: float | None
    """The share of successes among the episodes of `scr`; None if there are none."""
    episodes: tuple[EpisodeReport, ...]
    """The reports of the episodes."""
    tier: int = 0
    language: str = "en"


def end_without_result(code: int) -> str:
    """Return the end of an episode's process without a result in words, by its exit code (negative: a signal)."""
    if code < 0:
        return f"its process was killed by signal {-code}"
    return f"its process ended without a result (exit code {code})"


def report_of(trace: Trace, policy: str) -> EpisodeReport:
    """Return the report of a trace. `policy` is its default policy; a trace without an end counts as interrupted."""
    instance, outcome, attributed = trace.header.instance, trace.outcome or _unknown(trace), attribute(trace)
    return EpisodeReport(
        mission=instance.mission,
        seed=public_seed(trace.header.fingerprint, instance.seed),
        mode=instance.mode,
        policy=policy,
        policy_seed=trace.header.policy_seed,
        tier=instance.tier,
        language=instance.language,
        success=outcome.success,
        reason=outcome.reason,
        scr=outcome.scr,
        score=outcome.score,
        ticks=outcome.ticks,
        digest=outcome.digest,
        frames_digest=outcome.frames_digest,
        trace=str(trace.path),
        metrics=metrics(trace),
        detail=outcome.detail,
        hint=outcome.hint,
        cause=outcome.cause,
        attribution=trace.header.attribution,
        incidents=incidents(trace),
        happened=tuple(event for record in trace.boundaries for event in record.task_events if event.name),
        moved=trace.header.moved,
        withdrawn=withdrawn(outcome.processes),
        family=None if attributed is None else attributed.family,
        terciles=count_by_tercile(actions(trace)),
        perceived=detect(trace).counts,
        ambient_random=outcome.ambient_random,
        privileged=any(binding.privileged for binding in trace.header.bindings),
    )


def _unknown(trace: Trace) -> Outcome:
    last = trace.boundaries[-1] if trace.boundaries else None
    return Outcome(
        success=False,
        reason="interrupted",
        scr=last.scr if last else 0.0,
        score=last.reward if last else 0.0,
        ticks=last.tick if last else 0,
        digest=last.digest if last else "",
        frames_digest="",
    )


def summarise(episodes: Sequence[EpisodeReport], *, seeds: str, folder: str) -> SeedsReport:
    """All episodes of one command as one report; there is at least one."""
    counted = [episode for episode in episodes if episode.reason not in (ABORTED, INTERRUPTED)]
    reasons = Counter(episode.reason for episode in episodes)
    return SeedsReport(
        mission=episodes[0].mission,
        seed=seeds,
        mode=episodes[0].mode,
        tier=episodes[0].tier,
        language=episodes[0].language,
        policy=episodes[0].policy,
        success=all(episode.success for episode in episodes),
        reason=", ".join(f"{reason} {number}" for reason, number in sorted(reasons.items())),
        scr=_mean([episode.scr for episode in counted]),
        ticks=sum(episode.ticks for episode in counted),
        digest=hashlib.sha256("".join(episode.digest for episode in episodes).encode()).hexdigest(),
        trace=folder,
        metrics=mean_metrics(counted),
        tsr=_mean([float(episode.success) for episode in counted]) if counted else None,
        episodes=tuple(episodes),
    )


def mean_metrics(episodes: Sequence[EpisodeReport]) -> dict[str, float]:
    """The mean of every metric that is a number; episodes in which it is not one are left out of its mean."""
    values: dict[str, list[float]] = {}
    for episode in episodes:
        for name, value in msgspec.structs.asdict(episode.metrics).items() if episode.metrics is not None else ():
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                values.setdefault(name, []).append(float(value))
    return {name: _mean(numbers) for name, numbers in values.items()}


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0
