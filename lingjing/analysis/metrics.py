"""The paper's metrics of one episode, from its two tables of metrics and its table of communication metrics.

The metrics depend on the trace only. A metric that is not defined for an episode, such as a rate over nothing, is None
and is left out of means. Rates and shares are 0..1, except `gap`, which the paper gives in percent.

A field of `Metrics` declares a metric: its group in a printed score, its printed unit, and its definition. The table in
`docs/metrics.md` is generated from these (`python -m lingjing.analysis.metrics PAGE`). `metrics` computes all fields.
"""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections import Counter
from collections.abc import ItemsView, Iterable, Iterator, KeysView, Mapping, ValuesView
from functools import cache
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import msgspec

from lingjing.analysis.behaviour import actions, behaviour
from lingjing.analysis.box_conventions import convention_errors
from lingjing.analysis.completion import judged_targets, required_mass_kg
from lingjing.analysis.detection import Detection, detect, ratio, shots
from lingjing.analysis.idleness import idle_fraction
from lingjing.analysis.incidents import incidents
from lingjing.analysis.last_mile import last_mile
from lingjing.analysis.memo import cache_by_trace
from lingjing.analysis.repetition import excess_target_events, excess_target_rate, repeated_target_rate, target_events
from lingjing.analysis.search_marks import area_coverage, communication_at_discovery, redundant_revisit_rate
from lingjing.analysis.small_boxes import chance_level, strict_detections, tolerance_of
from lingjing.kernel.subtasks import required_groups
from lingjing.suggest import nearest_or
from lingjing.trace.reader import Trace
from lingjing.trace.records import DecisionRecord, Envelope, Usage

GROUPS = ("outcome", "perception", "communication", "behaviour", "cost")
"""The groups of a printed score, in order."""


class StageMetric(msgspec.Struct, frozen=True, kw_only=True):
    """One stage of the mission."""

    name: str
    done: int
    """Number of subjects that completed it."""
    required: int
    """Number of subjects that must complete it."""
    cumulative: bool
    """True if this stage and all stages before it are complete."""


