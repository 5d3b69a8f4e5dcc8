"""The failure family of a lost episode, with the records that show it.

The paper: "Each failed episode is assigned to its earliest model-caused breakdown using aligned perception,
localization, coordination, action, and task-state traces". Shares are taken over failed episodes without infrastructure
failures, and "each episode receives one label".

A *lost target* is one that success requires and that was not completed. Each of the paper's six families has one rule
here. A rule is applied to one lost target. It yields the tick at which the breakdown began and a chain of records as
evidence: agent, action, message, relation, event.

- `perception_miss`: a picture showed the target, and no report matched it within `DELAY` ticks, and no false report lay
  on it. In a mission with a matching rule it also applies if no picture showed the target and the mission's ticks ran
  out before a match. Its tick is then the last one. In a *navigation* (no rule judges reports, the target is hidden and
  a body must reach it) it applies if no picture showed the target, or if no body came nearer within `DELAY` ticks after
  the first picture that did.
- `object_confusion`: before the target was matched, a false report lay on an object of another class (IoU of at least
  `OVERLAP`). In a navigation: a body was stopped away from the target before a picture had shown it.
- `localisation_error`: a report matched the target, and no report located it within `DELAY` ticks. A rule of the
  mission that reads the position of a matched report decides whether it is located. In a navigation: a body was stopped
  away from the target after a picture had shown it.
- `handoff_break`: there are two cases. (1) The target was known (located, matched, or known from the start), a stage of
  the mission requires its assignment, and it was not assigned within `DELAY` ticks. (2) Nothing had to be found,
  several agents have bodies, and a stage that another one depends on was never done, or a body was never permitted to
  move. A team that is idle, or that serves completed targets instead, is no handoff break.
- `coordination_deadlock`: the target, or one that it waits for, was assigned and its place was known, and the assignee
  was idle for `DELAY` ticks. If no record names the assignee, all agents with bodies were idle. It also applies if two
  commands for the assignee's body were rejected as `conflict` after the assignment, and to a team of several bodies of
  which none acted in the first `DELAY` ticks.
- `context_drift`: after the assignment, the body was sent to other or completed targets (a forgotten subgoal), or
  `STUBBORN` times to one place without a target, or an agent that controls it repeated a rejected action `STUBBORN`
  times in a row, or the body acted for `DELAY` ticks and came no nearer to the target (an ignored order). Without an
  assignment: bodies that serve the target's group acted `DELAY` times on completed targets. In a navigation: the body
  had come near the target and went away again.

The earliest breakdown of any lost target determines the family. For equal ticks, the first family in this order wins.
An episode without a breakdown is `unattributed`. Examples are a broken constraint and a crash.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from lingjing.analysis.behaviour import EvaluatedAction, actions
from lingjing.analysis.completion import completion_ticks, required_target_groups
from lingjing.analysis.detection import OVERLAP, aligned_frames, confused_with, detect, iou, matching_rules
from lingjing.analysis.failure_records import DELAY, FAMILIES, Attribution, FailureFamily, RecordLink
from lingjing.analysis.idleness import still_steps
from lingjing.analysis.navigation_failures import NEARER_M, body_places, navigation_breakdowns, planar_distance
from lingjing.analysis.repetition import assignments_of
from lingjing.mission.conditions.quantities import QuantityKind
from lingjing.mission.conditions.survey import Condition, survey_instance
from lingjing.mission.instance import Instance
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Receipt

STUBBORN = 3
"""Repetitions of a rejected action that count as drift. Chosen: one or two may be an accident."""


def attribute(trace: Trace) -> Attribution | None:
    """Return the attribution of a lost episode, or None if it was won or did not end by itself."""
    outcome = trace.outcome
    if outcome is None or outcome.success or outcome.reason in CUT_SHORT or not trace.boundaries:
        return None
    story = _Story(trace)
    breakdowns = [breakdown for target in story.lost for breakdown in _breakdowns(story, target)]
    if not breakdowns:
        return Attribution(family="unattributed")
    return min(breakdowns, key=lambda breakdown: (breakdown.tick, FAMILIES.index(breakdown.family)))


@dataclass
class _Story:
    """The data of a trace that the rules need. Dictionaries of ticks hold the first tick by target or stage."""

    trace: Trace
    lost: list[str] = field(default_factory=list)
    """The lost targets."""
    matched: dict[str, int] = field(default_factory=dict)
    located: dict[str, int] = field(default_factory=dict)
    handed: dict[str, int] = field(default_factory=dict)
    """Completion of a stage in `handing`, by subject."""
    assigned: dict[str, list[tuple[int, str, str]]] = field(default_factory=dict)
    """Assignments of a target by another agent: tick, body, id of the message or command."""
    own_commands: dict[str, list[tuple[int, str, str]]] = field(default_factory=dict)
    """Commands of an agent that send its own body to a target: tick, body, id of the command."""
    done: dict[str, int] = field(default_factory=dict)
    """Completion of a stage for any subject, by stage."""
    judged: bool = False
    """True if the mission has a matching rule."""
    locates: bool = False
    """True if the mission has a rule that reads the position of a matched report."""
    assigns: bool = False
    """True if a stage requires an assignment."""
    handing: set[str] = field(default_factory=set)
    """Names of the stages that require an assignment."""
    stages: dict[str, Condition] = field(default_factory=dict)
    """The conditions of the stages, by stage."""

    def __post_init__(self) -> None:
        instance = self.trace.header.instance
        done, groups = completion_ticks(self.trace), required_target_groups(instance)
        candidates = (entity for entity in instance.entities if entity.role == "target")
        self.lost = [entity.id for entity in candidates if entity.id not in done and entity.group in groups]
        matching = matching_rules(self.trace)
        locating = _locating_rules(instance, matching)
        self.judged, self.locates = bool(matching), bool(locating)
        self.stages = {stage.name: stage for stage in survey_instance(instance).of_kind("stage")}
        self.handing = {name for name, stage in self.stages.items() if _reads(stage, "assignment")}
        self.assigns = bool(self.handing)
        assignments = assignments_of(self.trace)
        owners = {body: agent.id for agent in instance.agents for body in agent.controls}
        for record in self.trace.boundaries:
            for event in record.events:
                for name in event.bindings:
                    if event.kind in matching:
                        self.matched.setdefault(name, event.tick)
                    if event.kind in locating:
                        self.located.setdefault(name, event.tick)
            for change in record.stages:
                self.done.setdefault(change.stage, change.tick)
                if change.stage in self.handing:
                    self.handed.setdefault(change.subject, change.tick)
            for body, targets, message in assignments.at(record):
                for target in targets:
                    self.assigned.setdefault(target, []).append((record.tick, body, message))
            for command in (command for command in record.commands if command.origin == "agent"):
                entries = self.assigned if owners.get(command.resource) != command.sender else self.own_commands
                for target in assignments.targets_of(record, command.arguments, command.resource):
                    entries.setdefault(target, []).append((record.tick, command.resource, command.id))

    @property
    def reason(self) -> str:
        """The reason of the episode's end."""
        return "" if self.trace.outcome is None else self.trace.outcome.reason

    @property
    def last(self) -> int:
        """The last tick."""
        return self.trace.boundaries[-1].tick

    def mistaken(self, target: str) -> int | None:
        """Return the tick of the first false report that lay on the target, or None. Such a target was noticed."""
        frames = aligned_frames(self.trace)
        boxes = {(frame.id, box.box) for frame in frames for box in frame.boxes if box.entity == target}
        return min(
            (
                report.tick
                for report in detect(self.trace).reports
                if report.false and report.box is not None
                if any(report.frame == frame and iou(report.box, box) >= OVERLAP for frame, box in boxes)
            ),
            default=None,
        )

    def assignments_of(self, target: str) -> list[tuple[int, str, str]]:
        """Return the assignments of the target, or if there are none, those of the targets in `blocking`."""
        return self.assigned.get(target) or [
            assignment for name in self.blocking for assignment in self.assigned.get(name, ())
        ]

    @property
    def blocking(self) -> tuple[str, ...]:
        """The targets of stages that were never done and that other stages depend on."""
        instance = self.trace.header.instance
        groups = {entity.id: entity.group for entity in instance.entities if entity.role == "target"}
        sources = {relation.source for relation in instance.relations if relation.kind == "dependency"}
        waited = sources - set(self.done)
        blocking: dict[str, None] = {}
        for stage in instance.stages:
            read = {quantity.owner for leaf in self.stages[stage.name].leaves for quantity in leaf.quantities}
            if stage.name in waited:
                blocking |= dict.fromkeys(name for name, group in groups.items() if name in read or group in read)
        return tuple(blocking)

    def actions(self) -> tuple[EvaluatedAction, ...]:
        """Return all actions of the episode."""
        return actions(self.trace)


