"""`attribute`: the failure family of a lost episode, with the records that show it.

The paper: "Each failed episode is assigned to its earliest model-caused breakdown using aligned perception,
localization, coordination, action, and task-state traces"; shares are taken over failed episodes without
infrastructure failures, and "each episode receives one label". Its six families, and the rule that each has here. A
rule speaks of one *lost* target: one that success asks for and that was not completed. It gives the tick at which
the breakdown began and the chain of records that shows it: agent, action, message, relation, event.

- `perception_miss`: the target stood in a picture that was taken for an agent, and no report matched it within `DELAY`
  ticks or ever, nor lay a false report on it; or, in a mission that judges reports, it stood in no picture and was
  never matched when the mission's ticks ran out: then the breakdown is that the search ended without it, at the last
  tick.
- `object_confusion`: while the target was unmatched, a false report lay on something of another class by half or more.
- `localisation_error`: a report matched the target, and no report located it within `DELAY` ticks or ever, by the rule
  of the mission that asks for a matched report and looks at a position that it tells.
- `handoff_break`: what the target needs next was known (it was located, or matched, or nothing has to be found) and it
  was not assigned to who must serve it within `DELAY` ticks or ever, where a stage of the mission asks for that; or,
  among several agents with bodies and where nothing had to be found, a stage that another depends on was never done, or
  a body was never permitted to move.
- `coordination_deadlock`: the target, or one that it waits for, was assigned, and `DELAY` ticks passed in which the
  assignee did nothing though it was known where the target is, or, where no record names it, nobody with a body did
  anything; or two commands for the assignee's body were refused as `conflict` while it was open.
- `context_drift`: while the assignment was open, the body was sent to other targets or completed ones (a forgotten
  subgoal) or `STUBBORN` times to one place where no target is, or an agent that controls it did the same refused thing
  `STUBBORN` times in a row.

The earliest breakdown of any lost target is the episode's; of equal ticks the first in this order. What no rule
supports is `unattributed`: a broken constraint, a crash, a late stage of a mission whose perception is not
recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import msgspec

from lingjing.analysis.behaviour import JudgedAction, actions
from lingjing.analysis.completion import asked_groups, completion_ticks
from lingjing.analysis.detection import OVERLAP, confused_with, detect, iou, matching_rules, shots
from lingjing.analysis.idleness import still_steps
from lingjing.analysis.repetition import assignments_of
from lingjing.mission.expression import Aggregate, Attr, Call, Quantified, Ref, parts
from lingjing.mission.feasibility.condition_needs import mentions
from lingjing.mission.feasibility.needs import Handover
from lingjing.mission.feasibility.outline import Outline, of_instance
from lingjing.mission.instance import Instance
from lingjing.mission.model import Rule, Stage
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Receipt

FailureFamily = Literal[
    "perception_miss",
    "object_confusion",
    "localisation_error",
    "handoff_break",
    "coordination_deadlock",
    "context_drift",
    "unattributed",
]
FAMILIES: tuple[FailureFamily, ...] = get_args(FailureFamily)

DELAY = 10
"""Ticks after which what should have followed counts as missing: a sixth of the budget of the paper's search
missions."""

STUBBORN = 3
"""Refusals of the same action in a row that show drift and no accident."""


class RecordLink(msgspec.Struct, frozen=True, kw_only=True):
    """One record of a chain: its kind, where it is found (a frame, message, command or event id), and what it says."""

    kind: Literal["agent", "action", "message", "relation", "event", "picture"]
    tick: int
    record: str
    text: str


class Attribution(msgspec.Struct, frozen=True, kw_only=True):
    """The family of a failed episode; `target` and `tick` are those of the breakdown, `chain` shows it."""

    family: FailureFamily
    target: str = ""
    tick: int | None = None
    chain: tuple[RecordLink, ...] = ()


def attribute(trace: Trace) -> Attribution | None:
    """The attribution of a failed episode; None if it was won, or cut short by the infrastructure."""
    outcome = trace.outcome
    if outcome is None or outcome.success or outcome.reason in CUT_SHORT or not trace.boundaries:
        return None
    story = _Story(trace)
    found = [one for target in story.lost for one in _breakdowns(story, target)]
    if not found:
        return Attribution(family="unattributed")
    return min(found, key=lambda one: (one.tick, FAMILIES.index(one.family)))


@dataclass
class _Story:
    """What the rules ask of a trace, gathered once."""

    trace: Trace
    lost: list[str] = field(default_factory=list)
    matched: dict[str, int] = field(default_factory=dict)
    located: dict[str, int] = field(default_factory=dict)
    handed: dict[str, int] = field(default_factory=dict)
    assigned: dict[str, list[tuple[int, str, str]]] = field(default_factory=dict)
    taken: dict[str, list[tuple[int, str, str]]] = field(default_factory=dict)
    done: dict[str, int] = field(default_factory=dict)
    judged: bool = False
    locates: bool = False
    assigns: bool = False
    handing: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        instance = self.trace.header.instance
        done, groups = completion_ticks(self.trace), asked_groups(instance)
        self.lost = [
            one.id for one in instance.entities if one.role == "target" and one.id not in done and one.group in groups
        ]
        matching = matching_rules(self.trace)
        locating = _locating_rules(instance, matching)
        self.judged, self.locates = bool(matching), bool(locating)
        outline = of_instance(instance)
        self.handing = {stage.name for stage in instance.stages if _asks_for_assignment(stage, outline)}
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
            for command in (one for one in record.commands if one.origin == "agent"):
                given = self.assigned if owners.get(command.resource) != command.sender else self.taken
                for target in assignments.meant(record, command.arguments, command.resource):
                    given.setdefault(target, []).append((record.tick, command.resource, command.id))

    @property
    def reason(self) -> str:
        """Why the episode ended."""
        return "" if self.trace.outcome is None else self.trace.outcome.reason

    @property
    def last(self) -> int:
        """The last tick."""
        return self.trace.boundaries[-1].tick

    def mistaken(self, target: str) -> int | None:
        """When a false report first lay on the target, which then was not overlooked."""
        boxes = {(one.id, box.box) for one in shots(self.trace) for box in one.boxes if box.entity == target}
        return min(
            (
                one.tick
                for one in detect(self.trace).reports
                if one.false and one.box is not None
                if any(one.frame == frame and iou(one.box, box) >= OVERLAP for frame, box in boxes)
            ),
            default=None,
        )

    def assignments_of(self, target: str) -> list[tuple[int, str, str]]:
        """Those of the target, else those of the targets of a stage that it waits for and that was never done."""
        return self.assigned.get(target) or [one for name in self.blocking for one in self.assigned.get(name, ())]

    @property
    def blocking(self) -> tuple[str, ...]:
        """Targets of stages that others depend on and that were never done."""
        instance = self.trace.header.instance
        targets = {one.id: one.group for one in instance.entities if one.role == "target"}
        waited = {one.source for one in instance.relations if one.kind == "dependency"} - set(self.done)
        found: dict[str, None] = {}
        for stage in instance.stages:
            named = {part.name for part in parts(stage.condition) if isinstance(part, Ref)} | {stage.domain}
            if stage.name in waited:
                found |= dict.fromkeys(one for one, group in targets.items() if one in named or group in named)
        return tuple(found)

    def actions(self) -> tuple[JudgedAction, ...]:
        """All actions of the episode."""
        return actions(self.trace)


def _breakdowns(story: _Story, target: str) -> Iterator[Attribution]:
    """Every breakdown that the trace supports for one lost target."""
    for rule in (_miss, _confusion, _mislocated, _handoff, _deadlock, _drift):
        found = rule(story, target)
        if found is not None:
            yield found


def _miss(story: _Story, target: str) -> Attribution | None:
    if not story.judged:
        return None
    frames = [one for one in shots(story.trace) if any(box.entity == target and box.pixels for box in one.boxes)]
    matched = story.matched.get(target)
    if not frames:
        if matched is not None or story.reason != "budget":
            return None  # something else ended the search
        link = RecordLink(kind="event", tick=story.last, record="", text=f"{target} stands in no picture")
        return Attribution(family="perception_miss", target=target, tick=story.last, chain=(link,))
    first = frames[0]
    noticed = [tick for tick in (matched, story.mistaken(target)) if tick is not None]
    if noticed and min(noticed) - first.tick <= DELAY:
        return None
    agent = _who_controls(story.trace.header.instance, first.entity)
    after = "nor did any later" if matched is None else f"the first that did came {matched - first.tick} ticks later"
    chain = (
        RecordLink(kind="picture", tick=first.tick, record=first.id, text=f"{target} stands in it"),
        RecordLink(kind="agent", tick=first.tick, record=agent, text=f"{agent} was shown it, no report matched it"),
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
                RecordLink(kind="picture", tick=report.tick, record=report.frame, text=f"{other} stands in it"),
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
    """The first report that matched the target; none where a mission matches messages of another category."""
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
        return None  # found too late for anybody to act on it
    told = "never assigned" if handed is None else f"assigned {handed - known} ticks later"
    end = story.last if handed is None else handed
    chain = (
        RecordLink(kind="event", tick=known, record="", text=f"where {target} is was known"),
        RecordLink(kind="relation", tick=end, record="information_handoff", text=told),
    )
    return Attribution(family="handoff_break", target=target, tick=known, chain=chain)


def _known(story: _Story, target: str) -> int | None:
    """When it was known where the target is: when it was located, or matched; from the start if nobody has to find
    it."""
    if story.locates:
        return story.located.get(target)
    if story.judged:
        return story.matched.get(target)
    hidden = {one.id for one in story.trace.header.instance.entities if one.hidden}
    return None if target in hidden or not story.assigns else _due(story)


def _due(story: _Story) -> int | None:
    """When the stages before the one that asks for an assignment were done; None if one of them never was."""
    ticks = [0]
    for stage in story.trace.header.instance.stages:
        if stage.name in story.handing:
            break
        if stage.name not in story.done:
            return None
        ticks.append(story.done[stage.name])
    return max(ticks)


def _unopened(story: _Story, target: str) -> Attribution | None:
    """What somebody waits for and another was to bring about, where nothing had to be found for it."""
    instance = story.trace.header.instance
    if story.judged or sum(bool(agent.controls) for agent in instance.agents) < 2:
        return None
    done = story.done
    if any(name in story.assigned for name in story.blocking) and (_deadlock(story, target) or _drift(story, target)):
        return None  # somebody was told to, and what became of that is the breakdown
    for relation in instance.relations:
        if relation.kind == "dependency" and relation.source not in done and relation.target not in done:
            text = f"{relation.target} waits for {relation.source}, which was never done"
            link = RecordLink(kind="relation", tick=0, record="dependency", text=text)
            return Attribution(family="handoff_break", target=target, tick=0, chain=(link,))
    return _never_permitted(story, target)


def _never_permitted(story: _Story, target: str) -> Attribution | None:
    """A body whose first command and last command were both refused because what permits them never came about."""
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
            text = f"{first.sender} is refused to the end: {first.detail}"
            link = RecordLink(kind="action", tick=first.tick, record=first.request, text=text)
            return Attribution(family="handoff_break", target=target, tick=first.tick, chain=(link,))
    return None


def _deadlock(story: _Story, target: str) -> Attribution | None:
    given = story.assignments_of(target)
    handed = story.handed.get(target)
    if given:
        tick, body, record = given[0]
        link = RecordLink(kind="message", tick=tick, record=record, text=f"{target} is assigned to {body}")
    elif handed is not None:
        tick, body = handed, ""
        link = RecordLink(kind="relation", tick=tick, record="information_handoff", text=f"{target} is handed over")
    else:
        return None
    if story.judged:
        known = _known(story, target)
        if known is None:
            return None  # who waits for what nobody has found is not to blame
        tick = max(tick, known)
    for found in (_waiting(story, tick, body), _quarrel(story, tick, body)):
        if found:
            return Attribution(family="coordination_deadlock", target=target, tick=found[0].tick, chain=(link, *found))
    return None


def _waiting(story: _Story, tick: int, body: str) -> tuple[RecordLink, ...]:
    """The assignee, or where it is not known everybody with a body at once, idle for `DELAY` ticks in a row."""
    steps = still_steps(story.trace)
    agent = _who_controls(story.trace.header.instance, body) if body else ""
    idle = steps.get(agent, ()) if body else [all(one) for one in zip(*steps.values(), strict=False)]
    begin, length = _idle_stretch(idle, tick)
    if length < DELAY:
        return ()
    text = f"{agent or 'everybody'} is idle for {length} ticks"
    return (RecordLink(kind="agent", tick=begin, record=agent or ", ".join(steps), text=text),)


def _quarrel(story: _Story, tick: int, body: str) -> tuple[RecordLink, ...]:
    """Two or more commands for the body that were refused because others came first."""
    refused = [
        receipt
        for one in story.trace.boundaries
        for receipt in one.receipts
        if (receipt.reason, receipt.resource) == ("conflict", body) and one.tick > tick
    ]
    links = [
        RecordLink(kind="action", tick=one.tick, record=one.request, text=f"{one.sender} is refused: {one.detail}")
        for one in refused[:2]
    ]
    return tuple(links) if len(links) == 2 else ()


def _idle_stretch(steps: Sequence[bool], since: int) -> tuple[int, int]:
    """The first stretch of at least `DELAY` idle steps from a tick on: where it begins, and its length."""
    begin = since
    for number in range(since, len(steps) + 1):
        if number == len(steps) or not steps[number]:
            if number - begin >= DELAY:
                return begin, number - begin
            begin = number + 1
    return since, 0


def _drift(story: _Story, target: str) -> Attribution | None:
    given = sorted((*story.assignments_of(target), *story.taken.get(target, ())))
    if not given:
        return None
    tick, body, record = given[0]
    run: list[JudgedAction] = []
    stay: list[JudgedAction] = []
    for one in story.actions():
        if one.resource != body or one.tick <= tick:
            continue
        if one.forgotten:
            return _drifted(target, (tick, body, record), one, "means other targets than the one that is open")
        away = one.elsewhere and one.admitted
        stay = [*(stay if one.repeated else ()), one] if away else []
        if len(stay) >= STUBBORN:
            return _drifted(target, (tick, body, record), stay[0], f"goes {len(stay)} times where no target is")
        run = [*run, one] if one.repeated and not one.adherent else []
        if len(run) >= STUBBORN:
            return _drifted(target, (tick, body, record), run[0], f"is refused and repeated {len(run)} times")
    return None


def _drifted(target: str, given: tuple[int, str, str], one: JudgedAction, what: str) -> Attribution:
    tick, body, record = given
    chain = (
        RecordLink(kind="message", tick=tick, record=record, text=f"{target} is assigned to {body}"),
        RecordLink(kind="action", tick=one.tick, record=f"{one.agent} {one.verb}", text=f"{one.verb} of {body} {what}"),
    )
    return Attribution(family="context_drift", target=target, tick=one.tick, chain=chain)


def _locating_rules(instance: Instance, matching: frozenset[str]) -> frozenset[str]:
    """Rules that ask for a matched report and look at a position that it tells."""
    told = {
        message.kind: {field.name for field in message.fields if field.type == "position"}
        for message in instance.messages
    }
    return frozenset(
        rule.name
        for rule in instance.rules
        if any(isinstance(part, Call) and part.rule and part.function in matching for part in parts(rule.condition))
        and _reads_a_position(rule, told)
    )


def _reads_a_position(rule: Rule, told: Mapping[str, set[str]]) -> bool:
    """Whether a rule reads a field of a message that is one of the positions `told`, by kind."""
    found = tuple(parts(rule.condition))
    bound = {part.variable: part.domain for part in found if isinstance(part, Aggregate | Quantified)}
    domains = {one.name: one.domain for one in rule.parameters} | bound
    return any(
        isinstance(part, Attr)
        and isinstance(part.base, Ref)
        and part.name in told.get(domains.get(part.base.name, ""), ())
        for part in found
    )


def _asks_for_assignment(stage: Stage, outline: Outline) -> bool:
    """Whether a stage is done by giving somebody a destination."""
    domains = {stage.variable: stage.domain} if stage.variable and stage.domain else {}
    return any(isinstance(one, Handover) for one in mentions(stage.condition, outline, domains))


def _who_controls(instance: Instance, body: str) -> str:
    return next((agent.id for agent in instance.agents if body in agent.controls), body)


__all__ = ["DELAY", "FAMILIES", "Attribution", "FailureFamily", "RecordLink", "attribute"]
