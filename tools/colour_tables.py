"""Learn the colours of targets for the adversary `colour-table`: `python tools/colour_tables.py TRACE...`.

The traces are episodes of two seeds (`lingjing run bi --tier 1 --seed 0 --policy oracle`). Their pictures and true
boxes give, for each class, the colours that are frequent inside of its boxes and rare outside. The table is written
beside the adversary. Classes without a colour are left out, and those of classes without pictures in the traces stay.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict

import numpy as np
import numpy.typing as npt
from lingjing_agents.adversaries.pixels import TABLES, learn, tables
from lingjing_agents.perception.images import ImageBox

import lingjing

TARGETS = (
    "bridge_fracture", "building_fire", "delivery_door", "fire_source", "person_in_water", "pipeline_leak",
    "reference_building",
)  # fmt: skip
"""The classes of the targets of the shipped missions."""


def main() -> None:
    """Read the traces and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("traces", nargs="+", metavar="TRACE", help="folders of runs of two seeds")
    shown: dict[str, list[tuple[npt.NDArray[np.uint8], list[ImageBox]]]] = defaultdict(list)
    for path in parser.parse_args().traces:
        trace = lingjing.read(path)
        for info in trace.frames.values():
            classes = {box.cls for box in info.boxes} & set(TARGETS)
            rgb = trace.picture(info.id).rgb if classes else None
            for name in classes:
                shown[name].append((rgb, [box.box for box in info.boxes if box.cls == name]))
    learnt = {name: learn(pictures) for name, pictures in sorted(shown.items())}
    table = {**tables(), **{name: colours for name, colours in learnt.items() if colours}}
    TABLES.write_text(f"{json.dumps(dict(sorted(table.items())))}\n", encoding="utf-8")
    for name, colours in learnt.items():
        print(f"{name}: {len(colours)} colours from {len(shown[name])} pictures")


if __name__ == "__main__":
    main()
