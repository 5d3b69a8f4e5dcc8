"""Accepted and rejected twins, and counts, F1 and tables of the probe, computed by hand."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lingjing.bench.frame_sets.balance import class_set
from lingjing.bench.frame_sets.folder import read_class, write_set
from lingjing.bench.frame_sets.probe import Confusion, ProbedFrame, probe_cell, probe_table, probed
from lingjing.bench.frame_sets.twins import TWINS, import_twins, read_twins, twin_picture
from lingjing.errors import ExitCode, UsageError
from lingjing.plugins.frame_detector import FrameAnswer, FrameQuestion
from lingjing.testing import encode_jpeg, run_command
from lingjing.trace.records import Box
from tests.bench.frame_kit import POSE, made_frame

PERSON = "person_in_water"
BOX = (0.25, 0.25, 0.5, 0.75)
SCENE = {1: BOX, 2: BOX, 3: None, 4: None}
"""The box of the target in each frame by number; None for a frame without a target."""


def drawn(number: int, *, photo: bool = False, box: tuple[float, float, float, float] | None = BOX) -> np.ndarray:
    """Draw waves and a target; as a photo with other colours, noise and less contrast."""
    rows, columns = np.mgrid[0:48, 0:64]
    grey = 90 + 25 * np.sin(columns / 5 + number) + 15 * np.cos(rows / 4)
    if box is not None:
        x0, y0, x1, y1 = (round(share * side) for share, side in zip(box, (64, 48, 64, 48), strict=True))
        grey[y0:y1, x0:x1] = 230
    if photo:
        grey = 40 + 0.7 * grey + np.random.default_rng(number).normal(0, 3, grey.shape)
    colours = (0.8, 1.0, 0.9) if photo else (0.7, 0.9, 1.0)
    return np.clip(np.stack([grey * gain for gain in colours], axis=2), 0, 255).astype(np.uint8)


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A set of two frames with a target and two without."""
    import hashlib

    pictures = {n: encode_jpeg(drawn(n, box=box)) for n, box in SCENE.items()}
    frames = [
        made_frame(
            n, sha256=hashlib.sha256(pictures[n]).hexdigest(),
            boxes=() if box is None else (Box(entity="victim[1]", cls=PERSON, box=box, pixels=300, contrast=90.0),),
        )
        for n, box in SCENE.items()
    ]  # fmt: skip
    write_set(tmp_path / "set", [class_set(frames, PERSON)], {f.name: pictures[f.tick] for f in frames}.__getitem__)
    return tmp_path / "set"


def edit(made: Path, edits: Mapping[int, np.ndarray | bytes]) -> Path:
    """Make a folder with edits by the numbers of their frames."""
    import PIL.Image

    folder = made.parent / "edited"
    folder.mkdir()
    for item in read_class(made, PERSON):
        change = edits.get(item.frame.tick)
        if isinstance(change, bytes):
            (folder / f"{Path(item.frame.name).stem}.png").write_bytes(change)
        elif change is not None:
            PIL.Image.fromarray(change).save(folder / f"{Path(item.frame.name).stem}.png")
    return folder


def refused(made: Path, **edits: np.ndarray | bytes) -> dict[int, str]:
    """Return the reasons of rejected edits by the numbers of their frames (`e1`)."""
    numbers = {int(name[1:]): picture for name, picture in edits.items()}
    twins = import_twins(made, edit(made, numbers), made.parent / "twins", {})
    names = {item.frame.name: item.frame.tick for item in read_class(made, PERSON)}
    return {names[item.name]: item.reason for item in twins.refused}


def good() -> dict[str, np.ndarray | bytes]:
    return {f"e{n}": drawn(n, photo=True, box=box) for n, box in SCENE.items()}


def test_edits_that_keep_the_scene_become_twins(made: Path) -> None:
    assert refused(made, **good()) == {}
    twins = read_twins(made.parent / "twins")
    assert len(twins.taken) == 4
    assert all(twin_picture(made.parent / "twins", item) for item in twins.taken)


@pytest.mark.parametrize(
    ("edited", "reasons"),
    [
        ({"e1": b"no picture"}, {1: "unreadable"}),
        ({"e1": drawn(1, photo=True)[:40]}, {1: "size"}),
        ({"e1": drawn(1, photo=True, box=None)}, {1: "target"}),
        ({"e3": np.random.default_rng(5).integers(0, 255, (48, 64, 3)).astype(np.uint8)}, {3: "view"}),
    ],
)
def test_edits_that_change_more_than_the_appearance_are_rejected_with_the_reason(
    made: Path, edited: dict[str, np.ndarray | bytes], reasons: dict[int, str]
) -> None:
    assert refused(made, **{**good(), **edited}) == reasons


def test_unchanged_and_missing_edits_are_rejected(made: Path) -> None:
    from lingjing.testing import decode_jpeg

    same = decode_jpeg(encode_jpeg(drawn(1)))
    assert refused(made, **{**good(), "e1": same, "e3": None}) == {1: "unchanged", 3: "missing"}  # type: ignore[arg-type]