def _breakdowns(story: _Story, target: str) -> Iterator[Attribution]:
    """Yield the breakdown of each rule that applies to one lost target."""
    for rule in (_miss, _confusion, _mislocated, _handoff, _deadlock, _idle_team, _drift, _ignored_order, _astray):
        breakdown = rule(story, target)
        if breakdown is not None:
            yield breakdown
    yield from navigation_breakdowns(story.trace, target)


def _miss(story: _Story, target: str) -> Attribution | None:
    if not story.judged:
        return None
    frames = [
        frame
        for frame in aligned_frames(story.trace)
        if any(box.entity == target and box.pixels for box in frame.boxes)
    ]
    matched = story.matched.get(target)
    if not frames:
        if matched is not None or story.reason != "budget":
            return None  # the search did not end because of the tick budget
        link = RecordLink(kind="event", tick=story.last, record="", text=f"{target} is visible in no picture")
        return Attribution(family="perception_miss", target=target, tick=story.last, chain=(link,))
    first = frames[0]
    noticed = [tick for tick in (matched, story.mistaken(target)) if tick is not None]
    if noticed and min(noticed) - first.tick <= DELAY:
        return None
    agent = _controller(story.trace.header.instance, first.entity)
    after = "no later report did" if matched is None else f"the first match came {matched - first.tick} ticks later"
    chain = (
        RecordLink(kind="picture", tick=first.tick, record=first.id, text=f"{target} is visible"),
        RecordLink(kind="agent", tick=first.tick, record=agent, text=f"{agent} received it, no report matched it"),
        RecordLink(kind="event", tick=story.last if matched is None else matched, record="", text=after),
    )
    return Attribution(family="perception_miss", target=target, tick=first.tick, chain=chain)


