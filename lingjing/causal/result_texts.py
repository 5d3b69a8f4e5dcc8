"""Branches, blame and the value of messages in words, for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from shlex import quote

from lingjing.causal.blame import Blame, Cause
from lingjing.causal.branching import BranchResult
from lingjing.causal.interventions import BranchPlan, ReplacedPart
from lingjing.causal.message_value import EpisodeValues, MessageValue, by_kind, by_mode
from lingjing.causal.placebos import Placebos
from lingjing.causal.redriven import LATE
from lingjing.terminal import aligned
from lingjing.trace.reader import Trace
from lingjing.trace.records import MessageChange, Substitution

_SHOWN = 8
_DECISIVE = 20
_LATE_HINT = "whether an answer comes in time hangs on this machine: the same search may find others"


def branch_text(trace: Trace, plan: BranchPlan, result: BranchResult) -> str:
    """A trace and a branch of it in a few lines."""
    end = "the end" if trace.outcome is not None else f"boundary {len(trace.boundaries) - 1}, where the trace ends"
    same = f"all digests are equal to {end}" if result.differs is None else f"differs from boundary {result.differs} on"
    cost = f"{result.cpu_s:.2f} s CPU, fork {1000 * result.fork_s:.0f} ms"
    lines = [
        f"{trace.path}: {ending_of(trace)}",
        f"branch at boundary {plan.at}, {change_text(plan)}: {_ended(result)}",
        f"  {same}; {_count(result.pictures, 'picture')} asked of the camera, {cost}",
    ]
    if plan.substitutions:
        lines += [f"  replaced: {parts_text(result.replaced)}"]
    if result.unanswered:
        said = ", ".join(f"{_count(number, 'answer')} ({reason})" for reason, number in result.unanswered.items())
        lines += [f"  policies that failed in it, and did nothing then: {said}"]
    if result.path:
        lines += [f"trace: {result.path}"]
    return "\n".join(lines)


def ending_of(trace: Trace) -> str:
    """How the episode of a trace ended."""
    outcome = trace.outcome
    if outcome is None:
        return f"cut at boundary {len(trace.boundaries) - 1}"
    word = "won" if outcome.success else f"lost ({outcome.reason})"
    return f"{word} after {outcome.ticks} ticks, score {outcome.score:.2f}"


def change_text(plan: BranchPlan) -> str:
    """What a branch changes."""
    said = [_substitution_text(one, plan.at) for one in plan.substitutions] + [*map(_message_text, plan.messages)]
    said += [f"another decision of {agent} at {tick}" for agent, tick, _ in plan.replacements]
    return ", ".join(said) or "nothing changed"


def _substitution_text(one: Substitution, at: int) -> str:
    """`perception of scout[1]`, with where it begins and ends if that is not where the branch does."""
    begin = "" if one.first == at else f" from {one.first} on"
    until = "" if one.last is None else f" until {one.last}"
    return f"{one.faculty} of {one.agent}{begin}{until}"


def parts_text(parts: Sequence[ReplacedPart]) -> str:
    """What was replaced where."""
    found: dict[tuple[str, str], list[int]] = {}
    for part in parts:
        found.setdefault((part.faculty, part.agent), []).append(part.boundary)
    return "; ".join(f"{what} of {who} at {numbers_text(ticks)}" for (what, who), ticks in found.items()) or "nothing"


def numbers_text(numbers: Iterable[int]) -> str:
    """Some numbers, cut where they are many."""
    listed = list(numbers)
    more = f" and {len(listed) - _SHOWN} more" if len(listed) > _SHOWN else ""
    return ", ".join(map(str, listed[:_SHOWN])) + more


def _ended(result: BranchResult) -> str:
    word = "won" if result.success else f"lost ({result.reason}{': ' * bool(result.detail)}{result.detail})"
    return f"{word} after {result.ticks} ticks, score {result.score:.2f}"


def _message_text(change: MessageChange) -> str:
    later = f" by {change.ticks}" if change.ticks else ""
    words = {"drop": "dropped", "withhold": "withheld", "delay": "delayed", "repeat": "repeated", "forge": "forged"}
    return f"{change.message} {words[change.act]}{later}"


def _count(number: int, what: str) -> str:
    plural = "es" if what.endswith("ch") else "s"
    return f"{number} {what}{plural * (number != 1)}"


def blame_text(told: Blame) -> str:
    """What is to be blamed, on a page."""
    if told.success:
        return f"{told.path}: won, score {told.score:.2f}: nothing is to be blamed"
    lines = [f"{told.path}: lost ({told.reason}), score {told.score:.2f}", ""]
    assert told.null is not None
    if not told.null.identical:
        lines += [
            f"null fork: differs at boundary {told.null.boundary}, though nothing was changed.",
            f"{_unlike(told.unanswered)}: no branch says anything, and none was played.",
            *_unanswered_lines(told.unanswered),
            _cost(told),
        ]
        return "\n".join(lines)
    lines += _repair_lines(told) + _share_lines(told)
    lines += ["null fork: identical to the end, digest by digest"]
    if told.placebos is not None:
        lines += [_placebo_line(told.placebos)]
    return "\n".join([*lines, *_unanswered_lines(told.unanswered), _cost(told)])


def _unlike(unanswered: Mapping[str, int]) -> str:
    """Why a branch without any change is not the episode."""
    return "Policies failed in it that did not then" if unanswered else "The policies decide otherwise each time"


def _unanswered_lines(unanswered: Mapping[str, int]) -> list[str]:
    """In how many branches policies failed, which is nothing that was changed."""
    lines = [
        f"policies failed in {_count(number, 'branch')} ({reason}), and did nothing then"
        for reason, number in unanswered.items()
    ]
    return lines + [_LATE_HINT] * (LATE in unanswered)


def _repair_lines(told: Blame) -> list[str]:
    if not told.departed:
        return ["No agent ever decided otherwise than its reference: nothing is there to be replaced.", ""]
    if not told.tried:
        return ["Nothing was replaced: the branches did not suffice for it.", ""]
    if not told.repairs:
        rest = ", and not all was tried" if told.exhausted else ""
        return [f"Nothing that was replaced wins this episode{rest}.", ""]
    size = len(told.repairs[0].causes)
    kind = "Any one of these alone" if size == 1 else f"Any of these sets of {size}"
    all_tried = "" if told.complete else " (not all of this size were tried)"
    lines = [f"{kind}, replaced by the truth, wins{all_tried}:"]
    for repair in told.repairs:
        lines += [f"  {' and '.join(_cause_text(one, alone=size == 1) for one in repair.causes)}"]
        wide = "" if repair.narrowed else ", not narrowed"
        late = size > 1 and any(one.late for one in repair.causes)
        all_lose = "; everything from the first departures on does not win" if late else ""
        lines += [f"      won after {repair.ticks} ticks, score {repair.score:.2f}{wide}{all_lose}"]
    windows = " ".join(f"--substitute '{window_text(one)}'" for one in told.repairs[0].causes)
    return [*lines, f"The first again, with this search's options: lingjing fork {quote(told.path)} {windows}", ""]


def window_text(cause: Cause) -> str:
    """A cause with its window, as `lingjing fork --substitute` takes it."""
    until = "" if cause.first == cause.last else f"-{cause.last}"
    return f"{cause.faculty}:{cause.agent}@{cause.first}{until}"


def _cause_text(cause: Cause, *, alone: bool) -> str:
    window = f"boundary {cause.first}" if cause.first == cause.last else f"boundaries {cause.first} to {cause.last}"
    hidden = "; it shows only where the rest of this is replaced" if cause.masked else ""
    late = "; not if what it did otherwise before is replaced too" if cause.late and alone else ""
    return (
        f"{cause.faculty} of {cause.agent}, from boundary {cause.boundary} "
        f"({_count(cause.replaced, 'record')} replaced, {window}{hidden}{late})"
    )


def _share_lines(told: Blame) -> list[str]:
    if not told.shares:
        return []
    among = f", among {len(told.shares)} of {told.departed} that departed" if len(told.shares) < told.departed else ""
    lines = [f"Shapley shares of the win{among}:"]
    for one in told.shares:
        interval = "exact" if one.exact else f"95 %: {one.low:.2f} to {one.high:.2f}"
        lines += [f"  {one.share:5.2f}  {one.faculty} of {one.agent} ({interval})"]
    return [*lines, ""]


def _placebo_line(placebos: Placebos) -> str:
    tried = placebos.nudges + placebos.uninvolved
    if not tried + placebos.same:
        return "placebos: none was played, so how often luck repairs is not known"
    same = (
        f"{_count(placebos.same, 'record')} replaced by {'itself' if placebos.same == 1 else 'themselves'}: "
        f"{placebos.changed} of {placebos.same} changed anything"
    )
    luck = (
        f"{placebos.repaired} of {tried} won by luck "
        f"({_count(placebos.nudges, 'nudge')}, {placebos.uninvolved} uninvolved; "
        f"95 %: {placebos.low:.2f} to {placebos.high:.2f})"
    )
    return f"placebos: {same}; {luck}"


def _cost(told: Blame) -> str:
    more = ", and the budget did not suffice for all" if told.exhausted else ""
    camera = f" and {told.camera_s:.0f} s for {_count(told.pictures, 'picture')}" if told.pictures else ""
    return f"cost: {_count(told.branches, 'branch')}, {told.cpu_s + told.driven_s:.0f} s CPU{camera}{more}"


def value_text(episodes: Sequence[EpisodeValues]) -> str:
    """What messages were worth: each episode in a line, the tables, and the messages that decided."""
    lines = [line for episode in episodes for line in _episode_lines(episode)]
    kinds: list[tuple[str, ...]] = [
        ("mode", "kind", "way", "messages", "value", "of value", "decisive", "harmful", "of no use", "ticks")
    ]
    for row in by_kind(episodes):
        numbers = (row.valuable, row.decisive, row.harmful, row.moot)
        kinds += [
            (
                row.mode,
                row.kind,
                row.hop,
                f"{row.messages}",
                f"{row.mean:+.3f}",
                *map(str, numbers),
                f"{row.ticks:+.1f}",
            )
        ]
    lines += ["", *aligned(kinds)] if len(kinds) > 1 else []
    modes = by_mode(episodes)
    if len(modes) > 1:
        table: list[tuple[str, ...]] = [("mode", "won", "messages", "value", "decisive", "of no use", "ticks")]
        for one in modes:
            won = f"{one.won}/{one.episodes}"
            means = (f"{one.messages:.1f}", f"{one.value:+.2f}", f"{one.decisive:.1f}", f"{one.moot:.0%}")
            table += [(one.mode, won, *means, f"{one.ticks:.1f}")]
        some = ", of the messages that were tried" if any(one.left_out for one in modes) else ""
        lines += ["", f"per episode{some}:", *aligned(table)]
    decided = [(episode, one) for episode in episodes for one in episode.messages if one.decisive]
    if decided:
        lines += ["", "what decided:"]
        lines += [f"  {episode.path}: {_decisive_text(episode, one)}" for episode, one in decided[:_DECISIVE]]
        lines += [f"  and {len(decided) - _DECISIVE} more"] * (len(decided) > _DECISIVE)
    return "\n".join(lines)


def _episode_lines(episode: EpisodeValues) -> list[str]:
    word = "won" if episode.success else "lost"
    messages, branches = _count(len(episode.messages), "message"), _count(episode.branches, "branch")
    tried = f"{messages}, {branches}, {episode.cpu_s:.0f} s CPU"
    lines = [f"{episode.path}: {episode.mode}, {word} after {episode.ticks} ticks, score {episode.score:.2f}; {tried}"]
    if episode.left_out:
        lines += [f"  {episode.left_out} more were not tried: --branches"]
    if not episode.null.identical:
        lines += [
            f"  null fork: differs at boundary {episode.null.boundary}, though nothing was changed.",
            f"  {_unlike(episode.unanswered)}: no message was tried.",
        ]
    return lines + [f"  {line}" for line in _unanswered_lines(episode.unanswered)]


def _decisive_text(episode: EpisodeValues, one: MessageValue) -> str:
    then = f"lost ({one.reason})" if episode.success else "won"
    why = "though nobody decides otherwise" if one.swayed is None else f"decisions differ from boundary {one.swayed} on"
    return f"without {one.id} ({one.kind} of {one.sender}, {one.hop}) {then}: {why}"
