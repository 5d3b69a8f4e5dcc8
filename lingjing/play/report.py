"""What is reported of episodes: one by one, and several seeds as one."""

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
from lingjing.numerics import withdrawn
from lingjing.trace.reader import Trace
from lingjing.trace.records import MovedBody, Outcome, TaskEvent

ABORTED = "infrastructure-abort"
INTERRUPTED = "interrupted"
POLICY_FAILED = "policy-failure"
"""The reason of an episode that did not begin, because the code of a policy failed where it was loaded, built or given
its brief. It counts as lost and has no trace."""

SIGNALLED = "its process was interrupted by another process"
SERVER_KILLED = "the process that it was forked from was killed"
"""The details of aborts by a signal that the command itself has not sent."""


class EpisodeReport(msgspec.Struct, frozen=True, kw_only=True):
    """One episode: what `lingjing run --json` prints, `lingjing.run` returns and a study keeps as a row.

    `trace` is the path of the MCAP file (a `.part` if the episode was cut short, "" if it did not begin), `detail` the
    cause of an ending that the reason leaves open (which stage was late, which engine failed) and `hint` what to do
    about an abort, or a policy that failed. `warnings` are what a reader of the score should know, a line each:
    replaced answers of policies, an overview that could not be written; `attribution` says whose map was played on
    (`procedural`: nobody's); `policy_seed` started the policies' random streams; `scr` is the subtask completion rate,
    `score` the mission's own with its weights and penalties; `incidents` say who crashed, fell or ran out of energy,
    `happened` are the mission's own events; `moved` are the entities that begin farther from their declared places than
    they are long; `withdrawn` is what computed otherwise than the promise of one digest on every processor asks, by
    process. `metrics` is None for an episode whose process left nothing to count; `family` is the failure family of a
    lost episode, `terciles` the counts of the first, second and last third of its agents' actions, `perceived` what
    rates of perception over several episodes are made of. `ambient_random` names agents in whose calls a global random
    generator was used that nothing had seeded. `privileged` is true if a policy was shown the truth.
    """

    mission: str
    seed: int
    mode: str
    policy: str
    success: bool
    reason: str
    scr: float
    ticks: int
    digest: str
    trace: str
    metrics: Metrics | None
    frames_digest: str = ""
    detail: str = ""
    hint: str = ""
    warnings: tuple[str, ...] = ()
    attribution: str = ""
    policy_seed: int = 0
    score: float = 0.0
    incidents: tuple[Incident, ...] = ()
    happened: tuple[TaskEvent, ...] = ()
    moved: tuple[MovedBody, ...] = ()
    withdrawn: tuple[str, ...] = ()
    family: FailureFamily | None = None
    terciles: tuple[ActionCounts, ...] = ()
    perceived: PerceptionCounts | None = None
    ambient_random: tuple[str, ...] = ()
    privileged: bool = False

    @property
    def folder(self) -> Path:
        """The folder that holds the trace and the overview."""
        return Path(self.trace).parent


class SeedsReport(msgspec.Struct, frozen=True, kw_only=True):
    """Several seeds of one mission, as `lingjing run --seeds A-B --json` prints them.

    `tsr` is the share of successes among the episodes that were neither aborted by the infrastructure nor
    interrupted (None if there are none); `success` says whether every episode succeeded; `scr` and the numbers in
    `metrics` are means over the same episodes, `ticks` is their sum, `digest` is the SHA-256 over the episodes'
    digests in order, `trace` the folder that holds them.
    """

    mission: str
    seed: str
    mode: str
    policy: str
    success: bool
    reason: str
    scr: float
    ticks: int
    digest: str
    trace: str
    metrics: dict[str, float]
    tsr: float | None
    episodes: tuple[EpisodeReport, ...]


def end_without_result(code: int) -> str:
    """How the process of an episode ended that left no result: by its exit code, negative for a signal."""
    if code < 0:
        return f"its process was killed by signal {-code}"
    return f"its process ended without a result (exit code {code})"


def report_of(trace: Trace, policy: str) -> EpisodeReport:
    """What a trace says of its episode, which `policy` played; one without an end counts as interrupted."""
    instance, outcome, attributed = trace.header.instance, trace.outcome or _unknown(trace), attribute(trace)
    return EpisodeReport(
        mission=instance.mission,
        seed=instance.seed,
        mode=instance.mode,
        policy=policy,
        policy_seed=trace.header.policy_seed,
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
