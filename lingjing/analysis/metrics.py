"""The paper's metrics of one episode: outcome, coordination, provenance, perception, search (its two tables of
metrics and its table of communication metrics).

A pure function of the trace. What is not defined for an episode (a rate over nothing) is None and is left out of
means. Rates and shares are 0..1 except `gap`, which the paper gives in percent.

A field of `Metrics` says all there is to say of a metric: its group in a printed score, the unit that is printed behind
it, and its definition, of which the table in `docs/metrics.md` is made (`python -m lingjing.analysis.metrics PAGE`).
`metrics` computes every field.
"""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, get_type_hints

import msgspec

from lingjing.analysis.behaviour import actions, behaviour
from lingjing.analysis.completion import owed_kg
from lingjing.analysis.detection import Detection, detect, ratio, shots
from lingjing.analysis.idleness import idle_fraction
from lingjing.analysis.incidents import incidents
from lingjing.analysis.last_mile import last_mile
from lingjing.analysis.memo import once_per_trace
from lingjing.analysis.repetition import repeated_target_rate, target_events
from lingjing.analysis.search_marks import communication_at_discovery, redundant_revisit_rate
from lingjing.kernel.subtasks import required_groups
from lingjing.trace.reader import Trace
from lingjing.trace.records import DecisionRecord, Envelope, Usage

GROUPS = ("outcome", "perception", "communication", "behaviour", "cost")
"""The groups of a printed score, in order."""


class StageMetric(msgspec.Struct, frozen=True, kw_only=True):
    """One stage of the mission: subjects `done` of `required`; `cumulative` if it and all before it are complete."""

    name: str
    done: int
    required: int
    cumulative: bool


