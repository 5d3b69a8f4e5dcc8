"""Results of several places as one: shards of a suite, or what several people have submitted."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from pathlib import Path

from lingjing.bench.folder import read_results
from lingjing.bench.rows import RowKey, SuiteRow, comparable
from lingjing.errors import UsageError

_KEPT_APART = "merge those of one version each, or put them together all the same with --other-code"

_NOT_REPEATED = "one of the two was played on a machine, or by a policy, that does not repeat: leave one out"
_DRAWN_APART = (
    "their folders have salts of their own, so the policies drew other numbers: leave one out, play other seeds, or "
    "play with one `salt` file in both folders"
)


def merge_results(places: Sequence[Path], *, other_code: bool = False) -> list[SuiteRow]:
    """The rows of all places, each episode once. Raises `UsageError` where they may not stand in one table."""
    return merge_rows([(place, row) for place in places for row in read_results(place)], other_code=other_code)


def merge_rows(found: Sequence[tuple[Path, SuiteRow]], *, other_code: bool = False) -> list[SuiteRow]:
    """The same of rows that were read already, each with its place."""
    _check_alike("suite", found, "merge results of one suite")
    if not other_code:
        _check_alike("code", found, _KEPT_APART)
    _check_options(found)
    episodes: dict[tuple[Hashable, ...], list[tuple[Path, SuiteRow]]] = {}
    for place, row in found:
        episodes.setdefault((*row.cell, row.seed), []).append((place, row))
    return sorted((row for each in episodes.values() for row in _kept(each)), key=lambda row: row.key)


def _kept(found: Sequence[tuple[Path, SuiteRow]]) -> Iterator[SuiteRow]:
    """Of all tries of one episode that any place has, the one that counts, once, whatever the order of the places; and
    the aborted ones, each try once. A lost episode that another place has played to its end is not lost."""
    counted = [one for one in found if one[1].standing == "counted"]
    for place, row in counted[1:]:
        first_place, first = counted[0]
        if _outcome(row) != _outcome(first):
            drawn_alike = row.policy_seed == first.policy_seed
            raise UsageError(
                f"{_named(row)} ended otherwise in `{place}` than in `{first_place}`: {row.report.reason} with digest "
                f"{row.report.digest[:12]}, not {first.report.reason} with {first.report.digest[:12]}",
                hint=_NOT_REPEATED if drawn_alike else _DRAWN_APART,
            )
    tries: dict[RowKey, SuiteRow] = {}
    if counted:
        chosen = min((row for _, row in counted), key=_rank)
        tries[chosen.key] = chosen
    others = [row for _, row in found if row.standing == "aborted" or (row.standing == "lost" and not counted)]
    for row in sorted(others, key=_rank):
        tries.setdefault(row.key, row)
    yield from tries.values()


def _rank(row: SuiteRow) -> tuple[int, float, str, int, bool]:
    return row.tries, row.wall_s, row.salt_sha256, row.policy_seed, row.attention_iou is None


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


def _named(row: SuiteRow) -> str:
    return f"{row.entrant}, {row.column}{row.condition and f', {row.condition}'}, seed {row.seed}"


__all__ = ["merge_results", "merge_rows"]
