"""Targets of few pixels: `python -m benchmarks.small_targets [TRACE …]`.

Without traces, the oracle plays each mission with judged reports at tier 1, seed 1. For each class of target: the
median size of its true boxes in pixels, the share of boxes of that size that pass IoU >= 0.5 when they are 1, 2 and 3
pixels off in both axes, the same with a tolerance of 3 pixels, and the chance level of each rule.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from statistics import fmean, median

import lingjing
from lingjing.analysis.detection import aligned_frames
from lingjing.analysis.small_boxes import chance, passes, pixel_size
from lingjing.testing import mission_file
from lingjing.trace.reader import read_trace

MISSIONS = ("ssr", "ufr", "bi", "upr", "idf", "vdn")
OFF_PX = (1, 2, 3)
TOLERANCE_PX = 3.0

Sizes = dict[str, list[tuple[float, float, tuple[int, int]]]]
"""Width and height of the true boxes of a class, and the size of their pictures, pixels."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("traces", nargs="*", type=Path, metavar="TRACE")
    paths = parser.parse_args().traces
    with tempfile.TemporaryDirectory() as folder:
        sizes = measured(paths or played(Path(folder)))
    heads = [*(f"{off} px" for off in OFF_PX), "chance", f"chance with {TOLERANCE_PX:g} px"]
    print(f"{'class':20} boxes  median px  " + "  ".join(heads))
    for name, boxes in sorted(sizes.items()):
        wide, high = (median(box[axis] for box in boxes) for axis in (0, 1))
        shares = [fmean(passes(w, h, (off, off)) for w, h, _ in boxes) for off in OFF_PX]
        levels = [fmean(chance(w, h, picture, rule) for w, h, picture in boxes) for rule in (0.0, TOLERANCE_PX)]
        row = [*(f"{share:4.0%}" for share in shares), *(f"{level:.1e}" for level in levels)]
        print(f"{name:20} {len(boxes):5}  {wide:3.0f} x {high:3.0f}  " + "  ".join(row), flush=True)


def played(folder: Path) -> list[Path]:
    """Play each mission and return the traces."""
    paths = []
    for name in MISSIONS:
        done = lingjing.run(mission_file(name), policy="oracle", seed=1, tier=1, out=folder / name, overview=False)
        paths.append(Path(done.trace))
    return paths


def measured(paths: Iterable[Path]) -> Sizes:
    """Return the true boxes of targets in the pictures that agents could report from."""
    sizes: Sizes = defaultdict(list)
    for path in paths:
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
