"""Two short episodes that engines played, folders of made rows, and the texts of drawings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from lingjing import Session
from lingjing.bench.parquet import encode_rows
from lingjing.report.drawing import Drawing
from lingjing.report.evidence import ReportEvidence
from lingjing.report.gathering import gather
from lingjing.report.painting import painted
from lingjing.testing import mission_file
from tests.bench.suite_kit import SuiteRow

TICKS = 12


def lines_of(drawing: Drawing) -> list[str]:
    """The lines of text of a drawing."""
    with painted(drawing) as painting:
        return painting.lines()


def tooltips_of(drawing: Drawing) -> list[str]:
    """The tooltips of a drawing's marks."""
    with painted(drawing) as painting:
        return list(painting.tooltips.values())


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seed 1 of a sea rescue of twelve ticks in star and in broadcast, played by the oracle."""
    folder = tmp_path_factory.mktemp("report")
    text = mission_file("ssr").read_text().replace("ticks <= 60", f"ticks <= {TICKS}")
    (folder / "ssr.ljs").write_text(text)
    with Session() as session:
        for mode in ("star", "broadcast"):
            out = folder / "runs" / mode
            session.run(folder / "ssr.ljs", mode=mode, policy="oracle", seed=1, out=out, overview=False)
    return folder / "runs"


@pytest.fixture(scope="session")
def evidence(runs: Path) -> ReportEvidence:
    """The evidence of these two episodes."""
    return gather([runs])


@pytest.fixture
def results(tmp_path: Path) -> Callable[..., Path]:
    """A function that writes rows as a suite's folder and returns the folder."""

    def write(rows: Sequence[SuiteRow], name: str = "results") -> Path:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / "results.parquet").write_bytes(encode_rows(rows))
        return folder

    return write
