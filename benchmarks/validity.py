"""The stored record of the studies: `validity.json` beside this file, shown in docs/validity.md and the README.

`python -m benchmarks.validity DIR --write` makes the record of the rows in a folder of `lingjing bench validity`,
stores it with the rows (`validity-rows`), and writes its tables into both pages. A copy of the stored rows is a folder
that the same command continues. Without DIR it takes the stored record, without `--write` it only compares.

Exit codes: 0 the pages show the record, or were written; 1 a page differs from the record; 2 there is no such record.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from lingjing.bench.adversaries import SALT
from lingjing.bench.evidence import AUDIT
from lingjing.bench.folder import RESULTS, ResultsFolder, write_whole
from lingjing.bench.parquet import encode_rows, read_rows
from lingjing.bench.validity.pages import NO_MODEL, readme_rows, tables
from lingjing.bench.validity.program import read_program
from lingjing.bench.validity.record import (
    RECORD,
    ValidityRecord,
    encode_record,
    make_record,
    read_record,
    reading_studies,
)
from lingjing.errors import UsageError, hint_of
from lingjing.plugins.host import PluginHost

ROOT = Path(__file__).parents[1]
STORE = Path(__file__).with_name(RECORD)
ROWS = Path("benchmarks") / "validity-rows"
"""The folder of the stored rows, one folder for each study, below the root."""
BESIDE = ("salt", SALT, AUDIT)
"""The files of a study that are stored beside its rows: the salts that draw the players' chances and its instances, and
the audit."""
PAGE, README = Path("docs/validity.md"), Path("README.md")
BEGIN, END = "<!-- tables: python -m benchmarks.validity -->", "<!-- end of the tables -->"
"""The lines around the tables of the page."""
NOTHING = (
    "Nothing was played yet: the table is empty until `lingjing bench validity` has been run and its record is stored "
    f"as `benchmarks/{RECORD}`. {NO_MODEL}\n"
)
"""The text in place of the tables while there is no record."""
ENTRANTS = ("oracle", "heuristic")
"""The entrants of the README's table."""
_README_TABLE = re.compile(r"^Episodes won\b[^\n]*\n\n(?:\|[^\n]*\n)+", re.MULTILINE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the pages with a record, or write both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "folder", metavar="DIR", nargs="?", type=Path, help="a results folder (default: the stored one)"
    )
    parser.add_argument("--program", metavar="FILE", type=Path, help="a program of your own (default: the shipped one)")
    parser.add_argument("--write", action="store_true", help="store the record and write the pages")
    args = parser.parse_args(arguments)
    rows: dict[Path, bytes] = {}
    try:
        if args.folder is None:
            record = read_record(STORE)
        else:
            record, rows = record_and_rows(args.folder, args.program)
    except UsageError as error:
        print(f"error: {error}\nhint: {hint_of(error)}", file=sys.stderr)
        return 2
    wanted = written(ROOT, record)
    differing = [path for path, content in wanted.items() if not path.is_file() or path.read_bytes() != content]
    if args.write:
        for path in differing:
            write_whole(path, wanted[path])
    if rows and rows != stored_rows():
        differing.append(ROOT / ROWS)
        if args.write:
            store_rows(rows)
    for path in differing:
        print(f"{path.relative_to(ROOT)}: {'written' if args.write else 'differs from the record'}")
    return int(bool(differing) and not args.write)


def written(root: Path, record: ValidityRecord) -> dict[Path, bytes]:
    """Return the files below a root that show or store the record, with their contents."""
    page, readme = root / PAGE, root / README
    return {
        root / "benchmarks" / RECORD: encode_record(record),
        page: page_with(page.read_text(encoding="utf-8"), record).encode(),
        readme: readme_with(readme.read_text(encoding="utf-8"), record).encode(),
    }


def record_and_rows(folder: Path, program: Path | None = None) -> tuple[ValidityRecord, dict[Path, bytes]]:
    """Return the record of a results folder, and the files of its rows by their paths below `ROWS`.

    Both are of the same moment. A study that a command was killed in has rows in single files; they are joined here.
    Raises `UsageError` if the folder holds no studies of the program.
    """
    file = read_program(program)
    with reading_studies(file, folder, PluginHost()) as studies:
        record = make_record(file.program.name, studies)
        played = [study.run.results for study in studies if study.run.results.rows]
        rows = {Path(each.folder.name, RESULTS): _joined(each) for each in played}
        for each in played:
            for beside in (each.folder / name for name in BESIDE):
                if beside.is_file():
                    rows[Path(each.folder.name, beside.name)] = beside.read_bytes()
    return record, rows


def stored_rows() -> dict[Path, bytes]:
    """Return the files of the stored rows by their paths below `ROWS`."""
    files = (file for file in (ROOT / ROWS).glob("*/*") if file.name in (RESULTS, *BESIDE))
    return {file.relative_to(ROOT / ROWS): file.read_bytes() for file in files}


def store_rows(rows: Mapping[Path, bytes]) -> None:
    """Replace the stored rows as a whole. A kill leaves the old ones or the new ones, at worst under another name."""
    place = ROOT / ROWS
    new, old = (place.with_name(f"{place.name}.{word}") for word in ("new", "old"))
    shutil.rmtree(new, ignore_errors=True)
    for path, content in rows.items():
        (new / path).parent.mkdir(parents=True, exist_ok=True)
        write_whole(new / path, content)
    if place.is_dir():
        shutil.rmtree(old, ignore_errors=True)
        place.rename(old)
    new.rename(place)
    shutil.rmtree(old, ignore_errors=True)


def _joined(results: ResultsFolder) -> bytes:
    """Return the file of all rows of a study: its own one if that has them all."""
    whole = results.folder / RESULTS
    if whole.is_file() and {row.key: row for row in read_rows(whole)} == {row.key: row for row in results.rows}:
        return whole.read_bytes()
    return encode_rows(results.rows)


def stored_record() -> ValidityRecord | None:
    """Return the stored record; None while nothing was played."""
    return read_record(STORE) if STORE.is_file() else None


def page_with(text: str, record: ValidityRecord | None) -> str:
    """Return the text of the page with the tables of a record between its two marks."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise SystemExit(f"{PAGE} has lost its marks: {BEGIN} and {END}")
    shown = NOTHING if record is None else tables(record)
    return f"{before}{begin}\n\n{shown}\n{end}{after}"


def readme_with(text: str, record: ValidityRecord) -> str:
    """Return the README with the wins of the record in place of its table. The new table has no more words."""
    heads = [f"`{entrant}`/{tier}" for entrant in ENTRANTS for tier in (0, 1)]
    table = [f"|column|{'|'.join(heads)}|", f"|{'---|' * (len(heads) + 1)}", *readme_rows(record, ENTRANTS)]
    lines = ["Episodes won, [tier](docs/validity.md) 0 and 1; no model has played yet:", "", *table, ""]
    changed, count = _README_TABLE.subn(lambda _: "\n".join(lines), text)
    if count != 1:
        raise SystemExit(f"{README} has lost its table of episodes won")
    return changed


if __name__ == "__main__":
    raise SystemExit(main())
