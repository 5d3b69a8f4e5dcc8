"""`lingjing view`: one file, or a server until an interrupt."""

from __future__ import annotations

import http.client
import importlib.util
import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from lingjing.testing import sea_rescue
from tools.python_forks import run_python

VIEW = (sys.executable, "-m", "lingjing.cli.main", "view")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(target, ticks=8)
    return target


def view(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return run_python([*VIEW, *map(str, arguments)], timeout=600)


def test_the_page_is_written_as_one_file(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "episode.html"
    done = view(path, "-o", out)
    assert (done.returncode, done.stdout) == (0, "") and f"wrote {out}" in done.stderr
    assert out.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert view(path, "-o", "-", "--pictures", "0").stdout.startswith("<!doctype html>")


def test_wrong_arguments_give_a_message(path: Path, tmp_path: Path) -> None:
    for arguments, message in (
        ((path, "--port", "70000"), "--port 70000 is not a whole number from 0 to 65535"),
        ((path, "--pictures", "-1"), "--pictures"),
        ((tmp_path / "none.mcap",), "cannot read the trace"),
        ((path, "-o", tmp_path), "is a folder"),
        ((path, "-o", tmp_path / "no" / "x.html"), "cannot write"),
        ((path, "-o", tmp_path / "x.txt"), "the page is an .html file"),
        ((path, "--foxglove", "-o", tmp_path / "x.html"), "a layout for Foxglove is a .json file"),
    ):
        done = view(*arguments)
        assert done.returncode == 2 and message in done.stderr, done.stderr
        assert "Traceback" not in done.stderr


def test_metrics_count_a_file_with_several_names_once(path: Path, tmp_path: Path) -> None:
    (tmp_path / "link.mcap").symlink_to(path)
    command = [sys.executable, "-m", "lingjing.cli.main", "metrics", path, tmp_path / "link.mcap", path]
    done = run_python([*map(str, command), "--output-format", "json"], timeout=600)
    document = json.loads(done.stdout)
    assert [item["trace"] for item in document["episodes"]] == [str(path)] and document["together"]["episodes"] == 1
    assert done.stderr.splitlines() == [
        f"note: {tmp_path / 'link.mcap'} is the file {path} and counts once",
        f"note: {path} is named twice and counts once",
    ]


def test_a_damaged_file_is_reported_as_a_partial_trace(path: Path, tmp_path: Path) -> None:
    cut = tmp_path / "trace.mcap"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    of_folder = ("view", cut.parent, "-o", tmp_path / "y.html")
    for arguments in (("view", cut, "-o", tmp_path / "x.html"), ("metrics", cut), of_folder):
        command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
        done = run_python(command, timeout=600)
        assert done.returncode == 0 and f"note: {cut} " in done.stderr and "without an outcome" in done.stderr


def test_no_output_replaces_a_trace_or_an_input_file(path: Path, tmp_path: Path) -> None:
    trace, other, mission = tmp_path / "trace.mcap", tmp_path / "other.mcap", tmp_path / "m.ljs"
    shutil.copy(path, trace)
    shutil.copy(path, other)
    source = (Path(__file__).parents[2] / "scenarios" / "bi.ljs").read_text(encoding="utf-8")
    mission.write_text(source, encoding="utf-8")
    (tmp_path / "link.html").symlink_to(trace)
    for arguments, message in (
        (("view", trace, "-o", trace), "this command reads it"),
        (("view", trace, "-o", tmp_path / "link.html"), "this command reads it"),
        (("view", trace, "-o", other), "it holds a trace, which is never replaced"),
        (("view", trace, "--foxglove", "-o", other), "it holds a trace, which is never replaced"),
        (("metrics", trace, "-o", trace), "this command reads it"),
        (("report", trace, "-o", other), "it holds a trace, which is never replaced"),
        (("compile", mission, "--emit", "mission", "-o", mission), "this command reads it"),
    ):
        command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
        done = run_python(command, timeout=600)
        assert done.returncode == 2 and f"cannot write `{arguments[-1]}`: {message}" in done.stderr, done.stderr
    assert trace.read_bytes() == other.read_bytes() == path.read_bytes()
    assert mission.read_text(encoding="utf-8") == source


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_the_server_answers_until_it_is_ended(path: Path, end: signal.Signals) -> None:
    process = subprocess.Popen(
        [*VIEW, str(path), "--no-open"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(
            signal.SIGINT, signal.default_int_handler
        ),  # a shell's background job ignores it
    )
    assert process.stdout is not None and process.stderr is not None
    url = process.stdout.readline().strip()
    host, _, rest = url.removeprefix("http://").partition("/")
    connection = http.client.HTTPConnection(host, timeout=300)
    connection.request("GET", f"/{rest}")
    assert connection.getresponse().read().startswith(b"<!doctype html>")
    process.stderr.readline()
    process.send_signal(end)
    _, errors = process.communicate(timeout=600)
    assert "Traceback" not in errors
    assert process.returncode == 0


def test_other_viewers_get_their_files_and_wrong_arguments_give_a_message(path: Path, tmp_path: Path) -> None:
    layout = tmp_path / "layout.json"
    assert view(path, "--foxglove", "-o", layout).returncode == 0 and '"configById"' in layout.read_text()
    for arguments, message in (
        ((path, "--foxglove", "--rerun"), "not allowed with"),
        ((path, "--rerun", "-o", tmp_path / "x.mcap"), ".rrd" if importlib.util.find_spec("rerun") else "rerun-sdk"),
        ((path, "--rerun", "--follow"), "--rerun shows a finished episode"),
        ((path, "--follow", "-o", tmp_path / "x.html"), "remove one of them"),
        ((path, "--foxglove", "-o", tmp_path / "no" / "x.json"), "cannot write"),
    ):
        done = view(*arguments)
        assert done.returncode == 2 and message in done.stderr, done.stderr
        assert "Traceback" not in done.stderr


def test_a_trace_is_served_to_foxglove_until_an_interrupt(path: Path) -> None:
    process = subprocess.Popen(
        [*VIEW, str(path), "--foxglove", "--no-open"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stdout is not None and process.stderr is not None
    link = process.stdout.readline().strip()
    url = urlsplit(parse_qs(urlsplit(link).query)["ds.url"][0])
    connection = http.client.HTTPConnection(url.netloc, timeout=300)
    connection.request("GET", f"{url.path}?{url.query}", headers={"Range": "bytes=1-4"})
    assert connection.getresponse().read() == b"MCAP"
    process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 0 and "Traceback" not in errors