class Metrics(msgspec.Struct, frozen=True, kw_only=True):
    """The metrics of one episode: a structure and a mapping from names to values. Each field is followed by its
    definition.

    >>> scored = lingjing.metrics(lingjing.read("runs/first"))
    >>> scored.reason, scored["reason"], len(scored) == len(dict(scored))
    ('budget', 'budget', True)
    >>> scored.unit("gap"), scored.definition("rounds")
    ('%', 'Ticks with an assignment or a target-status message.')
    """

    success: Annotated[bool, "outcome"]
    """Every terminal condition confirmed within the budget."""
    scr: Annotated[float | None, "outcome"]
    """Subtask completion rate, "number of required targets, deliveries, rescues, repairs, or other task components
    completed, divided by the number required in that episode". The components are the targets of the groups that
    success requires (`forall v in victim: …`). In a mission of one target they are its stages, each counted once for
    each of its subjects. The rate of a won mission is 1."""
    score: Annotated[float | None, "outcome"]
    """The mission's own score: the share of the success condition's parts that hold, or, if stages have weights, the
    weighted share of the stages. It is 1 for a won mission. The penalties of broken soft constraints are subtracted."""
    ticks: Annotated[int, "outcome"]
    """Decision ticks."""
    sim_s: Annotated[float, "outcome", "s"]
    """Simulated seconds."""
    wall_s: Annotated[float | None, "outcome", "s"]
    """Wall-clock seconds."""
    reason: Annotated[str, "outcome"]
    """The reason of the end: [why an episode ends](kernel.md#why-an-episode-ends)."""
    incidents: Annotated[int, "outcome"]
    """Collisions (one for both sides), falls, drownings, empty batteries and tanks, and assets that became `dead`,
    `aground` or `fallen` without an event that explains it. The summary and `--json` list entities, time, place and
    cause."""

    reports: Annotated[int, "perception"]
    """Detection reports, each once, whatever the number of its recipients."""
    detections: Annotated[int, "perception"]
    """Reports that matched a visible target one to one (same class and picture, boxes overlap by half)."""
    targets_found: Annotated[int, "perception"]
    """Distinct targets matched at least once."""
    false_positives: Annotated[int, "perception"]
    """Reports that a rule compared with the truth without a match. Reports that no rule of the mission compares with
    the truth are neither detections nor false."""
    misses: Annotated[int, "perception"]
    """Visible targets that no report matched, summed over **all pictures**: a person found in one picture and
    overlooked in another counts once as found and once as missed. Rivals and other places, which no report can match,
    are never missed."""
    precision: Annotated[float | None, "perception"]
    """Detections over detections and false reports. N/A, like all rates of perception, if no rule of the mission judges
    reports. Reference pictures are left out of all these rates."""
    recall: Annotated[float | None, "perception"]
    """Detections over detections and misses, over pictures. It can be 0.6 although every person was found."""
    f1: Annotated[float | None, "perception"]
    """Harmonic mean of precision and recall."""
    miss_rate: Annotated[float | None, "perception"]
    """Share of pictures with a miss."""
    hallucination_rate: Annotated[float | None, "perception"]
    """Share of pictures with a false report."""
    confusion_rate: Annotated[float | None, "perception"]
    """Object confusion: share of pictures with a false report on an object of another class."""
    box_convention_errors: Annotated[int, "perception"]
    """Boxes that match no target as they were written and would match one under another convention (0 to 1000, pixels,
    y first, or width and height). Boxes of answers that could not be used count too. They are misses all the same."""
    localisation_error_m: Annotated[float | None, "perception", "m"]
    """Median planar distance between a matched report's position and the target when the picture was taken."""
    calibration_error: Annotated[float | None, "perception"]
    """Expected calibration error: difference between confidence and match rate, over ten weighted bins."""
    first_discovery_tick: Annotated[int | None, "perception"]
    """Tick of the first matched report."""

    messages: Annotated[int, "communication"]
    """Sender-to-recipient messages; one broadcast counts once for each recipient."""
    kilobytes: Annotated[float, "communication", "kB"]
    """Payload of these messages, in units of 1000 bytes."""
    rounds: Annotated[int, "communication"]
    """Ticks with an assignment or a target-status message."""
    gap: Annotated[float | None, "outcome", "%"]
    """Percent of the requirement that is incomplete at the end. The requirement is the mass of goods to deliver, or
    else the number of required targets, which is one in a mission that requires no group."""
    rep: Annotated[float | None, "communication"]
    """Repeated target rate by the paper's words: repeated assignments and visits of a target over all of them. A visit
    is an entry into the target's region by an asset that can serve it, with or without a stop. Staying inside is one
    visit. Either is repeated if the target was assigned before or is completed, so the arrival of an assignee is a
    repetition ([ADR 0053](adr/0053-the-paper-row-by-row.md)). A step of guidance and the way back to a depot are no
    events."""
    target_events: Annotated[int, "communication"]
    """All these assignments and visits, repeated or not: the denominator of `rep`."""
    discovery_messages: Annotated[float | None, "communication"]
    """Communication at discovery: share of messages sent in a tick in which a target was first matched."""
    conflicts: Annotated[int, "communication"]
    """Commands rejected because another agent's command had priority."""
    rejections: Annotated[int, "communication"]
    """Commands and messages rejected for any reason."""

    actions: Annotated[int, "behaviour"]
    """Physical commands that policies decided on."""
    adherence: Annotated[float | None, "behaviour"]
    """Share of actions that were admitted without change, or lost a resource to another agent's command, and broke no
    constraint."""
    repetition: Annotated[float | None, "behaviour"]
    """Share of actions with the same verb, resource and rounded arguments as the agent's previous action. The first
    action of each agent is left out."""
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
    """Model calls of policies."""
    tokens: Annotated[int, "cost"]
    """Prompt and completion tokens of these calls."""
    cost_usd: Annotated[float, "cost", "USD"]
    """Price of these calls."""
    json_compliance: Annotated[float | None, "cost"]
    """Share of model answers that match the requested schema. Answers to repeated requests are included."""
    answers: Annotated[int, "cost"]
    """All model answers, valid or not: the denominator of `json_compliance`."""
    substitutions: Annotated[int, "cost"]
    """Policy answers that were missing or malformed and became "do nothing"."""
    idle_fraction: Annotated[float | None, "cost"]
    """Agent steps "with no assigned or executed task action" over all steps. Only agents with a body count. A step is
    idle without an admitted or running command and without an open assignment."""

    coverage: Annotated[float | None, "outcome"]
    """Visited search cells over all cells that agents observe. N/A if agents observe no cells."""
    frames: Annotated[int, "perception"]
    """Pictures of mounted cameras, without reference pictures."""
    absent_frames: Annotated[int, "perception"]
    """Requested pictures that were not delivered."""
    faint_targets: Annotated[int, "perception"]
    """Targets drawn in a picture with a contrast under 5 of 255 (in fog, at night), summed over pictures. They have no
    visible pixels, so no report can match them and they are not missed ([ADR
    0012](adr/0012-targets-too-faint-to-see.md))."""
    stages: Annotated[tuple[StageMetric, ...], "outcome"] = ()
    """The number of subjects that completed each stage, and the number required."""
    last_mile: Annotated[int | None, "outcome"] = None
    """Number of stages S1 to S5 of last-mile delivery that were done in a row: aerial inspection, report of the route's
    ends, report of the places that the vehicle passes, arrival at the stop, the target house. N/A in other missions. A
    stage that an intervention supplies counts as done."""
    strict_detections: Annotated[int, "perception"] = 0
    """Detections with a box that overlaps the true one by half. They are all detections, unless the mission accepts a
    tolerance in pixels for small targets ([small targets](small-targets.md))."""
    chance: Annotated[float | None, "perception"] = None
    """Chance level of `detections`: share of boxes of a target's true size, at places drawn uniformly over the picture,
    that the mission would accept; mean over visible targets."""
    strict_chance: Annotated[float | None, "perception"] = None
    """Chance level of `strict_detections`."""
    area_coverage: Annotated[float | None, "outcome"] = None
    """Share of the ground of all search cells that pictures showed: the union of their footprints by height and tilt,
    cut at 20 degrees below the horizon ([ADR 0054](adr/0054-ground-seen.md)). N/A if agents observe no cells."""
    rep_excess: Annotated[float | None, "communication"] = None
    """Excess target rate: assignments and visits of a target that were of no use, over all of them. A visit by the
    assignee and its consent are of use. An order larger than one load can have several assignees."""
    excess_events: Annotated[int, "communication"] = 0
    """All assignments and visits that `rep_excess` counts: its denominator."""

    def __getitem__(self, name: str) -> Any:
        """Return the value of a metric. Raises `KeyError` with the nearest name if there is none of this name."""
        if name not in self.__struct_fields__:
            raise KeyError(
                f"no metric is called `{name}`: {nearest_or(name, self.__struct_fields__, 'see docs/metrics.md')}"
            )
        return getattr(self, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.__struct_fields__)

    def __len__(self) -> int:
        return len(self.__struct_fields__)

    def __contains__(self, name: object) -> bool:
        return name in self.__struct_fields__

    def keys(self) -> KeysView[str]:
        """Return the names in the order of the definitions."""
        return msgspec.structs.asdict(self).keys()

    def values(self) -> ValuesView[Any]:
        """Return the values in the order of `keys`."""
        return msgspec.structs.asdict(self).values()

    def items(self) -> ItemsView[str, Any]:
        """Return names and values in the order of `keys`."""
        return msgspec.structs.asdict(self).items()

    def get(self, name: str, default: Any = None) -> Any:
        """Return the value of a metric, or `default` if none has this name."""
        return getattr(self, name) if name in self.__struct_fields__ else default

    @staticmethod
    def unit(name: str) -> str:
        """Return the unit of a metric; "" for a count, a share, a text or a truth value. Raises `KeyError`."""
        return groups_and_units()[name][1]

    @staticmethod
    def definition(name: str) -> str:
        """Return the definition of a metric as one line. Raises `KeyError`."""
        return definitions()[name]


