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
from collections.abc import Sequence
from pathlib import Path

from lingjing.bench.adversaries import SALT
from lingjing.bench.folder import RESULTS
from lingjing.bench.validity.pages import NO_MODEL, readme_rows, tables
from lingjing.bench.validity.program import read_program
from lingjing.bench.validity.record import RECORD, ValidityRecord, encode_record, read_record, record_of_folder
from lingjing.errors import UsageError, hint_of
from lingjing.plugins.host import PluginHost

ROOT = Path(__file__).parents[1]
STORE = Path(__file__).with_name(RECORD)
ROWS = Path("benchmarks") / "validity-rows"
"""The folder of the stored rows, one folder for each study, below the root."""
KEPT = (RESULTS, "salt", SALT)
"""The files of a study that are stored: its rows, and the salts that draw the players' chances and its instances."""
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
    try:
        record = read_record(STORE) if args.folder is None else record_of(args.folder, args.program)
    except UsageError as error:
        print(f"error: {error}\nhint: {hint_of(error)}", file=sys.stderr)
        return 2
    wanted = written(ROOT, record)
    differing = [path for path, content in wanted.items() if not path.is_file() or path.read_bytes() != content]
    if args.folder is not None:
        rows = rows_of(args.folder)
        differing += [path for path, content in rows.items() if not path.is_file() or path.read_bytes() != content]
        wanted |= rows
        if args.write and rows:
            shutil.rmtree(ROOT / ROWS, ignore_errors=True)  # studies that the folder does not hold
            differing = list(dict.fromkeys((*differing, *rows)))
    for path in differing:
        if args.write:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(wanted[path])
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


def record_of(folder: Path, program: Path | None = None) -> ValidityRecord:
    """Return the record of the rows in a results folder. Raises `UsageError` if it holds no studies of the program."""
    return record_of_folder(read_program(program), folder, PluginHost())


def rows_of(folder: Path) -> dict[Path, bytes]:
    """Return the files of the stored rows with their contents, of the studies in a results folder that have rows."""
    studies = sorted(file.parent for file in folder.glob(f"*/{RESULTS}"))
    files = (study / name for study in studies for name in KEPT if (study / name).is_file())
    return {ROOT / ROWS / file.parent.name / file.name: file.read_bytes() for file in files}


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
