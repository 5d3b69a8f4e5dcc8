"""`lingjing prompts improve` over real HTTP: real episodes, a second model, no hidden values in its input."""

import re
from pathlib import Path

import pytest
from lingjing_agents.react.prompt_reviser import LETTERS_PER_TOKEN, ModelReviser, make_reviser, revised_prompt

from agents.tests.chat_server import NOOP, Reply, serve
from lingjing import read as read_trace
from lingjing.errors import ExitCode, InfrastructureError
from lingjing.plugins.calls import CallResult, UnrecordedCalls
from lingjing.plugins.prompts import TriedPrompt
from lingjing.testing import run_command

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
        code = run_command([
            "prompts", "improve", str(tmp_path / "tiny.ljs"), "-o", str(tmp_path / "P2.txt"), "--rounds", "1",
            "--seeds", "1000-1000", "--policy-arg", "model=player", "--policy-arg", f"base_url={server.url}",
            "--policy-arg", "price_in=0", "--policy-arg", "price_out=0",
            "--reviser-arg", "model=second", "--reviser-arg", f"base_url={server.url}",
        ])  # fmt: skip
    assert code == ExitCode.OK, capsys.readouterr().err
    question = next(item for item in server.requests if item["model"] == "second")["messages"][1]["content"]
    assert "TSR 0%" in question
    assert "I wait for somebody" in question
    trace = read_trace(tmp_path / "P2.txt.search" / "candidate-0-1000" / "trace.mcap")
    hidden = next(item for item in trace.header.instance.entities if item.id == "victim").position
    assert not {f"{hidden[0]:.1f}", f"{hidden[1]:.1f}"} & set(re.findall(r"-?\d+\.\d", question))
    assert trace.header.fingerprint["react.prompt"].startswith("candidate-0.txt sha256:")
    played = [item for item in server.requests if item["model"] == "player"]
    assert any("Look twice." in item["messages"][0]["content"] for item in played)
    assert (
        (tmp_path / "P2.txt").read_text().startswith("You are `$agent`, $role: $goal")
    )  # the first of equal candidates


def reviser(url: str, **options: str) -> ModelReviser:
    return make_reviser({"model": "second", "base_url": url, **options}, UnrecordedCalls())


LONGER = "You are $agent. Look twice and then act."


def test_a_reviser_that_returns_no_prompt_is_asked_once_more():
    with serve([Reply("no"), Reply("<prompt>Hello $stranger, look twice and act</prompt>")]) as server:
        revision = reviser(server.url).revise("You are $agent", "TSR 0%", [], [])
    assert revision.text == ""
    assert "nothing fills: stranger" in revision.fault
    assert "no text between <prompt> and </prompt>" in server.requests[1]["messages"][-1]["content"]
    with serve([Reply("no"), Reply(f"<prompt>\n{LONGER}\n</prompt>")]) as server:
        revision = reviser(server.url).revise("p", "r", ["f"], [])
    assert (revision.text, revision.fault) == (f"{LONGER}\n", "")
    with serve([Reply("no"), Reply({"prompt": LONGER})]) as server:
        assert reviser(server.url).revise("p", "r", ["f"], []).text == f"{LONGER}\n"
    assert ["response_format" in request for request in server.requests] == [False, True]
    assert "JSON object" in server.requests[1]["messages"][-1]["content"]
    with serve([Reply("", status=500)] * 9) as server, pytest.raises(InfrastructureError, match="gave no revision"):
        reviser(server.url, tries="1").revise("p", "r", [], [])


@pytest.mark.parametrize(
    "answer",
    [
        f"<think>first <prompt>a draft of some five words</prompt> no</think>\n<prompt>{LONGER}</prompt>",
        f"Between <prompt> and </prompt>:\n<Prompt>\n{LONGER}\n</PROMPT>\nIt is between <prompt> and </prompt>",
        f"<prompt>\n```text\n{LONGER}\n```\n</prompt>",
        f"```\n<prompt>\n{LONGER}\n</prompt>\n```",
        f"<prompt>\n<prompt>{LONGER}</prompt>\n</prompt>",
        f"<prompt>a first try of some words</prompt> Better: <prompt>{LONGER}</prompt>",
        f'  {{"prompt": "{LONGER}"}}',
    ],
)
def test_the_prompt_is_found_in_the_answers_of_weak_models(answer: str):
    assert revised_prompt(CallResult(text=answer, finish_reason="stop"), ["another"]) == f"{LONGER}\n"


@pytest.mark.parametrize(
    ("answer", "finish", "fault"),
    [
        ("", "stop", "has no text between"),
        ("I cannot help with robots.", "stop", "has no text between"),
        ('{"prompt": "You are', "length", "was cut off"),
        ('{"prompt": "<script src="}', "stop", "holds a prompt of fewer than 5 words"),
        ("<prompt></prompt>", "stop", "holds a prompt of fewer than 5 words"),
        ("I answer between <prompt> and </prompt>.", "stop", "holds a prompt of fewer than 5 words"),
        ("<think><prompt>You are one of five scouts</prompt>", "length", "ends within its reasoning and was cut off"),
        ("<prompt>You are the scout the scout the scout", "length", "was cut off before </prompt>"),
        ("<prompt>You are $agent. That costs $5 a call</prompt>", "stop", "`$` that begins no name"),
        ("<prompt>" + "so it goes on " * 6000 + "</prompt>", "stop", "a prompt has at most 65,536"),
        (f"<prompt> {LONGER}\n\n</prompt>", "stop", "was tried before, word for word"),
    ],
)
def test_an_answer_without_a_new_prompt_is_rejected_with_the_reason(answer: str, finish: str, fault: str):
    with pytest.raises(ValueError, match=re.escape(fault)):
        revised_prompt(CallResult(text=answer, finish_reason=finish), ["another", f"{LONGER}\n"])


def test_a_reviser_receives_the_tried_prompts_as_far_as_its_context_allows(tmp_path: Path):
    tried = [TriedPrompt("Fly low at first.", "TSR 10%"), TriedPrompt("", "no prompt: the answer was cut off")]
    failures = ["scout said nothing. " * 40, "boat stood still. " * 40]
    (tmp_path / "models.toml").write_text('[models.small]\nservice = "vllm"\nserved = "small"\ncontext = 3000\n')
    for options, parts in (
        ({}, ["FAILED EPISODE 1", "FAILED EPISODE 2", "DID NO BETTER: TSR 10%\nFly low", "the answer was cut off"]),
        ({"model": "small", "models": str(tmp_path / "models.toml"), "max_tokens": "700"}, ["FAILED EPISODE 1"]),
    ):
        with serve([Reply(f"<prompt>{LONGER}</prompt>")]) as server:
            reviser(server.url, **options).revise("You are $agent", "TSR 0%", failures, tried)
        question = server.requests[0]["messages"][1]["content"]
        every = ("FAILED EPISODE 1", "FAILED EPISODE 2", "DID NO BETTER: TSR 10%\nFly low", "the answer was cut off")
        assert [part for part in every if part in question] == parts
        letters = sum(len(message["content"]) for message in server.requests[0]["messages"])
        assert not options or letters / LETTERS_PER_TOKEN + 700 <= 3000
