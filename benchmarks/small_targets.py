"""Targets of few pixels: `python -m benchmarks.small_targets [TRACE …]`.

Without traces, the heuristic plays each mission with judged reports, seed 1: it looks from the mission's distance. For
each class of target: the median size of its true boxes in pixels, the share of boxes of that size that pass IoU >= 0.5
when they are 1, 2 and 3 pixels off in both axes, and the chance level of that rule and of a tolerance of 3 pixels.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean, median

import lingjing
from lingjing.analysis.detection import aligned_frames
from lingjing.analysis.small_boxes import chance, passes, pixel_size
from lingjing.testing import mission_file
from lingjing.trace.reader import read_trace

MISSIONS = ("ssr", "bi", "upr", "idf", "ufr")
OFF_PX = (1, 2, 3)
TOLERANCE_PX = 3.0

Sizes = dict[str, list[tuple[float, float, tuple[int, int]]]]
"""Width and height of the true boxes of a class, and the size of their pictures, pixels."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("traces", nargs="*", type=Path, metavar="TRACE")
    paths = parser.parse_args().traces
    heads = [*(f"{off} px" for off in OFF_PX), "chance", f"chance with {TOLERANCE_PX:g} px"]
    print(f"{'class':20} boxes  median px  " + "  ".join(heads))
    with tempfile.TemporaryDirectory() as folder:
        for path in paths or played(Path(folder)):
            print_rows(measured(path))


def print_rows(sizes: Sizes) -> None:
    """Print a row for each class."""
    for name, boxes in sorted(sizes.items()):
        wide, high = (median(box[axis] for box in boxes) for axis in (0, 1))
        shares = [fmean(passes(w, h, (off, off)) for w, h, _ in boxes) for off in OFF_PX]
        levels = [fmean(chance(w, h, picture, rule) for w, h, picture in boxes) for rule in (0.0, TOLERANCE_PX)]
        row = [*(f"{share:4.0%}" for share in shares), *(f"{level:.1e}" for level in levels)]
        print(f"{name:20} {len(boxes):5}  {wide:3.0f} x {high:3.0f}  " + "  ".join(row), flush=True)


def played(folder: Path) -> Iterator[Path]:
    """Play each mission and yield its trace."""
    for name in MISSIONS:
        done = lingjing.run(mission_file(name), policy="heuristic", seed=1, out=folder / name, overview=False)
        yield Path(done.trace)


def measured(path: Path) -> Sizes:
    """Return the true boxes of targets in the pictures that agents could report from."""
    sizes: Sizes = defaultdict(list)
    trace = read_trace(path)
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    for frame in aligned_frames(trace):
        picture = frame.pose.width, frame.pose.height
        for box in frame.boxes:
            if box.entity in targets:
                sizes[box.cls].append((*pixel_size(box.box, picture), picture))
    return sizes


if __name__ == "__main__":
    main()
