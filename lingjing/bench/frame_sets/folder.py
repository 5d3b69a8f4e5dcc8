"""A frame set as a folder: pictures, COCO annotations, a Hugging Face image folder and its card; written and read back.

    SET/README.md                         the card, with a configuration for each class
    SET/CLASS/frames.jsonl                what is known of each frame: `SetFrame`, one a line
    SET/CLASS/coco_train.json             COCO, file names relative to SET/CLASS; coco_validation.json beside it
    SET/CLASS/train/metadata.jsonl        for Hugging Face's `imagefolder`, beside the pictures; validation/ likewise
    SET/CLASS/train/NAME.jpg              the stored bytes of the trace

The folder appears whole or not at all, and is a function of its frames.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from lingjing.bench.frame_sets.balance import SPLITS, ClassSet, SetFrame, Split
from lingjing.bench.frame_sets.card import frame_card
from lingjing.errors import UsageError
from lingjing.scene.atomic_folder import folder_beside
from lingjing.trace.records import Box

FRAMES = "frames.jsonl"
CARD = "README.md"

PixelBounds = tuple[float, float, float, float]
"""COCO's box: left, top, width and height in pixels."""


def write_set(target: Path, sets: Sequence[ClassSet], jpeg: Callable[[str], bytes], about: str = "") -> None:
    """Write class sets; `jpeg` gives a frame's picture by its name.

    Raises `UsageError` if the folder cannot be written or holds something already, if a picture is not the one that
    its frame speaks of, or if a class or a frame has a name that no file should have: both come from traces.
    """
    with new_folder(target) as folder:
        for one in sets:
            _write_class(folder / _plain(one.cls), one, jpeg)
        (folder / CARD).write_text(frame_card(sets, about), encoding="utf-8")


def check_new(target: Path) -> None:
    """Raise `UsageError` if something else than an empty folder is there already."""
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UsageError(f"`{target}` is there already", hint="nothing is overwritten: name a new folder")


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """A folder to fill, which is at `target` in the end, whole or not at all.

    Raises `UsageError` if it cannot be written, or as `check_new` does.
    """
    check_new(target)
    target = target.absolute()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with folder_beside(target) as folder:
            yield folder
            folder.replace(target)
    except OSError as error:
        raise UsageError(
            f"cannot write `{target}`: {error.strerror}", hint="name another folder, or make room"
        ) from error


def _write_class(folder: Path, one: ClassSet, jpeg: Callable[[str], bytes]) -> None:
    folder.mkdir()
    encoder = msgspec.json.Encoder()
    (folder / FRAMES).write_bytes(b"".join(encoder.encode(frame) + b"\n" for frame in one.frames))
    for split in SPLITS:
        mine = [each for each in one.frames if each.split == split]
        (folder / split).mkdir()
        for each in mine:
            picture = jpeg(each.frame.name)
            if hashlib.sha256(picture).hexdigest() != each.frame.sha256:
                raise UsageError(f"the picture of {each.frame.name} is not the one that its trace speaks of")
            (folder / split / _plain(each.frame.name)).write_bytes(picture)
        (folder / f"coco_{split}.json").write_text(json.dumps(coco(one.cls, mine), indent=1) + "\n", encoding="utf-8")
        lines = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in _metadata(one.cls, mine))
        (folder / split / "metadata.jsonl").write_text(lines, encoding="utf-8")


def _plain(name: str) -> str:
    """The name of a file in a folder, which leads nowhere else. Raises `UsageError` for any other."""
    if not re.fullmatch(r"\w[\w.-]{0,199}", name):
        raise UsageError(f"a frame set has no file `{name[:200]}`", hint="names hold letters, digits, `_`, `.` and `-`")
    return name


def coco(cls: str, frames: Iterable[SetFrame]) -> dict[str, Any]:
    """COCO's annotations of one class. `area` are the visible pixels of a target, as a mask's would be."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, one in enumerate(frames, 1):
        frame = one.frame
        size = {"width": frame.pose.width, "height": frame.pose.height}
        told = {"present": one.present, "hard": one.hard, "mission": frame.mission, "seed": frame.seed}
        images.append({"id": number, "file_name": f"{one.split}/{frame.name}", **size, **told})
        annotations += [
            {
                "id": len(annotations) + place, "image_id": number, "category_id": 1, "bbox": pixel_bounds(one, box),
                "area": box.pixels, "iscrowd": 0,
            }
            for place, box in enumerate(frame.shows(cls), 1)
        ]  # fmt: skip
    return {
        "info": {"description": f"frames with and without {cls}, from episodes of Lingjing"},
        "licenses": [],
        "images": images,
        "annotations": annotations,
        "categories": [{"id": 1, "name": cls, "supercategory": "target"}],
    }


def pixel_bounds(one: SetFrame, box: Box) -> PixelBounds:
    """A normalised box in COCO's form, to a hundredth of a pixel."""
    wide, high = one.frame.pose.width, one.frame.pose.height
    x0, y0, x1, y1 = box.box
    return round(x0 * wide, 2), round(y0 * high, 2), round((x1 - x0) * wide, 2), round((y1 - y0) * high, 2)


def _metadata(cls: str, frames: Iterable[SetFrame]) -> Iterator[dict[str, Any]]:
    for one in frames:
        boxes = [list(pixel_bounds(one, box)) for box in one.frame.shows(cls)]
        yield {
            "file_name": one.frame.name,
            "present": one.present,
            "hard": one.hard,
            "objects": {"bbox": boxes, "category": [cls] * len(boxes)},
            "mission": one.frame.mission,
            "seed": one.frame.seed,
            "camera": one.frame.camera,
        }


def set_classes(folder: Path) -> tuple[str, ...]:
    """The classes of a set's folder. Raises `UsageError` if it is none."""
    found = tuple(sorted(path.parent.name for path in folder.glob(f"*/{FRAMES}")))
    if not found:
        raise UsageError(f"`{folder}` is no frame set", hint="`lingjing frames export` makes one")
    return found


def read_class(folder: Path, cls: str) -> tuple[SetFrame, ...]:
    """The frames of one class. Raises `UsageError` if they cannot be read."""
    file = folder / cls / FRAMES
    try:
        frames = tuple(msgspec.json.decode(line, type=SetFrame) for line in file.read_bytes().splitlines())
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise UsageError(f"`{file}` is not what this version writes: {error}", hint="export the set again") from error
    for one in frames:
        _plain(one.frame.name)
    return frames


def read_picture(folder: Path, cls: str, one: SetFrame) -> bytes:
    """The picture of a frame. Raises `UsageError` if it is gone or another one."""
    file = folder / cls / one.split / one.frame.name
    try:
        found = file.read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error
    if hashlib.sha256(found).hexdigest() != one.frame.sha256:
        raise UsageError(f"`{file}` is not the picture that was exported", hint="edited ones go into a folder of twins")
    return found


__all__ = ["Split", "coco", "pixel_bounds", "read_class", "read_picture", "set_classes", "write_set"]
