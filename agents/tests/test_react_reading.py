"""Whole episodes of a "model" that knows what its requests say and nothing else: what they say suffices to act."""

from pathlib import Path

import pytest

import lingjing
from agents.tests.chat_server import serve
from agents.tests.text_reader import ReadingModel
from lingjing import metrics
from lingjing import read as read_trace
from lingjing.testing import mission_file


@pytest.mark.study
@pytest.mark.parametrize(
    ("name", "mode", "done"),
    [
        ("ssr", "star", {"detect", "locate", "handoff", "execute"}),
        ("cd", "broadcast", {"execute"}),
        ("ld", "star", {"inspect", "drive"}),  # the dog's last leg is led by depth pictures, which no model is sent
    ],
)
def test_what_requests_say_suffices_to_act(name: str, mode: str, done: set[str], tmp_path: Path):
    with serve(ReadingModel()) as server:
        result = lingjing.run(
            mission_file(name),
            mode=mode,
            seed=1,
            policy="react",
            policy_args={"model": "reader", "base_url": server.url, "history_tokens": "0"},
            out=tmp_path / "run",
        )
    found = metrics(read_trace(result.trace))
    assert (found.json_compliance, found.substitutions) == (1.0, 0)
    assert {stage.name for stage in found.stages if stage.done == stage.required} >= done
    assert result.success == (name != "ld"), (result.reason, result.scr)
