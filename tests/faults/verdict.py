"""The verdict on the aftermath of a case: a list of faults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from errno import errorcode
from pathlib import Path

import msgspec

from lingjing import EpisodeReport
from lingjing import read as read_trace
from lingjing.bench.folder import read_results
from lingjing.errors import LingjingError, UsageError
from lingjing.system_hints import hint_of_system
from tests.faults.cases import Aftermath, Injection
from tests.play.report_kit import POLICY_FAILED

CODES = {0, 1, 2, 3, 130}
NOT_BEGUN = "did not begin, because a policy failed"
"""The words of a suite's tables for episodes without a start, because their policy could not be loaded."""

LOSS = "replaced by doing nothing"
"""The words of output and reports for lost turns of a policy."""

WAYS_OUT = ("hint: ", "see `lingjing ", *{hint_of_system(OSError(number, "")) or "hint: " for number in errorcode})
"""The beginnings of hints. The hint of a fault among several stands in its line, without `hint: `."""

HALF_WRITTEN = (".partial", ".new-", ".tmp")


def faults_of(case: Injection, after: Aftermath, folder: Path, wanted: Results) -> list[str]:
    """Each fault in one line; `wanted` are the results of the same command without a planted fault."""
    return [
        *_exit_faults(after),
        *(f"left running: {line}" for line in after.orphans),
        *_file_faults(case, after, folder),
        *_result_faults(after, folder, wanted),
    ]


def _exit_faults(after: Aftermath) -> Iterator[str]:
    if after.code == -1000:
        yield "it hung"
    elif after.code not in CODES:
        yield f"exit code {after.code}"
    if "Traceback" in after.errors or "Traceback" in after.output:
        yield "a traceback"
    if after.code in (1, 2, 3):
        if "error: " not in after.errors:
            yield "no message"
        elif not any(words in after.errors for words in WAYS_OUT):
            yield "a message without a way out"


def _file_faults(case: Injection, after: Aftermath, folder: Path) -> Iterator[str]:
    cleans_up = not case.lasting and case.kind not in (
        "name",
        "look",
    )  # the failing call may remove files
    for name in after.left:
        if name.endswith((".mcap", ".mcap.part")):
            yield from _trace_faults(folder / name)
        if cleans_up and (any(part in Path(name).name for part in HALF_WRITTEN) or name.startswith("tmp/lingjing")):
            yield f"left behind: {name}"


def _trace_faults(path: Path) -> Iterator[str]:
    try:
        trace = read_trace(path)
    except UsageError as error:
        if path.suffix != ".part" or path.stat().st_size > 100_000:  # a header that could not be written
            yield f"{path.name} cannot be read: {error}"
        return
    if path.suffix == ".mcap" and not trace.complete:
        yield f"{path.name} is not whole"


@dataclass(frozen=True)
class Result:
    """An episode's result. `lost_turns` are those that its policies lost and that report, metrics and trace record;
    `model_calls` are the requests to a chat model that its report counts; it has not `begun` if a policy could not be
    loaded."""

    digest: str
    lost_turns: int = 0
    model_calls: int = 0
    begun: bool = True


Results = Mapping[str, Result]
"""The results of a command by the name of the episode."""


def results_of(after: Aftermath, folder: Path) -> Results:
    """The results of a command that ended with exit code 0. Raises `ValueError` where there is none."""
    out = folder / "work" / "out"
    if (out / "results.parquet").is_file() or not after.output.startswith("{"):
        rows = {f"seed {row.seed}": row.report for row in read_results(out) if row.standing == "counted"}
        return {name: _result(report, out / report.trace if report.trace else None) for name, report in rows.items()}
    report = msgspec.json.decode(after.output, type=EpisodeReport)
    return {"the episode": _result(report, folder / "work" / report.trace)}


def _result(report: EpisodeReport, trace: Path | None) -> Result:
    counted = report.metrics.substitutions if report.metrics is not None else 0
    recorded = counted
    if trace is not None:
        recorded = sum(bool(made.substituted) for record in read_trace(trace).boundaries for made in record.decisions)
    is_warned = any(line.startswith(f"{counted} of ") and LOSS in line for line in report.warnings)
    calls = report.metrics.calls if report.metrics is not None else 0
    return Result(
        report.digest, counted if is_warned and recorded == counted else 0, calls, report.reason != POLICY_FAILED
    )


def _result_faults(after: Aftermath, folder: Path, wanted: Results) -> Iterator[str]:
    """With exit code 0 each result is that of the command without a fault, but for requests to a chat model that were
    made again, and for a loss that is reported in the output of the command, in the report or row, and in the trace."""
    if after.code != 0:
        return
    try:
        results = results_of(after, folder)
    except (ValueError, LingjingError, OSError) as error:
        yield f"no result with exit code 0: {error}"
        return
    if set(results) != set(wanted):
        yield f"results of {', '.join(results) or 'nothing'} in place of {', '.join(wanted)} with exit code 0"
    for name in set(results) & set(wanted):
        if results[name].digest == wanted[name].digest:
            continue
        if results[name].model_calls > wanted[name].model_calls:  # a request made again, which each decision records
            continue
        if not results[name].begun and any(NOT_BEGUN in line for line in _notes(after.output)):
            continue
        if not results[name].lost_turns:
            yield f"another digest of {name} with exit code 0"
        elif not any(LOSS in line for line in [*after.errors.splitlines(), *_notes(after.output)]):
            yield f"turns of {name} that were lost, which the output does not report"


def _notes(output: str) -> list[str]:
    """The notes below a suite's tables. What a report repeats in JSON is not read by a person and does not count."""
    return [line for line in output.splitlines() if line.startswith("- ")]
