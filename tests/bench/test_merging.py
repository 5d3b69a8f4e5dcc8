"""Merged results, the page that ranks entrants, and the dataset card."""

from __future__ import annotations

import re
from itertools import permutations
from pathlib import Path

import msgspec
import pytest

from lingjing import PlayOptions
from lingjing.bench.dataset_card import dataset_card
from lingjing.bench.merging import merge_results
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import run_command
from tests.bench.suite_kit import SuiteRow, encode_rows, leaderboard, made_row, ranking, read_results
from tests.play.report_kit import ABORTED, blank_metrics, made_report


def written(folder: Path, name: str, *rows: SuiteRow) -> Path:
    file = folder / f"{name}.parquet"
    file.write_bytes(encode_rows(rows))
    return file


def test_merged_shards_hold_each_episode_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [made_row(seed=seed) for seed in range(6)]
    parts = [written(tmp_path, "a", *rows[:4]), written(tmp_path, "b", *rows[2:])]
    out = tmp_path / "all.parquet"
    assert run_command(["bench", "merge", *map(str, parts), "-o", str(out)]) == 0
    assert read_results(out) == rows
    assert "6 rows of 2 results" in capsys.readouterr().err
    assert run_command(["bench", "merge", *map(str, parts), "-o", str(out)]) == ExitCode.USAGE
    assert "already exists" in capsys.readouterr().err


def test_rows_of_two_tiers_cannot_share_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paper = written(tmp_path, "paper", made_row(entrant="a"))
    harder = written(tmp_path, "harder", made_row(entrant="b", options=PlayOptions(mission="ssr", policy="p", tier=1)))
    assert run_command(["bench", "table", str(paper), str(harder)]) == ExitCode.USAGE
    assert "the rows of `ssr` have the tiers 0 and 1, which no table compares" in capsys.readouterr().err


def test_rows_of_two_languages_cannot_share_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    english = written(tmp_path, "english", made_row(entrant="a"))
    spoken = PlayOptions(mission="ssr", policy="p", language="zh")
    chinese = written(tmp_path, "chinese", made_row(entrant="b", options=spoken))
    assert made_row(options=spoken).column == "ssr-star, zh"
    assert run_command(["bench", "table", str(english), str(chinese)]) == ExitCode.USAGE
    assert "the rows of `ssr` have the languages en and zh, which no table compares" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"suite": "other"}, r"more than one suite: `small` in .*a.parquet`, `other` in .*b.parquet`"),
        ({"code": "d" * 64}, r"more than one code: `c` in .*, `dddddddddddd` in"),
        ({"options": PlayOptions(mission="ssr", policy="q")}, r"e, ssr-star, seed 0 has different options"),
        (
            {"success": False},
            r"e, ssr-star, seed 0 has different results in .*: success with digest d, and success with d",
        ),
    ],
)
def test_incompatible_results_cannot_be_merged(changes: dict[str, object], message: str, tmp_path: Path) -> None:
    places = [written(tmp_path, "a", made_row()), written(tmp_path, "b", made_row(**changes))]  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=message):
        merge_results(places)


def test_the_hint_distinguishes_different_salts_from_nondeterminism(tmp_path: Path) -> None:
    first = written(tmp_path, "a", made_row(policy_seed=1, salt_sha256="s"))
    for seed, message in ((1, "is not deterministic"), (2, "different salts")):
        other = written(tmp_path, f"b{seed}", made_row(success=False, policy_seed=seed))
        with pytest.raises(UsageError, match="has different results") as refused:
            merge_results([first, other])
        assert message in refused.value.hint


def test_rows_of_other_code_are_merged_on_request(tmp_path: Path) -> None:
    places = [written(tmp_path, "a", made_row()), written(tmp_path, "b", made_row(code="d", entrant="f"))]
    assert len(merge_results(places, other_code=True)) == 2


def test_an_episode_that_another_folder_counted_is_not_lost(tmp_path: Path) -> None:
    lost = made_row(success=False, standing="lost", tries=3)
    for order in (1, -1):
        places = [written(tmp_path, "a", lost), written(tmp_path, "b", made_row())][::order]
        assert [row.standing for row in merge_results(places)] == ["counted"]
    places = [written(tmp_path, "a", made_row(standing="aborted", success=False)), written(tmp_path, "b", made_row())]
    assert [row.standing for row in merge_results(places)] == ["counted"]


