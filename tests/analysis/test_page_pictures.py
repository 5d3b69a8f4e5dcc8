"""The best picture of each camera, and the map."""

from pathlib import Path

import msgspec
import numpy as np
from PIL import Image

from lingjing import Trace
from lingjing.analysis.page_pictures import BEST_SHARE, FRAME_WIDTH, best_frames, draw_trails, write_frame

replace = msgspec.structs.replace


def test_each_kind_of_camera_is_shown_once_with_a_target_in_view(trace: Trace) -> None:
    frames = best_frames([trace])
    kinds = {(frame.entity.partition("[")[0], frame.camera) for frame in trace.frames.values()}
    assert len(frames) == len(kinds)
    assert {(shown.info.entity.partition("[")[0], shown.info.camera) for shown in frames} == kinds
    assert any(shown.targets for shown in frames)
    for shown in frames:
        assert shown.agent in shown.caption and str(shown.info.tick) in shown.caption
        assert all(target in shown.caption for target in shown.targets)


def resized(trace: Trace, shares: dict[str, float]) -> Trace:
    """Return the trace with target boxes of the given shares of the picture, by frame. Other frames have no boxes."""
    target = next(entity.id for entity in trace.header.instance.entities if entity.role == "target")
    boundaries = []
    for record in trace.boundaries:
        frames = []
        for frame in record.frames:
            box = next((box for box in frame.boxes if box.entity == target), None)
            sized = () if frame.id not in shares or box is None else (_sized(box, frame, shares[frame.id]),)
            frames.append(replace(frame, boxes=sized))
        boundaries.append(replace(record, frames=tuple(frames)))
    return Trace(trace.path, trace.header, tuple(boundaries), trace.outcome, True, trace.places)


def _sized(box, frame, share):  # type: ignore[no-untyped-def]
    whole = frame.pose.width * frame.pose.height
    return replace(box, box=(0.4, 0.4, 0.6, 0.6), pixels=round(share * whole))


def test_the_chosen_picture_shows_its_target_neither_tiny_nor_too_large(trace: Trace) -> None:
    target = next(entity.id for entity in trace.header.instance.entities if entity.role == "target")
    seen = [frame.id for frame in trace.frames.values() if any(box.entity == target for box in frame.boxes)]
    assert len(seen) >= 2
    for other in (0.0002, 0.9):
        shares = {seen[0]: other, seen[1]: BEST_SHARE}
        (shown,) = [shown for shown in best_frames([resized(trace, shares)]) if shown.targets]
        assert shown.info.id == seen[1]


def test_a_frame_is_written_at_page_width_with_a_box(trace: Trace, tmp_path: Path) -> None:
    shown = next(shown for shown in best_frames([trace]) if shown.targets)
    write_frame(shown, tmp_path / "with.jpg")
    picture = Image.open(tmp_path / "with.jpg")
    assert picture.width <= FRAME_WIDTH
    pixels = np.asarray(picture.convert("RGB"), int)
    green = (pixels[..., 1] - pixels[..., 0] > 70) & (pixels[..., 1] - pixels[..., 2] > 40)
    assert green.sum() > 20


def test_the_map_is_drawn(trace: Trace, tmp_path: Path) -> None:
    draw_trails(trace, tmp_path / "map.png")
    picture = np.asarray(Image.open(tmp_path / "map.png").convert("RGB"), int)
    assert picture.shape[1] > 1000 and picture.std() > 5
