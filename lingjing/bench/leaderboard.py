"""An HTML page that ranks the entrants of a suite by their macro average."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lingjing.bench.evidence import AuditMark, audited_in_words, row_sha256
from lingjing.bench.exports import html_page, to_html
from lingjing.bench.played import Played, columns_of
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import cost_of
from lingjing.bench.table_cells import PRIVILEGED, UNAUDITED, UNRESOLVED, ResultCell, ResultLine, ResultTable, plain
from lingjing.bench.tables import average_cell, average_of, column_head, make_tables, rate_cell, standing_notes
from lingjing.bench.unresolved import SERVICE_OPTIONS, open_rows, unresolved_entrants
from lingjing.play.options import PlayOptions

UNRANKED = "not ranked: some columns were not played"
OPEN = (
    "not ranked: episodes were lost, or aborted without a later result, or played again after an abort that the "
    "entrant may have caused"
)
FEWER = "not ranked: some seeds that others have played are missing (--seeds, --missions and --modes choose equal ones)"
SHOWN = "not ranked: observes the ground truth"


def leaderboard(rows: Sequence[SuiteRow], marks: Mapping[str, AuditMark] | None = None) -> str:
    """Return the page. Entrants with every column and seed are ranked; the others and privileged ones follow.

    `marks` are those of audits (`evidence.audit_marks`): entrants with other rows are marked.
    """
    suite, marks = rows[0].suite if rows else "results", marks or {}
    tables = [_ranking(rows, marks), _played_by(rows, marks), *make_tables(rows, ("paired",))]
    return html_page(f"Leaderboard: {suite}", "".join(map(to_html, tables)))


def ranking(rows: Sequence[SuiteRow]) -> list[tuple[str, float]]:
    """Return entrants with their averages, the best first. Entrants with missing columns or seeds, or with open
    episodes, have nan and come last.
    """
    return _averages(rows, _unranked(rows, unresolved_entrants(rows)))


def _averages(rows: Sequence[SuiteRow], reasons: Mapping[str, str]) -> list[tuple[str, float]]:
    columns = columns_of(row for row in rows if row.standing == "counted")
    averages = [
        (name, math.nan if reason else average_of([row for row in rows if row.entrant == name], columns))
        for name, reason in reasons.items()
        if any(row.entrant == name for row in rows)
    ]
    return sorted(
        averages, key=lambda item: (math.isnan(item[1]), -item[1] if not math.isnan(item[1]) else 0.0, item[0])
    )


def _unranked(rows: Sequence[SuiteRow], unresolved: frozenset[str]) -> dict[str, str]:
    """Return the reason for which each entrant has no rank; "" for one that has.

    Entrants are ranked on equal seeds: one that chose its own could leave out those that it loses. The seeds are those
    of all that play without the truth, ranked or not, so that a second entrant cannot lower them.
    """
    columns = set(columns_of(row for row in rows if row.standing == "counted"))
    played: dict[str, set[tuple[str, str, int]]] = {}
    required: set[tuple[str, str, int]] = set()
    for row in rows:
        played.setdefault(row.entrant, set())
        if row.standing == "counted":
            played[row.entrant].add((row.mission, row.mode, row.seed))
        if not row.privileged:
            required.add((row.mission, row.mode, row.seed))

    def reason(name: str) -> str:
        if name in unresolved:
            return OPEN
        if {key[:2] for key in played[name]} != columns:
            return UNRANKED
        return FEWER if required - played[name] else ""

    return {name: reason(name) for name in played}


def _ranking(rows: Sequence[SuiteRow], audits: Mapping[str, AuditMark]) -> ResultTable:
    plain = [row for row in rows if not row.condition]
    counted, left_open = [row for row in plain if row.standing == "counted"], open_rows(plain)
    unresolved = unresolved_entrants(rows)
    columns, reasons = columns_of(counted), _unranked(plain, unresolved)
    lines: list[ResultLine] = []
    listed, place, last = 0, 0, math.nan
    for name, average in _averages([*counted, *left_open], reasons):
        own = [row for row in (*counted, *left_open) if row.entrant == name]
        privileged = any(row.privileged for row in own)
        group = SHOWN if privileged else reasons[name]
        if not group:
            listed += 1
            place, last = place if average == last else listed, average  # equal averages share a place
        cells = [rate_cell(Played.of(row for row in own if (row.mission, row.mode) == column)) for column in columns]
        is_unaudited = bool(audits) and any(row_sha256(row) not in audits for row in own if row.standing == "counted")
        marks = (name, *[UNRESOLVED] * (name in unresolved), *[PRIVILEGED] * privileged, *[UNAUDITED] * is_unaudited)
        label = (str(place) if not group else "", " ".join(marks))
        lines.append(ResultLine(group, label, (average_cell(own, columns, with_range=True), *cells)))
    heads = ("Avg", *(column_head(mission, mode, columns) for mission, mode in columns))
    lines.sort(key=lambda line: ("", FEWER, UNRANKED, OPEN, SHOWN).index(line.group))
    note = "Avg: modes of a mission first, then missions; its 95 % interval is a bootstrap over seeds"
    evidence = audited_in_words(rows, audits)
    evidence += (
        f"; {UNAUDITED} has rows that no audit has confirmed" if audits else ": every number is what its row claims"
    )
    salts = {row.salt_sha256 for row in counted}
    drawn_apart = "the seeds of policies were drawn from more than one salt: see the table of entrants"
    conditional = "rows with a condition are in no rank; `lingjing bench table --kind conditions` shows them"
    has_conditions = any(row.condition for row in rows)
    notes = (
        note, evidence, *[drawn_apart] * (len(salts) > 1), *[conditional] * has_conditions, *standing_notes(rows),
    )  # fmt: skip
    return ResultTable("ranking", "Task success rate (TSR, %)", ("", "Entrant"), heads, tuple(lines), notes)


def _played_by(rows: Sequence[SuiteRow], audits: Mapping[str, AuditMark]) -> ResultTable:
    lines = []
    for name in dict.fromkeys(row.entrant for row in rows):
        own = [row for row in rows if row.entrant == name]
        standings = [sum(row.standing == standing for row in own) for standing in ("counted", "aborted", "lost")]
        fields = ("policy", "model", "version", "salt_sha256", "split_sha256", "benchmark", "code")
        values = [_options(own), _endpoints(own), *(_all(own, field) for field in fields)]
        checked = sum(row_sha256(row) in audits for row in own if row.standing == "counted")
        cells = (
            *(ResultCell(str(number), number) for number in (*standings, checked)),
            plain(sum(map(cost_of, own)), ".2f"),
            *(ResultCell(text) for text in values),
        )
        lines.append(ResultLine("", (name,), cells))
    heads = (
        "counted", "aborted", "lost", "audited", "USD", "options", "endpoint", "policy", "model", "version", "salt",
        "split", "benchmark", "code",
    )  # fmt: skip
    return ResultTable("entrants", "Entrants", ("Entrant",), heads, tuple(lines))


_SHOWN_APART = frozenset(
    {"mission", "seed", "salt", "policy_seed", "mode", "tier", "language", "settings", "policy", "policies_for",
     "overview", "calls", "calls_from", "max_cost", "max_tokens", "ledger", "sign"}
)  # fmt: skip
"""The options that the page shows elsewhere, or that decide nothing."""


def _options(rows: Sequence[SuiteRow]) -> str:
    """Return the options of an entrant that differ from the defaults, other than those of its model's service."""
    default, words = PlayOptions(mission=""), dict[str, None]()
    for row in rows:
        arguments = {name: value for name, value in row.options.policy_args.items() if name not in SERVICE_OPTIONS}
        words |= dict.fromkeys(f"{name}={value}" for name, value in sorted(arguments.items()))
        for name in sorted(set(PlayOptions.__struct_fields__) - _SHOWN_APART - {"policy_args"}):
            if (value := getattr(row.options, name)) != getattr(default, name):
                words[f"{name}: {value}"] = None
        words |= dict.fromkeys(f"{role} plays {policy}" for role, policy in sorted(row.options.policies_for.items()))
    return ", ".join(words) or "–"


def _endpoints(rows: Sequence[SuiteRow]) -> str:
    """Return the services of an entrant's model; a dash without options that name one."""
    options = (row.options.policy_args for row in rows)
    named = (arguments.get(name) for arguments in options for name in SERVICE_OPTIONS)
    words = dict.fromkeys(str(value) for value in named if value)
    return ", ".join(words) or "–"


def _all(rows: Sequence[SuiteRow], field: str) -> str:
    """Return all values of a field, shortened; a dash if there are none."""
    return ", ".join(sorted({str(getattr(row, field))[:16] for row in rows} - {""})) or "–"


__all__ = ["leaderboard", "ranking"]
