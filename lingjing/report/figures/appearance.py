"""What another appearance of the same frames costs detectors: the paper's probe and its pairs of pictures."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator

from PIL import Image

from lingjing.analysis.shares import ConfidenceBounds
from lingjing.bench.frame_sets.folder import read_class, read_picture
from lingjing.bench.frame_sets.probe import ProbeCell, probe_table
from lingjing.bench.frame_sets.twins import read_twins, twin_picture
from lingjing.report.charts import WIDE, BarGroup, ChartBar, bar_chart
from lingjing.report.drawing import Drawing, PictureMark, WordsMark
from lingjing.report.estimates import BoundedEstimate
from lingjing.report.evidence import FrameProbe, ReportEvidence, TwinFolders
from lingjing.report.figure import FigureKind, FigurePart

PAIRS = 6
"""Classes of which a pair is shown."""

_PICTURE_PX = 640


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for probe in evidence.probes:
        yield _probed(probe)
    for folders in evidence.twins:
        drawings = tuple(_pairs(folders))
        known = read_twins(folders.twins)
        note = f"{len(known.taken)} pairs, {len(known.refused)} edits refused"
        if drawings:
            yield FigurePart(heading=f"pairs of {folders.twins.name}", drawings=drawings, notes=(note,))


def _probed(probe: FrameProbe) -> FigurePart:
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
    """The first pair of each class that shows its target, else the first one."""
    taken = read_twins(folders.twins).taken
    for cls in list(dict.fromkeys(one.cls for one in taken))[:PAIRS]:
        frames = {one.frame.name: one for one in read_class(folders.frames, cls)}
        own = [one for one in taken if one.cls == cls and one.name in frames]
        if not own:
            continue
        twin = next((one for one in own if frames[one.name].present), own[0])
        first = read_picture(folders.frames, cls, frames[twin.name])
        pictures = (_small(first), _small(twin_picture(folders.twins, twin)))
        yield _stacked(cls, pictures)


def _stacked(cls: str, pictures: tuple[bytes, bytes]) -> Drawing:
    marks: list[PictureMark | WordsMark] = []
    y = 0.0
    for data, said in zip(pictures, ("simulator frame", "twin"), strict=True):
        with Image.open(io.BytesIO(data)) as image:
            high = WIDE * image.height / image.width
        marks.append(PictureMark(x=0.0, y=y, width=WIDE, height=high, data=data))
        marks.append(WordsMark(x=2.0, y=y + high + 13.0, text=said, tone="faint"))
        y += high + 20.0
    words = f"A frame of {cls} from the simulator, and below it the edited twin of the same view."
    return Drawing(title=cls, description=words, width=WIDE, height=y, marks=tuple(marks))


def _small(data: bytes) -> bytes:
    with Image.open(io.BytesIO(data)) as image:
        plain = image.convert("RGB")
    plain.thumbnail((_PICTURE_PX, _PICTURE_PX), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    plain.save(out, "JPEG", quality=82, optimize=True)
    return out.getvalue()


KIND = FigureKind(
    name="appearance",
    title="Appearance probe",
    source="tab:sim2real, fig:appearance-pairs",
    about="F1 of saying whether a target is there, on the simulator's frames and on edited twins of them.",
    needs="lingjing frames probe SET --twins TWINS -o PROBE (docs/frames.md); name PROBE, SET and TWINS",
    make=_parts,
)
