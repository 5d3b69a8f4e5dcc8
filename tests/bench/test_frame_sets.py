"""Labelled sets of frames: labels, balance, hard negatives, splits, and readers of other projects."""

import hashlib
import json
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import PIL.Image
import pytest

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.bench.frame_sets.balance import class_set, validation_seeds
from lingjing.bench.frame_sets.folder import read_class, read_picture, set_classes, write_set
from lingjing.bench.frame_sets.labelled import labelled_frames, seen_targets
from lingjing.bench.frame_sets.sources import found_traces
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import play, run_command, sea_rescue
from tests.bench.frame_kit import BOAT, VICTIM, made_frame, picture, pictures_of

PERSON = "person_in_water"
replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sea rescue of seed 7."""
    path = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(path, ticks=60)
    return path


def files(folder: Path) -> dict[str, str]:
    """Return every file of a folder with its SHA-256."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def test_labelled_frames_have_the_true_boxes_of_the_trace_and_unique_names(episode: Path) -> None:
    trace = read_trace(episode)
    frames = list(labelled_frames(trace))
    assert [frame.frame for frame in frames] == list(trace.frames)
    assert all(frame.boxes == trace.frames[frame.frame].boxes for frame in frames)
    assert seen_targets(frames) == (PERSON,)
    assert len({frame.name for frame in frames}) == len(frames)
    assert all(frame.name.startswith("ssr-") and "[" not in frame.name for frame in frames)


def test_an_episode_that_was_cut_short_is_refused(episode: Path, tmp_path: Path) -> None:
    (tmp_path / "trace.mcap").write_bytes(episode.read_bytes()[:-2000])
    with pytest.raises(UsageError, match="cut short"):
        list(labelled_frames(read_trace(tmp_path / "trace.mcap")))


def test_a_balanced_set_has_equally_many_positives_and_negatives_and_prefers_hard_negatives() -> None:
    shown = [made_frame(number, boxes=(VICTIM,)) for number in range(4)]
    hard = [made_frame(10, reported=(PERSON,)), made_frame(11, boxes=(BOAT,))]
    plain = [made_frame(number) for number in range(20, 30)]
    faint = [made_frame(40, faint=(PERSON,))]
    made = class_set([*plain, *faint, *hard, *shown], PERSON)
    assert Counter((item.present, item.hard) for item in made.frames) == {
        (True, ""): 4, (False, "reported"): 1, (False, "other"): 1, (False, ""): 2,
    }  # fmt: skip
    assert (made.spare_positives, made.spare_negatives, made.faint) == (0, 8, 1)


def test_positive_frames_are_reduced_to_the_number_of_negative_frames() -> None:
    made = class_set([made_frame(n, boxes=(VICTIM,)) for n in range(5)] + [made_frame(9)], PERSON)
    assert sorted(item.present for item in made.frames) == [False, True]
    assert made.spare_positives == 4


def test_an_unbalanced_set_keeps_every_frame_that_is_not_faint() -> None:
    frames = [made_frame(1, boxes=(VICTIM,)), *(made_frame(n) for n in range(2, 9)), made_frame(9, faint=(PERSON,))]
    made = class_set(frames, PERSON, balanced=False)
    assert Counter(item.present for item in made.frames) == {True: 1, False: 7}
    assert (made.spare_negatives, made.faint) == (0, 1)


def test_rounding_up_validation_seeds_ignores_floating_point_errors() -> None:
    assert len(validation_seeds(range(100), 0.07)) == 7
    assert len(validation_seeds(range(100), 0.071)) == 8


def test_frames_of_missions_without_the_class_are_not_used_as_negatives() -> None:
    other = made_frame(1, targets=("fire",))
    assert class_set([made_frame(2, boxes=(VICTIM,)), other], PERSON).frames == ()


def test_training_and_validation_seeds_are_disjoint_and_each_split_is_balanced() -> None:
    frames = [
        made_frame(n, seed, boxes=(VICTIM,) if n % 3 == 0 else ()) for seed in range(2000, 2005) for n in range(9)
    ]
    made = class_set(frames, PERSON, 0.2)
    seeds = {
        split: {item.frame.seed for item in made.frames if item.split == split} for split in ("train", "validation")
    }
    assert seeds == {"train": {2000, 2001, 2002, 2003}, "validation": {2004}}
    assert [made.count(split, present=present) for split in ("train", "validation") for present in (True, False)] == [
        12, 12, 3, 3,
    ]  # fmt: skip


