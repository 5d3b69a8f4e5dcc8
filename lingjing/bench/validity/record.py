"""The record of the studies: for each entrant, column and tier the seeds that were played, won and lost.

The file has one line for each of them, sorted, so that two records can be compared line by line. Seeds are written as
ranges: `0-2,5`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.bench.adversaries import FIRST_FRESH
from lingjing.bench.evidence import audit_marks, check_rows, row_sha256
from lingjing.bench.executors import LocalExecutor
from lingjing.bench.rows import SuiteRow
from lingjing.bench.suite import MOST_SEEDS
from lingjing.bench.validity.program import Comparison, ProgramFile, Sees
from lingjing.bench.validity.studies import AdversaryStudy, PartStudy, Study, open_studies, plan_program
from lingjing.decoding import from_json
from lingjing.errors import UsageError
from lingjing.plugins.host import PluginHost

FORMAT = "lingjing-validity/1"
"""The format's name and version."""
RECORD = "validity.json"
"""The file of the record in the results folder."""


class RecordedStudy(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The versions behind the rows of a study."""

    study: str
    """The name of its folder."""
    compares: Comparison | Literal[""] = ""
    """The comparison that it was made for; "" for none."""
    benchmark: tuple[str, ...] = ()
    """The version of the benchmark; none if nothing was played."""
    missions: dict[str, str] = {}
    """The version of each mission that was played, by its name."""
    code: tuple[str, ...] = ()
    """The hashes of the code, sorted; several only with `--other-code`."""
    split: str = ""
    """The hash of the salt that drew its instances; "" for public seeds."""
    audited: int = 0
    """The number of its counted rows that `lingjing bench audit` has confirmed."""


class RecordedCell(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The episodes of an entrant in a column of a study."""

    study: str
    column: str
    """Mission and mode, such as `ssr-star`."""
    tier: int
    entrant: str
    sees: Sees
    planned: int
    """The number of seeds that the program declares."""
    seeds: str = ""
    """The seeds with a counted result, as ranges."""
    won: str = ""
    """The seeds in `seeds` of won episodes, as ranges."""
    lost: str = ""
    """The seeds of episodes without a result because of an infrastructure error, as ranges."""


class RecordedAdversary(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The worst adversary of a column at tier 1."""

    column: str
    planned: int
    """The number of fresh seeds that the program declares."""
    worst: str = ""
    """Its name; "" if it is not chosen yet."""
    sees: Literal["pictures", "nothing"] = "pictures"
    """`nothing`: its pictures are black."""
    seeds: str = ""
    """The fresh seeds with a counted result, as ranges."""
    won: str = ""
    lost: str = ""
    """The fresh seeds that the infrastructure has lost; the verdict counts them as won."""
    verdict: str = "undecided"
    """The verdict of the sequential test (`lingjing.bench.adversaries`)."""
    selection: tuple[tuple[str, int, int], ...] = ()
    """Adversary, wins and episodes on the seeds of the choice."""


class ValidityRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The record of a program."""

    format: str = FORMAT
    program: str
    """The program's name."""
    studies: tuple[RecordedStudy, ...]
    cells: tuple[RecordedCell, ...]
    adversaries: tuple[RecordedAdversary, ...] = ()


def make_record(program: str, studies: Sequence[Study]) -> ValidityRecord:
    """Return the record of the studies' rows, sorted. Raises `UsageError` for a row that contradicts itself or the
    others of its study.
    """
    for study in studies:
        _check_alike(study)
    _check_versions(studies)
    check_rows(row for study in studies for row in study.run.results.rows)
    parts = [study for study in studies if isinstance(study, PartStudy)]
    cells = sorted(
        (cell for study in parts for cell in _cells(study)),
        key=lambda cell: (cell.study, cell.column, cell.tier, cell.entrant),
    )
    adversaries = [each for study in studies if isinstance(study, AdversaryStudy) for each in _adversaries(study)]
    return ValidityRecord(
        program=program,
        studies=tuple(sorted(map(_recorded, studies), key=lambda study: study.study)),
        cells=tuple(cells),
        adversaries=tuple(sorted(adversaries, key=lambda each: each.column)),
    )


@contextmanager
def reading_studies(file: ProgramFile, folder: Path, host: PluginHost) -> Iterator[tuple[Study, ...]]:
    """Yield the studies in a results folder; no command can write to them meanwhile.

    Raises `UsageError` if the folder has none, or if a command is writing to it.
    """
    planned = plan_program(file, host)
    if not any((folder / plan.name).is_dir() for plan in planned):
        raise UsageError(
            f"`{folder}` holds no studies of the program `{file.program.name}`",
            hint="name the folder that `lingjing bench validity -o DIR` wrote",
        )
    with open_studies(planned, folder, LocalExecutor(), reading=True) as studies:
        yield studies


def _check_alike(study: Study) -> None:
    """Raise `UsageError` for rows that no command would have put into one folder."""
    rows, folder = study.run.results.rows, study.run.results.folder
    hint = "restore the folder: a command never mixes them"
    for other in sorted({row.suite for row in rows} - {study.run.plan.suite.name}):
        raise UsageError(f"`{folder}` holds results of the suite `{other}`", hint=hint)
    if len({(row.benchmark, row.split_sha256) for row in rows}) > 1:
        raise UsageError(
            f"the rows in `{folder}` are of several versions of the benchmark, or of several salts", hint=hint
        )


def _check_versions(studies: Sequence[Study]) -> None:
    """Raise `UsageError` if the studies are of several versions of the benchmark or of a mission."""
    rows = [row for study in studies for row in study.run.results.rows]
    if len({row.benchmark for row in rows}) > 1:
        raise UsageError("the studies are of several versions of the benchmark", hint="play them in one folder")
    for mission in sorted({row.mission for row in rows}):
        if len({row.mission_sha256 for row in rows if row.mission == mission}) > 1:
            raise UsageError(
                f"the rows are of several versions of the mission `{mission}`",
                hint="continue all studies with `lingjing bench validity --replay-changed --other-code`",
            )


def _recorded(study: Study) -> RecordedStudy:
    rows, marks = study.run.results.rows, audit_marks([study.run.results.folder])
    counted = [row for row in rows if row.standing == "counted"]
    return RecordedStudy(
        study=study.planned.name,
        compares=(study.planned.part.compares or "") if isinstance(study, PartStudy) else "",
        benchmark=tuple(sorted({row.benchmark for row in rows})),
        missions=dict(sorted({row.mission: row.mission_sha256 for row in rows if row.mission_sha256}.items())),
        code=tuple(sorted({row.code for row in rows})),
        split=next((row.split_sha256 for row in rows), ""),
        audited=sum(row_sha256(row) in marks for row in counted) if marks else 0,
    )


def _cells(study: PartStudy) -> Iterator[RecordedCell]:
    sees, planned = study.planned.sees, set(study.planned.part.seeds)
    rows = [row for row in study.run.results.rows if row.seed in planned]
    for cell in study.planned.plan.cells:
        counted, won, lost = _seeds(row for row in rows if row.cell == cell.key)
        name = cell.player.name
        yield RecordedCell(study=study.planned.name, column=cell.column_name, tier=cell.column.tier, entrant=name,
                           sees=sees[name], planned=len(planned), seeds=counted, won=won, lost=lost)  # fmt: skip


def _adversaries(study: AdversaryStudy) -> Iterator[RecordedAdversary]:
    blind = {each.name for each in study.planned.matrix.adversaries if each.blank_pictures}
    for result in study.whole.results():
        rows = [row for row in study.run.results.rows if row.seed >= FIRST_FRESH]
        own = [row for row in rows if row.entrant == result.worst and f"{row.mission}-{row.mode}" == result.column]
        counted, won, lost = _seeds(own)
        yield RecordedAdversary(
            column=result.column, planned=study.planned.declared.fresh, worst=result.worst,
            sees="nothing" if result.worst in blind else "pictures", seeds=counted, won=won, lost=lost,
            verdict=result.verdict.value, selection=result.selection,
        )  # fmt: skip


def _seeds(rows: Iterable[SuiteRow]) -> tuple[str, str, str]:
    """Return the counted, the won and the lost seeds as ranges. Aborted tries count nowhere."""
    listed = list(rows)
    counted = [row for row in listed if row.standing == "counted"]
    return (
        ranges(row.seed for row in counted),
        ranges(row.seed for row in counted if row.report.success),
        ranges(row.seed for row in listed if row.standing == "lost"),
    )


def ranges(seeds: Iterable[int]) -> str:
    """Return seeds as text: `0-2,5` for 0, 1, 2 and 5; "" for none."""
    runs: list[list[int]] = []
    for seed in sorted(set(seeds)):
        if runs and seed == runs[-1][1] + 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in runs)


def seeds_of(text: str) -> tuple[int, ...]:
    """Return the seeds of such a text, in order. Raises `ValueError` for any other text."""
    seeds: list[int] = []
    for run in text.split(",") if text else ():
        first, dash, last = run.partition("-")
        low, high = int(first), int(last if dash else first)
        if not low <= high < low + MOST_SEEDS:
            raise ValueError(f"`{run}` is no range of seeds")
        seeds += range(low, high + 1)
    return tuple(seeds)


def encode_record(record: ValidityRecord) -> bytes:
    """Return the file of a record: JSON with one line for each study, cell and adversary."""
    lines = [f'"format": {_json(record.format)}', f'"program": {_json(record.program)}']
    for name in ("studies", "cells", "adversaries"):
        items = ",\n".join(map(_json, getattr(record, name)))
        lines.append(f'"{name}": [\n{items}\n]' if items else f'"{name}": []')
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


def read_record(file: Path) -> ValidityRecord:
    """Return the record of a file. Raises `UsageError` for an unreadable file or another format."""
    try:
        record = from_json(file.read_bytes(), ValidityRecord)
        lines: list[RecordedCell | RecordedAdversary] = [*record.cells, *record.adversaries]
        for line in lines:
            _check_seeds(line)
    except OSError as error:
        hint = "`lingjing bench validity -o DIR` writes it into its folder"
        raise UsageError(f"cannot read `{file}`: {error.strerror}", hint=hint) from error
    except (ValueError, msgspec.DecodeError) as error:
        raise UsageError(f"`{file}` is not a record of the studies: {error}") from error
    if record.format != FORMAT:
        raise UsageError(f"`{file}` has the format {record.format}", hint=f"this version reads {FORMAT}")
    return record


def _check_seeds(each: RecordedCell | RecordedAdversary) -> None:
    """Raise `ValueError` if the seeds cannot be those of one entrant's episodes."""
    counted, won, lost = (set(seeds_of(text)) for text in (each.seeds, each.won, each.lost))
    if not won <= counted or counted & lost:
        raise ValueError(f"{each.column}: seeds were won that were not played, or lost ones are counted")


def _json(value: object) -> str:
    return msgspec.json.encode(value, order="deterministic").decode()


__all__ = [
    "RECORD", "RecordedAdversary", "RecordedCell", "RecordedStudy", "ValidityRecord", "encode_record", "make_record",
    "ranges", "read_record", "reading_studies", "seeds_of",
]  # fmt: skip
