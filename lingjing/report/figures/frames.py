"""Frames: the best frame of each kind of camera in an episode of each mission, with true boxes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

from PIL import Image

from lingjing.analysis.page_pictures import PageFrame, best_frames, frame_jpeg, sort_by_camera
from lingjing.report.chosen import chosen_episodes
from lingjing.report.drawing import WIDE, Drawing
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, column_words
from lingjing.report.text_layout import SMALL, wrapped
from lingjing.trace.reader import read_trace

if TYPE_CHECKING:
    from lingjing.report.painting import Canvas

MOST = 4
"""Largest number of frames of one mission: about one of each kind of camera."""

_LINE = 13.0


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    drawings = list[Drawing]()
    for episodes in chosen_episodes(evidence).values():
        shown = sort_by_camera(best_frames(read_trace(episode.path) for episode in episodes))
        drawings += map(_frame, shown[:MOST])
    if drawings:
        yield FigurePart(drawings=tuple(drawings))


def _frame(shown: PageFrame) -> Drawing:
    data = frame_jpeg(shown)
    with Image.open(io.BytesIO(data)) as image:
        height = WIDE * image.height / image.width
    lines = wrapped(shown.caption, WIDE - 4.0, SMALL)

    def paint(canvas: Canvas) -> None:
        canvas.picture(0.0, 0.0, WIDE, height, data)
        for place, line in enumerate(lines):
            canvas.text(2.0, height + 14.0 + _LINE * place, line, size=SMALL, tone="faint")

    instance = shown.trace.header.instance
    return Drawing(
        title=f"{column_words(instance.mission, instance.mode)}: {shown.info.camera} of {shown.info.entity}",
        description=f"{instance.mission} ({instance.mode}), seed {instance.seed}: {shown.caption}",
        width=WIDE, height=height + 12.0 + _LINE * len(lines), paint=paint,
    )  # fmt: skip


KIND = FigureKind(
    name="frames",
    title="Frames",
    source="fig:comm-scenario-examples",
    about="The frame of each kind of camera that shows a target best, with green boxes around targets.",
    needs="lingjing run ssr --seeds 0-1 (or any suite with --keep); it reads traces",
    make=_parts,
)
