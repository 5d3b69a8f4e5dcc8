"""An episode's model calls: recorded, read, replayed without a service, and limited; a real server on loopback."""

import json
import re
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import pytest

import lingjing
from agents.tests.chat_server import NOOP, Reply, completion, serve
from lingjing import EpisodeReport
from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.testing import recorded_calls, run_command

TEXT = """\
ljs 1
use std.air { quadrotor }
use std.sensors { nadir_hd }

mission glance "Two look down" {
  goal "Look."
  scene bay
  clock { tick = 2 s, sync = 500 ms }
  budget { ticks <= 4, policy <= 600 s, engine <= 60 s, capture <= 60 s }
  mode broadcast
  param height = 30 m in 20 m..60 m
  asset uav[1..2] : quadrotor {
    position = at(i, [(100 m, -700 m), (140 m, -700 m)], spread 8 m), band = 20 m..60 m
    camera nadir : nadir_hd { size = 320 by 180 }
    actions { takeoff, takePhoto }
  }
  agent scout[i in 1..2] as scout controls uav[i] { observes uav[i].*, events }
  success when distance_xy(uav[1], uav[2]) <= 0 m
}
"""
KEY = "sk-a-planted-key-4711-0815"
LOOK = {**NOOP, "command": {"verb": "takePhoto", "arguments": {"camera": "nadir"}, "resource": "uav[1]"}}
ARGUMENTS = {
    "model": "m", "api_key_env": "TEST_KEY", "price_in": "1", "price_out": "2", "tries": "2", "deadline": "500",
}  # fmt: skip


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "glance.ljs"
    path.write_text(TEXT)
    return path


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TEST_KEY", KEY)


class Script:
    """Answers by agent and number of its calls; the last of a list repeats, an agent without one does nothing."""

    def __init__(self, **replies: list[Reply]) -> None:
        self.replies = replies
        self.calls: Counter[str] = Counter()
        self.lock = threading.Lock()

    def __call__(self, request: dict[str, Any]) -> Reply:
        match = re.search(r"scout\[(\d)\]", request["messages"][0]["content"])
        assert match
        name = f"scout{match[1]}"
        with self.lock:
            number = self.calls[name]
            self.calls[name] += 1
        replies = self.replies.get(name, [Reply()])
        return replies[min(number, len(replies) - 1)]


def looking() -> Script:
    """Return answers: scout[1] looks down, and its second answer is invalid first; scout[2] does nothing."""
    return Script(scout1=[Reply(LOOK), Reply("so I look down"), Reply(LOOK)])


def play(
    mission: Path, out: Path, url: str, policy_args: dict[str, str] | None = None, **changes: object
) -> EpisodeReport:
    arguments = {**ARGUMENTS, "base_url": url, **(policy_args or {})}
    options = {"policy": "react", "policy_args": arguments, "overview": False, "world": "inline", "out": out, **changes}
    return lingjing.run(mission, **options)


def row(report: EpisodeReport) -> dict[str, object]:
    """Return a study's row of an episode, without the path of its trace and the wall-clock seconds."""
    plain = msgspec.to_builtins(report)
    del plain["trace"]
    return {**plain, "metrics": {k: v for k, v in plain["metrics"].items() if "wall" not in k}}


def decisions(report: EpisodeReport) -> list[object]:
    return [
        msgspec.structs.replace(made, policy_wall_s=0.0)
        for record in read_trace(report.trace).boundaries
        for made in record.decisions
    ]


def test_an_episode_is_replayed_without_its_service_byte_for_byte(tmp_path, mission, monkeypatch, capsys):
    with serve(looking()) as server:
        played = play(mission, tmp_path / "a", server.url)
        count = len(server.requests)
    assert count == 4 * 2 + 1
    monkeypatch.delenv("TEST_KEY")  # no key, no service
    again = play(mission, tmp_path / "b", server.url, calls="replay", calls_from=tmp_path / "a")
    third = play(mission, tmp_path / "c", server.url, calls="replay", calls_from=tmp_path / "b" / "trace.mcap")
    assert row(played) == row(again) == row(third)
    assert decisions(played) == decisions(again) == decisions(third)
    assert (played.digest, played.frames_digest) == (again.digest, again.frames_digest)
    assert played.metrics is not None
    assert played.metrics.calls == 9

    def recorded(name: str) -> list[object]:
        return recorded_calls(tmp_path / name)

    assert recorded("a") == recorded("b") == recorded("c")
    assert len(server.requests) == count


