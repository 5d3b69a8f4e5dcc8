"""The paper's metrics of one episode: outcome, coordination, provenance, perception, search (its two tables of
metrics and its table of communication metrics).

A pure function of the trace. What is not defined for an episode (a rate over nothing) is None and is left out of
means. Rates and shares are 0..1 except `gap`, which the paper gives in percent.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import msgspec

from lingjing.analysis.completion import owed_kg
from lingjing.analysis.detection import Detection, detect, ratio, shots
from lingjing.analysis.idleness import idle_fraction
from lingjing.analysis.incidents import incidents
from lingjing.analysis.repetition import repeated_target_rate
from lingjing.kernel.subtasks import required_groups
from lingjing.trace.reader import Trace
from lingjing.trace.records import DecisionRecord, Envelope, Usage


class StageMetric(msgspec.Struct, frozen=True, kw_only=True):
    """One stage of the mission: subjects `done` of `required`; `cumulative` if it and all before it are complete."""

    name: str
    done: int
    required: int
    cumulative: bool


class Metrics(msgspec.Struct, frozen=True, kw_only=True):
    """One episode's numbers; see the paper's tables for the definitions and the field comments for units."""

    success: bool
    scr: float | None
    """The paper's subtask completion rate: "Number of required targets, deliveries, rescues, repairs, or other task
    components completed, divided by the number required in that episode." """
    score: float | None
    """The mission's own score, 0..1: its weights and penalties count."""
    ticks: int
    sim_s: float
    wall_s: float | None
    reason: str
    incidents: int
    """Crashes, collisions, falls, empty stores and other losses: see `lingjing.analysis.incidents`."""

    reports: int
    """Detection reports, each counted once."""
    detections: int
    """Reports that matched a visible target."""
    targets_found: int
    """Distinct targets matched at least once."""
    false_positives: int
    misses: int
    """Visible targets without a matching report, summed over frames."""
    precision: float | None
    recall: float | None
    f1: float | None
    miss_rate: float | None
    hallucination_rate: float | None
    localisation_error_m: float | None
    """Median planar error of matched reports."""
    calibration_error: float | None
    first_discovery_tick: int | None

    messages: int
    """Sender-to-recipient edges."""
    kilobytes: float
    """Payload over all edges, in units of 1000 bytes."""
    rounds: int
    """Ticks with an assignment or a target-status message."""
    gap: float | None
    """The paper's: "percentage of the initial requirement that remains incomplete at episode end. The requirement is
    delivery mass for CD and target count for UFR and SSR." None without a requirement."""
    rep: float | None
    """Repeated target events over all target events: see `lingjing.analysis.repetition`."""
    conflicts: int
    rejections: int
    """Commands and messages refused for any reason, conflicts included."""

    calls: int
    tokens: int
    """Prompt and completion tokens of all policies."""
    cost_usd: float
    substitutions: int
    """Policy outputs that had to be replaced."""
    idle_fraction: float | None
    """The paper's "agent steps with no assigned or executed task action" over all: see `lingjing.analysis.idleness`."""

    coverage: float | None
    """Visited search cells over all search cells that agents observe; None where nobody observes any."""
    frames: int
    absent_frames: int
    faint_targets: int
    """Targets that were in a picture with too little contrast to be seen, summed over pictures (ADR 0012)."""
    stages: tuple[StageMetric, ...] = ()