def test_a_limited_set_takes_frames_from_the_seeds_in_turn_for_any_input_order() -> None:
    frames = [made_frame(n, seed, boxes=(VICTIM,) if n < 6 else ()) for seed in (2000, 2001, 2002) for n in range(12)]
    made = class_set(frames, PERSON, most=3)
    assert Counter(item.frame.seed for item in made.frames if item.present) == {2000: 1, 2001: 1, 2002: 1}
    assert class_set(frames[::-1], PERSON, most=3) == made


def test_validation_seeds_are_rounded_up_and_at_least_one_seed_is_for_training() -> None:
    assert validation_seeds([5], 0.5) == frozenset()
    assert validation_seeds([1, 2], 0.2) == {2}
    assert validation_seeds(range(10), 0.2) == {8, 9}
    assert validation_seeds(range(10), 0.0) == frozenset()


@pytest.fixture
def written(tmp_path: Path) -> Path:
    frames = [made_frame(n, 2000 + n % 3, boxes=(VICTIM, BOAT) if n % 2 else ()) for n in range(12)]
    write_set(tmp_path / "set", [class_set(frames, PERSON, 0.25)], pictures_of(frames))
    return tmp_path / "set"


def test_a_set_reads_back_as_it_was_written(written: Path) -> None:
    assert set_classes(written) == (PERSON,)
    frames = read_class(written, PERSON)
    assert Counter((item.split, item.present) for item in frames) == {
        ("train", True): 4, ("train", False): 4, ("validation", True): 2, ("validation", False): 2,
    }  # fmt: skip
    assert all(read_picture(written, PERSON, item) for item in frames)


def test_an_edited_picture_of_a_set_is_reported(written: Path) -> None:
    set_frame = read_class(written, PERSON)[0]
    (written / PERSON / set_frame.split / set_frame.frame.name).write_bytes(b"edited")
    with pytest.raises(UsageError, match="not the exported picture"):
        read_picture(written, PERSON, set_frame)


def test_pycocotools_reads_and_evaluates_the_coco_file(written: Path) -> None:
    pytest.importorskip("pycocotools", reason="COCO's own reader is not installed")
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    truth = COCO(str(written / PERSON / "coco_train.json"))
    assert [each["name"] for each in truth.loadCats(truth.getCatIds())] == [PERSON]
    assert len(truth.getImgIds()) == 8
    marks = truth.loadAnns(truth.getAnnIds())
    assert {tuple(mark["bbox"]) for mark in marks} == {(16.0, 24.0, 8.0, 12.0)}
    assert {mark["area"] for mark in marks} == {60}
    for image in truth.loadImgs(truth.getImgIds()):
        assert (written / PERSON / image["file_name"]).is_file()
        assert bool(truth.getAnnIds(imgIds=[image["id"]])) == image["present"]
    detections = truth.loadRes(
        [{key: mark[key] for key in ("image_id", "category_id", "bbox")} | {"score": 0.9} for mark in marks]
    )
    judged = COCOeval(truth, detections, "bbox")
    judged.evaluate()
    judged.accumulate()
    judged.summarize()
    assert judged.stats[1] == pytest.approx(1.0)


def test_the_image_folder_lists_every_picture_and_the_card_configures_every_split(
    written: Path,
) -> None:
    for split in ("train", "validation"):
        folder = written / PERSON / split
        lines = [json.loads(line) for line in (folder / "metadata.jsonl").read_text().splitlines()]
        assert {line["file_name"] for line in lines} == {path.name for path in folder.glob("*.jpg")}
        assert all(bool(line["objects"]["bbox"]) == line["present"] for line in lines)
    card = (written / "README.md").read_text()
    head = card.split("---\n")[1]
    assert 'config_name: "person_in_water"' in head
    assert all(f'path: "person_in_water/{split}/**"' in head for split in ("train", "validation"))
    assert "| `person_in_water` | validation | 2 | 2 | 0 | 2 | ssr | 2002 |" in card


def test_a_set_with_a_picture_that_does_not_match_its_hash_leaves_no_files(tmp_path: Path) -> None:
    frames = [made_frame(1, boxes=(VICTIM,)), made_frame(2)]
    with pytest.raises(UsageError, match="does not match the hash in its trace"):
        write_set(tmp_path / "set", [class_set(frames, PERSON)], lambda name: b"other")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["../evil.jpg", "/tmp/evil.jpg", "", "..", ".hidden", "a/b.jpg", "a\0.jpg"])
