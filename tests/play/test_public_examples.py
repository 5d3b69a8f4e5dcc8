"""The public names of `lingjing`: each has a docstring with an example, and every example is run.

The working folder of the examples holds `first.ljs` (the mission that `lingjing new mission first` writes, with eight
ticks in place of forty), `wrong.ljs` (the same with a misspelt type), `first.toml` (a suite of it) and `runs/first`
(an episode of it).
"""

from __future__ import annotations

import doctest
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing.testing import run_command

pytestmark = pytest.mark.slow

SUITE = """suite = 1
name = "first"
title = "First"
missions = ["first.ljs"]
modes = ["broadcast"]
seeds = [0]
entrants = [{ policy = "random" }]
"""

DOCUMENTED = sorted(set(lingjing.__all__) - {"__version__", "bench"})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    made = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        assert run_command(["new", "mission", "first"]) == 0
        text = Path("first.ljs").read_text().replace("ticks <= 40", "ticks <= 8")
        Path("first.ljs").write_text(text)
        Path("wrong.ljs").write_text(text.replace("boat : lifeboat", "boat : lifebot"))
        Path("first.toml").write_text(SUITE)
        lingjing.run("first.ljs", out="runs/first", overview=False)
        yield made


@pytest.mark.parametrize("name", [*DOCUMENTED, "bench"])
def test_the_example_of_each_public_name_runs(name: str, folder: Path) -> None:
    exported = importlib.import_module("lingjing.bench.playing").bench if name == "bench" else getattr(lingjing, name)
    finder = doctest.DocTestFinder(recurse=False)
    (example_set,) = finder.find(exported, name, module=False, globs={"lingjing": lingjing})
    assert example_set.examples, f"`lingjing.{name}` has no example in its docstring"
    if any("needs pandas" in example.source for example in example_set.examples):
        pytest.importorskip("pandas", reason="the extra `pandas` is not installed")
    printed: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    runner.run(example_set, out=printed.append)
    assert runner.failures == 0, "".join(printed)


PAGE = Path(__file__).parents[2] / "docs" / "python.md"


def test_the_page_names_every_export() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert [name for name in lingjing.__all__ if f"`{name}" not in text and f"lingjing.{name}" not in text] == []


@pytest.mark.usefixtures("folder")
def test_notebooks_show_a_line_a_table_and_pictures() -> None:
    mission, results = lingjing.compile("first.ljs"), lingjing.bench("first.toml", out="runs/bench/first")
    report, trace = lingjing.run(mission, policy="random", out="runs/<b>shown"), lingjing.read("runs/first")
    assert "<Mission first" in repr(mission)
    assert repr(report).startswith("<EpisodeReport first-broadcast seed 0, random: budget, SCR ")
    assert repr(trace).startswith("<Trace first-broadcast seed 0: budget, 9 boundaries, ")
    assert all("\n" not in repr(shown) for shown in (mission, report, trace, lingjing.show(trace)))
    tables = [shown._repr_html_() for shown in (mission, report, trace)]
    assert all(table.startswith("<table><caption>first") for table in tables)
    assert all("data:image/png;base64," in table for table in tables)
    assert all((shown._repr_png_() or b"").startswith(b"\x89PNG") for shown in (mission, report, trace))
    assert "budget</td>" in tables[1]
    assert tables[2].count("data:image/jpeg;base64,") == len(trace.frames) == 2
    assert "<b>" not in lingjing.read(report.trace)._repr_html_()
    assert "<table" in results._repr_html_()
    assert repr(results) == f"<SuiteResults 'First': {len(results.rows)} rows, runs/bench/first>"


@pytest.mark.usefixtures("folder")
def test_a_picture_that_cannot_be_drawn_is_replaced_by_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: object) -> bytes:
        raise lingjing.UsageError("no space left on the device")

    monkeypatch.setattr("lingjing.analysis.overview.overview_png", full)
    monkeypatch.setattr("lingjing.play.placed_plan.plan_png", full)
    for shown in (lingjing.read("runs/first"), lingjing.compile("first.ljs")):
        assert shown._repr_png_() is None
        assert "no space left on the device" in shown._repr_html_()


@pytest.mark.usefixtures("folder")
def test_an_inline_episode_is_isolated_from_its_page() -> None:
    html = lingjing.show("runs/first", height_px=300)._repr_html_()
    assert html.startswith('<iframe sandbox="allow-scripts" style="width:100%;height:300px;')
    assert 'srcdoc="&lt;!doctype' in html
    assert html.count("<") == 2  # the page is one escaped attribute
    with pytest.raises(lingjing.UsageError, match="height_px=0"):
        lingjing.show("runs/first", height_px=0)
    with pytest.raises(lingjing.UsageError, match="no trace"):
        lingjing.show(msgspec.structs.replace(lingjing.run("first.ljs", overview=False), trace=""))


def test_a_former_name_warns() -> None:
    with pytest.warns(DeprecationWarning, match="use `lingjing.read`"):
        assert lingjing.read_trace is lingjing.read  # type: ignore[attr-defined]


def test_lingjing_bench_is_callable_in_any_order_of_imports() -> None:
    assert callable(lingjing.bench)
    assert next(iter(inspect.signature(lingjing.bench).parameters)) == "suite"
    package = importlib.import_module("lingjing.bench.suite")  # sets the attribute `bench` to the package
    assert package.__name__ == "lingjing.bench.suite"
    assert callable(lingjing.bench)
    with pytest.raises(lingjing.UsageError, match="no suite"):
        lingjing.bench("mods")
