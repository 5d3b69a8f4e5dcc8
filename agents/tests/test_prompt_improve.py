"""`lingjing prompts improve` over real HTTP: real episodes, a second model, nothing hidden in what it reads."""

import re
from pathlib import Path

import pytest
from lingjing_agents.react.prompt_reviser import make_reviser

from agents.tests.chat_server import NOOP, Reply, serve
from lingjing.cli.main import main
from lingjing.errors import ExitCode, InfrastructureError
from lingjing.plugins.calls import UnrecordedCalls
from lingjing.trace.reader import read_trace

MISSION = """
ljs 1
use std.air { quadrotor }
use std.messages { report }
use std.sea { person_in_water }
mission tiny "Tiny search" {
  goal "Find the person."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 2, policy <= 90 s, engine <= 30 s, capture <= 10 s }
  mode single
  region search = box((0 m, -900 m), (200 m, -700 m))
  target victim : person_in_water { hidden position ~ sites(search) }
  asset uav : quadrotor { position = (100 m, -800 m, 1.1 m), actions { takeoff, stop } }
  agent scout as searcher controls uav { observes uav.*, events }
  message detection : report from searcher to all
  adjudicate found(v: victim) { when distance_xy(uav, v) <= 1 m }
  success when found(victim)
}
"""


def answer(request: dict) -> Reply:
    system = request["messages"][0]["content"]
    if system.startswith("You improve the prompt"):
        return Reply("Better:\n<prompt>\nYou are `$agent`. Look twice. $rules\n</prompt>")
    return Reply({**NOOP, "thought": "I wait for somebody"})


@pytest.mark.slow
def test_a_prompt_is_improved_from_failed_traces(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "tiny.ljs").write_text(MISSION)
    with serve(answer) as server:
        code = main([
            "prompts", "improve", str(tmp_path / "tiny.ljs"), "-o", str(tmp_path / "P2.txt"), "--rounds", "1",
            "--seeds", "1000-1000", "--policy-arg", "model=player", "--policy-arg", f"base_url={server.url}",
            "--policy-arg", "price_in=0", "--policy-arg", "price_out=0",
            "--reviser-arg", "model=second", "--reviser-arg", f"base_url={server.url}",
        ])  # fmt: skip
    assert code == ExitCode.OK, capsys.readouterr().err
    asked = next(one for one in server.requests if one["model"] == "second")["messages"][1]["content"]
    assert "TSR 0%" in asked
    assert "I wait for somebody" in asked
    trace = read_trace(tmp_path / "P2.txt.search" / "candidate-0-1000" / "trace.mcap")
    hidden = next(one for one in trace.header.instance.entities if one.id == "victim").position
    assert not {f"{hidden[0]:.1f}", f"{hidden[1]:.1f}"} & set(re.findall(r"-?\d+\.\d", asked))
    assert trace.header.fingerprint["react.prompt"].startswith("candidate-0.txt sha256:")
    played = [one for one in server.requests if one["model"] == "player"]
    assert any("Look twice." in one["messages"][0]["content"] for one in played)
    assert (tmp_path / "P2.txt").read_text().startswith("You are `$agent`, $role: $goal")  # the first of two equals


def test_a_second_model_that_gives_no_prompt_is_asked_once_more_and_then_an_abort():
    with serve([Reply("no"), Reply("<prompt>Hello $stranger</prompt>")]) as server:
        reviser = make_reviser({"model": "second", "base_url": server.url}, UnrecordedCalls())
        with pytest.raises(InfrastructureError, match="nothing fills: stranger"):
            reviser.revise("You are $agent", "TSR 0%", [])
    assert "no text between <prompt> and </prompt>" in server.requests[1]["messages"][-1]["content"]
    with serve([Reply("no"), Reply("<think><prompt>x $y</prompt></think><prompt>\nHello $agent\n</prompt>")]) as server:
        revision = make_reviser({"model": "second", "base_url": server.url}, UnrecordedCalls()).revise("p", "r", ["f"])
    assert revision.text == "Hello $agent\n"
