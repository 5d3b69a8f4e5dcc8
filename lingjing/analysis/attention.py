"""Attention IoU: the agreement of a vision model's attention with the true boxes of targets.

The paper: "Intersection over union between the ground truth target box and the image attention region obtained by
thresholding attention at its mean plus one standard deviation."

The user of the model supplies the maps in a NumPy archive (`.npz`, no pickles) with one array for each picture.
The name of an array is the picture's id. An array has the shape (rows, columns), any resolution and any scale, no
negative values, and covers the whole picture from the top left. Closed models supply no maps; the metric is then N/A.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.analysis.completion import sought_targets
from lingjing.analysis.detection import shots
from lingjing.errors import UsageError
from lingjing.plugins.frame_detector import UnitBox
from lingjing.trace.reader import Trace, read_trace

AttentionMap = npt.NDArray[np.float64]
"""(rows, columns), not negative."""

ATTENTION_FILE = "attention.npz"
"""Name of the archive of attention maps beside a trace."""


def read_attention(path: str | Path) -> dict[str, AttentionMap]:
    """Return the maps of a file by picture id. Raises `UsageError` for an invalid file, with the reason."""
    try:
        opened = np.load(path, allow_pickle=False)
        if not isinstance(opened, np.lib.npyio.NpzFile):
            raise ValueError("it is one array without a name")
        with opened as archive:
            maps = {name: np.asarray(archive[name]) for name in archive.files}
    except OSError as error:
        raise UsageError(f"cannot read the attention maps {path}: {error.strerror or error}") from error
    except (ValueError, EOFError, MemoryError, zipfile.BadZipFile, zlib.error, AttributeError) as error:
        hint = "use a .npz with one array per picture"
        raise UsageError(f"{path} holds no attention maps: {error}", hint=hint) from error
    return {name: _checked(path, name, array) for name, array in maps.items()}


def _checked(path: str | Path, name: str, array: npt.NDArray[np.generic]) -> AttentionMap:
    if array.ndim != 2 or not array.size or not _real(array.dtype):
        raise UsageError(f"{path}: `{name}` is {array.dtype} of shape {array.shape}, not numbers in rows and columns")
    plain = array.astype(np.float64)
    if not np.isfinite(plain).all() or (plain < 0).any():
        raise UsageError(f"{path}: `{name}` holds a number that is negative or not finite")
    return plain


def _real(kind: np.dtype[np.generic]) -> bool:
    return np.issubdtype(kind, np.integer) or np.issubdtype(kind, np.floating)


def attention_iou(trace: Trace, maps: Mapping[str, AttentionMap]) -> float | None:
    """Return the mean IoU over the visible targets of all pictures that have a map, or None if there are none."""
    targets = sought_targets(trace.header.instance)
    values = [
        box_iou(maps[frame.id], truth.box)
        for frame in shots(trace)
        if frame.id in maps
        for truth in frame.boxes
        if truth.entity in targets and truth.pixels > 0
    ]
    return float(np.mean(values)) if values else None


def attention_beside(trace: Path) -> float | None:
    """Return `attention_iou` of a trace for the maps in `ATTENTION_FILE` beside it.

    Returns None if one of the two files is missing or no map belongs to a picture with a target. Raises `UsageError`
    for an invalid file of maps.
    """
    file = trace.with_name(ATTENTION_FILE)
    return attention_iou(read_trace(trace), read_attention(file)) if file.is_file() and trace.is_file() else None


def box_iou(attention: AttentionMap, box: UnitBox) -> float:
    """Return the IoU, by area, of a box with the cells above the mean plus one standard deviation."""
    attended = attention > attention.mean() + attention.std()
    rows, columns = attention.shape
    x0, y0, x1, y1 = box
    inside = np.outer(_overlap(rows, y0, y1), _overlap(columns, x0, x1))
    shared = float(inside[attended].sum())
    union = float(attended.sum()) / attention.size + max(0.0, x1 - x0) * max(0.0, y1 - y0) - shared
    return shared / union if union > 0 else 0.0


def _overlap(count: int, low: float, high: float) -> AttentionMap:
    """Return the length of the interval from `low` to `high` in each of `count` equal parts of 0..1."""
    edges = np.arange(count + 1) / count
    inside: AttentionMap = np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0, None)
    return inside
