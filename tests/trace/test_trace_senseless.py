"""A well-formed trace of an impossible episode is rejected with the reason."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.mission.instance import Clock
from lingjing.testing import TraceWriter, run_command, sea_rescue
from lingjing.trace.records import Header


def with_clock(tick_s: float, sync_s: float) -> Header:
    header = sea_rescue.header()
    clock = Clock(tick_s=tick_s, sync_s=sync_s)
    return msgspec.structs.replace(header, instance=msgspec.structs.replace(header.instance, clock=clock))


def with_camera(**changes: float) -> Header:
    header = sea_rescue.header()
    entities = tuple(
        msgspec.structs.replace(
            entity, cameras=tuple(msgspec.structs.replace(camera, **changes) for camera in entity.cameras)
        )
        for entity in header.instance.entities
    )
    return msgspec.structs.replace(header, instance=msgspec.structs.replace(header.instance, entities=entities))


def written(folder: Path, header: Header) -> Path:
    """Return a sealed trace of six ticks with this header."""
    with TraceWriter(folder / "trace.mcap", header) as writer:
        steps = list(sea_rescue.episode(6, 64, 36))
        for record, pictures in steps:
            writer.boundary(record, pictures)
        return writer.finish(sea_rescue.outcome_of([record for record, _ in steps]))


@pytest.mark.parametrize(
    ("header", "fault"),
    [
        (with_clock(0.0, 0.5), "tick = 0 s and sync = 0.5 s must be above 0"),
        (with_clock(-10.0, 0.5), "tick = -10 s and sync = 0.5 s must be above 0"),
        (with_clock(10.0, 0.0), "tick = 10 s and sync = 0 s must be above 0"),
        (with_clock(10.0, 1e-300), "tick = 10 s has 1e+301 steps of sync = 1e-300 s, at most 100,000 are possible"),
        (with_camera(width=0), "the camera `nadir` of `uav[1]` is 0 x 360 pixels, 84 degrees wide"),
        (with_camera(hfov_deg=180.0), "the camera `nadir` of `uav[1]` is 640 x 360 pixels, 180 degrees wide"),
    ],
)
def test_an_impossible_header_is_rejected(tmp_path: Path, header: Header, fault: str) -> None:
    path = written(tmp_path, header)
    with pytest.raises(UsageError) as error:
        read_trace(path)
    assert str(error.value) == f"{path} describes no episode: {fault}"


@pytest.mark.parametrize("verb", ["metrics", "why", "view", "film", "replay", "report", "blame", "value"])
def test_no_command_crashes_for_a_tick_of_length_zero(
    tmp_path: Path, verb: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, with_clock(0.0, 0.5))
    output = {"view": ["-o", "out.html"], "film": ["-o", "out.mp4"], "report": ["-o", "out.html"]}.get(verb, [])
    assert run_command([verb, str(path), *output]) in {1, 2, 3}
    assert "describes no episode: tick = 0 s" in "".join(capfd.readouterr())
    assert [item.name for item in tmp_path.iterdir()] == ["trace.mcap"]
