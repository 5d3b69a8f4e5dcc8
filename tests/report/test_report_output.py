"""Pages and files: well-formed, escaped, the same bytes for the same runs; one message for an impossible request."""

from __future__ import annotations

import io
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import pytest
from PIL import Image

from lingjing.analysis import fonts
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
)
from lingjing.report.drawing import DARK, LIGHT, Drawing
from lingjing.report.estimates import UNKNOWN, BoundedEstimate, share
from lingjing.report.figure import FigureKind, FigurePart
from lingjing.report.figure_kinds import FIGURES
from lingjing.report.painting import SCALE, Canvas, boxed_letters, inline_svg, png_file, svg_file
from lingjing.report.sheet import sheet_of
from lingjing.report.text_layout import text_width
from lingjing.testing import run_command
from tests.bench.suite_kit import made_row
from tests.report.conftest import lines_of, tooltips_of

EVIL = "</title><script>alert(1)</script>'\"&\u202e\x1b[31m $x_$"
ROOT = Path(__file__).parents[2]
SVG = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"


def charts() -> list[Drawing]:
    """One chart of each kind, with a hostile text wherever a chart has texts."""
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
def test_a_drawing_is_well_formed_and_escapes_its_texts(number: int) -> None:
    drawing = charts()[number]
    for text in (svg_file(drawing), inline_svg(drawing, "a")):
        root = ET.fromstring(text)
        assert "<script" not in text and "\x1b" not in text and "\u202e" not in text
        tags = [each.tag.removeprefix(SVG) for each in root.iter()]
        assert tags[1:3] == ["title", "desc"] and not {"script", "style", "metadata"} & set(tags)
    with Image.open(io.BytesIO(png_file(drawing))) as image:
        assert image.size == (int(drawing.width * SCALE), int(drawing.height * SCALE))
        assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 3, "something is drawn"


@pytest.mark.parametrize("number", range(4))
def test_a_drawing_has_the_same_bytes_each_time(number: int) -> None:
    first, second = charts()[number], charts()[number]
    assert svg_file(first) == svg_file(second)
    assert inline_svg(first, "a") == inline_svg(second, "a")
    assert png_file(first) == png_file(second)


def test_matplotlib_settings_of_the_user_change_no_drawing() -> None:
    """A matplotlibrc file, a style that a program has chosen, or its own salt of ids."""
    from matplotlib import rc_context

    before = [svg_file(chart) for chart in charts()]
    with rc_context({"font.size": 30, "svg.fonttype": "path", "axes.grid": True, "lines.linewidth": 9,
                     "svg.hashsalt": None, "text.parse_math": True, "figure.facecolor": "red"}):  # fmt: skip
        assert [svg_file(chart) for chart in charts()] == before


def test_tooltips_show_the_values_of_marks() -> None:
    """A pointer over a bar, a marker, a part or a cell shows its name, its value and its count."""
    lines, bars, parts, grid = map(tooltips_of, charts())
    assert lines[1:] == ["n: 66.67 [20.77, 93.85] % (n = 3)"] * 2 and len(bars) == 1
    assert bars[0].endswith(": 67 [21, 94] (n = 3)") and bars[0].startswith("</title><script>")
    assert [tooltip[-4:] for tooltip in parts] == ["25 %", "75 %"] and parts[1].endswith("rest 75 %")
    assert grid[0].endswith("50 %") and grid[1].endswith("b: not played")


def test_tooltips_are_titles_inside_of_their_marks() -> None:
    root = ET.fromstring(svg_file(charts()[1]))
    (group,) = [each for each in root.iter(f"{SVG}g") if each.find(f"{SVG}title") is not None]
    assert group[0].tag == f"{SVG}title" and group[1].tag == f"{SVG}path"
    assert f"fill: {LIGHT['s0']}" in group[1].get("style", "")


