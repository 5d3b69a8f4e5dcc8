"""`overview.png`: one picture of an episode, drawn from its trace.

- `style`: colours, fonts and the placement of labels
- `mapview`: the map with regions, cells, tracks, true positions and reports
- `timeline`: messages, events and batteries over ticks
- `pictures`: crops of the best detections, and one whole frame
- `score`: the table of metrics
- `layout`: the page

The first call loads matplotlib; importing this package does not.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from lingjing.scene.city import City
from lingjing.trace.reader import Trace


def draw_overview(trace: Trace, path: Path, city: City | None = None) -> tuple[str, ...]:
    """Draw `trace`, whole or cut, as a PNG of 1800 by 1200 pixels at `path`, and return notes on missing letters.

    `city` is the city of the episode. If it is None, it is built again. If that is not possible exactly, the ground of
    the map stays blank.

    Raises `UsageError` if the file cannot be written.
    """
    from lingjing.analysis.overview.layout import draw_sheet
    from lingjing.analysis.played_city import city_of

    return draw_sheet(trace, path, city or city_of(trace))


def overview_png(trace: Trace) -> bytes:
    """Return the overview of a trace as a PNG. Raises `UsageError` if no temporary file can be written."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "overview.png"
        draw_overview(trace, path)
        return path.read_bytes()


__all__ = ["draw_overview", "overview_png"]