def _confusion(story: _Story, target: str) -> Attribution | None:
    until = story.matched.get(target, story.last + 1)
    for report in detect(story.trace).reports:
        other = confused_with(story.trace, report) if report.tick < until else None
        if other is not None:
            text = f"{report.sender} reports a {report.cls} where {other} is"
            chain = (
                RecordLink(kind="picture", tick=report.tick, record=report.frame, text=f"{other} is visible"),
                RecordLink(kind="message", tick=report.tick, record=report.id, text=text),
            )
            return Attribution(family="object_confusion", target=target, tick=report.tick, chain=chain)
    return None


def _mislocated(story: _Story, target: str) -> Attribution | None:
    matched, located = story.matched.get(target), story.located.get(target)
    if not story.locates or matched is None or (located is not None and located - matched <= DELAY):
        return None
    end = story.last if located is None else located
    chain = (
        *_first_report(story, target),
        RecordLink(kind="event", tick=end, record="", text="not located before"),
    )
    return Attribution(family="localisation_error", target=target, tick=matched, chain=chain)


def _first_report(story: _Story, target: str) -> Iterator[RecordLink]:
    """Yield the first report that matched the target. There is none if the mission matches other messages."""
    for report in detect(story.trace).reports:
        if report.target == target:
            off = "an unknown distance" if report.error_m is None else f"{report.error_m:.0f} m"
            text = f"{report.sender} reports {target} {off} off"
            yield RecordLink(kind="message", tick=report.tick, record=report.id, text=text)
            return


def _handoff(story: _Story, target: str) -> Attribution | None:
    known = _known(story, target)
    if known is None:
        return _unopened(story, target)
    if not story.assigns:
        return None
    handed = story.handed.get(target, story.handed.get(""))
    if handed is not None and handed - known <= DELAY:
        return None
    if handed is None and story.last - known <= DELAY:
        return None  # found too late for an assignment
    if handed is None and (_idle_team(story, target) or _astray(story, target)):
        return None  # no executor was free for it
    text = "never assigned" if handed is None else f"assigned {handed - known} ticks later"
    end = story.last if handed is None else handed
    chain = (
        RecordLink(kind="event", tick=known, record="", text=f"the place of {target} was known"),
        RecordLink(kind="relation", tick=end, record="information_handoff", text=text),
    )
    return Attribution(family="handoff_break", target=target, tick=known, chain=chain)


def _known(story: _Story, target: str) -> int | None:
    """Return the tick since which the place of the target was known, or None.

    It is the tick of its location or of its match. For a target that need not be found, it is that of `_due`.
    """
    if story.locates:
        return story.located.get(target)
    if story.judged:
        return story.matched.get(target)
    hidden = {entity.id for entity in story.trace.header.instance.entities if entity.hidden}
    return None if target in hidden or not story.assigns else _due(story)


def _due(story: _Story) -> int | None:
    """Return the tick at which all stages before the assignment were done, or None if one of them never was."""
    ticks = [0]
    for stage in story.trace.header.instance.stages:
        if stage.name in story.handing:
            break
        if stage.name not in story.done:
            return None
        ticks.append(story.done[stage.name])
    return max(ticks)


