"""Coverage and localisation by altitude in the sea rescue, from geometry alone: `python -m benchmarks.coverage`.

For each altitude: the share of visited cells and of the ground that nine pictures from the middles of the cells show,
the error on the water of a box that is two pixels off, and the size of a person in the picture. The paper's sweep of
altitudes (60, 100, 140 m) has its coverage rise from 64 to 90 % and its error from 112 to 286 m with models that fly.
"""

from __future__ import annotations

import lingjing
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.geometry import focal_px
from lingjing.scene.ground_coverage import seen_share
from lingjing.testing import mission_file
from lingjing.trace.records import CameraPose

ALTITUDES_M = (60.0, 100.0, 140.0)
OFF_PX = 2.0
PERSON_M = (0.6, 0.5)
"""Length and width of a person in the water, metres (`std.sea`)."""


def main() -> None:
    """Print the table."""
    ssr = instantiate(lingjing.compile(mission_file("ssr")), seed=0)
    level, cells = ssr.scene.datum_m, [cell.polygon for cell in ssr.cells]
    print("altitude m  cells visited %  ground seen %  error of 2 px m  person px")
    for altitude in ALTITUDES_M:
        poses = [
            CameraPose(position=(*cell.centre, level + altitude), heading_deg=0.0, tilt_deg=90.0) for cell in ssr.cells
        ]
        share, focal = seen_share(cells, poses, level), focal_px(poses[0])
        long, wide = (focal * size / altitude for size in PERSON_M)
        error = OFF_PX * altitude / focal
        print(f"{altitude:10.0f}  {100:15.0f}  {100 * (share or 0.0):13.1f}  {error:15.2f}  {long:.1f} x {wide:.1f}")


if __name__ == "__main__":
    main()
