"""`why`: why an episode ended as it did, in a screenful.

What success lacked and with which values (`clauses`), which stage, budget or constraint ended it, and what had set
that in motion: how far each target came and when, crashes, idle agents, refused commands, answers that were
replaced.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import msgspec

from lingjing.analysis.clauses import reading, unmet
from lingjing.analysis.completion import completion_ticks
from lingjing.analysis.detection import shots
from lingjing.analysis.families import attribute
from lingjing.analysis.idleness import idle_steps
from lingjing.analysis.incidents import incidents
from lingjing.analysis.registries import Rebuilt, registries
from lingjing.kernel.rules import holds
from lingjing.mission.expression import components
from lingjing.mission.wording import some
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Outcome, Receipt
from lingjing.trace.request_ids import is_request_of

IDLE_TICKS = 5
"""Idle stretches that are told of are at least so long."""

_MOST = 6
"""Lines of one kind; the rest are counted."""

_CLAUSES = 12
"""Lines of what success lacked."""

_SUCCESS = "success: every part of the mission's condition held"
_WORDS = {
    "success": _SUCCESS,
    "failure": "failure: the mission's own condition of failure held",
    "constraint": "a hard constraint was broken",
    "late": "a stage used up its own ticks",
    "budget": "the mission's ticks ran out",
    "infrastructure-abort": "aborted: something that the episode stands on failed; it counts for and against nobody",
    "interrupted": "interrupted from outside; it counts for and against nobody",
    "error": "ended by a fault of a program; it counts for and against nobody",
}


class EpisodeEnding(msgspec.Struct, frozen=True, kw_only=True):
    """Why an episode ended. `cause` is what ended it; `lacking` the parts of success that did not hold, indented by
    depth; `targets` how far each came; `troubles` what went wrong on the way, with when it began; `family` the
    failure family of a lost episode with its records. All in words."""

    episode: str
    cause: str
    lacking: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    troubles: tuple[str, ...] = ()
    family: str = ""

    @property
    def text(self) -> str:
        """The whole of it, a few headings and lines."""
        blocks = [self.episode, f"ended by: {self.cause}", *([f"failure family: {self.family}"] if self.family else [])]
        for heading, lines in (
            ("success lacked", self.lacking), ("how far each came", self.targets), ("on the way", self.troubles)
        ):  # fmt: skip
            if lines:
                blocks += [f"{heading}:", *(f"  {line}" for line in lines)]
        return "\n".join(blocks)


def why(trace: Trace) -> EpisodeEnding:
    """The ending of a trace, whole or cut."""
    history = list(registries(trace))
    won = trace.outcome is not None and trace.outcome.success
    return EpisodeEnding(
        episode=_episode(trace),
        cause=cause(trace),
        lacking=() if won or not history else tuple(_first(_lacking(trace, history), _CLAUSES)),
        targets=tuple(_first(_targets(trace))) if history else (),
        troubles=tuple(_troubles(trace, history)),
        family=_family(trace),
    )


def _family(trace: Trace) -> str:
    found = attribute(trace)
    if found is None or not found.chain:
        return "" if found is None else f"{found.family}: no rule is supported by the trace"
    links = "; ".join(
        f"{link.text} (tick {link.tick}{f', {link.record}' if link.record else ''})" for link in found.chain
    )
    return f"{found.family} of {found.target} from tick {found.tick}: {links}"


def _episode(trace: Trace) -> str:
    header, last = trace.header, trace.boundaries[-1] if trace.boundaries else None
    policies = some(list(dict.fromkeys(binding.policy for binding in header.bindings)))
    instance = header.instance
    reached = "no boundary" if last is None else f"tick {last.tick} of {instance.budget.ticks} ({last.time_s:g} s)"
    scored = "" if last is None else f", score {last.reward:.2f}, SCR {last.scr:.2f}"
    return f"{instance.mission} {instance.mode} seed {instance.seed}, {policies}: {reached}{scored}"


def cause(trace: Trace) -> str:
    """What ended an episode, in one line."""
    outcome = trace.outcome
    if outcome is None:
        return "nothing that is recorded: the trace has no outcome, so its episode was killed or the file cut"
    told = _WORDS[outcome.reason]
    if outcome.reason == "budget":
        told = f"{told}: {trace.header.instance.budget.ticks} ticks, and no stage's own bound was passed before"
    return told + (f": {_line(outcome.detail)}" if outcome.detail else "") + _way_out(outcome)


def _way_out(outcome: Outcome) -> str:
    return f" (hint: {_line(outcome.hint)})" if outcome.hint and outcome.reason in CUT_SHORT else ""


def _lacking(trace: Trace, history: Sequence[Rebuilt]) -> Iterator[str]:
    at = history[-1].at
    held = 0
    for each, part in components(trace.header.instance.success):
        members = [{}] if each is None else [{each.variable: one} for one in at.domain(each.domain)]
        for scope in members:
            if holds(part, scope, at):
                held += 1
                continue
            for lack in unmet(part, history, scope):
                yield f"{'  ' * lack.depth}{lack.text}: {lack.had}"
    if held:
        yield f"{held} other part{'s' * (held > 1)} of it held"


def _targets(trace: Trace) -> Iterator[str]:
    """A line for each target that is not completed, then one that counts the others."""
    instance = trace.header.instance
    completed = completion_ticks(trace)
    wanted = [entity.id for entity in instance.entities if entity.role == "target"]
    for name in wanted:
        if name not in completed:
            yield f"{name}: {_seen(trace, name)}{_stages(trace, name)}"
    done = [f"{name} at tick {completed[name]}" for name in wanted if name in completed]
    if done:
        yield f"completed: {some(done)}"


def _seen(trace: Trace, target: str) -> str:
    """When it first stood in a picture, and when a report first matched it."""
    pictures = [frame for frame in shots(trace) if any(box.entity == target and box.pixels for box in frame.boxes)]
    rules = {rule.name for rule in trace.header.instance.rules if rule.matching}
    events = [event for record in trace.boundaries for event in record.events]
    matched = [event.tick for event in events if event.kind in rules and target in event.bindings]
    if not shots(trace):
        return "no picture was taken"
    if not pictures:
        return f"in none of {len(shots(trace))} pictures" + (f", matched at tick {matched[0]}" if matched else "")
    seen = f"in {len(pictures)} of {len(shots(trace))} pictures, first {pictures[0].id}"
    if not rules:
        return seen
    return f"{seen}, first matched at tick {matched[0]}" if matched else f"{seen}, matched by no report"


def _stages(trace: Trace, target: str) -> str:
    """Which stages were done for it, and when."""
    instance = trace.header.instance
    group = next(entity.group for entity in instance.entities if entity.id == target)
    changes = [change for record in trace.boundaries for change in record.stages]
    done = {(change.stage, change.subject): change.tick for change in changes}
    told = []
    for stage in instance.stages:
        if stage.domain in (None, group):
            tick = done.get((stage.name, target if stage.domain else ""))
            told.append(f"{stage.name} {'never' if tick is None else f'at {tick}'}")
    return f"; {', '.join(told)}" if told else ""


def _troubles(trace: Trace, history: Sequence[Rebuilt]) -> Iterator[str]:
    yield from _first(f"tick {one.tick}: {one.line}" for one in incidents(trace))
    yield from _first(_broken(trace, history))
    yield from _replaced(trace)
    yield from _refused(trace)
    yield from _first(_idle(trace))
    yield from _absent(trace)


def _broken(trace: Trace, history: Sequence[Rebuilt]) -> Iterator[str]:
    """Constraints that were broken, from their events."""
    conditions = {constraint.name: constraint.condition for constraint in trace.header.instance.constraints}
    for one in history:
        for event in one.record.events:
            if event.kind in conditions:
                who = " ".join(("", *event.bindings))
                yield f"tick {event.tick}: {event.kind}{who} was broken: always {reading(conditions[event.kind], {})}"


def _replaced(trace: Trace) -> Iterator[str]:
    """Answers of policies that became "do nothing", by agent and reason."""
    found: dict[tuple[str, str], list[tuple[int, str]]] = {}
    asked = Counter(made.agent for record in trace.boundaries for made in record.decisions)
    for record in trace.boundaries:
        for made in record.decisions:
            if made.substituted:
                found.setdefault((made.agent, made.substituted), []).append((record.tick - 1, made.detail))
    for (agent, reason), times in found.items():
        tick, detail = times[0]
        first = f"first at tick {tick}: {_line(detail, 120)}"
        yield f"{agent}: {len(times)} of {asked[agent]} answers replaced ({reason}), {first}"


def _refused(trace: Trace) -> Iterator[str]:
    """Refused commands and messages by sender and reason, the most frequent first."""
    found: dict[tuple[str, str], list[Receipt]] = {}
    verbs = {}
    for record in trace.boundaries:
        for made in record.decisions:
            if made.decision.command is not None:
                verbs[made.agent, record.tick] = made.decision.command.verb
        for receipt in record.receipts:
            own = is_request_of("kernel command", receipt.request)
            if receipt.status == "rejected" and receipt.by != "policy" and not own:
                found.setdefault((receipt.sender, receipt.reason), []).append(receipt)
    most = sorted(found.items(), key=lambda one: -len(one[1]))
    for (sender, reason), receipts in most[:_MOST]:
        first = receipts[0]
        verb = "a message" if first.by == "bus" else verbs.get((sender, first.tick), "a command")
        told = f"first {verb} at tick {first.tick}" + (f": {_line(first.detail, 90)}" if first.detail else "")
        yield f"{sender}: {len(receipts)} refused ({reason}), {told}"
    if len(most) > _MOST:
        yield f"and {sum(len(receipts) for _, receipts in most[_MOST:])} more refusals"


def _idle(trace: Trace) -> Iterator[str]:
    """Agents with a long idle stretch: how many steps, and the longest."""
    for agent, steps in idle_steps(trace).items():
        begin, length = _longest(steps)
        if length >= IDLE_TICKS:
            yield f"{agent}: idle in {sum(steps)} of {len(steps)} ticks, longest from {begin} to {begin + length}"


def _longest(steps: Sequence[bool]) -> tuple[int, int]:
    """Where the longest run of idle steps begins, and its length."""
    best, begin = (0, 0), 0
    for number, idle in enumerate((*steps, False)):
        if not idle:
            best = max(best, (number - begin, -begin))
            begin = number + 1
    return -best[1], best[0]


def _absent(trace: Trace) -> Iterator[str]:
    lost = {
        (one.entity, one.camera, one.tick): one.reason
        for record in trace.boundaries
        for seen in record.observations
        for one in seen.absent
    }
    for reason, count in Counter(lost.values()).items():
        first = min(tick for (_, _, tick), why in lost.items() if why == reason)
        yield f"{count} picture{'s' * (count > 1)} did not come ({reason}), first at tick {first}"


def _first(lines: Iterable[str], most: int = _MOST) -> Iterator[str]:
    """The first of many lines, and how many more there are."""
    all_of_them = list(lines)
    yield from all_of_them[:most]
    if len(all_of_them) > most:
        yield f"and {len(all_of_them) - most} more"


def _line(text: str, most: int = 400) -> str:
    """What somebody else wrote, in one line: it must not look like one of ours."""
    return " ".join(text.split())[:most]
