"""The check of a model over a scripted service: tokens, compliance, the convention of boxes, prices, contexts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from agents.tests.chat_server import NOOP, ChatServer, Reply, serve
from lingjing.bench.model_check import AS_ASKED, ELSEWHERE, UNREADABLE, convention_of
from lingjing.errors import ExitCode
from lingjing.testing import run_command

PIXELS = {"box": [1190, 108, 1536, 281]}


def service(request: dict[str, Any]) -> Reply:
    """Bill by letters and pictures, write boxes in pixels, and keep to the contract in one of two columns."""
    text = str(request["messages"])
    if "red rectangle" in text:
        return Reply(PIXELS)
    return Reply(NOOP if "You are `inspector`" in text else "I would rather not say.")


def check(server: ChatServer, *more: str) -> int:
    prices = ("--policy-arg", "price_in=10", "--policy-arg", "price_out=20")
    return run_command(["models", "check", "tiny", "--policy-arg", f"base_url={server.url}", *prices, *more])


@pytest.mark.slow
def test_each_column_receives_one_real_request_and_faults_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    with serve(service) as server:
        assert check(server, "--columns", "bi-single", "cd-star") == ExitCode.OK
        assert len(server.requests) == 4, "two about the picture, one in each column"
        assert {request["max_tokens"] for request in server.requests[2:]} == {2048}, "the suites' encoding"
    out = capsys.readouterr().out
    assert "boxes: pixels, x first\n" in out
    assert "a picture of 1920 x 1080: 0 tokens" in out, "the scripted service counts none for it"
    columns = {line.split()[0]: line for line in out.splitlines() if line.startswith(("bi-", "cd-"))}
    assert columns["bi-single-tier1"].endswith("used")
    assert "no valid step after 0 repairs" in columns["cd-star-tier1"]
    assert "1 of 2 answers satisfy the contract; $0.0056 in all; served as test-model" in out


@pytest.mark.slow
def test_a_context_shorter_than_the_first_request_is_rejected_before_play(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with serve([Reply(NOOP)]) as server:
        text = f'[services.here]\nbase_url = "{server.url}"\n[models.short]\nservice = "here"\nserved = "short"\n'
        (tmp_path / "models.toml").write_text(f"{text}context = 2000\nprice_in = 0.0\nprice_out = 0.0\n")
        monkeypatch.setenv("LINGJING_MODELS", str(tmp_path / "models.toml"))
        command = ["run", "bi", "--policy", "react", "--policy-arg", "model=short", "-o", str(tmp_path / "run")]
        assert run_command([*command, "--no-overview"]) != ExitCode.OK
        assert server.requests == []
        assert "has a context of 2,000 tokens, and the first request of `inspector` has at least" in (
            capsys.readouterr().err
        )
        assert run_command(["bench", "main-lite", "--models", "short", "--check"]) == ExitCode.USAGE
        assert "`short` has a context of 2,000 tokens, and the encoding `paper` needs 16,384" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("answer", "convention"),
    [
        ('{"box": [0.62, 0.1, 0.8, 0.26]}', AS_ASKED),
        ("It is at [0.1, 0.62, 0.26, 0.8].", "shares, y first"),
        ('{"box": [620, 100, 800, 260]}', "thousandths, x first"),
        ('{"box": [100, 620, 260, 800]}', "thousandths, y first"),
        ('{"box": [1190, 108, 1536, 281]}', "pixels, x first"),
        ('{"box": [0.62, 0.1, 0.18, 0.16]}', "shares, x first, width and height"),
        ('{"box": [0.1, 0.1, 0.2, 0.2]}', ELSEWHERE),
        ("There is none.", UNREADABLE),
    ],
)
def test_the_convention_of_a_box_is_recognised(answer: str, convention: str) -> None:
    assert convention_of(answer) == convention


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("models", "check", "gpt-5.55"), "did you mean"),
        (("models", "check", "mine", "--policy-arg", "base_url=http://127.0.0.1:9/v1"), "`mine` does not answer"),
        (("models", "check", "gpt-5.5", "--columns", "bi-star"), "there is no column `bi-star`"),
    ],
)
def test_models_and_columns_that_cannot_be_checked_are_usage_errors(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command([*arguments]) == ExitCode.USAGE
    assert words in capsys.readouterr().err


def test_the_list_names_every_model_with_the_tokens_of_a_picture(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["models", "list"]) == ExitCode.OK
    lines = {line.split()[0]: line.split() for line in capsys.readouterr().out.splitlines()}
    assert lines["gpt-5.5"][1:4] == ["5", "30", "2448"] and lines["kimi-k2.5"][3] == "2691"
