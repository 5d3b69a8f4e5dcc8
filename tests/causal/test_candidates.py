"""`CandidatePlayer`: where candidates are played."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from lingjing.causal import candidates
from lingjing.causal.candidates import Candidate, CandidatePlayer, TriedCandidate
from lingjing.causal.failure import FailureSignature
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask
from lingjing.play.report import EpisodeReport
from lingjing.trace.reader import Trace
from lingjing.trace.records import Header
from tests.kernel import kernel_kit as kit
from tests.play.report_kit import made_report


def test_a_control_from_a_file_is_played_within_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its name is a path, which leads elsewhere."""
    played: list[Path] = []

    def play(tasks: Iterable[EpisodeTask], jobs: int) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        for task in tasks:
            played.append(task.folder)
            yield task, made_report(reason="infrastructure-abort")

    monkeypatch.setattr(candidates, "play_apart", play)
    folder = tmp_path / "in"
    folder.mkdir()
    control = "../../mine/check.py:Check"
    player = CandidatePlayer(
        trace=Trace(Path("made-up.mcap"), Header(instance=kit.make_instance(), bindings=(), fingerprint={}), (), None,
                    False),
        signature=FailureSignature(reason="budget"), sameness="reason", options=PlayOptions(mission=""), policies={},
        folder=folder, log=tmp_path / "tried.jsonl", budget=3, control=control,
    )  # fmt: skip
    candidate = Candidate("ljs 1", {})
    player.known[candidate.key, ""] = TriedCandidate(key=candidate.key, who="", verdict="fails")
    assert player.verdict(candidate) == "hopeless"
    assert [path.resolve().parent for path in played] == [folder]
