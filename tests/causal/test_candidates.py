"""Tests of `CandidatePlayer`: the places in which candidates are played."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from lingjing import EpisodeReport, PlayOptions, Trace
from lingjing.causal.candidates import Candidate, CandidatePlayer, TriedCandidate
from lingjing.causal.failure import FailureSignature
from lingjing.play.parallel import EpisodeProcesses, EpisodeTask
from lingjing.testing import rescue as kit
from lingjing.trace.records import Header
from tests.play.report_kit import made_report


def test_a_control_from_a_file_is_played_within_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control's name is a path, which leads out of the folder."""
    played: list[Path] = []

    def play(
        processes: EpisodeProcesses, tasks: Iterable[EpisodeTask], jobs: int
    ) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        for task in tasks:
            played.append(task.folder)
            yield task, made_report(reason="infrastructure-abort")

    monkeypatch.setattr(EpisodeProcesses, "play", play)
    folder = tmp_path / "in"
    folder.mkdir()
    control = "../../mine/check.py:Check"
    player = CandidatePlayer(
        trace=Trace(Path("made-up.mcap"), Header(instance=kit.instance(), bindings=(), fingerprint={}), (), None,
                    False),
        signature=FailureSignature(reason="budget"), sameness="reason", options=PlayOptions(mission=""), policies={},
        folder=folder, log=tmp_path / "tried.jsonl", budget=3, control=control,
    )  # fmt: skip
    candidate = Candidate("ljs 1", {})
    player.known[candidate.key, ""] = TriedCandidate(key=candidate.key, who="", verdict="fails")
    assert player.verdict(candidate) == "hopeless"
    assert [path.resolve().parent for path in played] == [folder]


def test_an_unwinnable_mission_is_distinguished_from_an_invalid_mission(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text(encoding="utf-8")
    player = CandidatePlayer(
        trace=Trace(Path("made-up.mcap"), Header(instance=kit.instance(), bindings=(), fingerprint={}), (), None,
                    False),
        signature=FailureSignature(reason="budget"), sameness="reason", options=PlayOptions(mission=""), policies={},
        folder=tmp_path, log=tmp_path / "tried.jsonl", budget=3, control="oracle",
    )  # fmt: skip
    too_short, torn = re.sub(r"ticks <= \d+", "ticks <= 2", text), text.replace("mission", "missing")
    assert too_short != text
    verdicts = [player.replayed(Candidate(text, {})) for text in (too_short, torn)]
    assert verdicts == ["hopeless", "no mission"]
