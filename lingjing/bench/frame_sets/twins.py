"""Twins: edited pictures of a set's frames with another appearance and the same entities at the same places.

A twin inherits the labels of its frame, so an edit that moved, removed or added a target must be rejected. Measured
are the size, that the picture has changed, and that the outlines of the whole view and of each target are at their
places. Other errors, such as an added target, are found by a
person, in a list of names with reasons. Rejected edits are stored with their reasons.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.bench.frame_sets.balance import SetFrame
from lingjing.bench.frame_sets.folder import new_folder, read_class, read_picture, set_classes
from lingjing.decoding import from_json
from lingjing.errors import UsageError
from lingjing.trace.images import decode_jpeg

TWINS = "twins.json"
"""The file of the records."""

ENDINGS = (".jpg", ".jpeg", ".png", ".webp")
"""Accepted suffixes of edited pictures."""

VIEW_PX = 120
"""Width to which pictures are reduced before the outlines of the view are compared, pixels. Chosen."""

VIEW_ALIKE = 0.2
"""The least correlation of the outlines (gradients) of two reduced pictures. Chosen."""
TARGET_ALIKE = 0.2
"""The least correlation of the outlines within a target's box and its surroundings, at full size. Chosen."""
AROUND = 0.5
"""Extent of the surroundings of a box, as a share of its sides. Chosen."""

Grey = npt.NDArray[np.float64]
"""A grey picture (height, width)."""


class TwinRecord(msgspec.Struct, frozen=True, kw_only=True):
    """An accepted edit."""

    cls: str
    name: str
    """The name of its frame."""
    file: str
    """Its path in the folder of twins."""
    sha256: str
    """SHA-256 of its file."""


class _RefusedEdit(msgspec.Struct, frozen=True, kw_only=True):
    """A rejected edit."""

    cls: str
    name: str
    reason: str
    """`missing`, `unreadable`, `size`, `unchanged`, `view`, `target`, or the reason in the list of rejections."""


class TwinSet(msgspec.Struct, frozen=True, kw_only=True):
    """The accepted and the rejected edits of a set."""

    taken: tuple[TwinRecord, ...]
    refused: tuple[_RefusedEdit, ...]


def import_twins(source: Path, edited: Path, target: Path, refusals: Mapping[str, str]) -> TwinSet:
    """Make a folder of twins of a set.

    Edits are `CLASS/NAME` or `NAME` below `edited`, with the suffix of any picture. `refusals` are reasons by frame
    name. Raises `UsageError` if a folder is missing, the target exists, or a refusal names no frame.
    """
    if not edited.is_dir():
        raise UsageError(f"`{edited}` is not a folder", hint="name the folder of the edited pictures")
    frames = [(cls, item) for cls in set_classes(source) for item in read_class(source, cls)]
    unknown = sorted(set(refusals) - {item.frame.name for _, item in frames})
    if unknown:
        raise UsageError(f"the list of rejections names `{unknown[0]}`, which is not a frame of the set")
    accepted, rejected = [], []
    with new_folder(target) as folder:
        for cls, item in frames:
            name = item.frame.name
            file = _edit_of(edited, cls, name)
            reason = refusals.get(name) or (_fault(source, cls, item, file) if file else "missing")
            if reason or file is None:
                rejected.append(_RefusedEdit(cls=cls, name=name, reason=reason))
                continue
            (folder / cls).mkdir(exist_ok=True)
            data = file.read_bytes()
            (folder / cls / file.name).write_bytes(data)
            place = f"{cls}/{file.name}"
            accepted.append(TwinRecord(cls=cls, name=name, file=place, sha256=hashlib.sha256(data).hexdigest()))
        twins = TwinSet(taken=tuple(accepted), refused=tuple(rejected))
        (folder / TWINS).write_bytes(msgspec.json.format(msgspec.json.encode(twins), indent=1) + b"\n")
    return twins


