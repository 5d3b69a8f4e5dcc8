"""`overview.png`: one picture of an episode, drawn from its trace.

- `style`     colours, fonts, the labels' placement
- `mapview`   the map: region, cells, tracks, truth and reports
- `timeline`  messages, events, batteries over ticks
- `pictures`  the best detections, cut out of their frames, and one whole frame
- `score`     the numbers
- `layout`    the page that holds them

matplotlib is loaded by the first call, not by this import.
"""

from __future__ import annotations

from pathlib import Path

from lingjing.scene.city import City
from lingjing.trace.reader import Trace


def draw_overview(trace: Trace, path: Path, city: City | None = None) -> tuple[str, ...]:
    """Draw `trace`, whole or cut, as a PNG of 1800 by 1200 pixels at `path`; notes on what is not as it should be.

    `city` is what it was played in, if the caller still has it; else it is built again, and the map stays blank where
    that cannot be done exactly.

    Raises `UsageError` if the file cannot be written.
    """
    from lingjing.analysis.overview.layout import draw_sheet
    from lingjing.analysis.played_city import city_of

    return draw_sheet(trace, path, city or city_of(trace))


__all__ = ["draw_overview"]