def _unopened(story: _Story, target: str) -> Attribution | None:
    """Return the handoff break of case (2): an unmet dependency or a missing permission."""
    instance = story.trace.header.instance
    if story.judged or sum(bool(agent.controls) for agent in instance.agents) < 2 or _idle_team(story, target):
        return None
    done = story.done
    if any(name in story.assigned for name in story.blocking) and (_deadlock(story, target) or _drift(story, target)):
        return None  # the blocking target was assigned, and the assignee's breakdown comes first
    for relation in instance.relations:
        if relation.kind == "dependency" and relation.source not in done and relation.target not in done:
            text = f"{relation.target} waits for {relation.source}, which was never done"
            link = RecordLink(kind="relation", tick=0, record="dependency", text=text)
            return Attribution(family="handoff_break", target=target, tick=0, chain=(link,))
    return _never_permitted(story, target)


def _never_permitted(story: _Story, target: str) -> Attribution | None:
    """Return the breakdown of a body that never moved because its commands were rejected as not permitted."""
    refused: dict[str, list[Receipt]] = {}
    moved: set[str] = set()
    for record in story.trace.boundaries:
        for receipt in record.receipts:
            if receipt.reason == "not_permitted":
                refused.setdefault(receipt.resource, []).append(receipt)
            elif receipt.status == "completed":
                moved.add(receipt.resource)
    for body, receipts in refused.items():
        if body not in moved and len(receipts) >= STUBBORN:
            first = receipts[0]
            text = f"{first.sender} is never permitted: {first.detail}"
            link = RecordLink(kind="action", tick=first.tick, record=first.request, text=text)
            return Attribution(family="handoff_break", target=target, tick=first.tick, chain=(link,))
    return None


def _deadlock(story: _Story, target: str) -> Attribution | None:
    assignments = story.assignments_of(target)
    handed = story.handed.get(target)
    if assignments:
        tick, body, record = assignments[0]
        link = RecordLink(kind="message", tick=tick, record=record, text=f"{target} is assigned to {body}")
    elif handed is not None:
        tick, body = handed, ""
        link = RecordLink(kind="relation", tick=tick, record="information_handoff", text=f"{target} is handed over")
    else:
        return None
    if story.judged:
        known = _known(story, target)
        if known is None:
            return None  # an agent that waits for an undiscovered target is not at fault
        tick = max(tick, known)
    for links in (_waiting(story, tick, body), _conflicts(story, tick, body)):
        if links:
            return Attribution(family="coordination_deadlock", target=target, tick=links[0].tick, chain=(link, *links))
    return None


def _waiting(story: _Story, tick: int, body: str) -> tuple[RecordLink, ...]:
    """Return the link for an assignee that is idle for `DELAY` ticks in a row; none if there is no such period.

    Without a known assignee, all agents with bodies must be idle at the same time.
    """
    steps = still_steps(story.trace)
    agent = _controller(story.trace.header.instance, body) if body else ""
    idle = steps.get(agent, ()) if body else [all(step) for step in zip(*steps.values(), strict=False)]
    begin, length = _idle_stretch(idle, tick)
    if length < DELAY:
        return ()
    text = f"{agent} is idle for {length} ticks" if agent else f"all agents are idle for {length} ticks"
    return (RecordLink(kind="agent", tick=begin, record=agent or ", ".join(steps), text=text),)


def _idle_team(story: _Story, target: str) -> Attribution | None:
    """Return the deadlock of a team of several bodies of which none acts from the beginning on."""
    steps = still_steps(story.trace)
    begin, length = _idle_stretch([all(step) for step in zip(*steps.values(), strict=False)], 0)
    if len(steps) < 2 or begin > 0 or length < DELAY:
        return None
    text = f"all {len(steps)} agents with bodies are idle for {length} ticks"
    link = RecordLink(kind="agent", tick=0, record=", ".join(steps), text=text)
    return Attribution(family="coordination_deadlock", target=target, tick=0, chain=(link,))


def _conflicts(story: _Story, tick: int, body: str) -> tuple[RecordLink, ...]:
    """Return links for two commands for the body that were rejected as `conflict`; none if there are fewer."""
    refused = [
        receipt
        for record in story.trace.boundaries
        for receipt in record.receipts
        if (receipt.reason, receipt.resource) == ("conflict", body) and record.tick > tick
    ]
    links = [
        RecordLink(
            kind="action",
            tick=receipt.tick,
            record=receipt.request,
            text=f"{receipt.sender} is refused: {receipt.detail}",
        )
        for receipt in refused[:2]
    ]
    return tuple(links) if len(links) == 2 else ()


