"""A real model, end to end and offline: SmolLM2-135M over HTTP plays six ticks of the sea rescue in each mode.

It plays badly, and what it scores is reported as it is: the test is of everything between a mission and a model. Run by
`make model`, which installs the model and its server; minutes on an idle processor.
"""

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import read as read_trace
from lingjing.testing import recorded_calls
from lingjing.testing.expressions import Number

PYTHON = os.environ.get("LINGJING_MODEL_PYTHON", "")
TICKS = 6
AGENTS = {"star": 3, "broadcast": 2}

pytestmark = [
    pytest.mark.model,
    pytest.mark.timeout(4 * 3600),  # two minutes on an idle processor, more than half an hour on one that forty share
    pytest.mark.skipif(not PYTHON, reason="`make model` installs the model and runs this"),
]


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    command = [PYTHON, str(Path(__file__).with_name("model_server.py"))]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, text=True, **pipes) as server:
        assert server.stdout is not None
        yield server.stdout.readline().strip()
        server.kill()


def models(folder: Path, url: str) -> Path:
    """Return an own table of models: the model repeats itself endlessly without a penalty for repetition."""
    path = folder / "models.toml"
    path.write_text(
        f'[services.local]\nbase_url = "{url}"\nconcurrency = 1\n'
        '[models.smollm2-135m]\nservice = "local"\nserved = "smollm2"\nimages = false\ncontext = 5120\n'
        "price_in = 0.0\nprice_out = 0.0\nextra_body = { repeat_penalty = 1.3, repeat_last_n = 256 }\n"
    )
    return path


@pytest.mark.parametrize("mode", ["broadcast", "star"])
def test_a_real_model_plays_six_ticks_and_again_without_its_server(mode: str, url: str, tmp_path: Path) -> None:
    mission = lingjing.compile("ssr")
    budget = msgspec.structs.replace(mission.budget, ticks=Number(value=float(TICKS)), policy=Number(value=3600.0))
    mission = msgspec.structs.replace(mission, budget=budget)
    arguments = {
        "model": "smollm2-135m", "models": models(tmp_path, url), "deadline": "3500", "max_tokens": "160",
        "prompt": "P0", "repairs": "0", "history_tokens": "400",
    }  # fmt: skip
    options = {
        "policy": "react", "policy_args": arguments, "mode": mode, "settings": {"uavs": 1.0, "victims": 1.0},
        "overview": False, "world": "inline",
    }  # fmt: skip
    played = lingjing.run(mission, out=tmp_path / "played", **options)
    assert (played.reason, played.ticks) in (("budget", TICKS), ("success", played.ticks))
    assert played.metrics is not None
    calls = recorded_calls(tmp_path / "played")
    assert len(calls) == played.metrics.calls == TICKS * AGENTS[mode]
    assert all(call.result is not None and call.result.completion_tokens > 0 for call in calls)
    assert all(json.loads(call.head)["repeat_penalty"] == 1.3 for call in calls)
    decisions = [made for record in read_trace(played.trace).boundaries for made in record.decisions]
    valid = sum(not made.substituted for made in decisions)
    print(
        f"\n{mode}: won {played.success}, SCR {played.scr:.2f}, {valid} of {len(decisions)} steps valid, "
        f"{played.metrics.tokens} tokens in {len(calls)} calls"
    )
    again = lingjing.run(mission, out=tmp_path / "again", calls="replay", calls_from=tmp_path / "played", **options)
    assert (again.digest, again.scr, again.warnings) == (played.digest, played.scr, played.warnings)
