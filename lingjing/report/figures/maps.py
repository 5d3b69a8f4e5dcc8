"""Where everybody went in an episode of each mission, on the city's map."""

from __future__ import annotations

import io
from collections.abc import Iterator

from PIL import Image

from lingjing.analysis.page_pictures import trails_png
from lingjing.report.chosen import chosen_episodes
from lingjing.report.drawing import Drawing, PictureMark
from lingjing.report.evidence import ReportEvidence, TracedEpisode
from lingjing.report.figure import FigureKind, FigurePart, called
from lingjing.trace.reader import read_trace

WIDTH = 720.0
COLOURS = 256
"""A map has few colours: a palette makes its file a third. Rare ones are kept, as those of a legend."""


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    drawings = tuple(_map(one) for episodes in chosen_episodes(evidence).values() for one in episodes)
    if drawings:
        yield FigurePart(drawings=drawings)


def _map(one: TracedEpisode) -> Drawing:
    with Image.open(io.BytesIO(trails_png(read_trace(one.path)))) as drawn:
        small = drawn.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    out = io.BytesIO()
    small.save(out, "PNG", optimize=True)
    row, high = one.row, WIDTH * small.height / small.width
    ended = "won" if row.report.success else f"lost ({row.report.reason})"
    words = (
        "Trails of all assets, which darken with time, on the map of the city; diamonds are where targets were at "
        "first, stars where they ended, plus signs and crosses what was reported, rightly and wrongly."
    )
    return Drawing(
        title=f"{row.mission.upper()} {row.mode}, seed {row.seed}, {called(row, row.condition)}: {ended}",
        description=words, width=WIDTH, height=high, wide=True,
        marks=(PictureMark(x=0.0, y=0.0, width=WIDTH, height=high, data=out.getvalue()),),
    )  # fmt: skip


KIND = FigureKind(
    name="maps",
    title="Maps",
    source="fig:lingjing-overview",
    about="The episodes of the communication traces from above, with what was hidden from the agents.",
    needs="lingjing run ssr --seeds 0-1 (or any suite with --keep); it reads traces",
    make=_parts,
)