Mapping.register(Metrics)  # a structure cannot inherit from an abstract class


def groups_and_units() -> dict[str, tuple[str, str]]:
    """Return group and unit of every metric by name, in the order of the fields."""
    hints = get_type_hints(Metrics, include_extras=True)
    return {name: (*hint.__metadata__, "")[:2] for name, hint in hints.items()}


@cache
def definitions() -> Mapping[str, str]:
    """Return the definition of every metric by name, in the order of the fields, each as one line."""
    body = ast.parse(textwrap.dedent(inspect.getsource(Metrics))).body[0]
    assert isinstance(body, ast.ClassDef)
    texts = [ast.literal_eval(node.value) for node in body.body if isinstance(node, ast.Expr)][1:]
    return {name: " ".join(text.split()) for name, text in zip(Metrics.__struct_fields__, texts, strict=True)}


def metrics(trace: Trace) -> Metrics:
    """Return all metrics of one trace, whole or cut. `scr` is None if the trace has no outcome.

    >>> lingjing.metrics(lingjing.read("runs/first")).reason
    'budget'
    """
    detection = detect(trace)
    outcome = trace.outcome
    scr = None if outcome is None else outcome.scr
    edges = [edge for record in trace.boundaries for edge in record.messages]
    decisions = [decision for record in trace.boundaries for decision in record.decisions]
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
        box_convention_errors=len(convention_errors(trace)),
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
        substitutions=sum(bool(decision.substituted) for decision in decisions),
        idle_fraction=idle_fraction(trace),
        coverage=_coverage(trace),
        frames=len(shots(trace)),
        absent_frames=_absent(trace),
        faint_targets=_faint(trace),
        stages=_stages_of(trace),
        strict_detections=strict_detections(trace),
        chance=chance_level(trace, tolerance_of(trace)),
        strict_chance=chance_level(trace, 0.0),
        area_coverage=area_coverage(trace),
        rep_excess=excess_target_rate(trace),
        excess_events=excess_target_events(trace)[1],
        last_mile=None if (chain := last_mile(trace)) is None else chain.cumulative,
    )


