"""Appearance probe: the F1 of detectors on frames and on edited twins of them, and pairs of frame and twin."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from PIL import Image

from lingjing.analysis.shares import ConfidenceBounds
from lingjing.bench.frame_sets.folder import read_class, read_picture
from lingjing.bench.frame_sets.probe import ProbeCell, probe_table
from lingjing.bench.frame_sets.twins import read_twins, twin_picture
from lingjing.report.charts import BarGroup, ChartBar, bar_chart
from lingjing.report.drawing import WIDE, Drawing
from lingjing.report.estimates import BoundedEstimate
from lingjing.report.evidence import FrameProbe, ReportEvidence, TwinFolders
from lingjing.report.figure import FigureKind, FigurePart

if TYPE_CHECKING:
    from lingjing.report.painting import Canvas

PAIRS = 6
"""Largest number of classes of which a pair is shown."""

_PICTURE_PX = 640
"""Largest side of a picture in a report: sharp at the width of a chart, and a file of about 60 kB."""

_JPEG_QUALITY = 82
_CAPTION = 20.0


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for probe in evidence.probes:
        yield _probe_part(probe)
    for folders in evidence.twins:
        drawings = tuple(_pairs(folders))
        twins = read_twins(folders.twins)
        note = f"{len(twins.taken)} pairs, {len(twins.refused)} edits rejected"
        if drawings:
            yield FigurePart(heading=f"pairs of {folders.twins.name}", drawings=drawings, notes=(note,))


def _probe_part(probe: FrameProbe) -> FigurePart:
    groups = [BarGroup(f"{cell.cls}: {cell.detector}", tuple(_bars(cell)), ".2f", 1.0) for cell in probe.cells]
    return FigurePart(
        heading=probe.name,
        drawings=(bar_chart("F1 of presence", groups),),
        tables=(probe_table(probe.cells, ("brackets are 95 % intervals over pairs",)),),
    )


def _bars(cell: ProbeCell) -> Iterator[ChartBar]:
    yield ChartBar("simulator's frames", 0, _estimate(cell.f1, cell.f1_bounds, cell.counted))
    if cell.pairs:
        yield ChartBar("twins", 1, _estimate(cell.twin_f1, cell.twin_bounds, cell.pairs))


def _estimate(value: float | None, bounds: ConfidenceBounds, count: int) -> BoundedEstimate:
    return BoundedEstimate(math.nan if value is None else value, bounds[0], bounds[1], count)


def _pairs(folders: TwinFolders) -> Iterator[Drawing]:
    """Yield a pair of each class: the first one that shows its target, else the first one."""
    accepted = read_twins(folders.twins).taken
    for cls in list(dict.fromkeys(twin.cls for twin in accepted))[:PAIRS]:
        frames = {frame.frame.name: frame for frame in read_class(folders.frames, cls)}
        twins = [twin for twin in accepted if twin.cls == cls and twin.name in frames]
        if not twins:
            continue
        twin = next((twin for twin in twins if frames[twin.name].present), twins[0])
        frame = read_picture(folders.frames, cls, frames[twin.name])
        yield _stacked(cls, (_small(frame), _small(twin_picture(folders.twins, twin))))


def _stacked(cls: str, pictures: tuple[bytes, bytes]) -> Drawing:
    heights = []
    for data in pictures:
        with Image.open(io.BytesIO(data)) as image:
            heights.append(WIDE * image.height / image.width)

    def paint(canvas: Canvas) -> None:
        y = 0.0
        for data, height, caption in zip(pictures, heights, ("simulator frame", "twin"), strict=True):
            canvas.picture(0.0, y, WIDE, height, data)
            canvas.text(2.0, y + height + 13.0, caption, tone="faint")
            y += height + _CAPTION

    words = f"A frame of {cls} from the simulator, and below it the edited twin of the same view."
    height = sum(heights) + _CAPTION * len(heights)
    return Drawing(title=cls, description=words, width=WIDE, height=height, paint=paint)


def _small(data: bytes) -> bytes:
    with Image.open(io.BytesIO(data)) as image:
        plain = image.convert("RGB")
    plain.thumbnail((_PICTURE_PX, _PICTURE_PX), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    plain.save(out, "JPEG", quality=_JPEG_QUALITY, optimize=True)
    return out.getvalue()


KIND = FigureKind(
    name="appearance",
    title="Appearance probe",
    source="tab:sim2real, fig:appearance-pairs",
    about="F1 of detecting the presence of a target, on the simulator's frames and on edited twins of them.",
    needs="lingjing frames probe SET --twins TWINS -o PROBE (docs/frames.md); name PROBE, SET and TWINS",
    make=_parts,
)
