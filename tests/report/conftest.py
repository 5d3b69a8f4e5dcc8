"""Two short episodes that were really played, and a folder of rows that nobody played."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from lingjing.bench.parquet import encode_rows
from lingjing.bench.rows import SuiteRow
from lingjing.data import data_path
from lingjing.play.episode import Session
from lingjing.report.evidence import ReportEvidence
from lingjing.report.gathering import gather

TICKS = 12


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seed 1 of a sea rescue of twelve ticks in star and in broadcast, played by the oracle."""
    folder = tmp_path_factory.mktemp("report")
    text = data_path("scenarios", "ssr.ljs").read_text().replace("ticks <= 60", f"ticks <= {TICKS}")
    (folder / "ssr.ljs").write_text(text)
    with Session() as session:
        for mode in ("star", "broadcast"):
            out = folder / "runs" / mode
            session.run(folder / "ssr.ljs", mode=mode, policy="oracle", seed=1, out=out, overview=False)
    return folder / "runs"


@pytest.fixture(scope="session")
def evidence(runs: Path) -> ReportEvidence:
    """What the two say."""
    return gather([runs])


@pytest.fixture
def results(tmp_path: Path) -> Callable[..., Path]:
    """Writes rows as a suite's folder."""

    def write(rows: Sequence[SuiteRow], name: str = "results") -> Path:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / "results.parquet").write_bytes(encode_rows(rows))
        return folder

    return write
