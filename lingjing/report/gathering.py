"""From places to evidence. Traces are read one at a time in each of `jobs` processes and only their rows are kept, so
that a thousand of them are never in memory at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from lingjing.analysis.attention import attention_beside
from lingjing.bench.folder import read_results
from lingjing.bench.frame_sets.folder import read_class, set_classes
from lingjing.bench.frame_sets.probe import ProbeCell
from lingjing.bench.frame_sets.twins import read_twins
from lingjing.bench.merging import merge_rows
from lingjing.bench.played import columns_of
from lingjing.bench.prompt_search import RESULTS, KeptSearch
from lingjing.bench.rows import SuiteRow
from lingjing.bench.suite import read_document
from lingjing.bench.unresolved import unresolved_entrants, with_marked_names
from lingjing.collector import collector_at_rest
from lingjing.errors import LingjingError, UsageError
from lingjing.report.evidence import (
    FrameProbe,
    PromptTrial,
    ReportEvidence,
    ReportStudy,
    TracedEpisode,
    TwinFolders,
)
from lingjing.report.places import FoundPlaces, find_places
from lingjing.report.trace_rows import row_of, with_conditions
from lingjing.trace.reader import read_trace
from lingjing.trace.records import CUT_SHORT

DecodedT = TypeVar("DecodedT")

NAMED = 3
"""So many of what is left out are named."""


class TraceReading(NamedTuple):
    """What became of reading one trace: a row, or why there is none."""

    path: Path
    row: SuiteRow | None
    fault: str = ""
    hint: str = ""


def gather(
    places: Sequence[Path],
    *,
    jobs: int = 1,
    other_code: bool = False,
    tell: Callable[[int, int], None] = lambda done, whole: None,
) -> ReportEvidence:
    """Everything that lies at the places. `tell` is given how many of how many traces have been read.

    A trace that was named itself and cannot be read raises `UsageError`; one that was found in a folder is left out,
    and said to be. Raises `UsageError` as well where nothing is left, or where results do not fit together.
    """
    found = find_places(places)
    suites, traced = _suites(found.results, other_code)
    loose, more, left_out = _loose(found, jobs, tell)
    evidence = ReportEvidence(
        studies=tuple(suites + loose),
        traced=tuple(traced + more),
        searches=tuple(_search(folder) for folder in found.searches),
        probes=tuple(FrameProbe(folder.name, _probe(folder)) for folder in found.probes),
        twins=tuple(_paired(found.frames, found.twins)),
        left_out=tuple(left_out),
    )
    if not (evidence.episodes or evidence.searches or evidence.probes or evidence.twins):
        hint = "; ".join(left_out) or "`lingjing run` and `lingjing bench` play some"
        raise UsageError("there is no episode to report: none of what was found counts", hint=hint)
    return evidence


# -- results of suites


def _suites(places: Sequence[Path], other_code: bool) -> tuple[list[ReportStudy], list[TracedEpisode]]:
    by_suite: dict[str, list[tuple[Path, SuiteRow]]] = {}
    for place in places:
        for row in read_results(place):
            by_suite.setdefault(row.suite, []).append((place, row))
    studies, traced = list[ReportStudy](), list[TracedEpisode]()
    for name, read in by_suite.items():
        rows = merge_rows(read, other_code=other_code)
        folders = list(dict.fromkeys(place if place.is_dir() else place.parent for place, _ in read))
        study = _study(name, _title(folders, name), rows)
        studies.append(study)
        traced += (TracedEpisode(path, row) for row in study.rows if (path := _kept(row, folders)) is not None)
    return studies, traced


def _study(name: str, title: str, rows: Sequence[SuiteRow]) -> ReportStudy:
    columns = {column: at for at, column in enumerate(columns_of(rows))}
    counted = sorted(
        (row for row in rows if row.standing == "counted"),
        key=lambda row: (columns[row.mission, row.mode], row.entrant_place, row.condition_place, row.seed),
    )
    named = with_marked_names(counted, unresolved_entrants(rows))
    return ReportStudy(name=name, title=title, rows=tuple(named), all_rows=tuple(rows))


def _title(folders: Sequence[Path], name: str) -> str:
    file = next((folder / "suite.toml" for folder in folders if (folder / "suite.toml").is_file()), None)
    title = str(read_document(file).get("title", "")) if file is not None else ""
    return title or name


def _kept(row: SuiteRow, folders: Sequence[Path]) -> Path | None:
    """The trace of a row, if it was kept."""
    if not row.report.trace:
        return None
    return next((path for folder in folders if (path := folder / row.report.trace).is_file()), None)


# -- traces that are no suite's


def _loose(
    found: FoundPlaces, jobs: int, tell: Callable[[int, int], None]
) -> tuple[list[ReportStudy], list[TracedEpisode], list[str]]:
    read: list[tuple[TraceReading, SuiteRow]] = []
    cut, faults, again = list[Path](), list[str](), list[Path]()
    for done, one in enumerate(_readings(found.traces, jobs), 1):
        if one.row is None and one.path in found.named:
            raise UsageError(one.fault, hint=one.hint or "leave it out")
        if one.row is None:
            faults.append(one.fault)
        elif one.row.report.reason in CUT_SHORT:
            cut.append(one.path)
        else:
            read.append((one, one.row))
        tell(done, len(found.traces))
    rows = with_conditions(row for _, row in read)
    kept: dict[object, tuple[TraceReading, SuiteRow]] = {}
    by_path = {row.report.trace: row for row in rows}
    for one, first in read:
        row = by_path[first.report.trace]
        if row.key in kept:
            again.append(one.path)
        else:
            kept[row.key] = one, row
    notes = [
        *_noted(
            cut, "cut short (interrupted, aborted by the infrastructure, killed, or the file is damaged), so in no rate"
        ),
        *_noted(again, "of an episode that is counted already (entrant, column, condition and seed)"),
        *_noted(faults, "cannot be read"),
    ]
    rows = [row for _, row in kept.values()]
    traced = [TracedEpisode(one.path, row) for one, row in kept.values()]
    return [_study("", "", rows)] if rows else [], traced, notes


def _readings(paths: Sequence[Path], jobs: int) -> Iterator[TraceReading]:
    if jobs == 1 or len(paths) < 2:
        yield from map(_reading, paths)
        return
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(min(jobs, len(paths))) as pool:
        yield from pool.map(_reading, paths, chunksize=4)


def _reading(path: Path) -> TraceReading:
    try:
        with collector_at_rest():
            row = row_of(read_trace(path))
            return TraceReading(path, msgspec.structs.replace(row, attention_iou=attention_beside(path)))
    except LingjingError as error:
        return TraceReading(path, None, fault=str(error), hint=error.hint)


def _noted(what: Sequence[object], said: str) -> Iterator[str]:
    if what:
        named = "; ".join(str(one) for one in what[:NAMED])
        more = f" and {len(what) - NAMED} more" if len(what) > NAMED else ""
        yield f"{said}: {len(what)} trace{'s' * (len(what) > 1)}: {named}{more}"


# -- what other verbs have measured


def _search(folder: Path) -> PromptTrial:
    return PromptTrial(folder.name, _decoded(folder / RESULTS, KeptSearch).candidates)


def _probe(folder: Path) -> tuple[ProbeCell, ...]:
    return tuple(_decoded(folder / "counts.json", list[ProbeCell]))


def _decoded(file: Path, kind: type[DecodedT]) -> DecodedT:
    try:
        return msgspec.json.decode(file.read_bytes(), type=kind)
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise UsageError(f"`{file}` is not what this version writes: {error}", hint="leave its folder out") from error


def _paired(sets: Sequence[Path], twins: Sequence[Path]) -> Iterator[TwinFolders]:
    """Each folder of twins with the set that has most of its frames."""
    names = {
        folder: {one.frame.name for cls in set_classes(folder) for one in read_class(folder, cls)} for folder in sets
    }
    for folder in twins:
        taken = {one.name for one in read_twins(folder).taken}
        shared = {one: len(taken & known) for one, known in names.items()}
        if any(shared.values()):
            yield TwinFolders(max(shared, key=lambda one: shared[one]), folder)


__all__ = ["gather"]
