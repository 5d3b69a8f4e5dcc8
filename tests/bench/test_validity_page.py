"""The page on validity: it shows the stored record, names tests that exist, and states numbers that are computed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import msgspec
import pytest

import lingjing
from benchmarks import validity
from lingjing.errors import ExitCode
from lingjing.testing import run_command
from tests.bench import test_published_flaws
from tests.bench.suite_kit import RESULTS, AuditRecord, encode_rows, read_results, row_sha256

ROOT = Path(lingjing.__file__).parents[1]
PAGE = (ROOT / validity.PAGE).read_text(encoding="utf-8")


def test_the_page_shows_the_stored_record() -> None:
    record = validity.stored_record()
    assert validity.page_with(PAGE, record) == PAGE, "write it: python -m benchmarks.validity --write"
    assert (validity.NOTHING in PAGE) is (record is None)
    assert validity.NO_MODEL in PAGE and "never by number" in PAGE


def test_the_stored_rows_give_the_stored_record(tmp_path: Path) -> None:
    """The rows behind the tables can be checked and continued."""
    rows = shutil.copytree(ROOT / validity.ROWS, tmp_path / "rows")
    assert validity.record_and_rows(rows)[0] == validity.stored_record()


def test_the_page_on_adversaries_shows_the_table_of_the_stored_controls(capsys: pytest.CaptureFixture[str]) -> None:
    rows = ROOT / "benchmarks" / "controls-rows.parquet"
    assert run_command(["bench", "table", str(rows), "--kind", "controls", "--other-code"]) == ExitCode.OK
    table = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    shown = (ROOT / "docs" / "adversaries.md").read_text(encoding="utf-8").splitlines()
    at = shown.index(table[0])
    assert len(table) == 2 + 4 and shown[at : at + len(table)] == table


def test_each_class_of_flaws_has_its_tests() -> None:
    listed = re.findall(r"^\| (\d) \| .* \| `(test_\d_)` \|$", PAGE, flags=re.MULTILINE)
    assert [int(number) for number, _ in listed] == [1, 2, 3, 4, 5, 6, 7, 8]
    for number, prefix in listed:
        tests = [name for name in vars(test_published_flaws) if name.startswith(prefix)]
        assert prefix == f"test_{number}_" and tests
    all_tests = {name[:7] for name in vars(test_published_flaws) if name.startswith("test_")}
    assert all_tests == {prefix for _, prefix in listed}


def test_the_smallest_differences_on_the_page_are_those_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    points = []
    for suite, of in (("reference", "20 of one column"), ("main", "100 of one column"), ("main", "the 1200 episodes")):
        assert run_command(["bench", suite, "--check"]) == ExitCode.OK
        points += re.findall(rf"(\d+) points over {of}", capsys.readouterr().err)
    few, many, whole = points
    assert f"{few} points with 20 seeds of a column, {many} with 100, {whole} over the 1,200 episodes" in PAGE


def test_the_commands_of_the_page_are_valid(capsys: pytest.CaptureFixture[str]) -> None:
    parts = re.findall(r"`lingjing bench validity --parts ([\w ]+)`", PAGE)
    assert parts
    for names in parts:
        assert run_command(["bench", "validity", "--check", "--parts", *names.split()]) == ExitCode.OK
    assert run_command(["bench", "controls", "--check", "--limit", "1"]) == ExitCode.OK


PROGRAM = """
validity = 1
name = "tiny"
missions = ["queue"]
[[parts]]
name = "reference"
tiers = [0]
seeds = 2
entrants = [{ policy = "oracle", sees = "truth" }, { policy = "heuristic", sees = "pictures" }]
"""


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the pages, into which the script writes."""
    for path in (validity.PAGE, validity.README):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / path, tmp_path / path)
    (tmp_path / "benchmarks").mkdir()
    monkeypatch.setattr(validity, "ROOT", tmp_path)
    monkeypatch.setattr(validity, "STORE", tmp_path / "benchmarks" / "validity.json")
    return tmp_path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A results folder: the oracle has won, the heuristic has lost."""
    from tests.bench.suite_kit import AnsweringExecutor, answered

    def answer(task: object) -> object:
        won = task.options.policy == "oracle"  # type: ignore[attr-defined]
        return answered(task, success=won, reason="success" if won else "budget", scr=float(won))  # type: ignore[arg-type]

    monkeypatch.setattr("lingjing.bench.executors.LocalExecutor", lambda jobs=1: AnsweringExecutor(answer))
    (tmp_path / "tiny.toml").write_text(PROGRAM)
    line = ["bench", "validity", "--program", str(tmp_path / "tiny.toml"), "-o", str(tmp_path / "out")]
    assert run_command(line) == ExitCode.OK
    return tmp_path / "out"


def test_the_script_stores_the_rows_and_writes_both_pages(
    root: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = [str(folder), "--program", str(root / "tiny.toml")]
    assert validity.main(line) == 1
    assert "docs/validity.md: differs from the record" in capsys.readouterr().out
    assert (root / validity.PAGE).read_text() == PAGE, "it writes only with --write"
    assert validity.main([*line, "--write"]) == 0
    page, readme = ((root / path).read_text() for path in (validity.PAGE, validity.README))
    assert "| oracle † | truth | 100 [34, 100] (2/2) | – |" in page and "Nothing was played yet" not in page
    assert "|queue-broadcast|2/2|–|0/2|–|\n|queue-star|2/2|–|0/2|–|\n" in readme
    assert len(readme.split()) < 500
    assert validity.main([]) == validity.main(line) == 0, "the pages agree with the stored record and with the rows"
    continued = shutil.copytree(root / validity.ROWS, root / "continued")
    assert [file.name for file in sorted(continued.iterdir())] == ["reference-tier0"]
    again = ["bench", "validity", "--program", str(root / "tiny.toml"), "-o", str(continued), "--check"]
    assert run_command(again) == ExitCode.OK and "0 episodes to play" in capsys.readouterr().err
    (root / validity.PAGE).write_text(page.replace("(2/2)", "(2/3)"))
    assert validity.main([]) == 1


def test_rows_of_a_killed_command_and_the_audit_are_stored_too(root: Path, folder: Path) -> None:
    """A killed command leaves rows in single files; the stored rows give the stored record all the same."""
    program, study = root / "tiny.toml", folder / "reference-tier0"
    rows = read_results(study)
    (study / RESULTS).write_bytes(encode_rows(rows[:3]))
    for number, row in enumerate(rows[3:]):
        (study / "parts" / f"{number:08d}.parquet").write_bytes(encode_rows([row]))
    confirmed = AuditRecord(rows={row_sha256(row): "checked" for row in rows[:5]})
    (study / "audit.json").write_bytes(msgspec.json.encode(confirmed))
    assert validity.main([str(folder), "--program", str(program), "--write"]) == 0
    copied = shutil.copytree(root / validity.ROWS, root / "copied")
    assert len(read_results(copied / "reference-tier0")) == len(rows)
    record, _ = validity.record_and_rows(copied, program)
    assert record == validity.stored_record()
    assert [each.audited for each in record.studies] == [5]
    assert validity.main([str(folder), "--program", str(program)]) == 0


def test_stored_rows_are_replaced_as_a_whole(
    root: Path, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    line, stored = [str(folder), "--program", str(root / "tiny.toml")], root / validity.ROWS
    shutil.copytree(folder / "reference-tier0", folder / "of-another-program")
    assert validity.main([*line, "--write"]) == 0
    assert [study.name for study in stored.iterdir()] == ["reference-tier0"]
    (stored / "reference-tier0" / RESULTS).write_bytes(b"old")
    shutil.copytree(stored / "reference-tier0", stored / "removed")
    assert validity.main(line) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "benchmarks/validity-rows: differs from the record"
    whole, written = validity.write_whole, []

    def killed(file: Path, content: bytes) -> None:
        written.append(file)
        if len(written) > 1:
            raise KeyboardInterrupt
        whole(file, content)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(validity, "write_whole", killed)
        validity.main([*line, "--write"])
    assert sorted(study.name for study in stored.iterdir()) == ["reference-tier0", "removed"]
    assert {(study / RESULTS).read_bytes() for study in stored.iterdir()} == {b"old"}
    assert validity.main([*line, "--write"]) == validity.main(line) == 0
    assert [study.name for study in stored.iterdir()] == ["reference-tier0"]
    assert [place.name for place in stored.parent.iterdir() if place.is_dir()] == ["validity-rows"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"suite": "reference-tier1"}, "holds results of the suite `reference-tier1`"),
        ({"benchmark": "0" * 64}, "are of several versions of the benchmark"),
        ({"mission_sha256": "0" * 64}, "are of several versions of the mission `"),
        ({"split_sha256": "0" * 64}, "or of several salts"),
    ],
)
def test_rows_of_another_suite_benchmark_mission_or_salt_do_not_reach_the_pages(
    root: Path, folder: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any], message: str
) -> None:
    first, *rows = read_results(folder / "reference-tier0")
    changed = encode_rows([msgspec.structs.replace(first, **changes), *rows])
    (folder / "reference-tier0" / RESULTS).write_bytes(changed)
    assert validity.main([str(folder), "--program", str(root / "tiny.toml"), "--write"]) == 2
    assert message in capsys.readouterr().err
    assert (root / validity.PAGE).read_text() == PAGE and not (root / validity.ROWS).exists()


def test_an_edited_record_does_not_reach_the_pages(root: Path, folder: Path) -> None:
    """The script reads the rows, not the record that lies beside them."""
    file = folder / "validity.json"
    file.write_text(file.read_text().replace('"entrant":"heuristic"', '"entrant":"heuristic","won":"0-1"'))
    assert validity.main([str(folder), "--program", str(root / "tiny.toml"), "--write"]) == 0
    assert "0/2" in (root / validity.README).read_text()
    assert {row.report.success for row in read_results(folder / "reference-tier0") if row.entrant == "heuristic"} == {
        False
    }


def test_rows_that_contradict_themselves_do_not_reach_the_pages(
    root: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / "reference-tier0" / RESULTS
    rows = [msgspec.structs.replace(row, report=msgspec.structs.replace(row.report, success=True, reason="success"))
            for row in read_results(file.parent)]  # fmt: skip
    file.write_bytes(encode_rows(rows))
    assert validity.main([str(folder), "--program", str(root / "tiny.toml"), "--write"]) == 2
    assert "the row of heuristic, queue-" in capsys.readouterr().err
    assert (root / validity.PAGE).read_text() == PAGE


def test_a_missing_record_and_a_folder_without_studies_give_one_message_each(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert validity.main([]) == 2
    assert "error: cannot read" in capsys.readouterr().err
    assert validity.main([str(root / "docs")]) == 2
    assert "holds no studies of the program" in capsys.readouterr().err
    assert sorted(path.name for path in (root / "docs").iterdir()) == ["validity.md"]