def test_drawings_of_one_page_share_no_ids_and_every_reference_is_resolved() -> None:
    texts = [inline_svg(chart, f"c-{number}") for number, chart in enumerate([*charts(), *charts()])]
    ids = [name for text in texts for name in re.findall(r' id="([^"]+)"', text)]
    assert len(ids) == len(set(ids)) > 10
    for text in texts:
        references = re.findall(r'href="#([^"]+)"', text) + re.findall(r"url\(#([^)]+)\)", text)
        assert set(references) <= set(re.findall(r' id="([^"]+)"', text))


def test_a_page_chooses_the_colours_of_its_drawings() -> None:
    """A page refers to colours as variables, which a dark page replaces; a file has the colours for white paper."""
    assert LIGHT.keys() == DARK.keys() and len(set(LIGHT.values())) == len(LIGHT)
    for chart in charts():
        page, file = inline_svg(chart, "a"), svg_file(chart)
        assert set(re.findall(r"var\(--(\w+)\)", page)) <= LIGHT.keys()
        assert re.findall(r"(?:fill|stroke): #\w+", page) == [] and "var(" not in file


def test_marks_stay_inside_of_their_drawing() -> None:
    long = "a name that is far too long for the width of a telephone and goes on and on and on"
    wide = [
        ChartSeries(f"{long} {number}", (BoundedEstimate(90.0, 10.0, 100.0, 3),) * 6, number) for number in range(12)
    ]
    chart = line_chart(long, [f"{long} {number}" for number in range(6)], wide, unit="%", most=100.0)
    svg = ET.fromstring(svg_file(chart))
    places = [*svg.iter(f"{SVG}text"), *svg.iter(f"{SVG}use")]
    assert len(places) > 72
    for each in places:
        assert 0 <= float(each.get("x", "nan")) <= chart.width and 0 <= float(each.get("y", "nan")) <= chart.height


@pytest.mark.parametrize("highest", [0.0, 1e-3, 0.7, 1.0, 43.0, 100.0, 12_345.0])
def test_an_axis_begins_at_zero_and_covers_every_value(highest: float) -> None:
    series = [ChartSeries("a", (BoundedEstimate(highest, math.nan, math.nan, 1),) * 2, 0)]
    labels = [line for line in lines_of(line_chart("t", ["x", "y"], series, unit="m")) if line.endswith(" m")]
    numbers = [float(label.split()[0]) for label in labels]
    assert numbers[0] == 0.0 and numbers == sorted(numbers) and 3 <= len(numbers) <= 6
    assert highest <= numbers[-1] <= max(2.5 * highest, 1.0)


def test_charts_without_values_are_drawn() -> None:
    empty = [
        line_chart("t", [], []),
        line_chart("t", ["a"], [ChartSeries("s", (UNKNOWN,), 0)]),
        bar_chart("t", []),
        share_chart("t", [], []),
        share_grid("t", [], []),
    ]
    for chart in empty:
        ET.fromstring(svg_file(chart))
        assert png_file(chart).startswith(b"\x89PNG")


def test_many_bars_have_their_names_beside_them() -> None:
    def texts(count: int, *, lone: bool = False) -> list[str]:
        bars = tuple(ChartBar(f"model {number}", number, share([True, False])) for number in range(count))
        return lines_of(bar_chart("t", [BarGroup("one", bars), BarGroup("two", bars)], lone=lone))

    assert texts(3).count("model 1") == 1, "in the legend"
    assert "model 0" not in texts(1) and texts(1, lone=True).count("model 0") == 1
    assert [texts(12).count(f"model {number}") for number in range(12)] == [2] * 12


def test_letters_of_other_scripts_are_written_or_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    chinese = "\u6865\u6881"

    def paint(canvas: Canvas) -> None:
        canvas.text(2.0, 14.0, chinese, size=12.0)

    drawing = Drawing(title="t", description="d", width=60.0, height=20.0, paint=paint)
    assert text_width(chinese, 12.0) == 24.0, "the width does not depend on the installed fonts"
    assert f">{chinese}</text>" in svg_file(drawing)
    if not boxed_letters(drawing):
        with Image.open(io.BytesIO(png_file(drawing))) as drawn:
            inks = [drawn.convert("L").crop(box).tobytes() for box in ((4, 4, 28, 32), (28, 4, 52, 32))]
        assert inks[0] != inks[1], "boxes are alike"
    monkeypatch.setattr(fonts, "_font_with", lambda letters: None)
    assert boxed_letters(drawing) == chinese


