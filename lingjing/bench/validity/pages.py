"""The tables of a record in Markdown: rates with intervals at both tiers, averages, differences and comparisons.

Every table says what was not played. A rate is followed by Wilson's interval at 95 % and the counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from lingjing.analysis.shares import wilson
from lingjing.bench.rows import NEVER_BY_NUMBER
from lingjing.bench.statistics import difference_bounds, holm, macro_average, macro_bounds, mcnemar
from lingjing.bench.table_cells import ABSENT, probability
from lingjing.bench.tables import FEWEST
from lingjing.bench.validity.record import RecordedAdversary, RecordedCell, RecordedStudy, ValidityRecord, seeds_of

NO_MODEL = "No row of a real model is here yet: all players are programs without a model."
"""The sentence beside every table until models have played."""

TIERS = (0, 1)
"""The tiers that stand side by side."""

_NOT_COUNTED = (
    "Of adversaries the fresh episodes alone are counted; those of the choice are listed below. Lost episodes (aborted "
    "three times by the infrastructure) are in no rate."
)
_SUCCESS_BY_COLUMN = "Task success rate in per cent, Wilson's 95 % interval, wins and episodes. † plays with the truth."
_MACRO_AVERAGE = (
    "Over the modes of a mission first, then over missions; bootstrap over seeds, where each column has "
    f"{FEWEST} of them."
)
_DIFFERENCES_OF_THE_BEST = (
    "The best player with pictures and without the truth, less the best one that sees nothing, in percentage points "
    "with Newcombe's 95 % interval. Both are the best of the same episodes, so a small difference may be chance. "
    "Players are compared on the seeds that both have played; adversaries play instances of a sealed split."
)
_WORST_ADVERSARIES = (
    "At tier 1 on instances of a sealed split: the worst adversary of a column on fresh seeds after the choice "
    "(`docs/adversaries.md`). *Undecided* is no verdict; `lingjing bench adversaries -o DIR/adversaries` goes on."
)
_STAR_AND_BROADCAST = (
    "The same team on the same instances; lost episodes count as failures. McNemar's exact test, two-sided, with "
    "Holm's correction over the missions, as planned beforehand in `docs/studies.md`: tested when all pairs are played."
)
_REDRAWN_INSTANCES = "The same player on public seeds and on instances of a sealed split, which were never seen before."
"""The texts of the sections."""

_SEES = ("truth", "pictures", "nothing")
_WORST = "worst adversary"


@dataclass(frozen=True, slots=True)
class Wins:
    """The counted episodes of an entrant."""

    by_seed: Mapping[int, bool]
    """The success by seed."""
    planned: int = 0

    @classmethod
    def of(cls, cell: RecordedCell | RecordedAdversary) -> Wins:
        """Return the counted episodes of a record's line."""
        won = set(seeds_of(cell.won))
        return cls({seed: seed in won for seed in seeds_of(cell.seeds)}, cell.planned)

    @property
    def counts(self) -> tuple[int, int]:
        """Wins and episodes."""
        return sum(self.by_seed.values()), len(self.by_seed)

    @property
    def rate(self) -> float:
        """The share of wins; nan without episodes."""
        won, played = self.counts
        return won / played if played else math.nan

    def on(self, seeds: Iterable[int]) -> Wins:
        """Return the episodes of these seeds."""
        return Wins({seed: self.by_seed[seed] for seed in seeds}, self.planned)

    def __str__(self) -> str:
        """`70 [40, 89] (7/10)`, or `not played`."""
        won, played = self.counts
        if not played:
            return "not played"
        low, high = wilson(won, played)
        few = f", {self.planned} planned" if played < self.planned else ""
        return f"{100 * won / played:.0f} [{100 * low:.0f}, {100 * high:.0f}] ({won}/{played}{few})"


def page(record: ValidityRecord, title: str = "") -> str:
    """Return all tables of a record as one Markdown document."""
    return f"# {title or record.program}\n\n{tables(record)}"


def tables(record: ValidityRecord) -> str:
    """Return all tables of a record, with headings of the third level."""
    sections = (_played, _rates, _averages, _differences, _adversaries, _modes, _redrawn)
    lines = [line for section in sections for line in section(record)]
    return "\n".join(lines).rstrip() + "\n"


# -- sections


def _played(record: ValidityRecord) -> Iterator[str]:
    yield from _section("What was played", f"{NO_MODEL} T{NEVER_BY_NUMBER[1:]}.")
    yield from _head("Study", "Episodes", "Planned", "Lost", "Benchmark", "Code", "Instances", "Audited rows")
    versions = {study.study: study for study in record.studies}
    own: dict[str, list[RecordedCell | RecordedAdversary]] = {}
    for cell in record.cells:
        own.setdefault(cell.study, []).append(cell)
    if record.adversaries:
        own["adversaries"] = [*record.adversaries]
    for name, cells in own.items():
        counted, lost = (sum(len(seeds_of(text)) for text in texts) for texts in (
            [cell.seeds for cell in cells], [cell.lost for cell in cells],
        ))  # fmt: skip
        study = versions.get(name, RecordedStudy(study=name))
        instances = f"sealed `{study.split[:12]}`" if study.split else "public seeds"
        planned = sum(cell.planned for cell in cells)
        yield _row(name, counted, planned, lost, _hashes(study.benchmark), _hashes(study.code),
                   instances if counted else ABSENT, study.audited)  # fmt: skip
    yield from ("", _NOT_COUNTED, "")


