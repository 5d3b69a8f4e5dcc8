"""Results of several places as one: shards of a suite, or what several people have submitted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from lingjing.bench.folder import read_results
from lingjing.bench.rows import RowKey, SuiteRow, comparable
from lingjing.errors import UsageError

_KEPT_APART = "merge those of one version each, or put them together all the same with --other-code"


def merge_results(places: Sequence[Path], *, other_code: bool = False) -> list[SuiteRow]:
    """The rows of all places, each episode once. Raises `UsageError` where they may not stand in one table."""
    found = [(place, row) for place in places for row in read_results(place)]
    _check_alike("suite", found, "merge results of one suite")
    if not other_code:
        _check_alike("code", found, _KEPT_APART)
    _check_options(found)
    kept: dict[RowKey, tuple[Path, SuiteRow]] = {}
    for place, row in found:
        before = kept.get(row.key)
        if before is None or before[1].standing != "counted":
            kept[row.key] = place, row
        elif row.standing == "counted" and _outcome(row) != _outcome(before[1]):
            raise UsageError(
                f"{_named(row)} ended otherwise in `{place}` than in `{before[0]}`: {row.report.reason} with digest "
                f"{row.report.digest[:12]}, not {before[1].report.reason} with {before[1].report.digest[:12]}",
                hint="one of the two was played on a machine, or by a policy, that does not repeat: leave one out",
            )
    return _without_old_tries([row for _, row in kept.values()])


def _check_alike(name: str, found: Iterable[tuple[Path, SuiteRow]], hint: str) -> None:
    """Raise `UsageError` unless all rows have one value of the field."""
    values: dict[str, Path] = {}
    for place, row in found:
        values.setdefault(getattr(row, name), place)
    if len(values) > 1:
        told = ", ".join(f"`{value[:12]}` in `{place}`" for value, place in values.items())
        raise UsageError(f"the results are of more than one {name}: {told}", hint=hint)


def _check_options(found: Iterable[tuple[Path, SuiteRow]]) -> None:
    first: dict[tuple[str, str, str, str], tuple[Path, SuiteRow]] = {}
    for place, row in found:
        other_place, other = first.setdefault(row.cell, (place, row))
        if comparable(row.options) != comparable(other.options):
            raise UsageError(
                f"{_named(row)} was played with other options in `{place}` than in `{other_place}`",
                hint="give one of the two entrants another name in its suite",
            )


def _outcome(row: SuiteRow) -> tuple[object, ...]:
    return row.report.digest, row.report.success, row.report.reason, row.report.scr


def _without_old_tries(rows: Sequence[SuiteRow]) -> list[SuiteRow]:
    """The rows without a lost episode that another place has played to its end."""
    counted = {(row.cell, row.seed) for row in rows if row.standing == "counted"}
    return [row for row in rows if row.standing != "lost" or (row.cell, row.seed) not in counted]


def _named(row: SuiteRow) -> str:
    return f"{row.entrant}, {row.column}{row.condition and f', {row.condition}'}, seed {row.seed}"


__all__ = ["merge_results"]