def test_a_name_from_a_trace_cannot_lead_out_of_the_folder(name: str, tmp_path: Path) -> None:
    """Names of classes and missions come from traces, which are not trusted."""
    frames = [made_frame(1, boxes=(VICTIM,), name=name), made_frame(2)]
    with pytest.raises(UsageError, match="cannot be a file"):
        write_set(tmp_path / "in" / "set", [class_set(frames, PERSON)], lambda _: picture(1))
    elsewhere = replace(VICTIM, cls=name)
    frames = [made_frame(1, boxes=(elsewhere,), targets=(name,)), made_frame(2, targets=(name,))]
    with pytest.raises(UsageError, match="cannot be a file"):
        write_set(tmp_path / "in" / "set", [class_set(frames, name)], pictures_of(frames))
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_set_that_names_files_elsewhere_is_not_read(tmp_path: Path) -> None:
    frames = [made_frame(1, boxes=(VICTIM,)), made_frame(2)]
    write_set(tmp_path / "set", [class_set(frames, PERSON)], pictures_of(frames))
    file = tmp_path / "set" / PERSON / "frames.jsonl"
    file.write_text(file.read_text().replace("ssr-star-2000-00000000-f1.jpg", "/dev/zero"))
    with pytest.raises(UsageError, match="`/dev/zero` cannot be a file"):
        read_class(tmp_path / "set", PERSON)


def test_frame_names_omit_the_folder_part_of_the_missions_name(episode: Path) -> None:
    trace = read_trace(episode)
    instance = replace(trace.header.instance, mission="../../x")
    other = Trace(trace.path, replace(trace.header, instance=instance), trace.boundaries, trace.outcome, True)
    assert all(frame.name.startswith("x-") and "/" not in frame.name for frame in labelled_frames(other))


def test_a_set_is_never_written_over_another(written: Path) -> None:
    before = files(written)
    with pytest.raises(UsageError, match="already exists"):
        write_set(written, [class_set([made_frame(1)], PERSON)], pictures_of([]))
    assert files(written) == before


def test_the_command_writes_the_same_bytes_if_a_trace_is_named_twice(episode: Path, tmp_path: Path) -> None:
    every = ["--held-out", "none"]
    assert run_command(["frames", "export", str(episode), "-o", str(tmp_path / "one"), *every]) == ExitCode.OK
    assert (
        run_command(["frames", "export", str(episode.parent), str(episode), "-o", str(tmp_path / "two"), *every])
        == ExitCode.OK
    )
    assert files(tmp_path / "one") == files(tmp_path / "two")
    frames = read_class(tmp_path / "one", PERSON)
    assert 0 < sum(item.present for item in frames) == len(frames) / 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "seed 7 is reserved for evaluations"),
        (["--held-out", "none", "--classes", "whale"], "no frame shows a `whale`"),
        (["--held-out", "none", "--validation", "1"], "a share from 0 to below 1"),
        (["--held-out", "none", "--most", "0"], "--most 0: must be at least 1"),
        (["--play", "ssr", "--seeds", "100-101"], "seed 100 is reserved for evaluations"),
    ],
)
def test_wrong_export_options_are_usage_errors(
    episode: Path, tmp_path: Path, capsys, options: list[str], message: str
) -> None:  # type: ignore[no-untyped-def]
    out = tmp_path / "set"
    assert run_command(["frames", "export", str(episode), "-o", str(out), *options]) == ExitCode.USAGE
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_places_without_a_trace_are_named(tmp_path: Path) -> None:
    for place in (tmp_path, tmp_path / "absent"):
        with pytest.raises(UsageError, match=place.name):
            found_traces([place])


def test_the_recorded_instance_mask_is_exported_with_each_picture(tmp_path: Path) -> None:
    text = """
ljs 2
use std.air { quadrotor }
use std.ground { car }
use std.fire { fire_source }

mission seen "Seen" {
  goal "Look down."
  scene residential { extent = 300 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 2 }
  region yard = box((-40 m, -40 m), (40 m, 40 m))
  region far = box((100 m, 100 m), (140 m, 140 m))
  target one : fire_source { hidden position ~ sites(yard) }
  asset parked : car { position = (0 m, 2 m) }
  asset uav : quadrotor {
    position = (0 m, 20 m, 60 m)
    camera nadir { size = 160 by 120, hfov = 84 deg, channels = [rgb, instance], capture = each_tick }
  }
  agent pilot as pilot controls uav { observes uav.*, events }
  success when uav in far
}
"""
    trace = play(text, tmp_path / "run", policy="idle", seed=2000).trace
    args = ["frames", "export", str(trace.path), "-o", str(tmp_path / "set"), "--every", "--classes", "fire_source"]
    assert run_command(args) == 0
    masks = sorted((tmp_path / "set").glob("fire_source/masks_*/*.png"))
    assert masks and len(masks) == len(list((tmp_path / "set").glob("fire_source/*/*.jpg")))
    for mask in masks:
        numbers = np.asarray(PIL.Image.open(mask))
        stored = trace.picture("-".join(mask.stem.split("-")[-3:])).instance
        assert numbers.shape == (120, 160) and stored is not None and np.array_equal(numbers, stored)