def _rates(record: ValidityRecord) -> Iterator[str]:
    yield from _section("Success by column", _SUCCESS_BY_COLUMN)
    worst = {each.column: each for each in record.adversaries}
    for column in _columns(record):
        yield from _head(f"`{column}`", "sees", *(f"tier {tier}" for tier in TIERS))
        for (entrant, sees), by_tier in _main(record, column).items():
            yield _row(_named(entrant, sees), sees, *(_cell(by_tier.get(tier)) for tier in TIERS))
        if column in worst:
            each = worst[column]
            name = f"{_WORST}: {each.worst}" if each.worst else f"{_WORST}: not chosen yet"
            yield _row(name, each.sees if each.worst else ABSENT, ABSENT, Wins.of(each))
        yield ""


def _averages(record: ValidityRecord) -> Iterator[str]:
    columns = _columns(record)
    yield from _section("Macro average", _MACRO_AVERAGE)
    yield from _head("Entrant", "sees", *(f"tier {tier}" for tier in TIERS))
    entrants: dict[tuple[str, str], dict[int, dict[str, Wins]]] = {}
    for column in columns:
        for key, by_tier in _main(record, column).items():
            for tier, wins in by_tier.items():
                entrants.setdefault(key, {}).setdefault(tier, {})[column] = wins
    for (entrant, sees), tiers in sorted(entrants.items(), key=lambda item: _place(item[0])):
        yield _row(_named(entrant, sees), sees, *(_average(tiers.get(tier, {}), len(columns)) for tier in TIERS))
    yield ""


def _average(columns: Mapping[str, Wins], whole: int) -> str:
    if not columns:
        return ABSENT
    played = {column: wins for column, wins in columns.items() if wins.by_seed}
    if len(played) < whole:
        return f"not all columns played ({len(played)} of {whole})"
    values: dict[tuple[str, str], dict[int, float]] = {}
    for column, wins in played.items():
        mission, _, mode = column.partition("-")
        values[mission, mode] = {seed: float(won) for seed, won in wins.by_seed.items()}
    text = f"{100 * macro_average(values):.0f}"
    if min(map(len, values.values())) < FEWEST:
        return text
    low, high = macro_bounds(values)
    return f"{text} [{100 * low:.0f}, {100 * high:.0f}]"


def _differences(record: ValidityRecord) -> Iterator[str]:
    yield from _section("Perceiving players less players without pictures", _DIFFERENCES_OF_THE_BEST)
    yield from _head("Column", "Tier", "with pictures", "without", "difference")
    blind = {each.column: each for each in record.adversaries if each.worst and each.sees == "nothing"}
    for column in _columns(record):
        for tier in TIERS:
            some = {key: by_tier[tier] for key, by_tier in _main(record, column).items() if tier in by_tier}
            seeing = {name: wins for (name, sees), wins in some.items() if sees == "pictures"}
            without = {name: wins for (name, sees), wins in some.items() if sees == "nothing"}
            if tier == 1 and column in blind:
                without[f"adversary {blind[column].worst}"] = Wins.of(blind[column])
            if seeing or without:
                yield _row(f"`{column}`", tier, *_difference(seeing, without))
    yield ""


def _difference(seeing: Mapping[str, Wins], without: Mapping[str, Wins]) -> tuple[str, str, str]:
    first, second = _best(seeing), _best(without)
    if first is None or second is None:
        return (first or "not played"), (second or "not played"), ABSENT
    best, rival = seeing[first], without[second]
    shared = best.by_seed.keys() & rival.by_seed.keys()
    if shared:  # matched instances; an adversary's seeds are its own
        best, rival = best.on(sorted(shared)), rival.on(sorted(shared))
    return f"{first} {_fraction(best)}", f"{second} {_fraction(rival)}", _points(best, rival)


def _adversaries(record: ValidityRecord) -> Iterator[str]:
    if not record.adversaries:
        return
    yield from _section("Worst adversaries", _WORST_ADVERSARIES)
    yield from _head("Column", "Worst", "Fresh seeds", "Verdict", "Seeds of the choice")
    for each in record.adversaries:
        choice = ", ".join(f"{name} {won}/{played}" for name, won, played in each.selection) or "not played"
        yield _row(f"`{each.column}`", each.worst or ABSENT, Wins.of(each), each.verdict if each.worst else ABSENT,
                   choice)  # fmt: skip
    yield ""


