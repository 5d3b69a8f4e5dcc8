"""Pages and files: well-formed, escaped, the same bytes for the same runs; one message for what cannot be done."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from lingjing.analysis import fonts
from lingjing.cli.main import main
from lingjing.errors import ExitCode
from lingjing.report.charts import (
    BarGroup,
    ChartBar,
    ChartSeries,
    ShareBar,
    bar_chart,
    line_chart,
    share_chart,
    share_grid,
    text_width,
)
from lingjing.report.drawing import Drawing, PictureMark, WordsMark
from lingjing.report.estimates import UNKNOWN, BoundedEstimate, share
from lingjing.report.figure import FigureKind, FigurePart
from lingjing.report.figure_kinds import FIGURES
from lingjing.report.raster import SCALE, boxed_letters, png_file
from lingjing.report.sheet import sheet_of
from lingjing.report.vector import inline_svg, svg_file
from tests.bench.suite_kit import made_row

EVIL = "</title><script>alert(1)</script>'\"&\u202e\x1b[31m"
ROOT = Path(__file__).parents[2]


def charts() -> list[Drawing]:
    some = share([True, False, True])
    return [
        line_chart(
            EVIL, [EVIL, "b"], [ChartSeries(EVIL, (some, UNKNOWN), 0), ChartSeries("n", (some, some), 9)], unit="%"
        ),
        bar_chart(EVIL, [BarGroup(EVIL, (ChartBar(EVIL, 0, some), ChartBar("x", 1, UNKNOWN)))]),
        share_chart(EVIL, (EVIL, "rest"), [ShareBar(EVIL, 3, (0.25, 0.75))]),
        share_grid(EVIL, [EVIL, "b"], [(EVIL, [50.0, float("nan")])]),
    ]


@pytest.mark.parametrize("number", range(4))
def test_a_drawing_is_well_formed_and_escapes_what_it_is_told(number: int) -> None:
    drawing = charts()[number]
    for text in (svg_file(drawing), inline_svg(drawing, "a")):
        root = ET.fromstring(text)
        assert "<script" not in text and "\x1b" not in text and "\u202e" not in text
        tags = [each.tag.rpartition("}")[2] for each in root.iter()]
        assert tags[1:3] == ["title", "desc"] and "script" not in tags
    with Image.open(io.BytesIO(png_file(drawing))) as image:
        assert image.size == (round(drawing.width * SCALE * 2) // 2, round(drawing.height * SCALE * 2) // 2)
        assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 3, "something is drawn"


def test_marks_stay_inside_of_their_drawing() -> None:
    long = "a name that is far too long for the width of a telephone and goes on and on and on"
    wide = [
        ChartSeries(f"{long} {number}", (BoundedEstimate(90.0, 10.0, 100.0, 3),) * 6, number) for number in range(12)
    ]
    chart = line_chart(long, [f"{long} {number}" for number in range(6)], wide, unit="%", most=100.0)
    svg = ET.fromstring(svg_file(chart))
    for each in svg.iter("{http://www.w3.org/2000/svg}text"):
        assert 0 <= float(each.get("x", "nan")) <= chart.width and 0 <= float(each.get("y", "nan")) <= chart.height


def test_many_bars_have_their_names_beside_them() -> None:
    def texts(count: int, *, lone: bool = False) -> list[str]:
        bars = tuple(ChartBar(f"model {number}", number, share([True, False])) for number in range(count))
        marks = bar_chart("t", [BarGroup("one", bars), BarGroup("two", bars)], lone=lone).marks
        return [mark.text for mark in marks if isinstance(mark, WordsMark)]

    assert texts(3).count("model 1") == 1, "in the legend"
    assert "model 0" not in texts(1) and texts(1, lone=True).count("model 0") == 1
    assert [texts(12).count(f"model {number}") for number in range(12)] == [2] * 12


def test_letters_of_other_scripts_are_written_or_said(monkeypatch: pytest.MonkeyPatch) -> None:
    chinese = "\u6865\u6881"
    told = Drawing(title="t", description="d", width=60.0, height=20.0,
                   marks=(WordsMark(x=2.0, y=14.0, text=chinese, size=12.0),))  # fmt: skip
    assert text_width(chinese, 12.0) == 24.0, "as wide as they are anywhere, whatever fonts are here"
    if not boxed_letters(told):
        with Image.open(io.BytesIO(png_file(told))) as drawn:
            inks = [drawn.convert("L").crop(box).tobytes() for box in ((4, 4, 28, 32), (28, 4, 52, 32))]
        assert inks[0] != inks[1], "boxes are alike"
    monkeypatch.setattr(fonts, "_font_with", lambda letters: None)
    assert boxed_letters(told) == chinese


def test_a_picture_is_inside_of_the_file() -> None:
    out = io.BytesIO()
    Image.new("RGB", (8, 6), "#123456").save(out, "PNG")
    picture = PictureMark(x=0.0, y=0.0, width=80.0, height=60.0, data=out.getvalue())
    drawing = Drawing(title="p", description="d", width=80.0, height=60.0, marks=(picture,))
    assert "href='data:image/png;base64," in svg_file(drawing)
    with Image.open(io.BytesIO(png_file(drawing))) as image:
        assert image.getpixel((40, 40)) == (0x12, 0x34, 0x56)


def test_a_sheet_has_all_drawings_of_a_figure() -> None:
    kind = FigureKind(name="n", title="T", source="", about="", needs="", make=lambda evidence: ())
    parts = [
        FigurePart(heading="one", drawings=tuple(charts()[:3])),
        FigurePart(heading="two", drawings=(charts()[3],)),
    ]
    sheet = sheet_of(kind, parts)
    assert sheet is not None
    assert len(sheet.marks) > sum(len(one.marks) for one in charts())
    assert sheet_of(kind, [FigurePart()]) is None


def test_a_sheet_of_wide_drawings_is_as_wide_as_they_are() -> None:
    maps = tuple(Drawing(title="m", description="d", width=720.0, height=60.0, marks=(), wide=True) for _ in range(3))
    sheet = sheet_of(FIGURES[0], [FigurePart(drawings=maps)])
    assert sheet is not None and 720.0 < sheet.width < 800.0


def test_bold_titles_of_a_sheet_end_where_it_does() -> None:
    title = "SSR broadcast, seed 3, heuristic (uavs = 2, victims = 1): won"
    chart = bar_chart(title, [BarGroup("one", (ChartBar("x", 0, UNKNOWN),))])
    sheet = sheet_of(FIGURES[0], [FigurePart(heading=f"{title}, and so on", drawings=(chart,))])
    assert sheet is not None
    bold = [mark for mark in sheet.marks if isinstance(mark, WordsMark) and mark.bold]
    assert len(bold) == 4, "two lines each"
    assert all(mark.x + text_width(mark.text, mark.size, bold=True) <= sheet.width for mark in bold)
    ET.fromstring(svg_file(sheet))


def test_the_page_is_one_file_that_says_what_is_missing(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "a.html", tmp_path / "b.html"
    assert main(["report", str(runs), "-o", str(first), "--title", EVIL]) == ExitCode.OK
    assert (
        main(["report", str(runs / "broadcast"), str(runs / "star"), "-o", str(second), "--title", EVIL]) == ExitCode.OK
    )
    capsys.readouterr()
    page = first.read_text()
    assert page == second.read_text(), "the same runs in another order"
    assert not re.search(r"(?:src|href)='(?!data:|#)", page) and "<script" not in page and "http-equiv" in page
    absent = page[page.index("id='absent'") :]
    assert "lingjing bench scaling" in absent and "Communication traces" not in absent
    assert page.count("<svg") >= 5 and page.count("image/png") >= 1 and page.count("image/jpeg") >= 1
    assert "oracle †" in page and "&lt;script&gt;" in page


def test_hostile_names_of_rows_are_text(results: Callable[..., Path], tmp_path: Path) -> None:
    rows = [
        made_row(entrant=EVIL, condition=EVIL, baseline=True, group=EVIL, mode=mode) for mode in ("star", "broadcast")
    ]
    out = tmp_path / "x.html"
    assert main(["report", str(results(rows)), "-o", str(out)]) == ExitCode.OK
    assert "<script" not in out.read_text() and "&lt;script&gt;" in out.read_text()


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_one_figure_by_its_name(suffix: str, runs: Path, tmp_path: Path) -> None:
    out = tmp_path / f"x.{suffix}"
    assert main(["report", str(runs), "--figure", "conversations", "-o", str(out)]) == ExitCode.OK
    before = out.read_bytes()
    assert main(["report", str(runs), "--figure", "conversations", "-o", str(out)]) == ExitCode.OK
    assert out.read_bytes() == before
    if suffix == "svg":
        ET.fromstring(before)
    else:
        with Image.open(io.BytesIO(before)) as image:
            assert image.width > 700


def test_the_list_names_every_figure_and_so_does_the_page_of_documentation(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "--list"]) == ExitCode.OK
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == [kind.name for kind in FIGURES]
    text = (ROOT / "docs" / "reports.md").read_text()
    rows = re.findall(r"^\| `([\w-]+)` \|", text, re.MULTILINE)
    assert rows == listed


def test_what_cannot_be_done_is_one_message(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    place = str(runs)
    for arguments, said in (
        (["report"], "nothing to report"),
        (["report", str(tmp_path / "empty")], "holds no trace and no results"),
        (["report", str(tmp_path / "gone")], "there is no"),
        (["report", place, "--figure", "scalling"], "did you mean `scaling`?"),
        (["report", place, "--figure", "scaling", "-o", str(tmp_path / "s.svg")], "run lingjing bench scaling"),
        (["report", place, "--figure", "maps", "-o", "x.pdf"], "a figure is an .svg or .png"),
        (["report", place, "-o", str(tmp_path / "gone" / "r.html")], "No such file or directory"),
        (["report", place, "-o", str(tmp_path)], "it is a folder"),
        (["report", place, "-j", "0"], "at least one"),
    ):
        assert main(arguments) == ExitCode.USAGE, arguments
        told = capsys.readouterr()
        assert said in told.err and told.out == "" and len(told.err.splitlines()) <= 2, told.err
    assert not list(tmp_path.glob("*.svg")) and not (tmp_path / "gone").exists()