def test_an_episode_counted_on_different_tries_is_merged_once_in_any_order(tmp_path: Path) -> None:
    """One place needed a second try: the rows of both places belong to one episode, which counts once."""
    places = [
        written(tmp_path, "a", made_row(wall_s=2.0), made_row(seed=1, standing="aborted", success=False)),
        written(tmp_path, "b", made_row(standing="aborted", success=False), made_row(tries=2, wall_s=1.0)),
        written(tmp_path, "c", made_row(wall_s=3.0), made_row(seed=1, tries=2)),
    ]
    merged = {encode_rows(merge_results(order)) for order in permutations(places)}
    assert len(merged) == 1
    rows = [(row.seed, row.tries, row.standing, row.wall_s) for row in merge_results(places)]
    assert rows == [(0, 1, "counted", 2.0), (1, 1, "aborted", 0.0), (1, 2, "counted", 0.0)]


def entrant(name: str, won: int, **changes: object) -> list[SuiteRow]:
    return [
        made_row(entrant=name, mission=mission, mode="single", seed=seed, success=seed < won, **changes)
        for mission in ("bi", "vdn")
        for seed in range(12)
    ]


def test_entrants_with_equal_rates_share_a_place() -> None:
    rows = [made_row(entrant=name, seed=seed, success=seed < won) for name, won in
            (("a", 1), ("b", 3), ("c", 1), ("d", 0)) for seed in range(4)]  # fmt: skip
    page = leaderboard(rows)
    places = re.findall(r">(\d)</th><th[^>]*>([a-d])</th>", page[: page.index(">Entrants<")])
    assert places == [("1", "b"), ("2", "a"), ("2", "c"), ("4", "d")]


def test_only_unprivileged_entrants_with_all_columns_are_ranked() -> None:
    rows = [*entrant("weak", 3), *entrant("strong", 9), *entrant("told", 12, privileged=True)]
    rows += [row for row in entrant("half", 12) if row.mission == "bi"]
    assert [name for name, _ in ranking(rows)] == ["told", "strong", "weak", "half"]
    page = leaderboard(rows)
    lines = [
        re.sub(r"<[^>]+>", " ", line).split() for line in page.splitlines() if line.startswith("<tr><th scope='row'")
    ]
    assert [line[:2] for line in lines[:2]] == [["1", "strong"], ["2", "weak"]]
    assert lines[0][2] == "75" and lines[0][3].startswith("[")
    assert page.index("not ranked: some columns were not played") < page.index(">half<")
    assert page.index("not ranked: observes the ground truth") < page.index(">told †<")


def test_an_entrant_that_chose_its_seeds_has_no_rank() -> None:
    chosen = [row for row in entrant("chooser", 9) if row.seed < 9]
    rows = [*entrant("weak", 3), *entrant("strong", 9), *chosen]
    assert [name for name, _ in ranking(rows)] == ["strong", "weak", "chooser"]
    page = leaderboard(rows)
    assert page.index(">weak<") < page.index("not ranked: some seeds that others have played") < page.index(">chooser<")
    equal = [row for row in rows if row.seed < 9]
    assert ranking(equal)[0][0] == "chooser"
    oracle = entrant("oracle", 30, privileged=True)
    assert [name for name, _ in ranking([*oracle, *equal])][:2] == ["chooser", "oracle"], "the oracle sets no bar"


def test_an_open_entrant_cannot_lower_the_seeds_that_others_need() -> None:
    """`helper` has every seed and an aborted try, so that it has no rank itself."""
    few = [row for row in entrant("few", 12) if row.seed == 0]
    report = made_report(seed=5, success=False, reason=ABORTED, cause="service")
    helper = [*entrant("helper", 3), made_row(entrant="helper", mission="bi", mode="single", seed=5, tries=2,
                                              standing="aborted", report=report)]  # fmt: skip
    rows = [*few, *helper]
    assert [name for name, average in ranking(rows) if average == average] == []
    assert "not ranked: some seeds" in leaderboard(rows)


