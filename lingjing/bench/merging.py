"""Merging of results from several places: shards of a suite, or results submitted by several people."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from pathlib import Path

from lingjing.bench.evidence import check_rows
from lingjing.bench.folder import read_results
from lingjing.bench.rows import RowKey, SuiteRow, check_tiers, comparable
from lingjing.errors import UsageError

_KEPT_APART = "merge the results of each version separately, or merge them anyway with --other-code"

_WORDS = {
    "split_sha256": "sealed split",
    "benchmark": "version of the benchmark",
    "mission_sha256": "version of the mission",
}
"""The names of fields in messages."""

_NOT_REPEATED = "the machine or the policy of one of them is not deterministic: remove one of them"
_DRAWN_APART = (
    "their folders have different salts, so the policies drew other numbers: remove one, play other seeds, or use the "
    "same `salt` file in both folders"
)


def merge_results(places: Sequence[Path], *, other_code: bool = False) -> list[SuiteRow]:
    """Return the rows of all places, each episode once. Raises `UsageError` if they may not stand in one table."""
    return merge_rows([(place, row) for place in places for row in read_results(place)], other_code=other_code)


def merge_rows(placed: Sequence[tuple[Path, SuiteRow]], *, other_code: bool = False) -> list[SuiteRow]:
    """Merge rows that are already read, each with its place. Raises `UsageError` as `merge_results` does."""
    _check_alike("suite", placed, "merge results of one suite")
    check_rows(row for _, row in placed)
    _check_alike("benchmark", placed, "prompts, looks or adjudication differ: make a table of each version")
    for mission in sorted({row.mission for _, row in placed}):
        own = [(place, row) for place, row in placed if row.mission == mission]
        _check_alike("mission_sha256", own, "the mission was changed: make a table of each version", f" `{mission}`")
    if not other_code:
        _check_alike("code", placed, _KEPT_APART)
    _check_alike("split_sha256", placed, "results of a sealed split and of public seeds, or of two splits, stay apart")
    _check_options(placed)
    _check_columns(placed)
    check_tiers(row for _, row in placed)
    episodes: dict[tuple[Hashable, ...], list[tuple[Path, SuiteRow]]] = {}
    for place, row in placed:
        episodes.setdefault((*row.cell, row.seed), []).append((place, row))
    return sorted((row for each in episodes.values() for row in _kept(each)), key=lambda row: row.key)


def _kept(placed: Sequence[tuple[Path, SuiteRow]]) -> Iterator[SuiteRow]:
    """Yield, of all tries of one episode, the counted one (once, in any order of the places) and each aborted try
    once. An episode that was lost in one place and counted in another is not lost.
    """
    counted = [item for item in placed if item[1].standing == "counted"]
    for place, row in counted[1:]:
        first_place, first = counted[0]
        if _outcome(row) != _outcome(first):
            drawn_alike = row.policy_seed == first.policy_seed
            raise UsageError(
                f"{_named(row)} has different results in `{place}` and `{first_place}`: {row.report.reason} with "
                f"digest {row.report.digest[:12]}, and {first.report.reason} with {first.report.digest[:12]}",
                hint=_NOT_REPEATED if drawn_alike else _DRAWN_APART,
            )
    tries: dict[RowKey, SuiteRow] = {}
    if counted:
        chosen = min((row for _, row in counted), key=_rank)
        tries[chosen.key] = chosen
    others = [row for _, row in placed if row.standing == "aborted" or (row.standing == "lost" and not counted)]
    for row in sorted(others, key=_rank):
        tries.setdefault(row.key, row)
    yield from tries.values()


def _rank(row: SuiteRow) -> tuple[int, float, str, int, bool]:
    return row.tries, row.wall_s, row.salt_sha256, row.policy_seed, row.attention_iou is None


def _check_alike(name: str, placed: Iterable[tuple[Path, SuiteRow]], hint: str, of: str = "") -> None:
    """Raise `UsageError` unless the field has the same value in all rows. `of`: added to the field's name."""
    values: dict[str, Path] = {}
    for place, row in placed:
        values.setdefault(getattr(row, name), place)
    if len(values) > 1:
        listed = ", ".join(f"`{value[:12]}` in `{place}`" for value, place in values.items())
        raise UsageError(f"the results have more than one {_WORDS.get(name, name)}{of}: {listed}", hint=hint)


def _check_options(placed: Iterable[tuple[Path, SuiteRow]]) -> None:
    first: dict[tuple[str, str, str, str], tuple[Path, SuiteRow]] = {}
    for place, row in placed:
        other_place, other = first.setdefault(row.cell, (place, row))
        if comparable(row.options) != comparable(other.options):
            raise UsageError(
                f"{_named(row)} has different options in `{place}` and `{other_place}`",
                hint="give one of the two entrants another name in its suite",
            )


def _check_columns(placed: Iterable[tuple[Path, SuiteRow]]) -> None:
    """Raise `UsageError` if two entrants played a column in different settings, cities or with other evaluators."""
    first: dict[tuple[str, str, str], tuple[Path, SuiteRow]] = {}
    for place, row in placed:
        other_place, other = first.setdefault((row.mission, row.mode, row.condition), (place, row))
        for name in ("settings", "scene", "evaluators"):
            if getattr(row.options, name) != getattr(other.options, name):
                raise UsageError(
                    f"{_named(row)} in `{place}` and {_named(other)} in `{other_place}` have different {name}: "
                    f"{getattr(row.options, name)!r} and {getattr(other.options, name)!r}",
                    hint="one of the rows is of another condition, or was changed",
                )


def _outcome(row: SuiteRow) -> tuple[object, ...]:
    return row.report.digest, row.report.success, row.report.reason, row.report.scr


def _named(row: SuiteRow) -> str:
    return f"{row.entrant}, {row.column}{row.condition and f', {row.condition}'}, seed {row.seed}"


__all__ = ["merge_results", "merge_rows"]