def metrics(trace: Trace) -> Metrics:
    """All metrics of one trace, whole or cut; a cut one has no `scr` unless its end was recorded."""
    detection = detect(trace)
    outcome = trace.outcome
    scr = None if outcome is None else outcome.scr
    edges = [edge for record in trace.boundaries for edge in record.messages]
    decisions = [made for record in trace.boundaries for made in record.decisions]
    usage = _usage(decisions)
    refusals = Counter(
        receipt.reason for record in trace.boundaries for receipt in record.receipts if receipt.status == "rejected"
    )
    return Metrics(
        success=outcome is not None and outcome.success,
        scr=scr,
        score=None if outcome is None else outcome.score,
        ticks=trace.boundaries[-1].tick if trace.boundaries else 0,
        sim_s=trace.boundaries[-1].time_s if trace.boundaries else 0.0,
        wall_s=None if outcome is None else outcome.wall_s,
        reason="" if outcome is None else outcome.reason,
        incidents=len(incidents(trace)),
        reports=len(detection.reports),
        detections=sum(report.target is not None for report in detection.reports),
        targets_found=len({report.target for report in detection.reports} - {None}),
        false_positives=detection.false_positives,
        misses=detection.false_negatives,
        precision=detection.precision,
        recall=detection.recall,
        f1=detection.f1,
        miss_rate=detection.miss_rate,
        hallucination_rate=detection.hallucination_rate,
        localisation_error_m=detection.localisation_error_m,
        calibration_error=detection.calibration_error,
        first_discovery_tick=_first_discovery(detection),
        messages=len(edges),
        kilobytes=sum(edge.bytes for edge in edges) / 1000,
        rounds=_rounds(edges),
        gap=_gap(trace),
        rep=repeated_target_rate(trace),
        conflicts=refusals["conflict"],
        rejections=refusals.total(),
        calls=usage.calls,
        tokens=usage.prompt_tokens + usage.completion_tokens,
        cost_usd=usage.cost_usd,
        substitutions=sum(bool(made.substituted) for made in decisions),
        idle_fraction=idle_fraction(trace),
        coverage=_coverage(trace),
        frames=len(trace.frames),
        absent_frames=_absent(trace),
        faint_targets=_faint(trace),
        stages=_stages(trace),
    )


def _first_discovery(detection: Detection) -> int | None:
    return min((report.tick for report in detection.reports if report.target is not None), default=None)


def _rounds(edges: Iterable[Envelope]) -> int:
    return len({edge.tick for edge in edges if edge.category in ("assignment", "target_status")})


def _gap(trace: Trace) -> float | None:
    """Mass as the requirement where goods are to be brought, else the count of required targets: those of the groups
    that success asks for, or one where it asks for no group."""
    owed = owed_kg(trace)
    if owed is not None:
        return 100.0 * owed[1] / owed[0]
    instance, outcome = trace.header.instance, trace.outcome
    if outcome is None or not any(entity.role == "target" for entity in instance.entities):
        return None
    share = outcome.scr if required_groups(instance) else float(outcome.success)
    return 100.0 * (1.0 - share)


def _usage(decisions: Iterable[DecisionRecord]) -> Usage:
    spent = [made.decision.usage for made in decisions if made.decision.usage is not None]
    return Usage(
        calls=sum(usage.calls for usage in spent),
        prompt_tokens=sum(usage.prompt_tokens for usage in spent),
        completion_tokens=sum(usage.completion_tokens for usage in spent),
        cost_usd=sum((usage.cost_usd for usage in spent), 0.0),
    )


def _coverage(trace: Trace) -> float | None:
    """Cells that the shared search state shows as visited, in any agent's observation, over those of its grids."""
    instance = trace.header.instance
    grids = {channel.name for agent in instance.agents for channel in agent.observes if channel.source == "grid"}
    cells = {cell.name for cell in instance.cells if cell.grid in grids}
    views = (view for record in trace.boundaries for seen in record.observations for view in seen.cells)
    return ratio(len(cells & {view.name for view in views if view.visited_tick is not None}), len(cells))


def _faint(trace: Trace) -> int:
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    return sum(box.entity in targets for frame in shots(trace) for box in frame.faint)


def _absent(trace: Trace) -> int:
    return len(
        {
            (absent.entity, absent.camera, absent.tick)
            for record in trace.boundaries
            for seen in record.observations
            for absent in seen.absent
        }
    )


def _stages(trace: Trace) -> tuple[StageMetric, ...]:
    instance = trace.header.instance
    members = Counter(entity.group for entity in instance.entities)
    done: dict[str, set[str]] = {}
    for record in trace.boundaries:
        for change in record.stages:
            done.setdefault(change.stage, set()).add(change.subject)
    found: list[StageMetric] = []
    for stage in instance.stages:
        required = members[stage.domain] if stage.domain is not None else 1
        count = len(done.get(stage.name, ()))
        whole = count >= required and (not found or found[-1].cumulative)
        found.append(StageMetric(name=stage.name, done=count, required=required, cumulative=whole))
    return tuple(found)
