"""Missions that cannot be won have an error with the true reason, and near ones that can be won have none."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.testing import Compilation, compile_file, compile_text
from tests.mission.language_cases import IMPOSSIBLE, WINNABLE, Variant

FOLDER = Path(__file__).parent / "language-cases"
REASONS = {
    "1-2": ("LJ0612", "`1 > 2` never holds"),
    "2-ticks": ("LJ0601", "take at least 90 s, the budget is 2 ticks of 10 s = 20 s"),
    "appears-after-the-budget": ("LJ0613", "a picture of `victim`; `victim` appears at 1,000 s"),
    "confidence-above-its-bound": (
        "LJ0612",
        "`r.confidence > 1` never holds, because the value is always between 0 and 1",
    ),
    "failure-before-success-can-be": ("LJ0601", "failure holds at 20 s at the latest"),
    "hard-constraint-keeps-the-boat-out": ("LJ0614", "a hard constraint on `boat in search` keeps `boat` away"),
    "index-that-is-not-there": ("LJ0206", "`victim` has 2 members, there is no 9"),
    "iou-above-1": ("LJ0612", "`iou(r.box, truth(v, r.frame).box) >= 1.5` never holds"),
    "more-places-than-fit": ("LJ0611", "40 places at least 200 m apart cannot fit"),
    "negated-at-all-times": ("LJ0612", "`not now >= 0 s` never holds"),
    "no-moveto-allowed": ("LJ0610", "a motion of `boat`), and `z` allows 0"),
    "nobody-delivers": ("LJ0612", "takes an asset of the engine or role `road`, and there is none"),
    "one-command-for-flight-and-picture-far": ("LJ0610", "a motion of `uav`, `takePhoto` of `uav`"),
    "payload-smaller-than-a-report": ("LJ0605", "has at least 98 bytes, and the payload of a message is 1 bytes"),
    "picture-only-after-a-match": ("LJ0606", "that for `uav.takePhoto`, that for `matched(victim)` again"),
    "reports-only-in-star-played-in-both": ("LJ0605", "in broadcast mode, no agent can send a `detection`"),
    "status-that-never-is": ("LJ0109", "the status of `boat` is never `nosuch`"),
    "success-before-anything": ("LJ0613", "takes at least 90.909 s, and `now < 5 s` holds not after 4.5 s"),
    "takeoff-only-search-far": ("LJ0607", "`uav` has no action that takes it 295.129 m nearer"),
    "unlock-waits-for-itself": ("LJ0606", "`rescue` of `victim`, that for `rescue` of `victim` again"),
    "victim-appears-in-star-only": ("LJ0613", "in broadcast mode, success can never hold"),
}
"""The code of each impossible mission, and a part of its message."""


def errors(compilation: Compilation) -> list[tuple[str, str]]:
    """The code and the message of each error."""
    return [(item.code, item.message) for item in compilation.diagnostics if item.severity == "error"]


@pytest.mark.parametrize("file", sorted((FOLDER / "impossible").glob("*.ljs")), ids=lambda file: file.stem)
def test_an_impossible_mission_has_an_error_with_its_reason(file: Path) -> None:
    code, part = REASONS[file.stem]
    (reported,) = errors(compile_file(str(file)))
    assert reported[0] == code and part in reported[1]


@pytest.mark.parametrize("file", sorted((FOLDER / "winnable").glob("*.ljs")), ids=lambda file: file.stem)
def test_a_winnable_mission_has_no_error(file: Path) -> None:
    compilation = compile_file(str(file))
    assert errors(compilation) == [] and compilation.mission is not None


@pytest.mark.parametrize("variant", IMPOSSIBLE, ids=lambda variant: variant.name)
def test_an_impossible_variant_has_an_error(variant: Variant) -> None:
    codes = {reported for reported, _ in errors(compile_text(variant.text))}
    assert variant.code in codes if variant.code else codes


@pytest.mark.parametrize("variant", WINNABLE, ids=lambda variant: variant.name)
def test_a_winnable_variant_has_no_error(variant: Variant) -> None:
    assert errors(compile_text(variant.text)) == []
