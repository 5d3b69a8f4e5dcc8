"""Tables of what messages were worth, worked out by hand; the value of one message of a real episode."""

import pytest

from lingjing.causal.message_value import EpisodeValues, MessageValue, by_kind, by_mode
from lingjing.causal.telling import value_text


def message(name: str, value: float, **changes: object) -> MessageValue:
    said: dict[str, object] = {
        "id": name, "tick": 3, "sender": "scout[1]", "kind": "detection", "category": "report", "hop": "to hub",
        "value": value, "ticks": 0, "swayed": 4, "decisive": False, "reason": "success",
    }  # fmt: skip
    return MessageValue(**{**said, **changes})  # type: ignore[arg-type]


def episode(mode: str, *messages: MessageValue, success: bool = True) -> EpisodeValues:
    return EpisodeValues(
        path=f"{mode}.mcap",
        mission="ssr",
        mode=mode,
        seed=1,
        success=success,
        score=1.0 if success else 0.5,
        ticks=20,
        unsaid=False,
        null_identical=True,
        messages=messages,
        branches=len(messages) + 1,
    )


STAR = episode(
    "star",
    message("m3-1", 0.5, decisive=True, reason="budget", ticks=40),
    message("m3-2", 0.0, swayed=None),
    message("m4-1", -0.25, kind="assignment", hop="from hub"),
)
BROADCAST = episode("broadcast", message("m2-1", 0.0, swayed=None, hop="to all"), success=False)


def test_kinds_are_counted_per_mode_and_way() -> None:
    broadcast, detection, assignment = by_kind([STAR, BROADCAST])
    assert (broadcast.mode, broadcast.moot, broadcast.valuable) == ("broadcast", 1, 0)
    assert (detection.messages, detection.mean, detection.ticks) == (2, 0.25, 20.0)
    assert (detection.valuable, detection.decisive, detection.harmful, detection.moot) == (1, 1, 0, 1)
    assert (assignment.hop, assignment.harmful, assignment.mean) == ("from hub", 1, -0.25)


def test_modes_stand_side_by_side() -> None:
    broadcast, star = by_mode([STAR, BROADCAST])
    assert (broadcast.won, star.won, star.episodes) == (0, 1, 1)
    assert (star.messages, star.value, star.decisive) == (3.0, 0.25, 1.0)
    assert star.moot == pytest.approx(1 / 3) and broadcast.moot == 1.0


def test_the_page_names_what_decided() -> None:
    said = value_text([STAR, BROADCAST])
    assert "without m3-1, a detection of scout[1] to hub, lost (budget): decisions differ from boundary 4 on" in said
    assert said.count("what decided:") == 1 and "per episode:" in said
    assert "per episode:" not in value_text([STAR])
