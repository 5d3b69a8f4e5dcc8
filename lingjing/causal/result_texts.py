"""Results of branches, blame and values of messages as text for a terminal."""

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
"""The greatest number of boundaries in a list."""

_DECISIVE = 20
"""The greatest number of decisive messages in a list."""

_LATE_HINT = "late answers depend on the speed of this machine: the same search may have another result"


def branch_text(trace: Trace, plan: BranchPlan, result: BranchResult) -> str:
    """Return a trace and its branch in a few lines."""
    end = "the end" if trace.outcome is not None else f"boundary {len(trace.boundaries) - 1}, where the trace ends"
    same = f"all digests are equal to {end}" if result.differs is None else f"differs from boundary {result.differs} on"
    cost = f"{result.cpu_s:.2f} s CPU, fork {1000 * result.fork_s:.0f} ms"
    lines = [
        f"{trace.path}: {ending_of(trace)}",
        f"branch at boundary {plan.at}, {_change_text(plan)}: {_ended(result)}",
        f"  {same}; {_count(result.pictures, 'picture')} requested, {cost}",
    ]
    if plan.substitutions:
        lines += [f"  replaced: {_parts_text(result.replaced)}"]
    if result.unanswered:
        listed = ", ".join(f"{_count(number, 'answer')} ({reason})" for reason, number in result.unanswered.items())
        lines += [f"  answers of failed policies, replaced by doing nothing: {listed}"]
    if result.path:
        lines += [f"trace: {result.path}"]
    return "\n".join(lines)


def ending_of(trace: Trace) -> str:
    """Return the outcome of a trace."""
    outcome = trace.outcome
    if outcome is None:
        return f"cut at boundary {len(trace.boundaries) - 1}"
    word = "won" if outcome.success else f"lost ({outcome.reason})"
    return f"{word} after {outcome.ticks} ticks, score {outcome.score:.2f}"


def _change_text(plan: BranchPlan) -> str:
    """Return the changes of a branch."""
    changes = [_substitution_text(substitution, plan.at) for substitution in plan.substitutions] + [
        *map(_message_text, plan.messages)
    ]
    changes += [f"another decision of {agent} at {tick}" for agent, tick, _ in plan.replacements]
    return ", ".join(changes) or "nothing changed"


def _substitution_text(substitution: Substitution, at: int) -> str:
    """Return `perception of scout[1]`, with its first and last boundary if they are not those of the branch."""
    begin = "" if substitution.first == at else f" from {substitution.first} on"
    until = "" if substitution.last is None else f" until {substitution.last}"
    return f"{substitution.faculty} of {substitution.agent}{begin}{until}"


def _parts_text(parts: Sequence[ReplacedPart]) -> str:
    """Return the replaced faculties and their boundaries."""
    boundaries: dict[tuple[str, str], list[int]] = {}
    for part in parts:
        boundaries.setdefault((part.faculty, part.agent), []).append(part.boundary)
    return (
        "; ".join(f"{faculty} of {agent} at {_numbers_text(ticks)}" for (faculty, agent), ticks in boundaries.items())
        or "nothing"
    )


def _numbers_text(numbers: Iterable[int]) -> str:
    """Return numbers as a list, shortened if there are many."""
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


def _count(number: int, noun: str) -> str:
    plural = "es" if noun.endswith("ch") else "s"
    return f"{number} {noun}{plural * (number != 1)}"


def blame_text(result: Blame) -> str:
    """Return the result of `blame`."""
    if result.success:
        return f"{result.path}: won, score {result.score:.2f}: there is nothing to blame"
    lines = [f"{result.path}: lost ({result.reason}), score {result.score:.2f}", ""]
    assert result.null is not None
    if not result.null.identical:
        lines += [
            f"null fork: differs at boundary {result.null.boundary}, although nothing was changed.",
            f"{_unlike(result.unanswered)}: branches would prove nothing, and none was played.",
            *_unanswered_lines(result.unanswered),
            _cost(result),
        ]
        return "\n".join(lines)
    lines += _repair_lines(result) + _share_lines(result)
    lines += ["null fork: identical to the end, digest by digest"]
    if result.placebos is not None:
        lines += [_placebo_line(result.placebos)]
    return "\n".join([*lines, *_unanswered_lines(result.unanswered), _cost(result)])


def _unlike(unanswered: Mapping[str, int]) -> str:
    """Return the reason why a null fork differs from the episode."""
    return "Policies failed that did not fail in the trace" if unanswered else "The policies are not deterministic"


def _unanswered_lines(unanswered: Mapping[str, int]) -> list[str]:
    """Return the numbers of branches with failed policies, which are no effect of the changes."""
    lines = [
        f"policies failed in {_count(number, 'branch')} ({reason}); their answers were replaced by doing nothing"
        for reason, number in unanswered.items()
    ]
    return lines + [_LATE_HINT] * (LATE in unanswered)


