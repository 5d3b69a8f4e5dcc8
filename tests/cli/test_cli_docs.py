"""`lingjing docs` with traces and results: a folder with a page without broken links."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lingjing
from lingjing.bench.version import benchmark_version, mission_version
from lingjing.testing import run_command, sea_rescue
from tests.bench.suite_kit import encode_rows, made_row

SCENARIOS = Path(lingjing.__file__).parents[1] / "scenarios"


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The trace of the sea rescue of the kit."""
    target = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(target, ticks=60)
    return target


def results(path: Path, *, benchmark: str = "") -> Path:
    """Rows of the present missions, and of this version of the benchmark (default: the present one)."""
    rows = [
        made_row(
            entrant="oracle",
            mission=name,
            benchmark=benchmark or benchmark_version(),
            mission_sha256=mission_version(SCENARIOS / f"{name}.ljs"),
        )
        for name in ("ssr", "cd")
    ]
    path.write_bytes(encode_rows(rows))
    return path


def test_a_page_has_the_pictures_of_a_trace_and_the_results_of_a_suite(
    played: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = results(tmp_path / "results.parquet")
    code = run_command(["docs", "ssr", "--trace", str(played), "--results", str(table), "-o", str(tmp_path / "pages")])
    assert code == 0
    assert capsys.readouterr().out == f"{tmp_path}/pages/ssr.md\n"
    text = (tmp_path / "pages" / "ssr.md").read_text()
    linked = re.findall(r"\]\(([^)]+\.(?:png|jpg|svg))\)", text)
    assert {"ssr-map.png", "ssr-graph.svg"} < set(linked) and len(linked) >= 3
    assert {path.name for path in (tmp_path / "pages").iterdir()} == {*linked, "ssr.md"}
    assert all((tmp_path / "pages" / name).stat().st_size > 1000 for name in linked)
    heads = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert heads[:4] == ["An episode", "What each agent sees", "What counts", "How well it is played"]
    assert "| rescue (victim) | the `vessel` engine | ≤ 50 m |" in text
    assert "| oracle | 100 \\[21, 100\\] (1/1) | 100 |" in text and "| SSR |" in text and "CD" not in text
    assert "seed 7, broadcast, played by `heuristic`" in text


def test_a_page_refuses_results_of_another_version(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, pages, mission = tmp_path / "results.parquet", tmp_path / "pages", tmp_path / "mine.ljs"
    mission.write_text(f"{(SCENARIOS / 'ssr.ljs').read_text()}# changed\n")
    line = ["--results", str(results(table)), "-o", str(pages)]
    assert run_command(["docs", str(mission), *line]) == 2
    assert "1 of the 1 rows of `ssr`" in (text := capsys.readouterr().err) and "another version of the mission" in text
    assert run_command(["docs", "-", *line]) == 2
    results(table, benchmark="0" * 64)
    assert run_command(["docs", "ssr", *line]) == 2
    assert "another version of the benchmark" in capsys.readouterr().err
    assert not pages.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("docs", "vdn", "--trace", "{trace}", "-o", "{out}"), "is of the mission `ssr`, not of `vdn`"),
        (("docs", "ssr", "--trace", "{trace}"), "a page with pictures needs a folder"),
        (("docs", "ssr", "--trace", "{trace}", "-o", "-"), "a page with pictures needs a folder"),
        (("docs", "ssr", "--trace", "none.mcap", "-o", "{out}"), "none.mcap"),
        (("docs", "ssr", "--results", "{trace}", "-o", "{out}"), "holds no results of a suite"),
        (("docs", "ssr", "--results", "none.parquet", "-o", "{out}"), "cannot read `none.parquet`"),
        (("docs", "ssr", "--trace", "{trace}", "-o", "/proc/nowhere"), "/proc/nowhere"),
    ],
)
def test_a_page_that_cannot_be_written_gives_a_message(
    arguments: tuple[str, ...], message: str, played: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    filled = [part.format(trace=played, out=tmp_path / "pages") for part in arguments]
    assert run_command(filled) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "pages").exists()