def read_twins(folder: Path) -> TwinSet:
    """Return the twins of a folder. Raises `UsageError` if it holds none."""
    try:
        return from_json((folder / TWINS).read_bytes(), TwinSet)
    except OSError as error:
        raise UsageError(
            f"`{folder}` holds no twins: {error.strerror}", hint="`lingjing frames twins` makes a folder of twins"
        ) from error
    except msgspec.DecodeError as error:
        raise UsageError(f"`{folder / TWINS}` has not the form of this version: {error}") from error


def twin_picture(folder: Path, twin: TwinRecord) -> bytes:
    """Return the file of a twin. Raises `UsageError` if it is missing or has changed."""
    try:
        data = (folder / twin.file).read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read `{folder / twin.file}`: {error.strerror}") from error
    if hashlib.sha256(data).hexdigest() != twin.sha256:
        raise UsageError(f"`{folder / twin.file}` has changed since its import", hint="import the edits again")
    return data


def decoded(data: bytes) -> npt.NDArray[np.uint8]:
    """Return a picture's pixels (height, width, 3). Raises `ValueError` if it cannot be read."""
    import PIL.Image

    try:
        with PIL.Image.open(io.BytesIO(data), formats=("JPEG", "PNG", "WEBP")) as image:
            return np.array(image.convert("RGB"))
    except (OSError, SyntaxError, PIL.Image.DecompressionBombError) as error:
        raise ValueError(str(error)) from error


def _edit_of(edited: Path, cls: str, name: str) -> Path | None:
    stem = Path(name).stem
    places = (folder / f"{stem}{ending}" for folder in (edited / cls, edited) for ending in ENDINGS)
    return next((place for place in places if place.is_file()), None)


def _fault(source: Path, cls: str, item: SetFrame, file: Path) -> str:
    """Return the reason to reject an edit, or ""."""
    try:
        twin = decoded(file.read_bytes())
    except ValueError:
        return "unreadable"
    original = decode_jpeg(read_picture(source, cls, item))
    if twin.shape != original.shape:
        return "size"
    if np.array_equal(twin, original):
        return "unchanged"
    before, after = (picture.astype(np.float64).mean(axis=2) for picture in (original, twin))
    patches = _patches(item, cls, original.shape[1], original.shape[0])
    if any(_alike(before[patch], after[patch]) < TARGET_ALIKE for patch in patches):
        return "target"
    step = max(1, original.shape[1] // VIEW_PX)
    return "view" if _alike(_smaller(before, step), _smaller(after, step)) < VIEW_ALIKE else ""


def _patches(item: SetFrame, cls: str, width: int, height: int) -> Iterator[tuple[slice, slice]]:
    for box in item.frame.shows(cls):
        x0, y0, x1, y1 = (share * side for share, side in zip(box.box, (width, height) * 2, strict=True))
        wide, high = AROUND * (x1 - x0) + 2, AROUND * (y1 - y0) + 2
        rows = slice(max(0, int(y0 - high)), min(height, int(y1 + high) + 1))
        yield rows, slice(max(0, int(x0 - wide)), min(width, int(x1 + wide) + 1))


def _smaller(grey: Grey, step: int) -> Grey:
    height, width = grey.shape[0] // step, grey.shape[1] // step
    small: Grey = grey[: height * step, : width * step].reshape(height, step, width, step).mean(axis=(1, 3))
    return small


def _alike(first: Grey, second: Grey) -> float:
    """Return the correlation (-1 to 1) of the gradient lengths of two pictures; 1 if neither has outlines."""
    a, b = (np.hypot(*np.gradient(picture)) for picture in (first, second))
    a, b = a - a.mean(), b - b.mean()
    spread = float(np.sqrt((a * a).sum() * (b * b).sum()))
    if spread == 0.0:
        return float(np.array_equal(a, b))
    return float((a * b).sum()) / spread


__all__ = ["TwinRecord", "TwinSet", "decoded", "import_twins", "read_twins", "twin_picture"]