class Metrics(msgspec.Struct, frozen=True, kw_only=True):
    """One episode's numbers; the definition of each is below it."""

    success: Annotated[bool, "outcome"]
    """Every terminal condition confirmed within the budget."""
    scr: Annotated[float | None, "outcome"]
    """Subtask completion rate, "number of required targets, deliveries, rescues, repairs, or other task components
    completed, divided by the number required in that episode": the targets of the groups that success asks for
    (`forall v in victim: …`); in a mission of one target its stages, each counted once for each of its subjects; 1
    when the mission is won."""
    score: Annotated[float | None, "outcome"]
    """The mission's own figure: the success condition's parts that hold, or, where stages have weights, the weighted
    share of the stages; 1 when the mission is won; less the penalties of broken soft constraints."""
    ticks: Annotated[int, "outcome"]
    """Decision ticks."""
    sim_s: Annotated[float, "outcome", "s"]
    """Simulated seconds."""
    wall_s: Annotated[float | None, "outcome", "s"]
    """Seconds on the clock."""
    reason: Annotated[str, "outcome"]
    """The reason of its end: [why an episode ends](kernel.md#why-an-episode-ends)."""
    incidents: Annotated[int, "outcome"]
    """Collisions (one for both sides), falls, drownings, empty batteries and tanks, and assets that became `dead`,
    `aground` or `fallen` for no reason that an engine gave; the summary and `--json` say who, when, where and why."""

    reports: Annotated[int, "perception"]
    """Detection reports, whether heard by many or by nobody."""
    detections: Annotated[int, "perception"]
    """Reports that matched a visible target one to one (same class and picture, boxes overlap by half)."""
    targets_found: Annotated[int, "perception"]
    """Distinct targets matched at least once."""
    false_positives: Annotated[int, "perception"]
    """Reports that a rule compared in vain. Reports that no rule of the mission compares with the truth are neither
    detections nor false."""
    misses: Annotated[int, "perception"]
    """Visible targets that no report matched, summed over **all pictures**: a person found in one picture and
    overlooked in another is found and missed once."""
    precision: Annotated[float | None, "perception"]
    """Detections over detections and false reports. N/A, as all rates of perception, where the mission judges no
    reports; reference pictures are left out of all of them."""
    recall: Annotated[float | None, "perception"]
    """Detections over detections and misses, over pictures; so it may be 0.6 with every person found."""
    f1: Annotated[float | None, "perception"]
    """Harmonic mean of precision and recall."""
    miss_rate: Annotated[float | None, "perception"]
    """Share of pictures with a miss."""
    hallucination_rate: Annotated[float | None, "perception"]
    """Share of pictures with a false report."""
    confusion_rate: Annotated[float | None, "perception"]
    """Object confusion: share of pictures with a false report whose box lies on something of another class."""
    localisation_error_m: Annotated[float | None, "perception", "m"]
    """Median planar distance between a matched report's position and the target when the picture was taken."""
    calibration_error: Annotated[float | None, "perception"]
    """Expected calibration error: confidence against match, ten bins, weighted."""
    first_discovery_tick: Annotated[int | None, "perception"]
    """Tick of the first matched report."""

    messages: Annotated[int, "communication"]
    """Sender-to-recipient messages; one broadcast counts once for each recipient."""
    kilobytes: Annotated[float, "communication", "kB"]
    """Their payload, in units of 1000 bytes."""
    rounds: Annotated[int, "communication"]
    """Ticks with an assignment or a target-status message."""
    gap: Annotated[float | None, "outcome", "%"]
    """Percent of what was required that is incomplete at the end: mass where goods are to be delivered, else required
    targets, one in a mission that asks for no group."""
    rep: Annotated[float | None, "communication"]
    """Repeated target rate: repeated assignments and visits of a target over all of them. A visit is an entry into
    the target's region by somebody who can serve it, to stop or to pass; staying inside is one. It is repeated when
    the target is completed or assigned to somebody else: the assignee's own arrival is what was asked for. A step of
    guidance, an assignee's yes to what it was given, and the way back to a depot are no events. An order larger than
    one load has room for several."""
    target_events: Annotated[int, "communication"]
    """Those assignments and visits, repeated or not: what `rep` is a share of."""
    discovery_messages: Annotated[float | None, "communication"]
    """Communication at discovery: share of messages sent in a tick in which a target was first matched."""
    conflicts: Annotated[int, "communication"]
    """Commands refused because another agent came first."""
    rejections: Annotated[int, "communication"]
    """Commands and messages refused for any reason."""

    actions: Annotated[int, "behaviour"]
    """Physical commands that policies decided on."""
    adherence: Annotated[float | None, "behaviour"]
    """Share of actions that were admitted as asked for and broke no constraint."""
    repetition: Annotated[float | None, "behaviour"]
    """Share of actions with the verb, resource and rounded arguments of the same agent's action before, over all but
    each agent's first."""
    out_of_bounds: Annotated[float | None, "behaviour"]
    """Share of actions that were clipped to or refused for a bound of place, height or motion, or broke a
    constraint."""
    forgotten: Annotated[float | None, "behaviour"]
    """Forgotten subgoals: share of actions on targets that are all completed, or on others than those that the body is
    assigned to and that are open."""
    redundant_revisits: Annotated[float | None, "behaviour"]
    """Share of visits of search cells (pictures from above one that the camera was not above before) that an earlier
    picture had covered; N/A where no agent observes cells."""

    calls: Annotated[int, "cost"]
    """Calls of policies to models."""
    tokens: Annotated[int, "cost"]
    """Prompt and completion tokens of them all."""
    cost_usd: Annotated[float, "cost", "USD"]
    """What policies spent on models."""
    json_compliance: Annotated[float | None, "cost"]
    """Answers of models that kept to the schema they were asked for, over all their answers, repeated ones included."""
    answers: Annotated[int, "cost"]
    """Those answers, good or bad: what `json_compliance` is a share of."""
    substitutions: Annotated[int, "cost"]
    """Policy answers that were missing or malformed and became "do nothing"."""
    idle_fraction: Annotated[float | None, "cost"]
    """Agent steps "with no assigned or executed task action" over all: of agents with a body, those without a command
    admitted or under way and without an open assignment."""

    coverage: Annotated[float | None, "outcome"]
    """Search cells visited over all cells that agents observe, N/A where none observes any."""
    frames: Annotated[int, "perception"]
    """Pictures that cameras of bodies took; reference pictures are none of them."""
    absent_frames: Annotated[int, "perception"]
    """Pictures asked for that did not come."""
    faint_targets: Annotated[int, "perception"]
    """Targets drawn in a picture with a contrast under 5 of 255 (in fog, at night), summed over pictures: they have
    no visible pixels, so no report can match them and none is missed ([ADR
    0012](adr/0012-targets-too-faint-to-see.md))."""
    stages: Annotated[tuple[StageMetric, ...], "outcome"] = ()
    """Each stage: subjects done of those required."""
    last_mile: Annotated[int | None, "outcome"] = None
    """How many of S1 to S5 of last-mile delivery were done in a row: aerial inspection, ends of the route named, places
    of the way named on the road graph, arrival at the stop, the target house; N/A in other missions. What an
    intervention gives counts as done."""


