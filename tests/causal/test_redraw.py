"""A picture rendered after the episode equals the one that the camera took, or would have taken."""

from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import Trace, run
from lingjing import read as read_trace
from lingjing.analysis.page_pictures import best_frames, sort_by_camera, unrecorded_frames
from lingjing.causal.redraw import redraw
from lingjing.cli import missionpage
from lingjing.testing import mission_file, shipped_missions, shortened

pytestmark = pytest.mark.slow

replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Two ticks of a dog in front of a house, with a picture at every tick."""
    short = shortened(mission_file("vdn"), 2)
    folder = tmp_path_factory.mktemp("walk") / "episode"
    return read_trace(run(short, policy="random", seed=1, out=folder, world="inline", overview=False).trace)


def test_a_redrawn_picture_equals_the_picture_of_the_trace(walk: Trace) -> None:
    frames = [frame for frame in walk.frames.values() if frame.camera == "front"]
    assert len(frames) >= 2
    wanted = [(frame.entity, "front", walk.boundaries[frame.tick]) for frame in frames]
    again = list(redraw(walk, wanted))
    assert [picture.info.sha256 for picture in again] == [frame.sha256 for frame in frames]
    assert [picture.info.boxes for picture in again] == [frame.boxes for frame in frames]


def test_a_picture_of_an_unused_camera_is_drawn_after_the_episode(walk: Trace) -> None:
    frames = best_frames([walk])
    assert [shown.info.camera for shown in sort_by_camera(frames)] == ["front", "reference"]
    assert unrecorded_frames(walk, frames, redraw) == []
    (shown,) = unrecorded_frames(walk, [frame for frame in frames if frame.info.camera != "front"], redraw)
    assert (shown.info.entity, shown.info.camera, shown.agent) == ("dog", "front", "navigator")
    assert shown.jpeg.startswith(b"\xff\xd8") and "drawn after the episode" in shown.caption
    assert "drawn after the episode" not in next(frame for frame in frames if frame.info.camera == "front").caption


def test_no_pictures_are_drawn_if_the_city_differs_from_that_of_the_trace(walk: Trace) -> None:
    other = Trace(walk.path, replace(walk.header, city_sha256="0"), walk.boundaries, walk.outcome, True, walk.places)
    assert unrecorded_frames(other, [], redraw) == []


def test_a_mission_page_shows_an_unused_camera(walk: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blind = tuple(replace(record, frames=()) for record in walk.boundaries)
    bare = Trace(walk.path, walk.header, blind, walk.outcome, True, walk.places)
    monkeypatch.setattr(missionpage, "_trace", lambda path, mission: bare)
    mission = lingjing.compile(next(path for path in shipped_missions() if path.stem == "vdn"))
    page = missionpage.write_page(mission, [walk.path], (), tmp_path).read_text(encoding="utf-8")
    assert "(vdn-dog-front.jpg)" in page and "drawn after the episode" in page
    assert (tmp_path / "vdn-dog-front.jpg").stat().st_size > 5000
