"""The folder of a frame set: pictures, COCO annotations, a Hugging Face image folder and a card.

    SET/README.md                         the card, with a configuration for each class
    SET/croissant.json                    the files, fields and checksums for MLCommons' readers
    SET/CLASS/frames.jsonl                the labels of each frame: one `SetFrame` per line
    SET/CLASS/coco_train.json             COCO, file names relative to SET/CLASS; coco_validation.json beside it
    SET/CLASS/train/metadata.jsonl        for Hugging Face's `imagefolder`, beside the pictures; validation/ likewise
    SET/CLASS/train/NAME.jpg              the stored bytes of the trace
    SET/CLASS/masks_train/NAME.png        the instance mask, if the camera stores one; masks_validation/ likewise

The folder is complete or absent, and is a function of its frames.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from lingjing.bench.croissant import CROISSANT, frames_croissant
from lingjing.bench.dataset_card import PAPER, seed_ranges
from lingjing.bench.exports import escape_markdown
from lingjing.bench.frame_sets.balance import SPLITS, ClassSet, SetFrame, Split
from lingjing.decoding import from_json
from lingjing.errors import UsageError
from lingjing.scene.atomic_folder import folder_beside
from lingjing.trace.records import Box

FRAMES = "frames.jsonl"
CARD = "README.md"

PixelBounds = tuple[float, float, float, float]
"""COCO's box: left, top, width and height in pixels."""


def write_set(
    target: Path,
    sets: Sequence[ClassSet],
    jpeg: Callable[[str], bytes],
    about: str = "",
    mask: Callable[[str], bytes | None] = lambda name: None,
) -> None:
    """Write class sets; `jpeg` returns a frame's picture by its name, `mask` its instance mask as PNG, None without.

    Raises `UsageError` if the folder cannot be written or is not empty, if a picture does not match its frame, or if a
    class or a frame has an unsafe file name: both come from traces.
    """
    with new_folder(target) as folder:
        for class_set in sets:
            _write_class(folder / _plain(class_set.cls), class_set, jpeg, mask)
        (folder / CARD).write_text(_frame_card(sets, about), encoding="utf-8")
        card = frames_croissant(folder, [class_set.cls for class_set in sets], SPLITS)
        (folder / CROISSANT).write_text(card, encoding="utf-8")


