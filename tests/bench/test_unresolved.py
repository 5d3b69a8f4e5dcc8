"""Lost episodes and failed services: no entrant gains a rank by them."""

from __future__ import annotations

from typing import get_args

import msgspec
import pytest

from lingjing import PlayOptions
from lingjing.bench.exports import to_latex
from lingjing.bench.unresolved import AT_ONCE_S, open_rows, unresolved_entrants
from lingjing.errors import AbortCause
from lingjing.play.outages import SERVICE_GONE
from tests.bench.suite_kit import OPEN, SuiteRow, leaderboard, made_row, make_tables, ranking, row_faults
from tests.play.report_kit import ABORTED, made_report

GONE = f"{SERVICE_GONE}the harness gets no answer for `a` either: refused"


OWN_SERVICE = PlayOptions(mission="ssr", policy="react", policy_args={"base_url": "http://localhost:1/v1"})
"""The options of an entrant that may switch off its own service at will."""


def won(entrant: str, wins: int, of: int) -> list[SuiteRow]:
    return [made_row(entrant=entrant, seed=seed, success=seed < wins) for seed in range(of)]


def ended(
    entrant: str, seed: int, standing: str, detail: str = GONE, cause: AbortCause = "service", **changes: object
) -> SuiteRow:
    """Return the row of an aborted try."""
    report = made_report(seed=seed, success=False, reason=ABORTED, detail=detail, cause=cause)
    return made_row(entrant=entrant, seed=seed, standing=standing, report=report, **changes)


def cells(rows: list[SuiteRow], kind: str = "success") -> dict[str, tuple[tuple[str, str], ...]]:
    (table,) = make_tables(rows, (kind,))
    return {line.label[0]: tuple((cell.text, cell.mark) for cell in line.cells) for line in table.lines}


def test_an_entrant_with_lost_episodes_is_not_ranked_and_has_a_best_and_a_worst_case() -> None:
    fair = won("fair", 9, 10)
    sly = [*won("sly", 9, 9), ended("sly", 9, "lost", "an engine died", "", tries=3)]
    cells_by_entrant = cells([*fair, *sly])
    assert cells_by_entrant["sly ‡"] == (("100 (90..100)", ""), ("100 (90..100)", ""))
    assert cells_by_entrant["fair"] == (("90", ""), ("90", ""))
    assert ranking([*fair, *sly])[0] == ("fair", 0.9)
    page = leaderboard([*fair, *sly])
    assert page.index(">fair<") < page.index(OPEN) < page.index(">sly ‡<")
    assert cells([*fair, *sly], "intervals")["sly ‡"][0][0] == "100 (90..100)"
    (table,) = make_tables([*fair, *sly], ("success",))
    assert any(note.startswith("‡ has episodes that were lost") for note in table.notes)
    assert r"\ddag" in to_latex(table)


def test_other_entrants_are_compared_without_an_entrant_with_lost_episodes() -> None:
    rows = [*won("a", 9, 10), *won("b", 4, 10), *won("sly", 9, 9), ended("sly", 9, "lost", tries=3)]
    assert [cells(rows)[name][0][1] for name in ("a", "b", "sly ‡")] == ["best", "second", ""]
    (paired,) = make_tables(rows, ("paired",))
    assert {name for line in paired.lines for name in line.label} == {"a", "b"}


def test_an_entrant_that_has_only_lost_episodes_is_listed() -> None:
    rows = [*won("a", 9, 10), *(ended("sly", seed, "lost", tries=3) for seed in range(10))]
    assert cells(rows)["sly ‡"] == (("(0..100)", ""), ("(0..100)", ""))
    assert ">sly ‡<" in leaderboard(rows)


def test_a_win_after_an_outage_of_the_entrants_service_is_a_failure_in_the_worst_case() -> None:
    rows = [*won("a", 9, 10), *won("sly", 10, 10), ended("sly", 3, "aborted", ended_unix_s=1e9)]
    assert unresolved_entrants(rows) == {"sly"}
    assert cells(rows)["sly ‡"][0] == ("100 (90..100)", "")
    lost_again = [*won("a", 9, 10), *won("sly", 3, 10), ended("sly", 7, "aborted")]
    assert cells(lost_again)["sly ‡"][0] == ("30", "")


