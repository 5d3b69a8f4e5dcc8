"""Faults of services and of lists of models are reported plainly, and the episode is kept."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from lingjing_agents.llm.models import UNKNOWN_PICTURES, read_models, shipped_picture_rules
from lingjing_agents.react.options import ReactOptions

from agents.tests.agent_kit import Inbox, brief, observe, react
from agents.tests.chat_server import NOOP, Reply, completion, serve
from lingjing.errors import ExitCode, UsageError
from lingjing.plugins.policy import NoDecisionError
from lingjing.testing import run_command
from tests.bench.suite_kit import TRIP, read_results


async def acted(step: Any, **more: str) -> Any:
    with serve([step if isinstance(step, Reply) else Reply(step)]) as server:
        policy = react(model="m", base_url=server.url, encoding="paper", tries="1", **more)
        await policy.reset(brief("scout[1]"))
        return await policy.act(observe("scout[1]", 0), Inbox())


async def test_a_chinese_thought_is_accepted_and_chinese_field_names_are_rejected() -> None:
    decision = await acted({**NOOP, "thought": "海面上没有人,等下一张照片。"})
    assert decision.thought == "海面上没有人,等下一张照片。"
    with pytest.raises(NoDecisionError) as refused:
        await acted({"想法": "没有人", "命令": None, "消息": []})
    assert "no valid step after 0 repairs; last fault:" in str(refused.value)
    with pytest.raises(NoDecisionError, match="last fault:"):
        await acted("我看不到任何人。")


async def test_the_error_about_a_large_picture_names_the_option_image_side() -> None:
    too_large = Reply(status=413, body='{"error": "image exceeds 1024 x 1024"}')
    with pytest.raises(NoDecisionError, match=r"answered 413.*image exceeds 1024 x 1024.*image_side"):
        await acted(too_large)
    with pytest.raises(NoDecisionError, match=r"answered 400.*image_side"):
        await acted(Reply(status=400, body='{"error": "the image is too large: at most 1024 pixels"}'))


def test_pictures_of_an_unknown_model_are_counted_by_all_shipped_rules() -> None:
    options = ReactOptions(model="never-heard-of", base_url="http://127.0.0.1:9/v1")
    assert options.profile.pictures == UNKNOWN_PICTURES
    assert options.profile.counted == shipped_picture_rules()


def test_an_unknown_picture_rule_in_a_list_of_models_is_reported_with_the_known_rules(tmp_path: Path) -> None:
    file = tmp_path / "models.toml"
    file.write_text('[models.mine]\nservice = "vllm"\nserved = "mine"\npictures = "llava"\n')
    with pytest.raises(UsageError, match=r"mine\.pictures: no rule for pictures is called `llava`; there are: "):
        read_models(file)


SUITE = """
suite = 1
name = "changing"
missions = ["short.ljs"]
seeds = [1, 2, 3]
tables = ["cost"]

[[entrants]]
name = "tester"
policy = "react"
args = { model = "test-model", base_url = "URL", price_in = 0, price_out = 0, max_tokens = 64 }
"""


@pytest.mark.slow
def test_a_service_that_changes_its_model_during_a_suite_is_reported_and_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "short.ljs").write_text(TRIP)
    suite, out, requests = tmp_path / "changing.toml", tmp_path / "out", []

    def answer(request: dict[str, Any]) -> Reply:
        requests.append(request)
        body = completion(Reply(NOOP)) | {"model": "tiny-0801" if len(requests) <= 6 else "tiny-0815"}
        return Reply(body=json.dumps(body))

    with serve(answer) as server:
        suite.write_text(SUITE.replace("URL", server.url))
        assert run_command(["bench", str(suite), "-o", str(out)]) == ExitCode.OK
    captured = capsys.readouterr()
    assert "warning: the service of tester names `tiny-0815` now, and before `tiny-0801`" in captured.err
    assert "the service of tester changed its model: it named tiny-0801 in 2, tiny-0815 in 1 episodes" in captured.out
    assert {(row.seed, row.served, row.standing) for row in read_results(out)} == {
        (1, "tiny-0801", "counted"), (2, "tiny-0801", "counted"), (3, "tiny-0815", "counted"),
    }  # fmt: skip
