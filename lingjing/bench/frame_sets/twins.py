"""Twins: pictures of a set's frames that somebody edited to look otherwise, with the same things in the same places.

A twin inherits the labels of its frame, so an edit that moved, removed or added a target must not become one. What can
be measured is: the size, that something was changed, that the outlines of the whole view and of each target are where
they were. What cannot (a target that was added, a count) is told by a list of names with reasons that somebody who
looked at the pictures wrote. Every edit that is refused is kept in view with its reason.
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
from lingjing.errors import UsageError
from lingjing.trace.images import decode_jpeg

TWINS = "twins.json"
ENDINGS = (".jpg", ".jpeg", ".png", ".webp")

VIEW_PX = 120
VIEW_ALIKE = 0.2
"""The least correlation of the outlines (gradients) of two pictures that are made about `VIEW_PX` pixels wide."""
TARGET_ALIKE = 0.2
"""The same within a target's box and its surroundings, at full size."""
AROUND = 0.5
"""How far the surroundings of a box reach, as a share of its sides."""

Grey = npt.NDArray[np.float64]


class TwinRecord(msgspec.Struct, frozen=True, kw_only=True):
    """An edited picture that was taken in: its class, its frame's name, and the SHA-256 of its file."""

    cls: str
    name: str
    file: str
    sha256: str


class RefusedEdit(msgspec.Struct, frozen=True, kw_only=True):
    """An edit that was not taken in. `reason` is `missing`, `unreadable`, `size`, `unchanged`, `view`, `target`, or
    what the list of refusals says."""

    cls: str
    name: str
    reason: str


class TwinSet(msgspec.Struct, frozen=True, kw_only=True):
    """All that became of a set's edits."""

    taken: tuple[TwinRecord, ...]
    refused: tuple[RefusedEdit, ...]


def take_in(source: Path, edited: Path, target: Path, refusals: Mapping[str, str]) -> TwinSet:
    """Make a folder of twins of a set. Edits are `CLASS/NAME` or `NAME` below `edited`, with any picture's ending;
    `refusals` are reasons by the names of frames.

    Raises `UsageError` if a folder is missing, the target is there, or a refusal names no frame.
    """
    if not edited.is_dir():
        raise UsageError(f"`{edited}` is no folder", hint="name the folder of the edited pictures")
    frames = [(cls, one) for cls in set_classes(source) for one in read_class(source, cls)]
    unknown = sorted(set(refusals) - {one.frame.name for _, one in frames})
    if unknown:
        raise UsageError(f"the refusals name `{unknown[0]}`, and the set has no such frame")
    taken, refused = [], []
    with new_folder(target) as folder:
        for cls, one in frames:
            name = one.frame.name
            file = _edit_of(edited, cls, name)
            reason = refusals.get(name) or (_fault(source, cls, one, file) if file else "missing")
            if reason or file is None:
                refused.append(RefusedEdit(cls=cls, name=name, reason=reason))
                continue
            (folder / cls).mkdir(exist_ok=True)
            data = file.read_bytes()
            (folder / cls / file.name).write_bytes(data)
            place = f"{cls}/{file.name}"
            taken.append(TwinRecord(cls=cls, name=name, file=place, sha256=hashlib.sha256(data).hexdigest()))
        twins = TwinSet(taken=tuple(taken), refused=tuple(refused))
        (folder / TWINS).write_bytes(msgspec.json.format(msgspec.json.encode(twins), indent=1) + b"\n")
    return twins


def read_twins(folder: Path) -> TwinSet:
    """The twins of a folder. Raises `UsageError` if it holds none."""
    try:
        return msgspec.json.decode((folder / TWINS).read_bytes(), type=TwinSet)
    except OSError as error:
        raise UsageError(
            f"`{folder}` holds no twins: {error.strerror}", hint="`lingjing frames twins` makes some"
        ) from error
    except msgspec.DecodeError as error:
        raise UsageError(f"`{folder / TWINS}` is not what this version writes: {error}") from error


def twin_picture(folder: Path, twin: TwinRecord) -> bytes:
    """The file of a twin. Raises `UsageError` if it is gone or another one."""
    try:
        data = (folder / twin.file).read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read `{folder / twin.file}`: {error.strerror}") from error
    if hashlib.sha256(data).hexdigest() != twin.sha256:
        raise UsageError(f"`{folder / twin.file}` has changed since it was taken in", hint="take the edits in again")
    return data


def decoded(data: bytes) -> npt.NDArray[np.uint8]:
    """A picture's pixels (height, width, 3). Raises `ValueError` if it cannot be read."""
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


def _fault(source: Path, cls: str, one: SetFrame, file: Path) -> str:
    """Why an edit is no twin of its frame; "" if nothing speaks against it."""
    try:
        twin = decoded(file.read_bytes())
    except ValueError:
        return "unreadable"
    original = decode_jpeg(read_picture(source, cls, one))
    if twin.shape != original.shape:
        return "size"
    if np.array_equal(twin, original):
        return "unchanged"
    before, after = (picture.astype(np.float64).mean(axis=2) for picture in (original, twin))
    patches = _patches(one, cls, original.shape[1], original.shape[0])
    if any(_alike(before[patch], after[patch]) < TARGET_ALIKE for patch in patches):
        return "target"
    step = max(1, original.shape[1] // VIEW_PX)
    return "view" if _alike(_smaller(before, step), _smaller(after, step)) < VIEW_ALIKE else ""


def _patches(one: SetFrame, cls: str, width: int, height: int) -> Iterator[tuple[slice, slice]]:
    for box in one.frame.shows(cls):
        x0, y0, x1, y1 = (share * side for share, side in zip(box.box, (width, height) * 2, strict=True))
        wide, high = AROUND * (x1 - x0) + 2, AROUND * (y1 - y0) + 2
        rows = slice(max(0, int(y0 - high)), min(height, int(y1 + high) + 1))
        yield rows, slice(max(0, int(x0 - wide)), min(width, int(x1 + wide) + 1))


def _smaller(grey: Grey, step: int) -> Grey:
    height, width = grey.shape[0] // step, grey.shape[1] // step
    small: Grey = grey[: height * step, : width * step].reshape(height, step, width, step).mean(axis=(1, 3))
    return small


def _alike(one: Grey, other: Grey) -> float:
    """The correlation (-1..1) of the lengths of the gradients of two pictures; 1 where neither has any outline."""
    a, b = (np.hypot(*np.gradient(picture)) for picture in (one, other))
    a, b = a - a.mean(), b - b.mean()
    spread = float(np.sqrt((a * a).sum() * (b * b).sum()))
    if spread == 0.0:
        return float(np.array_equal(a, b))
    return float((a * b).sum()) / spread


__all__ = ["RefusedEdit", "TwinRecord", "TwinSet", "decoded", "read_twins", "take_in", "twin_picture"]
