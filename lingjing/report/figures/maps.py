"""Maps: the trails of all assets in an episode of each mission, on the map of the city."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

from PIL import Image

from lingjing.analysis.page_pictures import trails_png
from lingjing.report.chosen import chosen_episodes
from lingjing.report.drawing import Drawing
from lingjing.report.evidence import ReportEvidence, TracedEpisode
from lingjing.report.figure import FigureKind, FigurePart, called
from lingjing.trace.reader import read_trace

if TYPE_CHECKING:
    from lingjing.report.painting import Canvas

WIDTH = 720.0
"""Width of a map in units, that of two charts."""

COLOURS = 256
"""Colours of a map's palette, which makes its file a third as large. Rare ones are kept, as those of a legend."""


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    drawings = tuple(_map(episode) for episodes in chosen_episodes(evidence).values() for episode in episodes)
    if drawings:
        yield FigurePart(drawings=drawings)


def _map(episode: TracedEpisode) -> Drawing:
    with Image.open(io.BytesIO(trails_png(read_trace(episode.path)))) as drawn:
        small = drawn.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    out = io.BytesIO()
    small.save(out, "PNG", optimize=True)
    row, height = episode.row, WIDTH * small.height / small.width

    def paint(canvas: Canvas) -> None:
        canvas.picture(0.0, 0.0, WIDTH, height, out.getvalue())

    ended = "won" if row.report.success else f"lost ({row.report.reason})"
    words = (
        "Trails of all assets, which darken with time, on the map of the city; diamonds are where targets were at "
        "first, stars where they ended, plus signs and crosses what was reported, rightly and wrongly."
    )
    return Drawing(
        title=f"{row.mission.upper()} {row.mode}, seed {row.seed}, {called(row, row.condition)}: {ended}",
        description=words, width=WIDTH, height=height, wide=True, paint=paint,
    )  # fmt: skip


KIND = FigureKind(
    name="maps",
    title="Maps",
    source="fig:lingjing-overview",
    about="The episodes of the communication traces from above, with everything that was hidden from the agents.",
    needs="lingjing run ssr --seeds 0-1 (or any suite with --keep); it reads traces",
    make=_parts,
)
