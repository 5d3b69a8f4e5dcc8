"""Tests of `FailureSignature`."""

from pathlib import Path

from lingjing import read as read_trace
from lingjing import run
from lingjing.causal.failure import failure_of

HERE = Path(__file__).parent / "shrink"


def test_late_stages_are_found_by_their_own_bound_and_not_by_the_text_of_the_detail(tmp_path: Path) -> None:
    """The ending reads "the stage execute was not done in the 2 ticks it had": the stage `done` is not late."""
    stage = "stage execute per p in person { done when saved(p) }"
    text = (HERE / "harbour.ljs").read_text()
    assert stage in text
    mission = tmp_path / "harbour.ljs"
    mission.write_text(
        text.replace(
            stage,
            "stage execute per p in person { done when saved(p), ticks <= 2 }\n"
            "  stage done per p in person { done when saved(p), ticks <= 20 }",
        )
    )
    report = run(
        mission, policy=f"{HERE / 'skippers.py'}:Timid", seed=3, settings={"people": 2.0},
        out=tmp_path / "episode", overview=False,
    )  # fmt: skip
    assert report.reason == "late" and "done in the 2 ticks" in report.detail
    signature = failure_of(read_trace(report.trace))
    assert signature is not None and signature.named == ("execute",)
