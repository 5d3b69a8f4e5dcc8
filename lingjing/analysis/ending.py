"""Explanation of an episode's end, in about one screen of text.

The explanation holds the unmet parts of success with their values (`clauses`), the stage, budget or constraint that
ended the episode, and the events that led to it: the progress of each target, incidents, idle agents, rejected commands
and substituted decisions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import msgspec

from lingjing.analysis.clauses import condition_text, unmet_parts
from lingjing.analysis.completion import completion_ticks, sought_targets
from lingjing.analysis.detection import shots
from lingjing.analysis.families import attribute
from lingjing.analysis.idleness import idle_steps
from lingjing.analysis.incidents import incidents
from lingjing.analysis.registries import RebuiltBoundary, registries
from lingjing.kernel.rules import holds
from lingjing.mission.expression import components
from lingjing.mission.wording import some
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Outcome, Receipt
from lingjing.trace.request_ids import is_request_of

IDLE_TICKS = 5
"""Shortest idle period that is mentioned, ticks. Chosen."""

_MOST = 6
"""Most lines of one kind; the rest are counted. Chosen."""

_CLAUSES = 12
"""Most lines of unmet parts of success. Chosen."""

_SUCCESS = "success: every part of the mission's condition held"
_WORDS = {
    "success": _SUCCESS,
    "failure": "failure: the mission's own condition of failure held",
    "constraint": "a hard constraint was broken",
    "late": "a stage used up its own ticks",
    "budget": "the mission's ticks ran out",
    "infrastructure-abort": "aborted: the infrastructure of the episode failed; the result is not counted",
    "interrupted": "interrupted from outside; the result is not counted",
    "error": "ended by an error of a program; the result is not counted",
}


class EpisodeEnding(msgspec.Struct, frozen=True, kw_only=True):
    """The explanation of an episode's end. All fields are texts."""

    episode: str
    """Mission, mode, seed, policies, ticks and score."""
    cause: str
    """The immediate cause of the end."""
    lacking: tuple[str, ...] = ()
    """The unmet parts of success, indented by depth. Empty for a won episode."""
    targets: tuple[str, ...] = ()
    """The progress of each target."""
    troubles: tuple[str, ...] = ()
    """Incidents, broken constraints, rejected requests and idle periods, each with its first tick."""
    family: str = ""
    """The failure family of a lost episode, with its evidence; "" for a won one."""

    @property
    def text(self) -> str:
        """The explanation as lines under headings."""
        blocks = [self.episode, f"ended by: {self.cause}", *([f"failure family: {self.family}"] if self.family else [])]
        for heading, lines in (
            ("unmet parts of success", self.lacking), ("targets", self.targets), ("troubles", self.troubles)
        ):  # fmt: skip
            if lines:
                blocks += [f"{heading}:", *(f"  {line}" for line in lines)]
        return "\n".join(blocks)


def why(trace: Trace) -> EpisodeEnding:
    """Explain the end of a trace, whole or cut."""
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
    attribution = attribute(trace)
    if attribution is None or not attribution.chain:
        return "" if attribution is None else f"{attribution.family}: no rule is supported by the trace"
    links = "; ".join(
        f"{link.text} (tick {link.tick}{f', {link.record}' if link.record else ''})" for link in attribution.chain
    )
    return f"{attribution.family} of {attribution.target} from tick {attribution.tick}: {links}"


def _episode(trace: Trace) -> str:
    header, last = trace.header, trace.boundaries[-1] if trace.boundaries else None
    policies = some(list(dict.fromkeys(binding.policy for binding in header.bindings)))
    instance = header.instance
    reached = "no boundary" if last is None else f"tick {last.tick} of {instance.budget.ticks} ({last.time_s:g} s)"
    scored = "" if last is None else f", score {last.reward:.2f}, SCR {last.scr:.2f}"
    return f"{instance.mission} {instance.mode} seed {instance.seed}, {policies}: {reached}{scored}"


def cause(trace: Trace) -> str:
    """Return the immediate cause of an episode's end, in one line."""
    outcome = trace.outcome
    if outcome is None:
        return "unknown: the trace has no outcome, so its process was killed or its file was cut"
    text = _WORDS[outcome.reason]
    if outcome.reason == "budget":
        text = f"{text}: {trace.header.instance.budget.ticks} ticks, and no stage's own bound was passed before"
    return text + (f": {_line(outcome.detail)}" if outcome.detail else "") + _hint(outcome)


def _hint(outcome: Outcome) -> str:
    return f" (hint: {_line(outcome.hint)})" if outcome.hint and outcome.reason in CUT_SHORT else ""


def _lacking(trace: Trace, history: Sequence[RebuiltBoundary]) -> Iterator[str]:
    """Yield the unmet parts of success, then the number of the others."""
    at = history[-1].at
    held = 0
    for each, part in components(trace.header.instance.success):
        members = [{}] if each is None else [{each.variable: member} for member in at.domain(each.domain)]
        for scope in members:
            if holds(part, scope, at):
                held += 1
                continue
            for lack in unmet_parts(part, history, scope):
                yield f"{'  ' * lack.depth}{lack.text}: {lack.had}"
    if held:
        yield f"{held} other part{'s' * (held > 1)} of it held"