def test_a_list_of_rejections_is_applied_with_its_reasons_and_must_name_frames_of_the_set(made: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    folder = edit(made, {n: drawn(n, photo=True, box=box) for n, box in SCENE.items()})
    name = read_class(made, PERSON)[0].frame.name
    listed = made.parent / "refused.csv"
    listed.write_text(f'{name},"a second person, added"\n')
    out = made.parent / "twins"
    command = ["frames", "twins", str(made), str(folder), "-o", str(out), "--refuse", str(listed)]
    assert run_command(command) == ExitCode.OK
    assert "3 twins imported, 1 edits rejected: 1 a second person, added" in capsys.readouterr().out
    assert [item.reason for item in read_twins(out).refused] == ["a second person, added"]
    listed.write_text("another.jpg,why\n")
    assert run_command([*command[:-3], str(made.parent / "more"), *command[-2:]]) == ExitCode.USAGE
    assert "is not a frame of the set" in capsys.readouterr().err
    assert not (made.parent / "more").exists()


def test_a_changed_twin_and_a_wrong_file_of_twins_are_reported(made: Path) -> None:
    refused(made, **good())
    folder = made.parent / "twins"
    twin = read_twins(folder).taken[0]
    (folder / twin.file).write_bytes(b"other")
    with pytest.raises(UsageError, match="has changed since"):
        twin_picture(folder, twin)
    (folder / TWINS).write_text("{}")
    with pytest.raises(UsageError, match="has not the form of this version"):
        read_twins(folder)


def probed_frame(n: int, truth: bool, frame: bool, twin: bool | None = None) -> ProbedFrame:
    return ProbedFrame(detector="d", cls=PERSON, name=str(n), truth=truth, said=frame, twin_said=twin)


def test_f1_is_computed_from_confusion_counts_as_in_the_paper() -> None:
    """Frames: TP 3, FN 1, FP 1, TN 3 → 6/8. Twins: TP 1, FN 3, FP 0, TN 4 → 2/5."""
    answers = [
        *(probed_frame(n, True, n < 3, n < 1) for n in range(4)),
        *(probed_frame(n, False, n == 4, False) for n in range(4, 8)),
    ]
    cell = probe_cell(answers)
    assert cell.frames == Confusion(true_positives=3, false_positives=1, false_negatives=1, true_negatives=3)
    assert cell.twins == Confusion(true_positives=1, false_positives=0, false_negatives=3, true_negatives=4)
    assert (cell.f1, cell.twin_f1) == (pytest.approx(6 / 8), pytest.approx(2 / 5))
    assert cell.difference == pytest.approx(2 / 5 - 6 / 8)
    assert cell.difference_bounds.low < cell.difference < cell.difference_bounds.high <= 1.0
    assert cell.f1_bounds.low < 6 / 8 < cell.f1_bounds.high


def test_only_frames_with_a_twin_count_if_there_are_twins() -> None:
    cell = probe_cell([probed_frame(1, True, True, True), probed_frame(2, True, False, None)])
    assert (cell.pairs, cell.counted, cell.f1, cell.twin_f1, cell.difference) == (1, 1, 1.0, 1.0, 0.0)


def test_the_difference_is_absent_without_twins_and_f1_is_absent_without_positives() -> None:
    cell = probe_cell([probed_frame(1, False, False)])
    assert (cell.pairs, cell.f1, cell.twins, cell.difference) == (0, None, None, None)
    assert math.isnan(cell.f1_bounds.low)
    (line,) = probe_table([cell]).lines
    assert [each.text for each in line.cells] == ["1", "N/A", "–", "–", "N/A", "N/A", "0"]


@dataclass
class Bright:
    """A detector that reports a target in a picture with a bright pixel, with a half-right box, and fails on dark
    pictures.
    """

    limit: int = 215

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        assert question.rgb.shape == (48, 64, 3)
        assert question.pose == POSE
        if question.rgb.max() < 60:
            return FrameAnswer(False, failure="too dark")
        yes = bool(question.rgb.max() > self.limit)
        return FrameAnswer(yes, ((0.25, 0.25, 0.5, 0.75), (0.0, 0.0, 0.1, 0.1)) if yes else ())


def test_a_detector_answers_frames_and_twins_and_its_boxes_are_scored(made: Path) -> None:
    edits = good() | {"e2": drawn(2, photo=True) // 8}
    refused(made, **edits)
    folder = made.parent / "twins"
    twins = {item.name: (folder, item) for item in read_twins(folder).taken}
    answers = list(probed(made, PERSON, read_class(made, PERSON), ("bright", Bright()), twins))
    by_number = {item.name.rsplit("-f", 1)[1]: item for item in answers}
    assert {name: (item.truth, item.said, item.twin_said) for name, item in by_number.items()} == {
        "1.jpg": (True, True, False), "2.jpg": (True, True, False), "3.jpg": (False, False, False),
        "4.jpg": (False, False, False),
    }  # fmt: skip
    cell = probe_cell(answers)
    assert (cell.precision, cell.recall, cell.unanswered) == (0.5, 1.0, 1)


def test_the_command_runs_a_shipped_detector_and_writes_its_answers(made: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    out = tmp_path / "probe"
    assert run_command(["frames", "probe", str(made), "--detector", "colours", "-o", str(out)]) == ExitCode.OK
    assert "| colours |" in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == [
        "answers.jsonl", "counts.json", "table.csv", "table.html", "table.md", "table.tex",
    ]  # fmt: skip
    (counts,) = json.loads((out / "counts.json").read_text())
    assert sum(counts["frames"].values()) == 4
    assert run_command(["frames", "probe", str(made), "--detector", "colours", "-o", str(out)]) == ExitCode.USAGE
    assert "already exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--detector", "nose"], "no detector is called `nose`"),
        (["--detector", "colours", "--detector-arg", "size=3"], "size"),
        (["--detector", "model"], "model"),
        (["--classes", "whale"], "the set has no `whale`"),
        (["--split", "validation"], "no frame to test"),
        (["--twins", "."], "holds no twins"),
    ],
)
def test_wrong_probe_options_are_usage_errors(made: Path, capsys, options: list[str], message: str) -> None:  # type: ignore[no-untyped-def]
    assert run_command(["frames", "probe", str(made), *options]) == ExitCode.USAGE
    assert message in capsys.readouterr().err