def _first_discovery(detection: Detection) -> int | None:
    return min((report.tick for report in detection.reports if report.target is not None), default=None)


def _rounds(edges: Iterable[Envelope]) -> int:
    return len({edge.tick for edge in edges if edge.category in ("assignment", "target_status")})


def _gap(trace: Trace) -> float | None:
    """Return the incomplete share in percent: of the required mass if goods must be delivered, else of the targets."""
    mass = required_mass_kg(trace)
    if mass is not None:
        return 100.0 * mass[1] / mass[0]
    instance, outcome = trace.header.instance, trace.outcome
    if outcome is None or not any(entity.role == "target" for entity in instance.entities):
        return None
    share = outcome.scr if required_groups(instance) else float(outcome.success)
    return 100.0 * (1.0 - share)


def _usage(decisions: Iterable[DecisionRecord]) -> Usage:
    usages = [entry.decision.usage for entry in decisions if entry.decision.usage is not None]
    return Usage(
        calls=sum(usage.calls for usage in usages),
        prompt_tokens=sum(usage.prompt_tokens for usage in usages),
        completion_tokens=sum(usage.completion_tokens for usage in usages),
        cost_usd=sum((usage.cost_usd for usage in usages), 0.0),
        answers=sum(usage.answers for usage in usages),
        valid_answers=sum(usage.valid_answers for usage in usages),
    )


def _coverage(trace: Trace) -> float | None:
    """Return the share of cells of observed grids that any agent's observation shows as visited."""
    instance = trace.header.instance
    grids = {channel.name for agent in instance.agents for channel in agent.observes if channel.source == "grid"}
    cells = {cell.name for cell in instance.cells if cell.grid in grids}
    views = (view for record in trace.boundaries for observed in record.observations for view in observed.cells)
    return ratio(len(cells & {view.name for view in views if view.visited_tick is not None}), len(cells))


def _faint(trace: Trace) -> int:
    targets = judged_targets(trace.header.instance)
    return sum(box.entity in targets for frame in shots(trace) for box in frame.faint)


def _absent(trace: Trace) -> int:
    return len(
        {
            (absent.entity, absent.camera, absent.tick)
            for record in trace.boundaries
            for observation in record.observations
            for absent in observation.absent
        }
    )


@cache_by_trace
def _stages_of(trace: Trace) -> tuple[StageMetric, ...]:
    """Return the completion of each stage, in declaration order."""
    instance = trace.header.instance
    members = Counter(entity.group for entity in instance.entities)
    done: dict[str, set[str]] = {}
    for record in trace.boundaries:
        for change in record.stages:
            done.setdefault(change.stage, set()).add(change.subject)
    stages: list[StageMetric] = []
    for stage in instance.stages:
        required = members[stage.domain] if stage.domain is not None else 1
        count = len(done.get(stage.name, ()))
        complete = count >= required and (not stages or stages[-1].cumulative)
        stages.append(StageMetric(name=stage.name, done=count, required=required, cumulative=complete))
    return tuple(stages)


def table() -> str:
    """Return the definitions as a table in Markdown, group by group, from the source of `Metrics`."""
    texts = definitions()
    rows = [(*how, name, texts[name]) for name, how in groups_and_units().items()]
    rows.sort(key=lambda row: GROUPS.index(row[0]))
    lines = (f"| {group} | `{name}` | {unit} | {text} |" for group, unit, name, text in rows)
    return "\n".join(["| group | metric | unit | definition |", "| --- | --- | --- | --- |", *lines]) + "\n"


def write_table(page: Path) -> None:
    """Replace the table at the end of the page."""
    text = page.read_text(encoding="utf-8")
    page.write_text(text[: text.index("| group |")] + table(), encoding="utf-8")


if __name__ == "__main__":
    write_table(Path(sys.argv[1]))
