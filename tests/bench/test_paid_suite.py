"""A suite with a model over HTTP: cost is counted, the limit holds, and the record replays without the service."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from lingjing_agents.llm.models import read_models
from lingjing_agents.llm.picture_tokens import jpeg_size

from agents.tests.chat_server import NOOP, Reply, completion, reading_model, serve
from lingjing.errors import ExitCode
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import TRIP, SuiteEpisode, estimates, read_plan, read_results

SUITE = """
suite = 1
name = "paid"
missions = ["short.ljs"]
seeds = [1]
tables = ["cost"]

[[entrants]]
name = "tester"
policy = "react"
args = { model = "test-model", base_url = "URL", price_in = 10, price_out = 20, max_tokens = 64 }
"""


@pytest.mark.slow
def test_costs_are_counted_the_limit_holds_and_recorded_calls_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "short.ljs").write_text(TRIP)
    suite, out = tmp_path / "paid.toml", tmp_path / "out"
    with serve(lambda request: Reply(NOOP)) as server:
        suite.write_text(SUITE.replace("URL", server.url))
        play = ["bench", str(suite), "-o", str(out)]
        assert run_command([*play, "--max-cost", "0.001"]) == ExitCode.USAGE, "less than one call may cost"
        assert (
            "the rest of $0.001 may not pay for another call ($0.00 spent): 1 of 1 episodes are not played"
            in capsys.readouterr().err
        )
        assert read_results(out) == [] and server.requests == []
        assert run_command([*play, "--max-cost", "5"]) == ExitCode.OK
        requests = len(server.requests)
    rows = read_results(out)
    assert [(row.standing, row.tries, row.report.metrics.calls) for row in rows] == [("counted", 1, 3)]
    assert requests == 3 and rows[0].report.metrics.cost_usd == pytest.approx(3 * (100 * 10 + 20 * 20) / 1e6)
    assert all((out / row.report.trace).with_name("calls.sqlite").is_file() for row in rows)
    again = ["bench", str(suite), "-o", str(tmp_path / "again"), "--calls", "replay", "--calls-from", str(out)]
    assert run_command(again) == ExitCode.OK, "the service is gone"
    replayed = read_results(tmp_path / "again")
    assert [(row.seed, row.policy_seed, row.report.digest) for row in replayed] == [
        (row.seed, row.policy_seed, row.report.digest) for row in rows
    ]


LISTED = """
[services.lab]
base_url = "URL"
cache_from = 1024
cache_step = 128

[models.counted]
service = "lab"
served = "counted"
pictures = "openai"
context = 272_000
price_in = 2.5
price_cached = 0.25
price_out = 15.0
"""

COUNTED = """
suite = 1
name = "counted"
missions = ["cd", "OTHER"]
columns = ["cd-broadcast", "OTHER-MODE"]
seeds = [3]
tables = ["cost"]

[args]
encoding = "paper"

[[entrants]]
model = "counted"
"""


TALK = (
    "The picture shows a street between two rows of houses, and nothing that looks like the target. "
    "I would have to fly on to see more, and the others have not written since the last tick. "
    "So I wait for a better moment and do nothing now. "
)
"""Three sentences, as the prompt allows."""


def talkative(model: Callable[[dict[str, Any]], Reply]) -> Callable[[dict[str, Any]], Reply]:
    """Return the model with three sentences before each step, and without reports: no episode of it is won."""

    def answer(request: dict[str, Any]) -> Reply:
        reply = model(request)
        return Reply({**reply.step, "thought": TALK, "messages": []})

    return answer


class CountingService:
    """A service that bills as a provider does: text by a real tokenizer, pictures by the rule of the model family, and
    prefixes of earlier requests at the price of cached tokens."""

    def __init__(self, model: Callable[[dict[str, Any]], Reply]) -> None:
        self._model = model
        self._read: set[str] = set()
        self._rule = read_models().pictures["openai"]

    def __call__(self, request: dict[str, Any]) -> Reply:
        reply, counted, cached, prefix = self._model(request), 0, 0, ""
        for message in request["messages"]:
            content = message["content"]
            parts = [{"type": "text", "text": content}] if isinstance(content, str) else content
            for part in parts:
                if part["type"] == "text":
                    counted += tokens(part["text"])
                else:
                    data = base64.b64decode(part["image_url"]["url"].split(",", 1)[1])
                    counted += self._rule.count(jpeg_size(data))
            prefix += json.dumps(message)
            cached = counted if prefix in self._read else cached
            self._read.add(prefix)
        body = completion(reply)
        answer = tokens(body["choices"][0]["message"]["content"])
        body["usage"] = {
            "prompt_tokens": counted, "completion_tokens": answer,
            "prompt_tokens_details": {"cached_tokens": cached // 128 * 128 if cached >= 1024 else 0},
        }  # fmt: skip
        return Reply(body=json.dumps(body))


@cache
def _tokenizer() -> Any:
    tokenizers = pytest.importorskip("tokenizers")
    package = find_spec("litellm")
    if package is None or package.origin is None:
        pytest.skip("litellm is not installed, which brings a tokenizer")
    file = Path(package.origin).parent / "litellm_core_utils" / "tokenizers" / "anthropic_tokenizer.json"
    return tokenizers.Tokenizer.from_file(str(file))


def tokens(text: str) -> int:
    return len(_tokenizer().encode(text, add_special_tokens=False).ids)


@pytest.mark.thorough
@pytest.mark.parametrize(("wins", "other"), [(True, "upr-star"), (False, "bi-single")])
def test_the_estimate_is_within_one_and_a_half_times_of_what_a_service_bills(
    wins: bool, other: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The model wins `cd` and `upr` with few words; in `bi` it writes as much as it may, and uses all ticks."""
    _tokenizer()
    suite, out = tmp_path / "counted.toml", tmp_path / "out"
    text = COUNTED if wins else COUNTED.replace('"cd", ', "").replace('"cd-broadcast", ', "")
    suite.write_text(text.replace("OTHER-MODE", other).replace("OTHER", other.partition("-")[0]))
    service = CountingService(reading_model() if wins else talkative(reading_model()))
    with serve(service) as server:
        (tmp_path / "models.toml").write_text(LISTED.replace("URL", server.url))
        monkeypatch.setenv("LINGJING_MODELS", str(tmp_path / "models.toml"))
        plan = read_plan(suite, PluginHost())
        (estimate,) = estimates([SuiteEpisode(cell, 3) for cell in plan.cells], plan.missions, (), PluginHost())
        assert run_command(["bench", str(suite), "-o", str(out), "--max-cost", "50"]) == ExitCode.OK
    metrics = [row.report.metrics for row in read_results(out)]
    billed, calls = sum(part.cost_usd for part in metrics), sum(part.calls for part in metrics)
    expected = estimate.usual if wins else estimate.full
    assert expected.cost_usd is not None and estimate.most.cost_usd is not None
    print(f"estimated {expected.calls:.0f} calls, ${expected.cost_usd:.3f}; billed {calls}, ${billed:.3f}")
    assert calls / 1.5 <= expected.calls <= calls * 1.5, (expected, calls)
    assert billed / 1.5 <= expected.cost_usd <= billed * 1.5, (expected, billed)
    assert billed < estimate.most.cost_usd and calls <= estimate.most.calls