def _idle_stretch(steps: Sequence[bool], since: int) -> tuple[int, int]:
    """Return begin and length of the first period of at least `DELAY` idle steps from a tick on; length 0 if none."""
    begin = since
    for number in range(since, len(steps) + 1):
        if number == len(steps) or not steps[number]:
            if number - begin >= DELAY:
                return begin, number - begin
            begin = number + 1
    return since, 0


def _drift(story: _Story, target: str) -> Attribution | None:
    assignments = sorted((*story.assignments_of(target), *story.own_commands.get(target, ())))
    if not assignments:
        return None
    tick, body, record = assignments[0]
    run: list[EvaluatedAction] = []
    stay: list[EvaluatedAction] = []
    for action in story.actions():
        if action.resource != body or action.tick <= tick:
            continue
        if action.forgotten:
            return _drifted(target, (tick, body, record), action, "has other targets than the assigned one")
        away = action.elsewhere and action.admitted
        stay = [*(stay if action.repeated else ()), action] if away else []
        if len(stay) >= STUBBORN:
            return _drifted(
                target, (tick, body, record), stay[0], f"goes {len(stay)} times to a place without a target"
            )
        run = [*run, action] if action.repeated and not action.adherent else []
        if len(run) >= STUBBORN:
            return _drifted(target, (tick, body, record), run[0], f"is refused and repeated {len(run)} times")
    return None


def _ignored_order(story: _Story, target: str) -> Attribution | None:
    """Return the drift of a body that was ordered to the target, acted for `DELAY` ticks and came no nearer."""
    places = body_places(story.trace)
    for tick, body, record in sorted(story.assigned.get(target, ())):
        until = tick + DELAY
        own = [action for action in story.actions() if action.resource == body and tick < action.tick <= until]
        obeyed = any(tick < sent <= until for sent, mover, _ in story.own_commands.get(target, ()) if mover == body)
        far = planar_distance(places, body, target, tick)
        if obeyed or not own or far is None or until > story.last:
            continue
        nearest = min(planar_distance(places, body, target, later) or 0.0 for later in range(tick, until + 1))
        if nearest > far - NEARER_M:
            return _drifted(target, (tick, body, record), own[0], f"and {DELAY} ticks lead no nearer to {target}")
    return None


def _astray(story: _Story, target: str) -> Attribution | None:
    """Return the drift of bodies that act on completed targets while the target is assigned to none."""
    assignments = assignments_of(story.trace)
    group = assignments.groups.get(target)
    if story.assigned.get(target) or group is None:
        return None
    acted = [
        action
        for action in story.actions()
        if action.forgotten and action.on_completed and (action.resource, group) in assignments.serving
    ]
    if len(acted) < DELAY:
        return None
    first = acted[0]
    text = f"{first.verb} of {first.resource} leads to a completed target; {len(acted)} actions do"
    link = RecordLink(kind="action", tick=first.tick, record=f"{first.agent} {first.verb}", text=text)
    return Attribution(family="context_drift", target=target, tick=first.tick, chain=(link,))


def _drifted(target: str, assignment: tuple[int, str, str], action: EvaluatedAction, what: str) -> Attribution:
    tick, body, record = assignment
    name, text = f"{action.agent} {action.verb}", f"{action.verb} of {body} {what}"
    chain = (
        RecordLink(kind="message", tick=tick, record=record, text=f"{target} is assigned to {body}"),
        RecordLink(kind="action", tick=action.tick, record=name, text=text),
    )
    return Attribution(family="context_drift", target=target, tick=action.tick, chain=chain)


def _locating_rules(instance: Instance, matching: frozenset[str]) -> frozenset[str]:
    """Return the rules that call a matching rule and read the position of a report."""
    positions = {
        (spec.kind, field.name) for spec in instance.messages for field in spec.fields if field.type == "position"
    }
    return frozenset(
        rule.name
        for rule in survey_instance(instance).of_kind("rule")
        if any(called.name in matching for called in rule.reads("rule"))
        and any((report.owner, report.name) in positions for report in rule.reads("message"))
    )


def _reads(condition: Condition, kind: QuantityKind) -> bool:
    """Return whether a condition reads a quantity of a kind, itself or through rules."""
    return any(quantity.kind == kind for leaf in condition.leaves for quantity in leaf.quantities)


def _controller(instance: Instance, body: str) -> str:
    """Return the agent that controls a body, or the body's id if none does."""
    return next((agent.id for agent in instance.agents if body in agent.controls), body)


__all__ = ["DELAY", "FAMILIES", "Attribution", "FailureFamily", "RecordLink", "attribute"]