def check_new(target: Path) -> None:
    """Raise `UsageError` unless the path is free or an empty folder."""
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UsageError(f"`{target}` already exists", hint="nothing is overwritten: name a new folder")


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """Yield a folder to fill, which is moved to `target` at the end, so that `target` is complete or absent.

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


def _write_class(
    folder: Path, class_set: ClassSet, jpeg: Callable[[str], bytes], mask: Callable[[str], bytes | None]
) -> None:
    folder.mkdir()
    encoder = msgspec.json.Encoder()
    (folder / FRAMES).write_bytes(b"".join(encoder.encode(frame) + b"\n" for frame in class_set.frames))
    for split in SPLITS:
        mine = [each for each in class_set.frames if each.split == split]
        (folder / split).mkdir()
        for each in mine:
            picture = jpeg(each.frame.name)
            if hashlib.sha256(picture).hexdigest() != each.frame.sha256:
                raise UsageError(f"the picture of {each.frame.name} does not match the hash in its trace")
            (folder / split / _plain(each.frame.name)).write_bytes(picture)
            numbers = mask(each.frame.name)
            if numbers is not None:
                (folder / f"masks_{split}").mkdir(exist_ok=True)
                (folder / f"masks_{split}" / _plain(each.frame.name)).with_suffix(".png").write_bytes(numbers)
        (folder / f"coco_{split}.json").write_text(
            json.dumps(coco(class_set.cls, mine), indent=1) + "\n", encoding="utf-8"
        )
        lines = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in _metadata(class_set.cls, mine))
        (folder / split / "metadata.jsonl").write_text(lines, encoding="utf-8")


def _plain(name: str) -> str:
    """Return the name if it is a plain file name. Raises `UsageError` for any other."""
    if not re.fullmatch(r"\w[\w.-]{0,199}", name):
        raise UsageError(
            f"`{name[:200]}` cannot be a file of a frame set", hint="names hold letters, digits, `_`, `.` and `-`"
        )
    return name


def coco(cls: str, frames: Iterable[SetFrame]) -> dict[str, Any]:
    """Return COCO's annotations of one class. `area` is the number of visible pixels of a target, as of a mask."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, item in enumerate(frames, 1):
        frame = item.frame
        size = {"width": frame.pose.width, "height": frame.pose.height}
        labels = {"present": item.present, "hard": item.hard, "mission": frame.mission, "seed": frame.seed}
        images.append({"id": number, "file_name": f"{item.split}/{frame.name}", **size, **labels})
        annotations += [
            {
                "id": len(annotations) + place, "image_id": number, "category_id": 1, "bbox": _pixel_bounds(item, box),
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


def _pixel_bounds(item: SetFrame, box: Box) -> PixelBounds:
    """Return a normalised box in COCO's form, rounded to 0.01 pixels."""
    wide, high = item.frame.pose.width, item.frame.pose.height
    x0, y0, x1, y1 = box.box
    return round(x0 * wide, 2), round(y0 * high, 2), round((x1 - x0) * wide, 2), round((y1 - y0) * high, 2)


def _metadata(cls: str, frames: Iterable[SetFrame]) -> Iterator[dict[str, Any]]:
    for item in frames:
        boxes = [list(_pixel_bounds(item, box)) for box in item.frame.shows(cls)]
        yield {
            "file_name": item.frame.name,
            "present": item.present,
            "hard": item.hard,
            "objects": {"bbox": boxes, "category": [cls] * len(boxes)},
            "mission": item.frame.mission,
            "seed": item.frame.seed,
            "camera": item.frame.camera,
        }


def set_classes(folder: Path) -> tuple[str, ...]:
    """Return the classes of a set's folder. Raises `UsageError` for another folder."""
    classes = tuple(sorted(path.parent.name for path in folder.glob(f"*/{FRAMES}")))
    if not classes:
        raise UsageError(f"`{folder}` is not a frame set", hint="`lingjing frames export` makes one")
    return classes


def read_class(folder: Path, cls: str) -> tuple[SetFrame, ...]:
    """Return the frames of one class. Raises `UsageError` if they cannot be read."""
    file = folder / cls / FRAMES
    try:
        frames = tuple(from_json(line, SetFrame) for line in file.read_bytes().splitlines())
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise UsageError(f"`{file}` has not the form of this version: {error}", hint="export the set again") from error
    for item in frames:
        _plain(item.frame.name)
    return frames


def read_picture(folder: Path, cls: str, item: SetFrame) -> bytes:
    """Return the picture of a frame. Raises `UsageError` if it is missing or has changed."""
    file = folder / cls / item.split / item.frame.name
    try:
        picture = file.read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error
    if hashlib.sha256(picture).hexdigest() != item.frame.sha256:
        raise UsageError(f"`{file}` is not the exported picture", hint="put edited pictures into a folder of twins")
    return picture


def _frame_card(sets: Sequence[ClassSet], about: str = "") -> str:
    """Return the card in Markdown, with the YAML header that dataset hubs read."""
    return "\n".join([*_card_head(sets), *_card_counts(sets, about), *_card_choice(), *_card_limits()]) + "\n"


def _card_head(sets: Sequence[ClassSet]) -> Iterator[str]:
    size = sum(len(class_set.frames) for class_set in sets)
    yield "---"
    yield 'pretty_name: "Lingjing frames"'
    yield "task_categories: [object-detection, image-classification]"
    yield "tags: [simulation, aerial-imagery, hard-negatives]"
    yield f"size_categories: [{'n<1K' if size < 1000 else '1K<n<10K' if size < 10000 else '10K<n<100K'}]"
    yield "configs:"
    for class_set in sets:
        yield f"- config_name: {json.dumps(class_set.cls)}"
        yield "  data_files:"
        for split in SPLITS:
            if any(each.split == split for each in class_set.frames):
                yield f"  - {{split: {split}, path: {json.dumps(f'{class_set.cls}/{split}/**')}}}"
    yield "---"
    yield "\n# Lingjing frames\n"


def _card_counts(sets: Sequence[ClassSet], about: str) -> Iterator[str]:
    if about:
        yield f"{escape_markdown(' '.join(about.split()))}\n"
    yield f"Frames of simulated cameras from episodes of missions in simulated cities, as specified in *{PAPER}*.\n"
    yield "| class | split | with a target | without | of these hard | boxes | missions | seeds |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | --- | --- |"
    for of_class in sets:
        for split in SPLITS:
            mine = [item for item in of_class.frames if item.split == split]
            boxes = sum(len(item.frame.shows(of_class.cls)) for item in mine)
            missions = ", ".join(sorted({item.frame.mission for item in mine})) or "–"
            hard = Counter(item.hard for item in mine if item.hard)
            listed = ", ".join(f"{number} {name}" for name, number in sorted(hard.items())) or "0"
            seeds = seed_ranges({item.frame.seed for item in mine}) or "–"
            with_target, without = (of_class.count(split, present=present) for present in (True, False))
            yield (
                f"| `{of_class.cls}` | {split} | {with_target} | {without} "
                f"| {listed} | {boxes} | {missions} | {seeds} |"
            )
    yield ""
    for of_class in sets:
        yield (
            f"- `{of_class.cls}`: left out {of_class.spare_positives} frames with a target and "
            f"{of_class.spare_negatives} without for balance, and {of_class.faint} with faint targets only"
        )
    policies = sorted({item.frame.policy for of_class in sets for item in of_class.frames})
    yield f"- policies: {escape_markdown(', '.join(policies)) or 'none'}"


def _card_choice() -> Iterator[str]:
    yield "\n## How frames were chosen\n"
    yield "- A target counts as visible if the engine drew enough of its pixels with enough contrast (ADR 0012)."
    yield "- As many frames without a target as with one, in each split; no seed is in both splits."
    yield "- Hard negatives come first: `reported` if a policy falsely reported a target there, `other` if another"
    yield "  entity of the mission is in view. Each seed gives one frame in turn."
    yield "- `coco_*.json` is COCO with boxes in pixels, `area` visible pixels; `metadata.jsonl` is for `imagefolder`."


def _card_limits() -> Iterator[str]:
    yield "\n## Limits\n"
    yield "- The frames were taken by policies during missions: they are not a random sample of the city."
    yield "- Frames of one episode are correlated: count episodes, not frames."
    yield "- The pictures are rendered. Results may not transfer to photographs."


__all__ = ["Split", "coco", "read_class", "read_picture", "set_classes", "write_set"]
