"""The page of model calls and the log of Inspect, of a real record; in a browser where one is installed."""

from __future__ import annotations

import base64
import json
import urllib.request
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import lingjing
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing.errors import ExitCode
from lingjing.testing import mission_file, run_command
from lingjing.viewer.server import ViewServer
from lingjing.viewer.trace_source import TraceSource
from tests.browser import PROGRAM, browser, opened

HOSTILE = "</script><script>document.title='taken'</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bridge inspection of some ticks, with pictures, a hostile thought and one answer that is no JSON."""
    path = tmp_path_factory.mktemp("calls") / "bi.ljs"
    text = mission_file("bi").read_text().replace("ticks <= 60", "ticks <= 4")
    assert "ticks <= 4" in text
    path.write_text(text)
    replies = [Reply(NOOP), Reply({**NOOP, "thought": HOSTILE}), Reply("I see nothing."), Reply(NOOP)]
    with serve(replies) as server:
        arguments = {"model": "tiny", "base_url": server.url, "encoding": "paper", "price_in": 10, "price_out": 20}
        lingjing.run(path, policy="react", policy_args=arguments, overview=False, out=path.parent / "run")
    return path.parent / "run"


def content(page: str) -> dict[str, Any]:
    data = page.split('id="d-calls">', 1)[1].split("<", 1)[0]
    return json.loads(zlib.decompress(base64.b64decode(data)))


def test_the_page_has_each_call_with_its_pictures_and_its_decision(episode: Path, tmp_path: Path) -> None:
    out = tmp_path / "calls.html"
    assert run_command(["calls", str(episode), "--html", str(out)]) == ExitCode.OK
    page = out.read_text()
    listed = content(page)
    assert [call["tick"] for call in listed["calls"]] == [0, 1, 2, 3]
    assert [call["spent_tokens"] for call in listed["calls"]] == [120, 240, 360, 480]
    assert listed["calls"][3]["spent_usd"] == pytest.approx(4 * (100 * 10 + 20 * 20) / 1e6)
    assert [call["decision"].get("substituted", "") for call in listed["calls"]] == ["", "", "policy_error", ""]
    assert "no valid step after 0 repairs" in listed["calls"][2]["decision"]["detail"]
    assert any(message["pictures"] for call in listed["calls"] for message in call["messages"])
    assert page.count('id="d-picture-') == listed["pictures"] > 0
    assert "http" not in page.split("<script>")[-1], "the page sends no requests"
    assert HOSTILE not in page and "Content-Security-Policy" in page
    assert run_command(["calls", str(episode), "--html", str(out), "--pictures-mb", "0", "--tick", "1"]) == ExitCode.OK
    fewer = out.read_text()
    assert len(content(fewer)["calls"]) == 1 and 'id="d-picture-' not in fewer
    assert content(fewer)["notes"] == ["The pictures are not in this file."]


@contextmanager
def shown(folder: Path) -> Iterator[ViewServer]:
    server = ViewServer(TraceSource(lingjing.read(folder / "trace.mcap"), truth=False))
    try:
        yield server
    finally:
        server.close()


def test_the_viewer_serves_the_page_only_with_its_token(episode: Path, tmp_path: Path) -> None:
    with shown(episode) as server:
        with urllib.request.urlopen(server.url) as answer:
            assert '"calls":true' in answer.read().decode()
        with urllib.request.urlopen(server.address("/calls")) as answer:
            assert len(content(answer.read().decode())["calls"]) == 4
            assert "script-src 'sha256-" in answer.headers["Content-Security-Policy"]
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(server.address("/calls").partition("?")[0])
        assert refused.value.code == 403
    alone = tmp_path / "trace.mcap"
    alone.write_bytes((episode / "trace.mcap").read_bytes())
    with shown(tmp_path) as server, pytest.raises(urllib.error.HTTPError) as missing:
        urllib.request.urlopen(server.address("/calls"))
    assert missing.value.code == 404


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--html", "a.html", "--inspect", "b.eval"), "--html and --inspect write one file each"),
        (("--inspect", "calls.txt"), "a log of Inspect is an .eval or .json file"),
        (("--html", "nowhere/a.html"), "nowhere"),
        (("--html", "a.html", "--pictures-mb", "many"), "--pictures-mb"),
    ],
)
def test_an_output_that_cannot_be_written_is_a_usage_error(
    arguments: tuple[str, ...], words: str, episode: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert run_command(["calls", str(episode), *arguments]) == ExitCode.USAGE
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(find_spec("inspect_ai") is None, reason="inspect_ai is not installed: pip install inspect_ai")
def test_inspect_reads_the_log_with_messages_pictures_and_scores(episode: Path, tmp_path: Path) -> None:
    from inspect_ai.log import read_eval_log

    out = tmp_path / "calls.eval"
    assert run_command(["calls", str(episode), "--inspect", str(out)]) == ExitCode.OK
    log = read_eval_log(str(out))
    assert log.samples is not None and len(log.samples) == 1
    (sample,) = log.samples
    models = [event for event in sample.events if event.event == "model"]
    assert [event.metadata["tick"] for event in models] == [0, 1, 2, 3]
    assert [event.output.completion for event in models][2] == "I see nothing."
    assert sample.scores is not None and sample.scores["success"].value == "I"
    assert log.stats.model_usage["tiny"].total_tokens == 480
    assert any(part.type == "image" for event in models for part in event.input[-1].content if part.type != "text")
    made = [event.data for event in sample.events if event.event == "info"]
    assert made[2]["substituted"] == "policy_error"


@pytest.mark.skipif(not PROGRAM or find_spec("playwright") is None, reason="no browser is installed: `make browser`")
def test_the_page_is_searched_and_read_in_a_browser(episode: Path, tmp_path: Path) -> None:
    out = tmp_path / "calls.html"
    assert run_command(["calls", str(episode), "--html", str(out)]) == ExitCode.OK
    with browser() as chromium, opened(chromium, out.as_uri()) as page:
        page.wait_for_selector("html[data-ready]")
        assert page.locator("#list li").count() == 4
        page.keyboard.press("ArrowDown")
        assert page.locator("#call h2").inner_text().startswith("tick 1")
        assert page.title() != "taken"
        page.fill("#words", "see nothing")
        page.wait_for_selector("#list li:nth-child(1):last-child")
        assert page.locator("#found").inner_text() == "1 of 4 calls"
        assert page.locator("#call mark").count() > 0
        assert "replaced by a no-op" in page.locator(".checks").inner_text()
        page.fill("#words", "")
        page.select_option("#kind", "odd")
        page.wait_for_selector("#list li:nth-child(1):last-child")
        page.select_option("#kind", "pictures")
        page.wait_for_selector("#call img")
        assert page.evaluate("document.querySelector('#call img').naturalWidth") > 0
    with shown(episode) as server, browser() as chromium, opened(chromium, server.url) as page:
        page.wait_for_selector("html[data-ready]")
        with page.expect_popup() as popup:
            page.click("#calls")
        popup.value.wait_for_selector("html[data-ready]")
        assert popup.value.locator("#list li").count() == 4