def test_letters_that_the_usual_font_lacks_are_drawn_in_another_font(monkeypatch: pytest.MonkeyPatch) -> None:
    """Circled letters stand for Chinese ones: matplotlib ships a font that has them, and DejaVu Sans has none."""
    circled = "\u24b6\u24b7"
    other = str(Path(mpl.get_data_path()) / "fonts" / "ttf" / "STIXGeneral.ttf")
    chart = bar_chart("t", [BarGroup(circled, (ChartBar("x", 0, UNKNOWN),))])
    assert fonts.missing_letters(circled) == circled

    def drawn(having: tuple[tuple[str, int], ...]) -> bytes:
        monkeypatch.setattr(fonts, "_fonts", lambda letters: having)
        monkeypatch.setattr(fonts, "_font_with", lambda letters: having[0] if having else None)
        assert boxed_letters(chart) == ("" if having else circled)
        with Image.open(io.BytesIO(png_file(chart))) as image:
            return image.convert("L").crop((0, 20, 60, 52)).tobytes()

    boxes, letters = drawn(()), drawn(((other, 0),))
    assert min(boxes) < 128 and min(letters) < 128 and boxes != letters


def test_a_picture_is_embedded_in_the_file() -> None:
    out = io.BytesIO()
    Image.new("RGB", (8, 6), "#123456").save(out, "PNG")

    def paint(canvas: Canvas) -> None:
        canvas.part(10.0, 5.0).picture(0.0, 0.0, 60.0, 50.0, out.getvalue())

    drawing = Drawing(title="p", description="d", width=80.0, height=60.0, paint=paint)
    (image,) = ET.fromstring(svg_file(drawing)).iter(f"{SVG}image")
    assert image.get(LINK, "").startswith("data:image/png;base64,")
    assert [image.get(name) for name in ("x", "y", "width", "height")] == ["10", "5", "60", "50"]
    with Image.open(io.BytesIO(png_file(drawing))) as drawn:
        assert drawn.convert("RGB").getpixel((80, 60)) == (0x12, 0x34, 0x56)
        assert drawn.convert("RGB").getpixel((10, 60)) == (255, 255, 255)


def test_a_sheet_has_all_drawings_of_a_figure() -> None:
    kind = FigureKind(name="n", title="T", source="", about="", needs="", make=lambda evidence: ())
    parts = [
        FigurePart(heading="one", drawings=tuple(charts()[:3])),
        FigurePart(heading="two", drawings=(charts()[3],)),
    ]
    sheet = sheet_of(kind, parts)
    assert sheet is not None
    assert set(lines_of(sheet)) >= {line for chart in charts() for line in lines_of(chart)}
    assert sorted(tooltips_of(sheet)) == sorted(tooltip for chart in charts() for tooltip in tooltips_of(chart))
    assert sheet_of(kind, [FigurePart()]) is None


def test_a_sheet_is_as_wide_as_its_wide_drawings() -> None:
    maps = tuple(
        Drawing(title="m", description="d", width=720.0, height=60.0, paint=lambda canvas: None, wide=True)
        for _ in range(3)
    )
    sheet = sheet_of(FIGURES[0], [FigurePart(drawings=maps)])
    assert sheet is not None and 720.0 < sheet.width < 800.0


def test_bold_titles_do_not_extend_beyond_the_edge_of_a_sheet() -> None:
    title = "SSR broadcast, seed 3, heuristic (uavs = 2, victims = 1): won"
    chart = bar_chart(title, [BarGroup("one", (ChartBar("x", 0, UNKNOWN),))])
    sheet = sheet_of(FIGURES[0], [FigurePart(heading=f"{title}, and so on", drawings=(chart,))])
    assert sheet is not None
    bold = [
        text
        for text in ET.fromstring(svg_file(sheet)).iter(f"{SVG}text")
        if "font-weight: 700" in text.get("style", "")
    ]
    assert len(bold) == 4, "two lines each"
    for text in bold:
        (size,) = re.findall(r"font-size: (\d+)px", text.get("style", ""))
        assert float(text.get("x", "nan")) + text_width(text.text or "", float(size), bold=True) <= sheet.width


