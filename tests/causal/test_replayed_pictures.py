"""Pictures rendered again, compared with those of a trace: changed pictures are found, differences of renderers
tolerated.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from lingjing import Trace, replay, run
from lingjing import read as read_trace
from lingjing.causal.picture_comparison import BLOCK, LEVELS_MOST, PictureWitness, picture_difference, worst_levels
from lingjing.causal.recorded import recorded_frame
from lingjing.errors import ExitCode
from lingjing.kernel.world.contract import StoredFrame
from lingjing.testing import TraceWriter, encode_jpeg, mission_file, run_command, shortened
from lingjing.testing.traces import START, next_frames_digest, verify
from lingjing.trace.records import FrameInfo
from lingjing.trace.writer import PictureParts

replace = msgspec.structs.replace
Pixels = npt.NDArray[np.uint8]


@pytest.fixture(scope="module")
def inspected(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Six ticks of an oracle that searches a leak, the last with a picture."""
    short = shortened(mission_file("upr"), 6)
    folder = tmp_path_factory.mktemp("inspected") / "episode"
    trace = read_trace(run(short, policy="oracle", seed=1, out=folder, world="inline", overview=False).trace)
    assert trace.frames
    return trace


def repainted(trace: Trace, path: Path, paint: Callable[[Pixels], Pixels], renderer: str = "") -> Trace:
    """Return a complete, sealed trace of the same records in which every picture was replaced and every hash
    matches.
    """

    def changed(info: FrameInfo) -> PictureParts:
        held = trace.picture(info.id)
        jpeg = encode_jpeg(paint(held.rgb))
        changed_info = replace(info, sha256=hashlib.sha256(jpeg).hexdigest(), renderer=renderer or info.renderer)
        return changed_info, jpeg, held.depth, held.semantic

    frames_digest = START
    with TraceWriter(path, trace.header) as writer:
        for record in trace.boundaries:
            parts = [changed(info) for info in record.frames]
            infos = tuple(part[0] for part in parts)
            frames_digest = next_frames_digest(frames_digest, infos)
            writer.boundary(replace(record, frames=infos), parts)
        assert trace.outcome is not None
        writer.finish(replace(trace.outcome, frames_digest=frames_digest))
    return read_trace(path)


def spotted(rgb: Pixels) -> Pixels:
    """Return the picture with a white square of a block's size."""
    rgb[400 : 400 + BLOCK, 600 : 600 + BLOCK] = 255
    return rgb


def dotted(rgb: Pixels) -> Pixels:
    """Return the picture with a few pixels made slightly brighter."""
    rgb[400:404, 600:604] = np.minimum(rgb[400:404, 600:604].astype(int) + 30, 255).astype(np.uint8)
    return rgb


def test_replaced_pictures_of_a_sealed_trace_differ_on_the_same_renderer(
    inspected: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forged = repainted(inspected, tmp_path / "trace.mcap", dotted)
    assert verify(forged, pixels=True) is None
    call = ["replay", "--world", "inline", "--pictures", str(forged.path)]
    assert run_command(call) == ExitCode.MISSION
    output = capsys.readouterr().out
    first = next(iter(inspected.frames.values()))
    assert f"differs at boundary {first.tick}" in output
    assert f"camera: frames[{first.id}].pixels" in output and "pixels differ on the same renderer" in output


def test_pictures_of_another_renderer_are_compared_with_a_tolerance(inspected: Trace, tmp_path: Path) -> None:
    near = repainted(inspected, tmp_path / "near.mcap", dotted, renderer="another")
    result = replay(near, world="inline", draw=True)
    assert result.difference is None and result.confirmed == result.boundaries
    assert "recorded with another" in result.pixels
    far = repainted(inspected, tmp_path / "far.mcap", spotted, renderer="another")
    other = replay(far, world="inline", draw=True).difference
    assert other is not None and other.engine == "camera" and f"the tolerance is {LEVELS_MOST:g}" in other.replayed


def test_equal_pictures_have_no_difference_and_a_missing_picture_is_reported(inspected: Trace) -> None:
    frame = recorded_frame(inspected, next(iter(inspected.frames)))
    assert picture_difference(inspected, frame) == ""
    lost = Trace(inspected.path, inspected.header, inspected.boundaries, inspected.outcome, True, {})
    assert "the picture" in picture_difference(lost, frame) and "is missing in" in picture_difference(lost, frame)


def test_a_stored_picture_that_does_not_match_its_hash_differs_on_any_renderer(
    inspected: Trace, tmp_path: Path
) -> None:
    forged = repainted(inspected, tmp_path / "trace.mcap", lambda rgb: rgb, renderer="another")
    records = tuple(
        replace(record, frames=tuple(replace(frame, sha256="0" * 64) for frame in record.frames))
        for record in forged.boundaries
    )
    lying = Trace(forged.path, forged.header, records, forged.outcome, True, forged.places)
    frame = recorded_frame(inspected, next(iter(inspected.frames)))
    assert "does not match the recorded hash" in picture_difference(lying, frame)


def test_boxes_of_another_renderer_are_compared_with_a_tolerance(inspected: Trace) -> None:
    frame = recorded_frame(inspected, next(iter(inspected.frames)))
    (box, *rest) = frame.info.boxes
    counted = replace(box, pixels=box.pixels + 1)
    moved = replace(box, box=(box.box[0] + 0.02, *box.box[1:]))

    def drawn(*boxes: object) -> StoredFrame:
        info = replace(frame.info, renderer="another", boxes=boxes)
        return StoredFrame(info, frame.jpeg, frame.depth, frame.semantic)

    witness = PictureWitness(inspected)
    assert witness(drawn(counted, *rest)).info == frame.info and witness.differing is None
    assert "differs by more than 0.5%" in picture_difference(inspected, drawn(moved, *rest))
    assert "visible in only one" in picture_difference(inspected, drawn(*rest))


def test_the_worst_block_decides_for_any_picture_size() -> None:
    for shape in ((40, 50, 3), (5, 3, 3), (BLOCK, BLOCK, 3)):
        black = np.zeros(shape, np.uint8)
        other = black.copy()
        other[-BLOCK:, -BLOCK:] = 100
        assert worst_levels(black, black) == 0.0
        assert worst_levels(black, other) > LEVELS_MOST
