"""`lingjing new mission --from`: the conversation with a scripted service over real HTTP."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agents.tests.chat_server import ChatServer, Reply, serve
from lingjing.testing import run_command

MISSION = """ljs 2
use std.sea { lifeboat, person_in_water }

mission small "A small rescue" {
  goal "Bring the boat to the person."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 20 s, sync = 1 s }
  budget { ticks <= 8 }
  region area = box((60 m, -1300 m), (160 m, -1200 m))
  target victim : person_in_water { position ~ sites(area) }
  asset boat : lifeboat { position = (110 m, -1360 m), heading = 0 deg, actions { moveTo } }
  agent skipper as rescuer controls boat { observes boat.*, victim.position, events }
  success when emitted(rescue, victim)
  expect { EXPECT }
}
"""
GOOD = MISSION.replace("EXPECT", "oracle wins for seeds 0, idle loses for seeds 0, draws spread over area")
FAULTY = GOOD.replace("sites(area)", "sites(aera)")
WRONG = GOOD.replace("idle loses for seeds 0", "idle wins for seeds 0")

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write(server: ChatServer, *options: str) -> int:
    words = ["new", "mission", "small", "--from", "a boat saves one person", "--model", "scripted"]
    return run_command([*words, "--model-arg", f"base_url={server.url}", "--model-arg", "tries=1", *options])


def fenced(text: str) -> Reply:
    return Reply(step=f"Here it is:\n\n```ljs\n{text}```\nIt is small.")


def message_texts(server: ChatServer, number: int) -> list[str]:
    """The messages of a request."""
    return [message["content"] for message in server.requests[number]["messages"]]


def test_errors_and_failed_expectations_are_returned_to_the_model_until_none_is_left(capsys: Capture) -> None:
    with serve([fenced(FAULTY), fenced(WRONG), fenced(GOOD)]) as server:
        assert write(server, "--model-arg", "grammar=grammar") == 0
    captured = capsys.readouterr()
    assert Path("small.ljs").read_text() == GOOD and not Path("small.draft.ljs").exists()
    assert "after 3 answers" in captured.out and "round 2 of 6: 1 of 3 expectations fail" in captured.err
    system, user = message_texts(server, 0)
    assert "# .ljs on one card" in system and user == "Write this mission: a boat saves one person"
    assert "did you mean `area`?" in message_texts(server, 1)[-1] and message_texts(server, 1)[-2].startswith(
        "Here it is"
    )
    assert "idle wins for seeds 0\n  failed: 0 of 1 episodes were won" in message_texts(server, 2)[-1]
    assert len(message_texts(server, 2)) == 4  # only the last answer stays in the conversation
    assert all(request["grammar"].startswith("root ::=") for request in server.requests)


def test_an_answer_without_fences_is_read_from_its_first_statement(capsys: Capture) -> None:
    with serve([Reply(step=f"I think this is right.\n\n{GOOD}")]) as server:
        assert write(server) == 0
    assert Path("small.ljs").read_text() == GOOD
    assert "grammar" not in server.requests[0]


def test_writing_ends_after_the_last_round_without_a_valid_mission(capsys: Capture) -> None:
    with serve([Reply(step="I cannot do that."), fenced(FAULTY)]) as server:
        assert write(server, "--rounds", "3") == 1
    captured = capsys.readouterr()
    assert len(server.requests) == 3 and not Path("small.ljs").exists()
    assert Path("small.draft.ljs").read_text() == FAULTY
    assert "error: after 3 answers no mission holds" in captured.err and "hint: a larger --rounds" in captured.err
    assert "no mission. Answer with the whole file" in message_texts(server, 1)[-1]


@pytest.mark.parametrize("death", [Reply(drop=True), Reply(status=500), Reply(body="<html>")])
def test_an_outage_of_the_service_is_an_infrastructure_failure_and_the_draft_is_kept(
    death: Reply, capsys: Capture
) -> None:
    with serve([fenced(FAULTY), death]) as server:
        assert write(server) == 3
    captured = capsys.readouterr()
    assert "gave no answer" in captured.err and "the last draft is small.draft.ljs" in captured.err
    assert Path("small.draft.ljs").read_text() == FAULTY and not Path("small.ljs").exists()


@pytest.mark.parametrize(
    ("expectations", "why"),
    [
        ('oracle wins for seeds 0, "/tmp/x.py:X" loses', "`/tmp/x.py:X` cannot be run"),
        ("oracle wins for seeds 0, react loses", "`react` cannot be run"),
        ("oracle wins for seeds 0..99", "has 100 seeds; at most 10"),
        ("idle loses", "lacks an expectation that it can be won"),
    ],
)
def test_expectations_written_by_a_model_are_limited(expectations: str, why: str, capsys: Capture) -> None:
    with serve([fenced(MISSION.replace("EXPECT", expectations))]) as server:
        assert write(server, "--rounds", "1") == 1
    assert why in capsys.readouterr().out


def test_long_episodes_and_large_fleets_are_not_played(capsys: Capture) -> None:
    text = GOOD.replace("ticks <= 8", "ticks <= 9000")
    with serve([fenced(text), fenced(text.replace("9000", "9").replace("asset boat", "asset boat[1..99]"))]) as server:
        assert write(server, "--rounds", "2") == 1
    assert "at most 300 are played" in message_texts(server, 1)[-1]


def test_the_tokens_are_limited(capsys: Capture) -> None:
    with serve([fenced(GOOD)]) as server:
        assert write(server, "--max-tokens", "100") == 3
    assert server.requests == [] and "tokens" in capsys.readouterr().err


def test_without_a_model_the_prompt_is_written(capsys: Capture) -> None:
    assert run_command(["new", "mission", "--from", "two drones find a hiker"]) == 0
    prompt = Path("mission.prompt.md").read_text()
    assert "# .ljs on one card" in prompt and prompt.endswith("Write this mission: two drones find a hiker\n")
    assert "lingjing test mission.ljs" in capsys.readouterr().out
    assert run_command(["new", "mission", "--from", "again"]) == 2
    assert "already exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["mission", "--from", "  "], "takes a sentence"),
        (["agent", "scout", "--from", "x"], "--from writes a mission"),
        (["mission", "when", "--from", "x"], "is a word of the language"),
        (["mission", "--from", "x", "--model", "m", "--rounds", "0"], "--rounds takes 1 to 50"),
        (["mission", "--from", "x", "--model", "gpt-5.5"], "cost money"),
        (["mission", "--from", "x", "--model", "unknown-model"], "base_url"),
        (["mission", "a", "--model", "m"], "add --from"),
        (["mission"], "has no name"),
    ],
)
def test_wrong_arguments_are_usage_errors(words: list[str], why: str, capsys: Capture) -> None:
    assert run_command(["new", *words]) == 2
    assert why in capsys.readouterr().err and list(Path().iterdir()) == []


def test_the_grammar_defines_what_it_uses_and_has_no_left_recursion() -> None:
    with serve([fenced(GOOD)]) as server:
        assert write(server, "--model-arg", "grammar=structured_outputs") == 0
    grammar = server.requests[0]["structured_outputs"]["grammar"]
    plain = re.sub(r'"(?:\\.|[^"\\])*"|\[[^\]]*\]', "'", grammar)
    rules = dict(re.findall(r"^([\w-]+) ::= (.*)$", plain, re.MULTILINE))
    used = {name for body in rules.values() for name in re.findall(r"[a-z][\w-]*", body)}
    assert used <= set(rules) and "root" in rules
    for name in rules:
        reached: set[str] = set()
        waiting = [name]
        while waiting:
            for first in beginnings(rules[waiting.pop()]) - reached:
                reached.add(first)
                waiting.append(first)
        assert name not in reached, name


def beginnings(body: str) -> set[str]:
    """The rules with which a body can begin."""
    depth, at_start, names, optional = 0, True, set[str](), False
    for part in re.findall(r"[a-z][\w-]*|\)\?|[()|']", body):
        if part == "(":
            depth += 1
            optional = at_start
        elif part.startswith(")"):
            depth -= 1
            at_start = at_start or (optional and part == ")?")
        elif part == "|":
            at_start = at_start or depth == 0 or optional
        elif at_start:
            names |= {part} - {"'"}
            at_start = False
    return names