def printed() -> dict[str, tuple[str, str]]:
    """Group and unit of every metric by name, in the order of the fields."""
    hints = get_type_hints(Metrics, include_extras=True)
    return {name: (*hint.__metadata__, "")[:2] for name, hint in hints.items()}


def metrics(trace: Trace) -> Metrics:
    """All metrics of one trace, whole or cut; a cut one has no `scr` unless its end was recorded."""
    detection = detect(trace)
    outcome = trace.outcome
    scr = None if outcome is None else outcome.scr
    edges = [edge for record in trace.boundaries for edge in record.messages]
    decisions = [made for record in trace.boundaries for made in record.decisions]
    usage = _usage(decisions)
    acted = behaviour(actions(trace))
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
        confusion_rate=detection.confusion_rate,
        localisation_error_m=detection.localisation_error_m,
        calibration_error=detection.calibration_error,
        first_discovery_tick=_first_discovery(detection),
        messages=len(edges),
        kilobytes=sum(edge.bytes for edge in edges) / 1000,
        rounds=_rounds(edges),
        gap=_gap(trace),
        rep=repeated_target_rate(trace),
        target_events=target_events(trace)[1],
        discovery_messages=communication_at_discovery(trace),
        conflicts=refusals["conflict"],
        rejections=refusals.total(),
        actions=acted.actions,
        adherence=acted.adherence,
        repetition=acted.repetition,
        out_of_bounds=acted.out_of_bounds,
        forgotten=acted.forgotten,
        redundant_revisits=redundant_revisit_rate(trace),
        calls=usage.calls,
        tokens=usage.prompt_tokens + usage.completion_tokens,
        cost_usd=usage.cost_usd,
        json_compliance=usage.valid_answers / usage.answers if usage.answers else None,
        answers=usage.answers,
        substitutions=sum(bool(made.substituted) for made in decisions),
        idle_fraction=idle_fraction(trace),
        coverage=_coverage(trace),
        frames=len(shots(trace)),
        absent_frames=_absent(trace),
        faint_targets=_faint(trace),
        stages=stages_of(trace),
        last_mile=None if (chain := last_mile(trace)) is None else chain.cumulative,
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
        answers=sum(usage.answers for usage in spent),
        valid_answers=sum(usage.valid_answers for usage in spent),
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


@once_per_trace
def stages_of(trace: Trace) -> tuple[StageMetric, ...]:
    """Each stage: subjects done of those required."""
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


def table() -> str:
    """The definitions as a table in Markdown, group by group; they are read from the source of `Metrics`."""
    body = ast.parse(textwrap.dedent(inspect.getsource(Metrics))).body[0]
    assert isinstance(body, ast.ClassDef)
    texts = [ast.literal_eval(node.value) for node in body.body if isinstance(node, ast.Expr)][1:]
    rows = [(*how, name, " ".join(text.split())) for (name, how), text in zip(printed().items(), texts, strict=True)]
    rows.sort(key=lambda row: GROUPS.index(row[0]))
    lines = (f"| {group} | `{name}` | {unit} | {text} |" for group, unit, name, text in rows)
    return "\n".join(["| group | metric | unit | what it is |", "| --- | --- | --- | --- |", *lines]) + "\n"


def write_table(page: Path) -> None:
    """Put the table in the place of the one that the page ends with."""
    text = page.read_text(encoding="utf-8")
    page.write_text(text[: text.index("| group |")] + table(), encoding="utf-8")


if __name__ == "__main__":
    write_table(Path(sys.argv[1]))
