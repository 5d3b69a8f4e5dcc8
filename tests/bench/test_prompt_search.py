"""Improving a prompt: development seeds alone, the best candidate kept, a stopped search goes on."""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest

from lingjing.bench import prompt_search
from lingjing.bench.prompt_search import RESULTS, PromptCandidate, PromptSearch
from lingjing.cli.main import main
from lingjing.errors import ExitCode, InfrastructureError, UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask
from lingjing.play.report import ABORTED, EpisodeReport
from lingjing.plugins.prompts import Revision

WON = {"first": (), "worse": (), "better": (1, 2), "equal": (1, 3)}
"""Which seeds a prompt wins."""


class Reviser:
    """Gives the next of its texts; keeps what it was asked."""

    def __init__(self, *texts: str) -> None:
        self.texts = list(texts)
        self.asked: list[tuple[str, str, int]] = []

    def revise(self, prompt: str, results: str, failures: Sequence[str]) -> Revision:
        self.asked.append((prompt, results, len(failures)))
        return Revision(self.texts.pop(0), "asked", "answered")


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Episodes without a world: a prompt's text says which seeds it wins. Returns what was played."""
    done: list[tuple[str, int]] = []

    def play(tasks: Sequence[EpisodeTask], jobs: int):
        for task in tasks:
            text = Path(str(task.options.policy_args["prompt"])).read_text()
            seed = task.options.seed
            done.append((text, seed))
            aborted = text == "first" and seed == 3 and done.count((text, seed)) == 1
            yield task, EpisodeReport(
                mission="m", seed=seed, mode="star", policy="react", success=seed in WON[text], scr=0.5, ticks=1,
                digest="", reason=ABORTED if aborted else "budget", trace=str(task.folder / "trace.mcap"), metrics=None,
            )  # fmt: skip

    monkeypatch.setattr(prompt_search, "play_apart", play)
    monkeypatch.setattr(prompt_search, "read_trace", lambda path: path)
    monkeypatch.setattr(prompt_search, "failed_episode", lambda trace: f"failed in {trace}")
    return done


def search(folder: Path, reviser: Reviser, **changes: object) -> PromptSearch:
    given = {"check": lambda text: None, "seeds": (1, 2, 3), **changes}
    return PromptSearch(folder, PlayOptions(mission="m", policy="react"), "prompt", reviser=reviser, **given)  # type: ignore[arg-type]


def test_the_best_is_kept_and_revised_and_an_equal_one_does_not_take_its_place(tmp_path: Path, played: list):
    reviser = Reviser("worse", "better", "equal")
    best = search(tmp_path / "s", reviser).run("first", 3)
    assert (best.text, best.number, best.tsr) == ("better", 2, pytest.approx(2 / 3))
    assert [prompt for prompt, _, _ in reviser.asked] == ["first", "first", "better"]
    assert [failures for _, _, failures in reviser.asked] == [3, 3, 1]
    assert (tmp_path / "s" / "candidate-2.txt").read_text() == "better"
    assert (tmp_path / "s" / "revision-1-answered.txt").read_text() == "answered"


def test_an_aborted_episode_is_played_again_with_its_seed(tmp_path: Path, played: list):
    search(tmp_path, Reviser("worse")).run("first", 1)
    assert [seed for text, seed in played if text == "first"] == [1, 2, 3, 3]


def test_a_stopped_search_goes_on_and_plays_nothing_twice(tmp_path: Path, played: list):
    with pytest.raises(IndexError):  # the reviser is gone after the first revision
        search(tmp_path, Reviser("worse")).run("first", 2)
    before = len(played)
    best = search(tmp_path, Reviser("better")).run("first", 2)
    assert best.text == "better"
    assert played[before:] == [("better", 1), ("better", 2), ("better", 3)]
    kept = msgspec.json.decode((tmp_path / RESULTS).read_bytes(), type=list[PromptCandidate])
    assert [one.number for one in kept] == [0, 1, 2]


def test_a_folder_of_another_search_is_refused(tmp_path: Path, played: list):
    search(tmp_path, Reviser("worse")).run("first", 1)
    with pytest.raises(UsageError, match="another prompt, or on other seeds"):
        search(tmp_path, Reviser("worse"), seeds=(7, 8)).run("first", 1)
    with pytest.raises(UsageError, match="another prompt, or on other seeds"):
        search(tmp_path, Reviser("worse")).run("second", 1)


def test_a_revision_that_is_no_prompt_is_not_played(tmp_path: Path, played: list):
    def check(text: str) -> None:
        raise ValueError("has holes that nothing fills: x")

    with pytest.raises(InfrastructureError, match="the revision has holes"):
        search(tmp_path, Reviser("worse"), check=check).run("first", 1)
    assert {text for text, _ in played} == {"first"}


def test_seeds_of_the_evaluation_are_refused(capsys: pytest.CaptureFixture[str]):
    command = ["prompts", "improve", "ssr", "-o", "x.txt", "--seeds", "150-160", "--held-out", "0-199"]
    assert main(command) == ExitCode.USAGE
    assert "150 is both" in capsys.readouterr().err


def test_shipped_prompts_are_listed_and_shown(capsys: pytest.CaptureFixture[str]):
    assert main(["prompts", "list"]) == ExitCode.OK
    assert [line.split()[1] for line in capsys.readouterr().out.splitlines()] == ["P0", "P1"]
    assert main(["prompts", "show", "P0"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith("You are `$agent`, $role: $goal")
    assert main(["prompts", "show", "P9"]) == ExitCode.USAGE
