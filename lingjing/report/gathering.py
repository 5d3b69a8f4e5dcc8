"""Reads places into evidence.

Traces are read one at a time in each of `jobs` processes, and only their rows are kept: a thousand traces are never in
memory together.
"""

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
from lingjing.decoding import from_json
from lingjing.errors import LingjingError, UsageError, hint_of
from lingjing.report.evidence import (
    FrameProbe,
    PromptTrial,
    ReportEvidence,
    ReportStudy,
    TracedEpisode,
    TwinFolders,
)
from lingjing.report.places import PlaceContents, find_places
from lingjing.report.trace_rows import row_of, with_conditions
from lingjing.trace.reader import read_trace
from lingjing.trace.records import CUT_SHORT

DecodedT = TypeVar("DecodedT")

NAMED = 3
"""Number of omitted traces that a note names; the others are counted."""


class _TraceReading(NamedTuple):
    """The outcome of reading one trace."""

    path: Path
    """Path of the trace."""

    row: SuiteRow | None
    """Row of its episode; None if it cannot be read."""

    error: str = ""
    """The message of the error that prevented reading."""

    hint: str = ""
    """The hint of `error`."""


def gather(
    places: Sequence[Path],
    *,
    jobs: int = 1,
    other_code: bool = False,
    tell: Callable[[int, int], None] = lambda done, whole: None,
) -> ReportEvidence:
    """Read everything at the places. `tell` receives the number of traces that are read, and the number of all.

    A trace in a folder that cannot be read is left out, and a note reports it. Raises `UsageError` if a place cannot be
    read that was named itself, if no episode is left, or if results do not fit together.
    """
    contents = find_places(places)
    suites, traced = _suites(contents.results, other_code)
    loose, more, left_out = _loose(contents, jobs, tell)
    evidence = ReportEvidence(
        studies=tuple(suites + loose),
        traced=tuple(traced + more),
        searches=tuple(_search(folder) for folder in contents.searches),
        probes=tuple(FrameProbe(folder.name, _probe(folder)) for folder in contents.probes),
        twins=tuple(_paired(contents.frames, contents.twins)),
        left_out=tuple(left_out),
    )
    if not (evidence.episodes or evidence.searches or evidence.probes or evidence.twins):
        hint = "; ".join(left_out) or "`lingjing run` and `lingjing bench` play some"
        raise UsageError("there is no episode to report: nothing at these places counts", hint=hint)
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
    """Return the path of a row's trace; None if the trace was not kept."""
    if not row.report.trace:
        return None
    return next((path for folder in folders if (path := folder / row.report.trace).is_file()), None)


# -- single traces


def _loose(
    contents: PlaceContents, jobs: int, tell: Callable[[int, int], None]
) -> tuple[list[ReportStudy], list[TracedEpisode], list[str]]:
    read: list[tuple[_TraceReading, SuiteRow]] = []
    cut, errors, again = list[Path](), list[str](), list[Path]()
    for done, reading in enumerate(_readings(contents.traces, jobs), 1):
        if reading.row is None and reading.path in contents.named:
            raise UsageError(reading.error, hint=reading.hint or "leave it out")
        if reading.row is None:
            errors.append(reading.error)
        elif reading.row.report.reason in CUT_SHORT:
            cut.append(reading.path)
        else:
            read.append((reading, reading.row))
        tell(done, len(contents.traces))
    rows = with_conditions(row for _, row in read)
    kept: dict[object, tuple[_TraceReading, SuiteRow]] = {}
    by_path = {row.report.trace: row for row in rows}
    for reading, first in read:
        row = by_path[first.report.trace]
        if row.key in kept:
            again.append(reading.path)
        else:
            kept[row.key] = reading, row
    notes = [
        *_noted(
            cut, "cut short (interrupted, aborted by the infrastructure, killed, or the file is damaged), so in no rate"
        ),
        *_noted(again, "of an episode that is counted already (entrant, column, condition and seed)"),
        *_noted(errors, "cannot be read"),
    ]
    rows = [row for _, row in kept.values()]
    traced = [TracedEpisode(reading.path, row) for reading, row in kept.values()]
    return [_study("", "", rows)] if rows else [], traced, notes


def _readings(paths: Sequence[Path], jobs: int) -> Iterator[_TraceReading]:
    if jobs == 1 or len(paths) < 2:
        yield from map(_reading, paths)
        return
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(min(jobs, len(paths))) as pool:
        yield from pool.map(_reading, paths, chunksize=4)


def _reading(path: Path) -> _TraceReading:
    try:
        with collector_at_rest():
            row = row_of(read_trace(path))
            return _TraceReading(path, msgspec.structs.replace(row, attention_iou=attention_beside(path)))
    except LingjingError as error:
        return _TraceReading(path, None, error=str(error), hint=hint_of(error))


def _noted(traces: Sequence[object], reason: str) -> Iterator[str]:
    if traces:
        named = "; ".join(str(trace) for trace in traces[:NAMED])
        more = f" and {len(traces) - NAMED} more" if len(traces) > NAMED else ""
        yield f"{reason}: {len(traces)} trace{'s' * (len(traces) > 1)}: {named}{more}"


# -- measurements of other commands


def _search(folder: Path) -> PromptTrial:
    return PromptTrial(folder.name, _decoded(folder / RESULTS, KeptSearch).candidates)


def _probe(folder: Path) -> tuple[ProbeCell, ...]:
    return tuple(_decoded(folder / "counts.json", list[ProbeCell]))


def _decoded(file: Path, kind: type[DecodedT]) -> DecodedT:
    try:
        return from_json(file.read_bytes(), kind)
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise UsageError(f"`{file}` is not what this version writes: {error}", hint="leave its folder out") from error


def _paired(sets: Sequence[Path], twins: Sequence[Path]) -> Iterator[TwinFolders]:
    """Yield each folder of twins with the set that has most of its frames."""
    names = {
        folder: {frame.frame.name for cls in set_classes(folder) for frame in read_class(folder, cls)}
        for folder in sets
    }
    for folder in twins:
        edited = {twin.name for twin in read_twins(folder).taken}
        shared = {frames: len(edited & known) for frames, known in names.items()}
        if any(shared.values()):
            yield TwinFolders(max(shared, key=lambda frames: shared[frames]), folder)


__all__ = ["gather"]
