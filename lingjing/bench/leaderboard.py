"""A page that ranks the entrants of a suite by their macro average, with what a reader must know of each."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.bench.exports import html_page, to_html
from lingjing.bench.played import Played, columns_of
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import cost_of
from lingjing.bench.table_cells import PRIVILEGED, UNRESOLVED, ResultCell, ResultLine, ResultTable, plain
from lingjing.bench.tables import average_cell, average_of, column_head, make_tables, rate_cell, standing_notes
from lingjing.bench.unresolved import open_rows, unresolved_entrants

UNRANKED = "not ranked: some columns are not played"
OPEN = "not ranked: episodes are lost, or were played again after an abort that the entrant may have caused"
SHOWN = "not ranked: shown the truth"


def leaderboard(rows: Sequence[SuiteRow]) -> str:
    """The page: entrants that have played every column are ranked, the others and those shown the truth follow."""
    suite = rows[0].suite if rows else "results"
    tables = [_ranking(rows), _played_by(rows), *make_tables(rows, ("paired",))]
    return html_page(f"Leaderboard: {suite}", "".join(map(to_html, tables)))


def ranking(rows: Sequence[SuiteRow]) -> list[tuple[str, float]]:
    """Entrants with their averages, the best first; nan and last for those that have not played every column, or have
    open episodes."""
    columns, unresolved = columns_of(row for row in rows if row.standing == "counted"), unresolved_entrants(rows)
    entrants = dict.fromkeys(row.entrant for row in rows)
    averages = [
        (name, math.nan if name in unresolved else average_of([row for row in rows if row.entrant == name], columns))
        for name in entrants
    ]
    return sorted(averages, key=lambda one: (math.isnan(one[1]), -one[1] if not math.isnan(one[1]) else 0.0, one[0]))


def _ranking(rows: Sequence[SuiteRow]) -> ResultTable:
    plain = [row for row in rows if not row.condition]
    counted, left_open = [row for row in plain if row.standing == "counted"], open_rows(plain)
    columns, unresolved = columns_of(counted), unresolved_entrants(plain)
    lines: list[ResultLine] = []
    listed, place, last = 0, 0, math.nan
    for name, average in ranking([*counted, *left_open]):
        own = [row for row in (*counted, *left_open) if row.entrant == name]
        shown = any(row.privileged for row in own)
        group = SHOWN if shown else OPEN if name in unresolved else UNRANKED if math.isnan(average) else ""
        if not group:
            listed += 1
            place, last = place if average == last else listed, average  # who ties shares a place
        cells = [rate_cell(Played.of(row for row in own if (row.mission, row.mode) == one)) for one in columns]
        marks = (name, *[UNRESOLVED] * (name in unresolved), *[PRIVILEGED] * shown)
        label = (str(place) if not group else "", " ".join(marks))
        lines.append(ResultLine(group, label, (average_cell(own, columns, with_range=True), *cells)))
    heads = ("Avg", *(column_head(mission, mode, columns) for mission, mode in columns))
    lines.sort(key=lambda line: ("", UNRANKED, OPEN, SHOWN).index(line.group))
    note = "Avg: modes of a mission first, then missions; its 95 % interval is a bootstrap over seeds"
    return ResultTable(
        "ranking", "Task success rate (TSR, %)", ("", "Entrant"), heads, tuple(lines), (note, *standing_notes(rows))
    )


def _played_by(rows: Sequence[SuiteRow]) -> ResultTable:
    lines = []
    for name in dict.fromkeys(row.entrant for row in rows):
        own = [row for row in rows if row.entrant == name]
        standings = [sum(row.standing == one for row in own) for one in ("counted", "aborted", "lost")]
        said = [_all(own, field) for field in ("policy", "model", "version", "salt_sha256", "code")]
        cells = (
            *(ResultCell(str(number), number) for number in standings),
            plain(sum(map(cost_of, own)), ".2f"),
            *(ResultCell(text) for text in said),
        )
        lines.append(ResultLine("", (name,), cells))
    heads = ("counted", "aborted", "lost", "USD", "policy", "model", "version", "salt", "code")
    return ResultTable("entrants", "Who played, and how", ("Entrant",), heads, tuple(lines))


def _all(rows: Sequence[SuiteRow], field: str) -> str:
    """Every value of a field, shortened; a dash for none."""
    return ", ".join(sorted({str(getattr(row, field))[:16] for row in rows} - {""})) or "–"


__all__ = ["leaderboard", "ranking"]
