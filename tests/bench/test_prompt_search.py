"""Prompt search: development seeds only, the best candidate is kept, and an interrupted search continues."""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest

from lingjing import EpisodeReport, PlayOptions
from lingjing.bench import prompt_search
from lingjing.bench.folder import lock_folder
from lingjing.bench.prompt_search import RESULTS, KeptSearch, PromptSearch
from lingjing.errors import ExitCode, InfrastructureError, UsageError
from lingjing.play.parallel import EpisodeProcesses
from lingjing.plugins.calls import CallRequest, CallResult, ModelCalls, SpendingLimitError
from lingjing.plugins.prompts import Revision, TriedPrompt
from lingjing.testing import run_command
from tests.bench.suite_kit import EpisodeTask
from tests.play.report_kit import ABORTED, blank_metrics

WON = {"first": (), "worse": (), "better": (1, 2), "equal": (1, 3), "all": (1, 2, 3), "aborting": (), "dear": ()}
"""The seeds that each prompt wins."""

ABORTING = {("aborting", 2): "the camera ended", ("dear", 1): "money: the limit of $1 does not cover another call"}
"""(prompt, seed) of episodes that cannot be played → the reason."""


HOLES = "has holes that nothing fills: x"


class Reviser:
    """A reviser that returns its texts in order, and stores its requests and its model calls."""

    def __init__(self, *texts: str) -> None:
        self.texts = list(texts)
        self.requests: list[tuple[str, str, int]] = []
        self.failures: list[str] = []
        self.tried: list[TriedPrompt] = []
        self.calls: ModelCalls | None = None

    def __call__(self, calls: ModelCalls) -> "Reviser":
        self.calls = calls
        return self

    def revise(self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> Revision:
        self.requests.append((prompt, results, len(failures)))
        self.failures, self.tried = list(failures), list(tried)
        text = self.texts.pop(0)
        return Revision(text, "asked", "answered", fault="" if text else "is cut off")


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Replaces episodes: a prompt's text names the seeds that it wins. Returns the list of played episodes."""
    done: list[tuple[str, int]] = []

    def play(processes: EpisodeProcesses, tasks: Sequence[EpisodeTask], jobs: int):
        for task in tasks:
            text = Path(str(task.options.policy_args["prompt"])).read_text()
            seed = task.options.seed
            done.append((text, seed))
            assert not task.folder.exists()
            task.folder.mkdir(parents=True)
            (task.folder / "trace.mcap").touch()
            aborted = (text == "first" and seed == 3 and done.count((text, seed)) == 1) or (text, seed) in ABORTING
            yield task, EpisodeReport(
                mission="m", seed=seed, mode="star", policy="react", success=seed in WON[text], scr=0.5, ticks=1,
                digest="", reason=ABORTED if aborted else "budget",
                trace=str(task.folder / "trace.mcap"), detail=ABORTING.get((text, seed), ""),
                metrics=blank_metrics(answers=seed, json_compliance=1.0),
            )  # fmt: skip

    monkeypatch.setattr(EpisodeProcesses, "play", play)
    monkeypatch.setattr(prompt_search, "read_trace", lambda path: path)
    monkeypatch.setattr(prompt_search, "_failed_episode", lambda trace: f"failed in {trace}")
    return done


def search(folder: Path, reviser: Reviser, **changes: object) -> PromptSearch:
    defaults = {"check": lambda text: None, "seeds": (1, 2, 3), "options": PlayOptions(mission="m", policy="react")}
    return PromptSearch(folder, option="prompt", reviser=reviser, **{**defaults, **changes})  # type: ignore[arg-type]


def test_the_best_prompt_is_revised_and_an_equal_prompt_does_not_replace_it(tmp_path: Path, played: list):
    reviser = Reviser("worse", "better", "equal")
    best = search(tmp_path / "s", reviser).run("first", 3)
    assert (best.text, best.number, best.tsr) == ("better", 2, pytest.approx(2 / 3))
    assert [prompt for prompt, _, _ in reviser.requests] == ["first", "first", "better"]
    assert [failures for _, _, failures in reviser.requests] == [3, 3, 1]
    assert (tmp_path / "s" / "candidate-2.txt").read_text() == "better"
    assert (tmp_path / "s" / "revision-1-answered.txt").read_text() == "answered"


def test_an_aborted_episode_is_played_again_with_its_seed(tmp_path: Path, played: list):
    search(tmp_path, Reviser("worse")).run("first", 1)
    assert [seed for text, seed in played if text == "first"] == [1, 2, 3, 3]


def test_the_reviser_reads_the_traces_of_failed_episodes(tmp_path: Path, played: list):
    reviser = Reviser("better")
    search(tmp_path, reviser).run("worse", 1)
    assert reviser.failures == [f"failed in {tmp_path}/candidate-0-{seed}/trace.mcap" for seed in (1, 2, 3)]


def test_a_stopped_search_continues_and_plays_no_episode_twice(tmp_path: Path, played: list):
    with pytest.raises(IndexError):  # the reviser is gone after the first revision
        search(tmp_path, Reviser("worse")).run("first", 2)
    before = len(played)
    best = search(tmp_path, Reviser("better")).run("first", 2)
    assert best.text == "better"
    assert played[before:] == [("better", 1), ("better", 2), ("better", 3)]
    kept = msgspec.json.decode((tmp_path / RESULTS).read_bytes(), type=KeptSearch)
    assert [item.number for item in kept.candidates] == [0, 1, 2]
    assert [(item.answers, item.valid) for item in kept.candidates[1].episodes] == [(1, 1), (2, 2), (3, 3)]


def test_a_folder_of_another_search_is_refused(tmp_path: Path, played: list):
    search(tmp_path, Reviser("worse")).run("first", 1)
    with pytest.raises(UsageError, match="a search with other seeds"):
        search(tmp_path, Reviser("worse"), seeds=(7, 8)).run("first", 1)
    with pytest.raises(UsageError, match="a search with other start"):
        search(tmp_path, Reviser("worse")).run("better", 1)
    other = PlayOptions(mission="m", policy="react", policy_args={"model": "another"})
    with pytest.raises(UsageError, match="a search with other options"):
        search(tmp_path, Reviser("worse"), options=other).run("first", 1)
    elsewhere = PlayOptions(mission="m", policy="react", policy_args={"base_url": "http://localhost:9/v1"})
    assert search(tmp_path, Reviser(), options=elsewhere).run("first", 1).text == "first"
    with lock_folder(tmp_path, "search of prompts"), pytest.raises(UsageError, match="another search of prompts"):
        search(tmp_path, Reviser()).run("first", 1)


def test_files_left_by_a_killed_episode_are_removed(tmp_path: Path, played: list):
    (tmp_path / "candidate-0-2").mkdir()
    (tmp_path / "candidate-0-2" / "trace.mcap.part").write_bytes(b"cut short")
    search(tmp_path, Reviser("worse")).run("first", 1)  # the player rejects a folder that exists


def test_a_search_stops_if_an_episode_of_a_candidate_cannot_be_played(tmp_path: Path, played: list):
    with pytest.raises(InfrastructureError, match="candidate 1 could not be played, the first is seed 2: the camera"):
        search(tmp_path, Reviser("aborting")).run("first", 1)
    assert played.count(("aborting", 2)) == 3


def test_a_search_ends_when_every_episode_is_won(tmp_path: Path, played: list):
    reviser = Reviser("all")
    assert search(tmp_path, reviser).run("first", 4).text == "all"
    assert len(reviser.requests) == 1


def test_the_cost_limit_covers_episodes_and_revisions_and_ends_the_search(tmp_path: Path, played: list):
    capped = PlayOptions(mission="m", policy="react", max_cost=1.0)
    with pytest.raises(UsageError, match="money: the limit") as failure:
        search(tmp_path, Reviser("dear"), options=capped).run("first", 1)
    assert "higher --max-cost" in str(failure.value.hint)
    assert played.count(("dear", 1)) == 1
    reviser = Reviser()
    with pytest.raises(UsageError, match="money"):
        search(tmp_path, reviser, options=capped).run("first", 1)
    assert reviser.calls is not None
    assert reviser.calls.capped
    request = CallRequest(tick=0, number=0, head=b"{}", messages=(), most_usd=0.6, most_tokens=9)
    assert reviser.calls.begin(request) is None
    reviser.calls.end(request, CallResult(text="x", prompt_tokens=1, cost_usd=0.6))
    with pytest.raises(SpendingLimitError, match="does not cover another call"):
        reviser.calls.begin(request)


def test_an_invalid_revision_is_not_played(tmp_path: Path, played: list):
    def check(text: str) -> None:
        raise ValueError(HOLES)

    assert search(tmp_path, Reviser("worse"), check=check).run("first", 1).text == "first"
    assert {text for text, _ in played} == {"first"}
    kept = msgspec.json.decode((tmp_path / RESULTS).read_bytes(), type=KeptSearch)
    assert [(item.text, item.fault) for item in kept.candidates] == [
        ("first", ""),
        ("", "has holes that nothing fills: x"),
    ]


def test_a_round_without_a_prompt_ends_and_the_next_revision_receives_its_result(tmp_path: Path, played: list):
    lines: list[str] = []
    reviser = Reviser("worse", "", "better")
    best = search(tmp_path, reviser, tell=lambda item: lines.append(item.line)).run("first", 3)
    assert best.text == "better"
    assert [text for text, _ in played].count("first") == 4  # one aborted episode again, and none for the lost round
    assert lines[2] == "no prompt: the answer is cut off"
    assert [item.text for item in reviser.tried] == ["worse", ""]
    assert reviser.tried[0].results.startswith("TSR 0%") and reviser.tried[1].results == lines[2]
    assert (tmp_path / "revision-2-answered.txt").read_text() == "answered"
    again: list[str] = []
    assert search(tmp_path, Reviser(), tell=lambda item: again.append(item.line)).run("first", 3) == best
    assert again == lines


def test_seeds_of_the_evaluation_are_refused(capsys: pytest.CaptureFixture[str]):
    command = ["prompts", "improve", "ssr", "-o", "x.txt", "--seeds", "150-160", "--held-out", "0-199"]
    assert run_command(command) == ExitCode.USAGE
    assert "150 is both" in capsys.readouterr().err


def test_a_paid_search_reports_its_cost_and_starts_only_with_a_limit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-something-long-enough")
    command = ["prompts", "improve", "ssr", "-o", str(tmp_path / "x.txt"), "--policy-arg", "model=gpt-5.5"]
    assert run_command(command) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert "100 episodes" in errors
    assert "--max-cost" in errors
    assert not list(tmp_path.iterdir())
    command[-1] = "model=unheard-of"
    assert run_command([*command, "--max-cost", "5"]) == ExitCode.USAGE
    assert "those of unheard-of are unknown" in capsys.readouterr().err


def test_shipped_prompts_are_listed_and_shown(capsys: pytest.CaptureFixture[str]):
    assert run_command(["prompts", "list"]) == ExitCode.OK
    assert [line.split()[1] for line in capsys.readouterr().out.splitlines()] == ["P0", "P1"]
    assert run_command(["prompts", "show", "P0"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith("You are `$agent`, $role: $goal")
    assert run_command(["prompts", "show", "P9"]) == ExitCode.USAGE