@pytest.mark.parametrize(
    ("other", "is_open"),
    [
        ({"entrant": "a", "ended_unix_s": 1e9 + AT_ONCE_S - 1}, False),
        ({"entrant": "a", "ended_unix_s": 1e9 + AT_ONCE_S + 1}, True),
        ({"entrant": "sly", "ended_unix_s": 1e9}, True),
        ({"entrant": "a"}, True),
        ({"entrant": "a", "ended_unix_s": 1e9, "foreign": True}, True),
        ({"entrant": "a", "ended_unix_s": 1e9, "options": OWN_SERVICE}, True),
        ({"entrant": "a", "ended_unix_s": 1e9, "options": PlayOptions(mission="ssr", policy="b.py:B")}, True),
    ],
)
def test_an_abort_is_resolved_if_an_entrant_with_this_projects_code_has_the_same_cause_at_the_same_time(
    other: dict[str, object], is_open: bool
) -> None:
    entrant = str(other.pop("entrant"))
    aborted = [ended("sly", 3, "aborted", ended_unix_s=1e9), ended(entrant, 4, "aborted", **other)]
    assert ("sly" in unresolved_entrants([*won("a", 9, 10), *won("sly", 10, 10), *aborted])) is is_open


def test_an_abort_of_an_own_service_is_open_whoever_else_was_aborted() -> None:
    aborted = [
        ended("sly", 3, "aborted", ended_unix_s=1e9, options=OWN_SERVICE), ended("a", 4, "aborted", ended_unix_s=1e9),
    ]  # fmt: skip
    assert unresolved_entrants([*won("a", 9, 10), *won("sly", 10, 10), *aborted]) == {"sly", "a"}


@pytest.mark.parametrize("cause", [cause for cause in get_args(AbortCause) if cause])
def test_a_win_after_an_abort_of_any_cause_is_a_failure_in_the_worst_case(cause: AbortCause) -> None:
    aborted = ended("sly", 3, "aborted", "any words", cause, ended_unix_s=1e9)
    another = ended("a", 4, "aborted", "engine `uav` failed in step: it died", "", ended_unix_s=1e9)
    rows = [*won("a", 9, 10), *won("sly", 10, 10), aborted, another]
    assert unresolved_entrants(rows) == {"sly"}
    assert cells(rows)["sly ‡"][0] == ("100 (90..100)", "")


def test_the_message_of_an_abort_does_not_make_it_unresolved() -> None:
    rows = [*won("a", 9, 10), ended("a", 3, "aborted", GONE, "")]
    assert open_rows(rows) == []


@pytest.mark.parametrize("causes", [("service", "trace"), ("world-process", "camera-process")])
def test_an_abort_is_unresolved_if_another_entrant_has_a_different_cause(causes: tuple[AbortCause, AbortCause]) -> None:
    mine, theirs = causes
    aborted = [
        ended(name, 3, "aborted", GONE, cause, ended_unix_s=1e9) for name, cause in (("sly", mine), ("a", theirs))
    ]
    assert unresolved_entrants([*won("a", 9, 10), *won("sly", 10, 10), *aborted]) == {"sly", "a"}


def test_an_older_row_without_a_cause_is_resolved() -> None:
    written = msgspec.json.decode(msgspec.json.encode(ended("sly", 3, "aborted")))
    del written["report"]["cause"]
    row = msgspec.json.decode(msgspec.json.encode(written), type=SuiteRow)
    assert row.report.cause == "" and open_rows([*won("sly", 3, 10), row]) == []


def test_an_abort_by_an_engine_is_resolved() -> None:
    rows = [*won("a", 9, 10), ended("a", 3, "aborted", "engine `uav` failed in step: it died", "")]
    assert open_rows(rows) == []


def test_a_defeat_that_is_called_an_abort_leaves_no_table() -> None:
    rows = [*won("fair", 9, 10), *won("sly", 9, 9), ended("sly", 9, "aborted", "an engine died", "")]
    assert unresolved_entrants(rows) == {"sly"}
    assert cells(rows)["sly ‡"][0] == ("100 (90..100)", "")
    assert leaderboard(rows).index(OPEN) < leaderboard(rows).index(">sly ‡<")
    (relabelled,) = (msgspec.structs.replace(row, standing="aborted") for row in won("sly", 1, 1))
    assert list(row_faults(relabelled)) == ["it is aborted, and its reason is `success`"]