def _repair_lines(result: Blame) -> list[str]:
    if not result.departed:
        return ["No agent departed from its reference: there is nothing to replace.", ""]
    if not result.tried:
        return ["Nothing was replaced: --branches is too small.", ""]
    if not result.repairs:
        rest = "; not everything was tried" if result.exhausted else ""
        return [f"No replacement wins this episode{rest}.", ""]
    size = len(result.repairs[0].causes)
    kind = "Any one of these alone" if size == 1 else f"Any of these sets of {size}"
    all_tried = "" if result.complete else " (not all of this size were tried)"
    lines = [f"{kind}, replaced by the truth, wins{all_tried}:"]
    for repair in result.repairs:
        lines += [f"  {' and '.join(_cause_text(cause, alone=size == 1) for cause in repair.causes)}"]
        wide = "" if repair.narrowed else ", not narrowed"
        late = size > 1 and any(cause.late for cause in repair.causes)
        all_lose = "; replacing everything from the first departures on does not win" if late else ""
        lines += [f"      won after {repair.ticks} ticks, score {repair.score:.2f}{wide}{all_lose}"]
    windows = " ".join(f"--substitute '{window_text(cause)}'" for cause in result.repairs[0].causes)
    return [
        *lines,
        f"To play the first again, with the options of this search: lingjing fork {quote(result.path)} {windows}",
        "",
    ]


def window_text(cause: Cause) -> str:
    """Return a cause with its window in the form of `lingjing fork --substitute`."""
    until = "" if cause.first == cause.last else f"-{cause.last}"
    return f"{cause.faculty}:{cause.agent}@{cause.first}{until}"


def _cause_text(cause: Cause, *, alone: bool) -> str:
    window = f"boundary {cause.first}" if cause.first == cause.last else f"boundaries {cause.first} to {cause.last}"
    hidden = "; it appears only if the rest of this set is replaced" if cause.masked else ""
    late = "; not if its earlier departures are replaced too" if cause.late and alone else ""
    return (
        f"{cause.faculty} of {cause.agent}, from boundary {cause.boundary} "
        f"({_count(cause.replaced, 'record')} replaced, {window}{hidden}{late})"
    )


def _share_lines(result: Blame) -> list[str]:
    if not result.shares:
        return []
    among = (
        f", of {len(result.shares)} of {result.departed} pairs with departures"
        if len(result.shares) < result.departed
        else ""
    )
    lines = [f"Shapley shares of the win{among}:"]
    for share in result.shares:
        interval = "exact" if share.exact else f"95 %: {share.low:.2f} to {share.high:.2f}"
        lines += [f"  {share.share:5.2f}  {share.faculty} of {share.agent} ({interval})"]
    return [*lines, ""]


def _placebo_line(placebos: Placebos) -> str:
    tried = placebos.nudges + placebos.uninvolved
    if not tried + placebos.same:
        return "placebos: none was played, so the rate of wins by chance is unknown"
    same = (
        f"{_count(placebos.same, 'record')} replaced by {'itself' if placebos.same == 1 else 'themselves'}: "
        f"{placebos.changed} of {placebos.same} changed anything"
    )
    chance = (
        f"{placebos.repaired} of {tried} won by chance "
        f"({_count(placebos.nudges, 'nudge')}, {placebos.uninvolved} uninvolved; "
        f"95 %: {placebos.low:.2f} to {placebos.high:.2f})"
    )
    return f"placebos: {same}; {chance}"


def _cost(result: Blame) -> str:
    more = "; --branches was too small for the complete search" if result.exhausted else ""
    camera = f" and {result.camera_s:.0f} s for {_count(result.pictures, 'picture')}" if result.pictures else ""
    return f"cost: {_count(result.branches, 'branch')}, {result.cpu_s + result.driven_s:.0f} s CPU{camera}{more}"


def value_text(episodes: Sequence[EpisodeValues]) -> str:
    """Return the values of messages: a line per episode, the tables, and the decisive messages."""
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
        for item in modes:
            won = f"{item.won}/{item.episodes}"
            means = (f"{item.messages:.1f}", f"{item.value:+.2f}", f"{item.decisive:.1f}", f"{item.moot:.0%}")
            table += [(item.mode, won, *means, f"{item.ticks:.1f}")]
        some = ", over the measured messages" if any(item.left_out for item in modes) else ""
        lines += ["", f"per episode{some}:", *aligned(table)]
    decided = [(episode, item) for episode in episodes for item in episode.messages if item.decisive]
    if decided:
        lines += ["", "decisive messages:"]
        lines += [f"  {episode.path}: {_decisive_text(episode, item)}" for episode, item in decided[:_DECISIVE]]
        lines += [f"  and {len(decided) - _DECISIVE} more"] * (len(decided) > _DECISIVE)
    return "\n".join(lines)


def _episode_lines(episode: EpisodeValues) -> list[str]:
    word = "won" if episode.success else "lost"
    messages, branches = _count(len(episode.messages), "message"), _count(episode.branches, "branch")
    tried = f"{messages}, {branches}, {episode.cpu_s:.0f} s CPU"
    lines = [f"{episode.path}: {episode.mode}, {word} after {episode.ticks} ticks, score {episode.score:.2f}; {tried}"]
    if episode.left_out:
        lines += [f"  {episode.left_out} further messages were not measured: raise --branches"]
    if not episode.null.identical:
        lines += [
            f"  null fork: differs at boundary {episode.null.boundary}, although nothing was changed.",
            f"  {_unlike(episode.unanswered)}: no message was measured.",
        ]
    return lines + [f"  {line}" for line in _unanswered_lines(episode.unanswered)]


def _decisive_text(episode: EpisodeValues, message: MessageValue) -> str:
    then = f"lost ({message.reason})" if episode.success else "won"
    why = (
        "although no decision differs"
        if message.swayed is None
        else f"decisions differ from boundary {message.swayed} on"
    )
    return f"without {message.id} ({message.kind} of {message.sender}, {message.hop}) {then}: {why}"
