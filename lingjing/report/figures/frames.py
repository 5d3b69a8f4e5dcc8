"""What agents saw: the best frame of each kind of camera in an episode of each mission, with true boxes."""

from __future__ import annotations

import io
from collections.abc import Iterator

from PIL import Image

from lingjing.analysis.page_pictures import ShownFrame, best_frames, frame_jpeg, in_order
from lingjing.report.charts import WIDE, wrapped
from lingjing.report.chosen import chosen_episodes
from lingjing.report.drawing import Drawing, PictureMark, WordsMark
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, column_words
from lingjing.trace.reader import read_trace

MOST = 4
"""Frames of one mission."""

_SIZE = 10.0


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    drawings = list[Drawing]()
    for episodes in chosen_episodes(evidence).values():
        shown = in_order(best_frames(read_trace(one.path) for one in episodes))
        drawings += map(_frame, shown[:MOST])
    if drawings:
        yield FigurePart(drawings=tuple(drawings))


def _frame(shown: ShownFrame) -> Drawing:
    data = frame_jpeg(shown)
    with Image.open(io.BytesIO(data)) as image:
        high = WIDE * image.height / image.width
    lines = wrapped(shown.caption, WIDE - 4.0, _SIZE)
    words = (
        WordsMark(x=2.0, y=high + 14.0 + 13.0 * at, text=line, size=_SIZE, tone="faint")
        for at, line in enumerate(lines)
    )
    kind = shown.trace.header.instance
    return Drawing(
        title=f"{column_words(kind.mission, kind.mode)}: {shown.info.camera} of {shown.info.entity}",
        description=f"{kind.mission} ({kind.mode}), seed {kind.seed}: {shown.caption}",
        width=WIDE, height=high + 8.0 + 13.0 * len(lines) + 4.0,
        marks=(PictureMark(x=0.0, y=0.0, width=WIDE, height=high, data=data), *words),
    )  # fmt: skip


KIND = FigureKind(
    name="frames",
    title="Frames",
    source="fig:comm-scenario-examples",
    about="The frame of each kind of camera that shows a target best, a green box around what is one.",
    needs="lingjing run ssr --seeds 0-1 (or any suite with --keep); it reads traces",
    make=_parts,
)