def test_importing_the_report_modules_does_not_load_matplotlib() -> None:
    script = (
        "import sys, lingjing, lingjing.report.figure_kinds, lingjing.cli.report; print('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_the_page_is_one_file_that_lists_missing_figures(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "a.html", tmp_path / "b.html"
    assert run_command(["report", str(runs), "-o", str(first), "--title", EVIL]) == ExitCode.OK
    assert (
        run_command(["report", str(runs / "broadcast"), str(runs / "star"), "-o", str(second), "--title", EVIL])
        == ExitCode.OK
    )
    capsys.readouterr()
    page = first.read_text()
    assert page == second.read_text(), "the same runs in another order"
    assert not re.search(r"(?:src|href)=['\"](?!data:|#)", page) and "<script" not in page and "http-equiv" in page
    absent = page[page.index("id='absent'") :]
    assert "lingjing bench scaling" in absent and "Communication traces" not in absent
    assert page.count("<svg") >= 5 and page.count("image/png") >= 1 and page.count("image/jpeg") >= 1
    assert "oracle †" in page and "&lt;script&gt;" in page


def test_hostile_names_of_rows_are_escaped(results: Callable[..., Path], tmp_path: Path) -> None:
    rows = [
        made_row(entrant=EVIL, condition=EVIL, baseline=True, group=EVIL, mode=mode) for mode in ("star", "broadcast")
    ]
    out = tmp_path / "x.html"
    assert run_command(["report", str(results(rows)), "-o", str(out)]) == ExitCode.OK
    assert "<script" not in out.read_text() and "&lt;script&gt;" in out.read_text()


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_one_figure_is_written_by_its_name_with_the_same_bytes_each_time(
    suffix: str, runs: Path, tmp_path: Path
) -> None:
    out = tmp_path / f"x.{suffix}"
    assert run_command(["report", str(runs), "--figure", "conversations", "-o", str(out)]) == ExitCode.OK
    before = out.read_bytes()
    assert run_command(["report", str(runs), "--figure", "conversations", "-o", str(out)]) == ExitCode.OK
    assert out.read_bytes() == before
    if suffix == "svg":
        ET.fromstring(before)
    else:
        with Image.open(io.BytesIO(before)) as image:
            assert image.width > 700


def test_the_list_and_the_page_of_documentation_name_every_figure(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["report", "--list"]) == ExitCode.OK
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == [kind.name for kind in FIGURES]
    text = (ROOT / "docs" / "reports.md").read_text()
    rows = re.findall(r"^\| `([\w-]+)` \|", text, re.MULTILINE)
    assert rows == listed


def test_an_impossible_request_gives_one_message(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    place = str(runs)
    for arguments, message in (
        (["report"], "no place is named"),
        (["report", str(tmp_path / "empty")], "holds no trace and no results"),
        (["report", str(tmp_path / "gone")], "there is no"),
        (["report", place, "--figure", "scalling"], "did you mean `scaling`?"),
        (["report", place, "--figure", "scaling", "-o", str(tmp_path / "s.svg")], "run lingjing bench scaling"),
        (["report", place, "--figure", "maps", "-o", "x.pdf"], "a figure is written as .svg or .png"),
        (["report", place, "-o", str(tmp_path / "gone" / "r.html")], "No such file or directory"),
        (["report", place, "-o", str(tmp_path)], "it is a folder"),
        (["report", place, "-j", "0"], "must be at least 1"),
    ):
        assert run_command(arguments) == ExitCode.USAGE, arguments
        shown = capsys.readouterr()
        assert message in shown.err and shown.out == "" and len(shown.err.splitlines()) <= 2, shown.err
    assert not list(tmp_path.glob("*.svg")) and not (tmp_path / "gone").exists()
