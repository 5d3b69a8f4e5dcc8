"""A Rerun recording, read back by Rerun itself. It contains hidden targets only on request."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lingjing import Trace
from lingjing.errors import UsageError
from lingjing.viewer.rerun_recording import write_rerun


def reader_output(path: Path, *options: str) -> str:
    """Return the output of Rerun's own reader for a file, after it has verified the file."""
    for words in (("verify", str(path)), ("print", *options, str(path))):
        done = subprocess.run(
            [sys.executable, "-m", "rerun", "rrd", *words], capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("truth", [False, True])
def test_the_recording_has_the_content_of_the_trace(trace: Trace, tmp_path: Path, truth: bool) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: run `make readers`")
    first = min(record.tick for record in trace.boundaries if record.events)
    short = Trace(trace.path, trace.header, trace.boundaries[:first], None, False, trace.places)
    write_rerun(short, tmp_path / "episode.rrd", truth=truth)
    content = reader_output(tmp_path / "episode.rrd")
    for path in ("world/bodies/uav_1", "world/cameras/uav_1/nadir/rgb", "score/score", "agents/scout_1/thought",
                 "world/regions/search", "map/boat", "world/trails/uav_1"):  # fmt: skip
        assert path in content
    assert ("victim_1" in content) is truth and ("/rgb/truth" in content) is truth
    assert [file.name for file in tmp_path.iterdir()] == ["episode.rrd"]


def test_a_found_target_appears_and_reported_boxes_are_drawn(trace: Trace, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: run `make readers`")
    write_rerun(trace, tmp_path / "episode.rrd", truth=False)
    content = reader_output(tmp_path / "episode.rrd")
    assert (
        "world/bodies/victim_1" in content
        and "/rgb/reported" in content
        and "log/kernel" in content
        and "/rgb/truth" not in content
    )
    for body, timed in (
        ("victim_1", True),
        ("uav_1", False),
    ):  # a marker without a time is at the origin until its target is found
        marker = reader_output(tmp_path / "episode.rrd", "-vv", "--entity", f"/world/bodies/{body}/marker")
        assert "Boxes3D:labels" in marker and ("simulation" in marker) is timed


def test_a_failed_write_is_an_error(trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "rerun", None)
        with pytest.raises(UsageError, match="needs rerun-sdk") as caught:
            write_rerun(trace, tmp_path / "episode.rrd", truth=False)
        assert caught.value.hint == "pip install 'rerun-sdk>=0.41'"
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: run `make readers`")
    with pytest.raises(UsageError, match=r"an \.rrd file"):
        write_rerun(trace, tmp_path / "episode.mcap", truth=False)
    with pytest.raises(UsageError, match=r"cannot write .*No such file"):
        write_rerun(trace, tmp_path / "no" / "episode.rrd", truth=False)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_an_error(trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed: run `make readers`")

    def full(*_: object, **__: object) -> None:
        raise RuntimeError("File-writer thread shut down prematurely")

    monkeypatch.setattr(rerun.RecordingStream, "flush", full)
    short = Trace(trace.path, trace.header, trace.boundaries[:1], None, False, trace.places)
    with pytest.raises(UsageError, match="File-writer thread") as caught:
        write_rerun(short, tmp_path / "episode.rrd", truth=False)
    assert "make room" in str(caught.value.hint) and not list(tmp_path.iterdir())
