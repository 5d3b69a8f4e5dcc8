"""Tables of the values of messages, computed by hand."""

from __future__ import annotations

import msgspec

from lingjing.causal.branching import BranchResult, NullFork, failed_answers
from lingjing.causal.message_value import EpisodeValues, Hop, KindValue, MessageValue, ModeValue, by_kind, by_mode
from lingjing.causal.result_texts import value_text


def message(name: str, kind: str, hop: Hop, value: float = 0.0, ticks: int = 0, swayed: int | None = 3) -> MessageValue:
    return MessageValue(
        id=name, tick=2, sender="scout[1]", kind=kind, category="report", hop=hop, value=value, ticks=ticks,
        swayed=swayed, decisive=value == 1.0, reason="budget" if value == 1.0 else "success",
    )  # fmt: skip


def episode(mode: str, *messages: MessageValue) -> EpisodeValues:
    return EpisodeValues(
        path=f"{mode}.mcap", mission="ssr", mode=mode, seed=1, success=True, score=1.0, ticks=30, unsaid=False,
        null=NullFork(identical=True), messages=messages, branches=1 + len(messages), cpu_s=4.0,
    )  # fmt: skip


STAR = episode(
    "star",
    message("m2-1", "detection", "to hub", 1.0, 20),
    message("m2-2", "detection", "to hub", -0.5, -4),
    message("m3-1", "detection", "from hub", swayed=None),
)
BROADCAST = episode("broadcast", message("m2-1", "detection", "to all", swayed=None))


def test_a_row_holds_one_kind_and_one_hop_in_one_mode() -> None:
    rows = {(row.mode, row.hop): row for row in by_kind([STAR, BROADCAST])}
    assert len(rows) == 3
    assert rows["star", "to hub"] == KindValue(
        mode="star", kind="detection", hop="to hub", messages=2, mean=0.25, valuable=1, decisive=1, harmful=1, moot=0,
        ticks=8.0,
    )  # fmt: skip
    assert rows["star", "from hub"].moot == rows["broadcast", "to all"].moot == 1


def test_values_of_modes_are_means_over_episodes() -> None:
    silent = episode("broadcast")
    assert by_mode([STAR, BROADCAST, silent]) == (
        ModeValue(mode="broadcast", episodes=2, won=2, messages=0.5, value=0.0, decisive=0.0, moot=1.0, ticks=30.0),
        ModeValue(mode="star", episodes=1, won=1, messages=3.0, value=0.5, decisive=1.0, moot=1 / 3, ticks=30.0),
    )


def test_unmeasured_messages_are_counted_and_noted_in_the_text() -> None:
    short = msgspec.structs.replace(STAR, left_out=5)
    assert "per episode, over the measured messages:" in value_text([short, BROADCAST])
    assert "per episode:" in value_text([STAR, BROADCAST])
    assert [row.left_out for row in by_mode([short, STAR, BROADCAST])] == [0.0, 2.5]


def test_an_episode_that_differs_from_its_null_fork_is_in_no_table() -> None:
    moody = msgspec.structs.replace(BROADCAST, null=NullFork(identical=False, boundary=7), messages=(), branches=1)
    assert by_mode([STAR, moody]) == by_mode([STAR])
    assert value_text([moody]) == (
        "broadcast.mcap: broadcast, won after 30 ticks, score 1.00; 0 messages, 1 branch, 4 s CPU\n"
        "  null fork: differs at boundary 7, although nothing was changed.\n"
        "  The policies are not deterministic: no message was measured."
    )


def test_policies_that_failed_in_branches_are_reported() -> None:
    text = value_text([msgspec.structs.replace(STAR, unanswered={"policy_timeout": 2})])
    assert "(policy_timeout); their answers were replaced by doing nothing\n  late answers depend" in text
    branches = [BranchResult(unanswered={"policy_timeout": 3}), BranchResult(unanswered={"policy_error": 1})]
    assert failed_answers(branches, frozenset({"policy_error"})) == {"policy_timeout": 1}


def test_decisive_messages_are_listed() -> None:
    text = value_text([STAR, BROADCAST])
    assert "star.mcap: star, won after 30 ticks, score 1.00; 3 messages, 4 branches, 4 s CPU" in text
    assert text.endswith(
        "decisive messages:\n"
        "  star.mcap: without m2-1 (detection of scout[1], to hub) lost (budget): decisions differ from boundary 3 on"
    )
