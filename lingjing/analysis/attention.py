"""Attention IoU: how well the places that a vision model looked at agree with the true boxes of targets.

The paper: "Intersection over union between the ground truth target box and the image attention region obtained by
thresholding attention at its mean plus one standard deviation." Maps come from whoever ran the model: a NumPy archive
(`.npz`, no pickles) with one array for each picture, its name the picture's id, of shape (rows, columns), not negative,
of any resolution and any scale, that covers the whole picture from the top left. Closed models give none: N/A.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.analysis.detection import shots
from lingjing.errors import UsageError
from lingjing.plugins.frame_detector import UnitBox
from lingjing.trace.reader import Trace, read_trace

AttentionMap = npt.NDArray[np.float64]

ATTENTION_FILE = "attention.npz"
"""Maps of where a model looked, beside the trace that they are of."""


def read_attention(path: str | Path) -> dict[str, AttentionMap]:
    """The maps of a file by picture. Raises `UsageError` that names what is wrong with it."""
    try:
        opened = np.load(path, allow_pickle=False)
        if not isinstance(opened, np.lib.npyio.NpzFile):
            raise ValueError("it is one array without a name")
        with opened as archive:
            maps = {name: np.asarray(archive[name]) for name in archive.files}
    except OSError as error:
        raise UsageError(f"cannot read the attention maps {path}: {error.strerror or error}") from error
    except (ValueError, EOFError, MemoryError, zipfile.BadZipFile, zlib.error, AttributeError) as error:
        raise UsageError(f"{path} holds no attention maps: {error}", hint="give a .npz, an array a picture") from error
    return {name: _checked(path, name, found) for name, found in maps.items()}


def _checked(path: str | Path, name: str, found: npt.NDArray[np.generic]) -> AttentionMap:
    if found.ndim != 2 or not found.size or not _real(found.dtype):
        raise UsageError(f"{path}: `{name}` is {found.dtype} of shape {found.shape}, not numbers in rows and columns")
    plain = found.astype(np.float64)
    if not np.isfinite(plain).all() or (plain < 0).any():
        raise UsageError(f"{path}: `{name}` holds a number that is negative or not finite")
    return plain


def _real(kind: np.dtype[np.generic]) -> bool:
    return np.issubdtype(kind, np.integer) or np.issubdtype(kind, np.floating)


def attention_iou(trace: Trace, maps: Mapping[str, AttentionMap]) -> float | None:
    """Mean over the visible targets of all pictures that have a map; None if there is none."""
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    values = [
        box_iou(maps[frame.id], truth.box)
        for frame in shots(trace)
        if frame.id in maps
        for truth in frame.boxes
        if truth.entity in targets and truth.pixels > 0
    ]
    return float(np.mean(values)) if values else None


def attention_beside(trace: Path) -> float | None:
    """`attention_iou` of a trace by the maps in `ATTENTION_FILE` beside it; None where one of the two files is missing
    or no map shows a target. Raises `UsageError` for a file that holds no maps."""
    file = trace.with_name(ATTENTION_FILE)
    return attention_iou(read_trace(trace), read_attention(file)) if file.is_file() and trace.is_file() else None


def box_iou(attention: AttentionMap, box: UnitBox) -> float:
    """IoU of a box, in shares of the picture, with the cells above mean plus one standard deviation, by area."""
    attended = attention > attention.mean() + attention.std()
    rows, columns = attention.shape
    x0, y0, x1, y1 = box
    inside = np.outer(_overlap(rows, y0, y1), _overlap(columns, x0, x1))
    shared = float(inside[attended].sum())
    union = float(attended.sum()) / attention.size + max(0.0, x1 - x0) * max(0.0, y1 - y0) - shared
    return shared / union if union > 0 else 0.0


def _overlap(count: int, low: float, high: float) -> AttentionMap:
    """How much of an interval within 0..1 lies in each of `count` equal parts of it."""
    edges = np.arange(count + 1) / count
    inside: AttentionMap = np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0, None)
    return inside