def _targets(trace: Trace) -> Iterator[str]:
    """Yield a line for each target that is not completed, then one line for the completed ones."""
    instance = trace.header.instance
    completed = completion_ticks(trace)
    sought = sought_targets(instance)
    targets = [entity.id for entity in instance.entities if entity.id in sought]
    for name in targets:
        if name not in completed:
            yield f"{name}: {_seen(trace, name)}{_stages(trace, name)}"
    done = [f"{name} at tick {completed[name]}" for name in targets if name in completed]
    if done:
        yield f"completed: {some(done)}"


def _seen(trace: Trace, target: str) -> str:
    """Return the first picture of a target and the tick of its first matched report, in words."""
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
    """Return the stages of a target with their ticks of completion, in words."""
    instance = trace.header.instance
    group = next(entity.group for entity in instance.entities if entity.id == target)
    changes = [change for record in trace.boundaries for change in record.stages]
    done = {(change.stage, change.subject): change.tick for change in changes}
    texts = []
    for stage in instance.stages:
        if stage.domain in (None, group):
            tick = done.get((stage.name, target if stage.domain else ""))
            texts.append(f"{stage.name} {'never' if tick is None else f'at {tick}'}")
    return f"; {', '.join(texts)}" if texts else ""


def _troubles(trace: Trace, history: Sequence[RebuiltBoundary]) -> Iterator[str]:
    yield from _first(f"tick {incident.tick}: {incident.line}" for incident in incidents(trace))
    yield from _first(_broken(trace, history))
    yield from _replaced(trace)
    yield from _refused(trace)
    yield from _first(_idle(trace))
    yield from _absent(trace)


def _broken(trace: Trace, history: Sequence[RebuiltBoundary]) -> Iterator[str]:
    """Yield a line for each event of a broken constraint."""
    conditions = {constraint.name: constraint.condition for constraint in trace.header.instance.constraints}
    for boundary in history:
        for event in boundary.record.events:
            if event.kind in conditions:
                name = " ".join((event.kind, *event.bindings))
                yield f"tick {event.tick}: {name} was broken: always {condition_text(conditions[event.kind], {})}"


def _replaced(trace: Trace) -> Iterator[str]:
    """Yield a line for the substituted decisions of each agent and reason."""
    substituted: dict[tuple[str, str], list[tuple[int, str]]] = {}
    totals = Counter(entry.agent for record in trace.boundaries for entry in record.decisions)
    for record in trace.boundaries:
        for entry in record.decisions:
            if entry.substituted:
                substituted.setdefault((entry.agent, entry.substituted), []).append((record.tick - 1, entry.detail))
    for (agent, reason), times in substituted.items():
        tick, detail = times[0]
        first = f"first at tick {tick}: {_line(detail, 120)}"
        yield f"{agent}: {len(times)} of {totals[agent]} answers replaced ({reason}), {first}"


def _refused(trace: Trace) -> Iterator[str]:
    """Yield a line for the rejected requests of each sender and reason, the most frequent first."""
    refused: dict[tuple[str, str], list[Receipt]] = {}
    verbs = {}
    for record in trace.boundaries:
        for entry in record.decisions:
            if entry.decision.command is not None:
                verbs[entry.agent, record.tick] = entry.decision.command.verb
        for receipt in record.receipts:
            own = is_request_of("kernel command", receipt.request)
            if receipt.status == "rejected" and receipt.by != "policy" and not own:
                refused.setdefault((receipt.sender, receipt.reason), []).append(receipt)
    most = sorted(refused.items(), key=lambda item: -len(item[1]))
    for (sender, reason), receipts in most[:_MOST]:
        first = receipts[0]
        verb = "a message" if first.by == "bus" else verbs.get((sender, first.tick), "a command")
        example = f"first {verb} at tick {first.tick}" + (f": {_line(first.detail, 90)}" if first.detail else "")
        yield f"{sender}: {len(receipts)} refused ({reason}), {example}"
    if len(most) > _MOST:
        yield f"and {sum(len(receipts) for _, receipts in most[_MOST:])} more refusals"


def _idle(trace: Trace) -> Iterator[str]:
    """Yield a line for each agent with a long idle period: the number of idle steps and the longest period."""
    for agent, steps in idle_steps(trace).items():
        begin, length = _longest(steps)
        if length >= IDLE_TICKS:
            yield f"{agent}: idle in {sum(steps)} of {len(steps)} ticks, longest from {begin} to {begin + length}"


def _longest(steps: Sequence[bool]) -> tuple[int, int]:
    """Return the begin and the length of the longest run of idle steps."""
    best, begin = (0, 0), 0
    for number, idle in enumerate((*steps, False)):
        if not idle:
            best = max(best, (number - begin, -begin))
            begin = number + 1
    return -best[1], best[0]


def _absent(trace: Trace) -> Iterator[str]:
    """Yield a line for the undelivered pictures of each reason."""
    lost = {
        (absent.entity, absent.camera, absent.tick): absent.reason
        for record in trace.boundaries
        for observation in record.observations
        for absent in observation.absent
    }
    for reason, count in Counter(lost.values()).items():
        first = min(tick for (_, _, tick), other in lost.items() if other == reason)
        yield f"{count} picture{'s' * (count > 1)} not delivered ({reason}), first at tick {first}"


def _first(lines: Iterable[str], most: int = _MOST) -> Iterator[str]:
    """Yield the first `most` lines, then the number of the others."""
    all_of_them = list(lines)
    yield from all_of_them[:most]
    if len(all_of_them) > most:
        yield f"and {len(all_of_them) - most} more"


def _line(text: str, most: int = 400) -> str:
    """Return a foreign text as one line, so that it cannot imitate further lines of the explanation."""
    return " ".join(text.split())[:most]