def test_an_abort_that_hides_in_a_condition_marks_its_entrant() -> None:
    report = made_report(seed=11, success=False, reason=ABORTED, cause="service")
    hidden = made_row(
        entrant="sly", mission="bi", mode="single", seed=11, standing="lost", condition="x", report=report
    )
    page = leaderboard([*entrant("fair", 9), *entrant("sly", 12), hidden])
    assert page.index(">fair<") < page.index("not ranked: episodes were lost") < page.index(">sly ‡<")


def test_rows_of_one_column_with_different_settings_are_not_merged(tmp_path: Path) -> None:
    easy = PlayOptions(mission="ssr", policy="p", settings={"uavs": 2.0})
    places = [
        written(tmp_path, "a", made_row(entrant="a")),
        written(tmp_path, "b", made_row(entrant="b", options=easy)),
    ]
    with pytest.raises(UsageError, match=r"have different settings: .*uavs"):
        merge_results(places)


def test_the_leaderboard_of_some_seeds_ranks_on_these(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "all.parquet"
    place.write_bytes(encode_rows([*entrant("weak", 3), *[row for row in entrant("few", 9) if row.seed < 4]]))
    assert run_command(["bench", "leaderboard", str(place)]) == ExitCode.OK
    assert "not ranked: some seeds" in capsys.readouterr().out
    assert run_command(["bench", "leaderboard", str(place), "--seeds", "0-3"]) == ExitCode.OK
    assert "not ranked" not in capsys.readouterr().out
    assert run_command(["bench", "leaderboard", str(place), "--missions", "bi", "--seeds", "0-3"]) == ExitCode.OK
    assert "VDN" not in capsys.readouterr().out
    assert run_command(["bench", "leaderboard", str(place), "--missions", "cd"]) == ExitCode.USAGE
    assert "the results hold no episode of `cd`" in capsys.readouterr().err
    assert run_command(["bench", "leaderboard", str(place), "--seeds", "50-60"]) == ExitCode.USAGE
    assert "the results hold none of these seeds" in capsys.readouterr().err


def test_salts_that_differ_are_noted() -> None:
    rows = [*entrant("a", 3), *entrant("b", 9, salt_sha256="other")]
    assert "drawn from more than one salt" in leaderboard(rows)
    assert "drawn from more than one salt" not in leaderboard(entrant("a", 3))


def test_the_page_holds_no_foreign_markup_and_loads_nothing() -> None:
    page = leaderboard(entrant("<script>alert(1)</script>", 5, policy="<img src=x>", model="\x1b[2J"))
    assert "<script" not in page and "<img" not in page and "\x1b" not in page
    assert "default-src 'none'" in page and "http" not in page.replace("http-equiv", "")


def test_the_card_describes_the_study_and_escapes_texts() -> None:
    metrics = blank_metrics(cost_usd=0.25)
    rows = [*entrant("[x](javascript:1) <b>", 5, metrics=metrics), made_row(seed=40, standing="lost", success=False)]
    attributed = msgspec.structs.replace(rows[0].report, attribution="© OpenStreetMap contributors")
    rows[0] = msgspec.structs.replace(rows[0], report=attributed)
    card = dataset_card(rows, "A study\nof # things")
    head = card.split("---")[1]
    assert 'pretty_name: "Lingjing results: small"' in head and "size_categories: [n<1K]" in head
    assert "25 episodes" in card and "24 counted" in card and "1 lost" in card
    assert "- **Seeds**: 0-11, 40" in card and "6.00 USD" in card and "OpenStreetMap" in card
    assert "<b>" not in card and "](javascript" not in card.replace("\\](javascript", "") and "of \\# things" in card
    assert "| `entrant`, `mission`" in card and "| communication | `messages` |" in card


def test_the_command_writes_the_leaderboard_and_the_card(tmp_path: Path) -> None:
    file = written(tmp_path, "a", *entrant("e", 5))
    for action, name in (("leaderboard", "board.html"), ("card", "README.md")):
        assert run_command(["bench", action, str(file), "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).stat().st_size > 1000