def test_the_record_can_be_listed_and_read(tmp_path, mission, capsys):
    with serve(looking()) as server:
        report = play(mission, tmp_path / "a", server.url)
        shown = set(re.findall(r"data:image/jpeg;base64,[^\"]*", json.dumps(server.requests)))
    assert run_command(["calls", report.trace]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 9
    assert lines[0].split()[:3] == ["tick", "agent", "call"]
    assert lines[1].split()[:6] == ["0", "scout[1]", "0", "0", "1", "100"]
    assert run_command(["calls", str(tmp_path / "a"), "--agent", "scout[1]", "--tick", "1", "--full"]) == 0
    text = capsys.readouterr().out
    assert "=== tick 1, scout[1], call 1: " in text
    assert "--- user\nYour answer cannot be used: " in text
    assert "--- answer (stop)\nso I look down" in text
    pictures = tmp_path / "pictures"
    assert run_command(["calls", report.trace, "--output-format", "json", "--pictures", str(pictures)]) == 0
    calls = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [call["request"]["model"] for call in calls] == ["m"] * 9
    files = list(pictures.iterdir())
    assert files
    assert all(path.read_bytes()[:2] == b"\xff\xd8" for path in files)
    assert len(files) == len(shown)
    assert run_command(["calls", report.trace, "--pictures", str(mission)]) == 2
    assert f"cannot write into `{mission}`" in capsys.readouterr().err
    assert run_command(["calls", str(tmp_path / "nowhere")]) == 2
    assert run_command(["calls", str(mission)]) == 2


def test_no_stored_file_contains_the_key(tmp_path, mission):
    with serve(lambda request: Reply({**NOOP, "thought": f"your key is {KEY}"})) as server:
        report = play(mission, tmp_path / "a", server.url)
    assert read_trace(report.trace).boundaries
    assert "***" in Path(report.trace).with_name("calls.sqlite").read_bytes().decode("latin-1")
    for path in (tmp_path / "a").iterdir():
        assert KEY[3:].encode() not in path.read_bytes(), path


def failing() -> Script:
    """scout[2] receives a rejection, a time-out and a pause that is too long; scout[1] none of them."""
    return Script(scout2=[Reply(status=401), Reply(delay_s=3600.0), Reply(status=429, headers={"retry-after": "900"})])


@pytest.mark.parametrize("deadline", ["3", "60"])
def test_failures_and_time_outs_are_replayed_at_once(tmp_path, mission, deadline):
    """`react` ends a call at its own deadline, or at nine tenths of the time that the mission allows a policy."""
    mission.write_text(TEXT.replace("policy <= 600 s", "policy <= 5 s").replace("ticks <= 4", "ticks <= 3"))
    with serve(failing()) as server:
        played = play(mission, tmp_path / "a", server.url, {"deadline": deadline})
    again = play(mission, tmp_path / "b", "http://127.0.0.1:1/v1", {"deadline": deadline}, calls="replay",
                 calls_from=tmp_path / "a")  # fmt: skip
    made = [decision for decision in decisions(played) if decision.agent == "scout[2]"]
    assert made[1].substituted == "policy_error"
    assert "no answer from the model within" in made[1].detail
    assert {decision.substituted for decision in made} <= {
        "policy_error",
        "policy_timeout",
    }  # the refusal may arrive too late
    assert decisions(played) == decisions(again)
    assert row(played) == row(again)
    waited = [record.decisions[1].policy_wall_s for record in read_trace(again.trace).boundaries[1:]]
    assert max(waited) < 3.0


def test_a_missing_answer_is_an_error_and_never_a_call(tmp_path, mission):
    with serve(looking()) as server:
        play(mission, tmp_path / "a", server.url)
        recorded = len(server.requests)
        mission.write_text(TEXT.replace("ticks <= 4", "ticks <= 6"))
        report = play(mission, tmp_path / "b", server.url, calls="replay", calls_from=tmp_path / "a")
        assert len(server.requests) == recorded
    assert (report.reason, report.ticks) == ("infrastructure-abort", 4)
    assert report.detail.startswith("calls: `")
    assert "has no answer for `scout[1]`, tick 4, call 0" in report.detail


def test_replayed_calls_with_other_requests_are_reported(tmp_path, mission):
    with serve(looking()) as server:
        play(mission, tmp_path / "a", server.url)
    other = play(
        mission, tmp_path / "b", server.url, {"max_tokens": "999"}, calls="replay", calls_from=tmp_path / "a",
        engine_args={"camera.quality": "60"},
    )  # fmt: skip
    assert other.reason == "budget"
    assert "9 of 9 replayed calls were asked with other parameters, first `scout[1]`, tick 0, call 0" in other.warnings
    assert any(
        "replayed calls were asked with other pictures, first `scout[1]`, tick 1" in warning
        for warning in other.warnings
    )
    assert not any("other texts" in warning for warning in other.warnings)
    mission.write_text(TEXT.replace('"Look."', '"Look down."'))
    third = play(mission, tmp_path / "c", server.url, calls="replay", calls_from=tmp_path / "a")
    assert "9 of 9 replayed calls were asked with other texts, first `scout[1]`, tick 0, call 0" in third.warnings


def test_the_record_of_another_episode_is_refused(tmp_path, mission):
    with serve([Reply()]) as server:
        play(mission, tmp_path / "runs" / "glance-broadcast-0-1", server.url)
        play(mission, tmp_path / "runs" / "glance-broadcast-1-1", server.url, seed=1)
    first = tmp_path / "runs" / "glance-broadcast-0-1"
    with pytest.raises(UsageError, match="seed 0, and the options are those of glance, broadcast, seed 1"):
        play(mission, tmp_path / "b", server.url, seed=1, calls="replay", calls_from=first)
    report = play(mission, tmp_path / "c", server.url, seed=1, calls="replay", calls_from=tmp_path / "runs")
    assert report.reason == "budget"
    with pytest.raises(UsageError, match="no record of model calls"):
        play(mission, tmp_path / "d", server.url, seed=2, calls="replay", calls_from=tmp_path / "runs")
    assert not (tmp_path / "d").exists()


def test_live_calls_and_policies_without_a_model_leave_no_record(tmp_path, mission):
    with serve([Reply()]) as server:
        play(mission, tmp_path / "a", server.url, calls="live")
    lingjing.run(mission, policy="random", overview=False, world="inline", out=tmp_path / "b")
    assert not list(tmp_path.glob("*/calls.sqlite"))


def test_the_limit_of_money_is_never_exceeded(tmp_path, mission):
    answer = completion(Reply()) | {"usage": {"prompt_tokens": 8_000, "completion_tokens": 0}}
    with serve([Reply(body=json.dumps(answer))]) as server:
        report = play(mission, tmp_path / "a", server.url, {"price_in": "10", "price_out": "10"}, max_cost=0.4)
        # each is billed $0.08, of eight that are wanted; what is reserved at once decides how many are made
        assert 1 <= len(server.requests) <= 5
    assert report.reason == "infrastructure-abort"
    assert report.detail.startswith("money: the limit of $0.4 does not cover another call: $")
    assert report.hint.startswith("raise --max-cost")
    assert read_trace(report.trace).boundaries


def test_processes_of_one_command_share_the_limit(tmp_path, mission, capsys):
    answer = completion(Reply()) | {"usage": {"prompt_tokens": 4_000, "completion_tokens": 0}}
    with serve([Reply(body=json.dumps(answer))]) as server:
        options = [f"--policy-arg={name}={value}" for name, value in {**ARGUMENTS, "base_url": server.url}.items()]
        command = ["run", str(mission), "--policy=react", *options, "--seeds=0-3", "-j2", "--no-overview"]
        code = run_command([*command, "--max-tokens=80000", "--json", f"-o{tmp_path / 'runs'}"])
        assert 1 <= len(server.requests) <= 20  # one too many is the fault; how many are set aside at once is chance
    assert code == 3
    assert "tokens: the limit of 80000 does not cover another call" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"calls": "replay"}, "requires --calls-from"),
        ({"calls_from": "x"}, "not --calls record"),
        ({"calls": "replay", "calls_from": "nowhere"}, "`nowhere` does not exist"),
        ({"calls": "again"}, "'record', 'replay' or 'live'|record"),
        ({"max_cost": 0.0}, "must be greater than 0"),
        ({"max_cost": float("nan")}, "must be greater than 0"),
        ({"max_tokens": -1}, "must be greater than 0"),
    ],
)
def test_invalid_or_conflicting_options_are_reported(tmp_path, mission, options, error):
    with pytest.raises(UsageError, match=error):
        lingjing.run(mission, policy="random", out=tmp_path / "a", **options)


def test_a_missing_price_under_a_limit_of_money_is_reported_before_the_first_call(tmp_path, mission):
    with serve([Reply()]) as server, pytest.raises(UsageError, match="the price of `mystery` is not known"):
        lingjing.run(
            mission, policy="react", policy_args={"model": "mystery", "base_url": server.url}, max_cost=1.0,
            out=tmp_path / "a", world="inline",
        )  # fmt: skip
    assert not server.requests
    assert threading.active_count() < 50