def _modes(record: ValidityRecord) -> Iterator[str]:
    cells = _compared(record, "modes")
    if not cells:
        return
    yield from _section("Star and broadcast", _STAR_AND_BROADCAST)
    yield from _head("Mission", "Pairs", "Star won", "Broadcast won", "Only star", "Only broadcast", "p", "p (Holm)")
    tests = []
    for mission in dict.fromkeys(cell.column.partition("-")[0] for cell in cells):
        star, broadcast = (_with_lost(cells, f"{mission}-{mode}") for mode in ("star", "broadcast"))
        pairs = star.by_seed.keys() & broadcast.by_seed.keys()
        tests.append(
            (mission, star.on(sorted(pairs)), broadcast.on(sorted(pairs)), mcnemar(star.by_seed, broadcast.by_seed))
        )
    complete = all(star.planned <= test.pairs for _, star, _, test in tests)
    corrected = holm([test.p for *_, test in tests])
    for (mission, star, broadcast, test), p in zip(tests, corrected, strict=True):
        shown = (probability(test.p).text, probability(p).text) if complete else ("not tested yet", ABSENT)
        pairs_text = f"{test.pairs}" if test.pairs >= star.planned else f"{test.pairs} of {star.planned}"
        yield _row(mission.upper(), pairs_text, star.counts[0], broadcast.counts[0], test.only_first, test.only_second,
                   *shown)  # fmt: skip
    yield ""


def _with_lost(cells: Iterable[RecordedCell], column: str) -> Wins:
    """Return the episodes of a column; lost ones as failures."""
    for cell in cells:
        if cell.column == column:
            wins = Wins.of(cell)
            return Wins({**wins.by_seed, **dict.fromkeys(seeds_of(cell.lost), False)}, wins.planned)
    return Wins({})


def _redrawn(record: ValidityRecord) -> Iterator[str]:
    cells = _compared(record, "redrawn")
    if not cells:
        return
    yield from _section("Redrawn instances", _REDRAWN_INSTANCES)
    yield from _head("Column", "Tier", "Entrant", "public seeds", "redrawn", "difference")
    for cell in cells:
        public = _main(record, cell.column).get((cell.entrant, cell.sees), {}).get(cell.tier, Wins({}))
        redrawn = Wins.of(cell)
        points = _points(public, redrawn) if public.by_seed and redrawn.by_seed else ABSENT
        yield _row(f"`{cell.column}`", cell.tier, cell.entrant, public, redrawn, points)
    yield ""


# -- lookups


def _columns(record: ValidityRecord) -> tuple[str, ...]:
    """Return the columns of the main studies, sorted."""
    return tuple(sorted({cell.column for cell in _compared(record, "")}))


def _compared(record: ValidityRecord, comparison: str) -> list[RecordedCell]:
    """Return the cells of the studies that were made for a comparison; "" for none."""
    studies = {study.study for study in record.studies if study.compares == comparison}
    return [cell for cell in record.cells if cell.study in studies]


def _main(record: ValidityRecord, column: str) -> dict[tuple[str, str], dict[int, Wins]]:
    """Return the episodes of each entrant in a column, by tier: first entrants with the truth, then with pictures."""
    cells = [cell for cell in _compared(record, "") if cell.column == column]
    entrants: dict[tuple[str, str], dict[int, Wins]] = {}
    for cell in sorted(cells, key=lambda cell: _place((cell.entrant, cell.sees))):
        entrants.setdefault((cell.entrant, cell.sees), {})[cell.tier] = Wins.of(cell)
    return entrants


def _place(key: tuple[str, str]) -> tuple[int, str]:
    return _SEES.index(key[1]), key[0]


def _best(entrants: Mapping[str, Wins]) -> str | None:
    """Return the entrant with the highest rate; None if none has played."""
    played = {name: wins for name, wins in entrants.items() if wins.by_seed}
    return max(sorted(played), key=lambda name: played[name].rate, default=None)


# -- texts


def _named(entrant: str, sees: str) -> str:
    return f"{entrant} †" if sees == "truth" else entrant


def _cell(wins: Wins | None) -> str:
    return ABSENT if wins is None else str(wins)


def _hashes(hashes: Sequence[str]) -> str:
    return ", ".join(f"`{each[:12]}`" for each in hashes) or ABSENT


def _fraction(wins: Wins) -> str:
    return "{}/{}".format(*wins.counts)


def _points(first: Wins, second: Wins) -> str:
    """Return the difference of two rates in percentage points with its interval."""
    low, high = difference_bounds(first.counts, second.counts)
    return f"{100 * (first.rate - second.rate):+.0f} [{100 * low:+.0f}, {100 * high:+.0f}]"


def _head(*names: str) -> tuple[str, str]:
    return _row(*names), _row(*("---" for _ in names))


def _row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def _section(title: str, text: str) -> tuple[str, ...]:
    return f"### {title}", "", text, ""


def readme_rows(record: ValidityRecord, entrants: Sequence[str]) -> list[str]:
    """Return the rows of the README's table: wins of each entrant at both tiers, without spaces."""
    rows = []
    for column in _columns(record):
        known = {name: by_tier for (name, _), by_tier in _main(record, column).items()}
        cells = [known.get(name, {}).get(tier) for name in entrants for tier in TIERS]
        rows.append(f"|{column}|{'|'.join(_fraction(each) if each and each.by_seed else ABSENT for each in cells)}|")
    return rows


__all__ = ["NO_MODEL", "TIERS", "Wins", "page", "readme_rows", "tables"]
