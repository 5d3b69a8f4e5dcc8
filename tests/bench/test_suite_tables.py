"""Numbers and marks of tables, and the escaping of markup in texts."""

from __future__ import annotations

import csv
import io
import math

import msgspec
import pytest

from lingjing.analysis.behaviour import ActionCounts
from lingjing.analysis.detection import PerceptionCounts
from lingjing.analysis.metrics import StageMetric
from lingjing.bench.countdown import Countdown
from lingjing.bench.exports import html_page, to_csv, to_html, to_latex, to_markdown
from lingjing.bench.played import Played, columns_of
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, best_of
from lingjing.bench.tables import TABLES, make_tables
from lingjing.cli import bench
from tests.bench.suite_kit import SuiteRow, made_row
from tests.play.report_kit import blank_metrics, made_report


def column(entrant: str, mission: str, mode: str, won: int, of: int = 10, **changes: object) -> list[SuiteRow]:
    return [
        made_row(entrant=entrant, mission=mission, mode=mode, seed=seed, success=seed < won, **changes)
        for seed in range(of)
    ]


def test_pooled_rates_are_over_counts_and_not_over_episodes() -> None:
    metrics = [
        {"detections": 9, "misses": 1, "false_positives": 0, "f1": 0.9, "rep": 0.1, "target_events": 10},
        {"detections": 0, "misses": 0, "false_positives": 0, "f1": None, "rep": 0.5, "target_events": 90},
    ]
    played = Played.of(made_row(seed=seed, metrics=item) for seed, item in enumerate(metrics))
    assert played.f1() == pytest.approx(18 / 19)
    assert played.weighted("rep", "target_events") == pytest.approx(0.46)
    assert math.isnan(Played(()).f1()) and math.isnan(Played(()).rate())


def test_perception_is_pooled_over_frames_and_reports() -> None:
    """One frame of ten and 45 of 90 with a miss: 46 of 100. Three errors of one episode and one of the other: the
    median of the four. Two confidences of 0.9 in one bin, one of them right: |1 - 1.8| over 2."""
    counts = [
        PerceptionCounts(frames=10, missing=1, errors_m=(1.0, 2.0, 3.0), confidences=((0.9, True),)),
        PerceptionCounts(frames=90, missing=45, hallucinating=9, errors_m=(80.0,), confidences=((0.9, False),)),
    ]
    played = Played.of((*(made_row(seed=seed, perceived=item) for seed, item in enumerate(counts)), made_row(seed=2)))
    assert played.perceived("missing") == pytest.approx(0.46)
    assert (played.perceived("hallucinating"), played.perceived("confusing")) == (pytest.approx(0.09), 0.0)
    assert played.location_error_m() == 2.5
    assert played.calibration_error() == pytest.approx(0.4)
    nothing = Played(())
    undefined = nothing.perceived("missing"), nothing.location_error_m(), nothing.calibration_error()
    assert all(map(math.isnan, undefined))


# -- tables


def test_the_main_table_has_the_papers_columns_average_and_marks() -> None:
    rows = [
        *column("a", "ssr", "star", 4), *column("a", "ssr", "broadcast", 8), *column("a", "vdn", "single", 5),
        *column("b", "ssr", "star", 6, entrant_place=1), *column("b", "ssr", "broadcast", 8, entrant_place=1),
        *column("b", "vdn", "single", 1, entrant_place=1), *column("c", "ssr", "star", 5, entrant_place=2),
        *column("o", "ssr", "star", 10, entrant_place=3, privileged=True),
    ]  # fmt: skip
    (table,) = make_tables(rows[::-1], ["success"])
    assert table.heads == ("VDN", "SSR^s", "SSR^b", "Avg")
    cells_by_entrant = {line.label[0]: [(cell.text, cell.mark) for cell in line.cells] for line in table.lines}
    assert list(cells_by_entrant) == ["a", "b", "c", "o †"]
    assert cells_by_entrant["a"] == [("50", "best"), ("40", ""), ("80", ""), ("55", "best")]
    assert cells_by_entrant["b"] == [("10", "second"), ("60", "best"), ("80", ""), ("40", "second")]
    assert cells_by_entrant["c"] == [("–", ""), ("50", "second"), ("–", ""), ("–", "")]
    assert cells_by_entrant["o †"][1] == ("100", "")
    assert columns_of(rows) == (("vdn", "single"), ("ssr", "star"), ("ssr", "broadcast"))


def test_lost_and_aborted_episodes_are_in_no_rate_and_are_noted() -> None:
    rows = [
        *column("a", "ssr", "star", 10), made_row(entrant="a", seed=10, success=False, standing="lost", tries=3),
        made_row(entrant="a", seed=9, success=False, standing="aborted"),
    ]  # fmt: skip
    (table,) = make_tables(rows, ["success"])
    assert table.lines[0].cells[0].text == "100 (91..100)"
    assert table.notes[0] == "10 episodes are counted; 1 infrastructure abort was played again with its seed"
    assert table.notes[1] == "1 are lost (aborted 3 times) and in no rate: a ssr-star seed 10"


def test_modes_are_compared_on_the_same_mission() -> None:
    metrics = {
        "star": {"messages": 6, "kilobytes": 0.52, "gap": 13.0, "rep": 0.17, "target_events": 6, "rounds": 5},
        "broadcast": {"messages": 61, "kilobytes": 3.0, "gap": 15.0, "rep": 0.11, "target_events": 9, "rounds": 9},
    }
    rows = [row for mode, item in metrics.items() for row in column("q", "ufr", mode, 5, metrics=item)]
    rows += column("q", "bi", "single", 5)
    (table,) = make_tables(rows, ["modes"])
    assert [(line.label, *((cell.text, cell.mark) for cell in line.cells)) for line in table.lines] == [
        (("UFR", "TSR"), ("50", ""), ("50", "")),
        (("UFR", "Msg"), ("6.0", "best"), ("61.0", "")),
        (("UFR", "KB"), ("0.5", "best"), ("3.0", "")),
        (("UFR", "Rnd"), ("5.0", "best"), ("9.0", "")),
        (("UFR", "Gap"), ("13", "best"), ("15", "")),
        (("UFR", "Rep"), ("17", ""), ("11", "best")),
    ]


def test_repeated_target_events_are_pooled_over_the_episodes_of_a_mode() -> None:
    """One repeated event of one, and none of nine: 1 of 10. An episode without any counts for nothing."""
    some = [{"rep": 1.0, "target_events": 1}, {"rep": 0.0, "target_events": 9}, {"rep": None, "target_events": 0}]
    rows = [made_row(mode="star", seed=seed, metrics=item) for seed, item in enumerate(some)]
    rows += [made_row(mode="broadcast", seed=seed, metrics=some[2]) for seed in range(3)]
    (table,) = make_tables(rows, ["modes"])
    assert [cell.text for cell in table.lines[-1].cells] == ["10", "N/A"]


def test_conditions_are_compared_with_the_baseline_and_stages_are_cumulative() -> None:
    def stages(*whole: bool) -> tuple[StageMetric, ...]:
        names = ("detect", "locate")
        return tuple(
            StageMetric(name=name, done=int(item), required=1, cumulative=item)
            for name, item in zip(names, whole, strict=True)
        )

    full = {
        "tokens": 1000,
        "coverage": 0.9,
        "json_compliance": 0.96,
        "answers": 25,
        "stages": stages(True, True),
    }
    coarse = {"tokens": 250, "coverage": 0.5, "stages": stages(True, False)}
    rows = [
        *column(
            "q",
            "ssr",
            "broadcast",
            7,
            condition="Full",
            baseline=True,
            metrics=full,
            perceived=PerceptionCounts(errors_m=(50.0, 52.0, 54.0)),
        ),
        *column("q", "ssr", "broadcast", 6, condition="Coarse", condition_place=1, metrics=coarse),
    ]
    (table,) = make_tables(rows, ["conditions"])
    assert table.heads[-2:] == ("detect", "locate")
    cells_by_condition = {line.label[0]: [cell.text for cell in line.cells] for line in table.lines}
    assert cells_by_condition["Full"][:2] == ["10", "70"] and cells_by_condition["Full"][5:] == [
        "52.0",
        "90",
        "96",
        "1.00",
        "100",
        "100",
    ]
    assert cells_by_condition["Coarse"][5:] == ["N/A", "50", "–", "0.25", "100", "0"]
    assert [line.cells[1].mark for line in table.lines] == ["best", "second"]
    assert make_tables(column("q", "ssr", "star", 7), ["conditions"]) == ()


def test_paired_tests_use_common_instances_and_correct_each_family_separately() -> None:
    rows = [*column("a", "ssr", "star", 9), *column("b", "ssr", "star", 0, of=8), *column("c", "bi", "single", 3)]
    rows += column("a", "ssr", "broadcast", 1)
    (table,) = make_tables(rows, ["paired"], "Study")
    assert table.title == "Study: paired tests"
    assert [(line.group, line.label, [cell.text for cell in line.cells]) for line in table.lines] == [
        ("Entrants and conditions", ("a", "b"), ["8", "8", "0", "0.008", "0.008"]),
        ("Modes", ("a, SSR star", "a, SSR broadcast"), ["10", "8", "0", "0.008", "0.008"]),
    ]


@pytest.mark.parametrize("kind", TABLES)
def test_every_kind_of_table_accepts_few_rows_and_no_rows(kind: str) -> None:
    assert make_tables([], [kind]) == ()
    for table in make_tables([made_row(), made_row(mode="broadcast"), made_row(entrant="f")], [kind]):
        assert all(len(line.cells) == len(table.heads) for line in table.lines)
        assert all(len(line.label) == len(table.labels) for line in table.lines)


def test_a_row_without_metrics_is_a_failure_like_any_other() -> None:
    rows = [made_row(success=True), made_row(seed=1, success=False, metrics=None)]
    (table,) = make_tables(rows, ["success"])
    assert table.lines[0].cells[0].text == "50"
    for kind in TABLES:
        make_tables(rows, [kind])


# -- exports

HOSTILE = "<img src=x onerror=alert(1)> | *b* `c` \\input{/etc/passwd} & 50% $x$ #_ {y} ~^ \x1b[31m\u202e\n=1+1"
TABLE = ResultTable(
    "success", HOSTILE, ("Entrant",), ("UFR^s", "<b>"),
    (ResultLine(HOSTILE, ("=HYPERLINK(1)",), (ResultCell("<i>", 1.0, "best"), ResultCell("12", 12.4, "second"))),),
    (HOSTILE,),
)  # fmt: skip


def test_html_holds_no_foreign_markup() -> None:
    from html.parser import HTMLParser

    tags: set[str] = set()

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            tags.add(tag)
            assert all(name in {"class", "colspan", "scope"} for name, _ in attrs)

    Reader().feed(to_html(TABLE))
    assert tags <= {"table", "caption", "thead", "tbody", "tr", "th", "td", "sup", "ul", "li"}
    assert "<td class='best'>&lt;i&gt;</td>" in to_html(TABLE) and "<th>UFR<sup>s</sup></th>" in to_html(TABLE)
    page = html_page("<script>", to_html(TABLE))
    assert "<script" not in page and "\x1b" not in page and "\u202e" not in page


def test_markdown_and_latex_hold_no_foreign_markup() -> None:
    text = to_markdown(TABLE)
    assert "<img" not in text and "\\| \\*b\\*" in text and "**&lt;i&gt;**" in text and "<u>12</u>" in text
    assert all(line.count("|") - line.count("\\|") == 4 for line in text.splitlines() if line.startswith("|"))
    text = to_latex(TABLE)
    assert "\\input" not in text.replace("\\textbackslash{}input", "") and "\\& 50\\%" in text
    assert r"\textbf{\textless{}i\textgreater{}} & \underline{12} \\" in text and "UFR$^{s}$" in text
    assert all(line.startswith(("%", "\\", "=HYPERLINK", "Entrant")) or " & " in line for line in text.splitlines())


@pytest.mark.parametrize("name", ["[2] x", "*x"])
def test_a_latex_name_is_not_read_as_an_argument_of_the_line_break_before_it(name: str) -> None:
    table = ResultTable("t", "T", ("a",), ("b",), (ResultLine("", (name,), (ResultCell("1", 1.0),)),))
    assert f"\n{{}}{name} & 1 \\\\" in to_latex(table)


def test_csv_reads_back_and_no_cell_begins_a_formula() -> None:
    head, row = csv.reader(io.StringIO(to_csv(TABLE)))
    assert head == ["group", "Entrant", "UFR^s", "<b>"]
    assert row[1] == "'=HYPERLINK(1)" and row[3] == "12.4"
    assert "\x1b" not in to_csv(TABLE)


def test_no_csv_header_begins_a_formula() -> None:
    table = ResultTable("t", "T", ("+a",), ("=HYPERLINK(1)",), (ResultLine("", ("x",), (ResultCell("1", 1.0),)),))
    assert next(csv.reader(io.StringIO(to_csv(table)))) == ["group", "'+a", "'=HYPERLINK(1)"]


# -- progress while a suite is played


def test_the_remaining_time_and_cost_use_the_means_of_each_kind_of_episode() -> None:
    countdown = Countdown(2, ["quick", "quick", "slow", "new"])
    assert math.isnan(countdown.left_s) and math.isnan(countdown.left_usd)
    countdown.done("quick", 10.0, 1.0)
    countdown.learn("slow", 90.0, 3.0)
    assert countdown.left_s == (10.0 + 90.0 + 50.0) / 2
    assert countdown.left_usd == 1.0 + 3.0 + 2.0


def test_the_progress_bar_shows_done_and_remaining_episodes() -> None:
    countdown = Countdown(1, ["a"] * 20)
    assert bench._bar(0, 20, countdown) == "[..........] 0/20, ? left:"
    countdown.learn("a", 195.0, 0.16)
    assert bench._bar(10, 20, countdown) == "[#####.....] 10/20, 1 h 05 min and $3.20 left:"
    assert (bench.duration(100.0), bench.duration(0.4)) == ("2 min", "0 s")
    assert blank_metrics().cost_usd == 0.0


def test_the_behaviour_table_has_the_papers_columns_and_pools_rates_of_actions() -> None:
    """Five agents that act twice have five actions with a predecessor, one that acts 90 times has 89: of these 94 five
    are repeated. Weighted by actions it would be ten of a hundred."""
    few = {"coverage": 0.9, "first_discovery_tick": 12, "redundant_revisits": 0.1, "idle_fraction": 0.12,
           "discovery_messages": 0.8}  # fmt: skip
    many = {**few, "first_discovery_tick": None}
    none = ActionCounts()
    thirds = {
        0: (ActionCounts(actions=5, adherent=5), ActionCounts(actions=5, adherent=5, following=5, repeated=5), none),
        1: (
            ActionCounts(actions=30, following=29, adherent=30),
            none,
            ActionCounts(actions=60, following=60, adherent=15),
        ),
    }
    rows = [
        made_row(seed=seed, report=made_report(seed=seed, metrics=blank_metrics(**item), terciles=thirds[seed]))
        for seed, item in enumerate((few, many))
    ]
    (table,) = make_tables(rows, ["behaviour"])
    texts = [cell.text for cell in table.lines[0].cells]
    assert texts == ["90", "12.0", "10", "0.12", "80", "55", "5", "0", "0"]
    (table,) = make_tables([made_row(metrics=few)], ["behaviour"])
    assert [cell.text for cell in table.lines[0].cells][5:] == ["–"] * 4


def lost(entrant: str, group: str, mission: str, mode: str, *families: str) -> list[SuiteRow]:
    return [
        made_row(
            entrant=entrant, group=group, mission=mission, mode=mode, seed=seed, success=False,
            report=made_report(success=False, family=family),
        )
        for seed, family in enumerate(families)
    ]  # fmt: skip


def test_failure_families_are_balanced_over_modes_then_missions_and_entrants() -> None:
    """By hand. A in ufr: star 1/1 miss, broadcast 1/2 miss, so 75 %; in cd no miss: (75 + 0) / 2 = 37.5. B: 0 of 4 in
    bi, so the heading of both has (75 + 0 + 0) / 3 = 25, not 2 of 9."""
    rows = [
        *lost("a", "API", "ufr", "star", "perception_miss"),
        *lost("a", "API", "ufr", "broadcast", "perception_miss", "context_drift"),
        *lost("a", "API", "cd", "star", "coordination_deadlock", "coordination_deadlock"),
        *lost("b", "API", "bi", "single", *["object_confusion"] * 3, "unattributed"),
        *lost("c", "Open", "bi", "single", "handoff_break"),
        made_row(entrant="c", group="Open", mission="cd"),
        *(msgspec.structs.replace(row, privileged=True) for row in lost("o", "Open", "cd", "star", "handoff_break")),
    ]
    tiers, entrants = make_tables(rows, ["failures"])
    assert tiers.heads == ("API (n = 9)", "Open (n = 1)", "Most in")
    assert {line.label[0]: [cell.text for cell in line.cells] for line in tiers.lines} == {
        "Perception miss": ["25", "0", "UFR"],
        "Object confusion": ["25", "0", "BI"],
        "Localization error": ["0", "0", "–"],
        "Long-context drift": ["8", "0", "UFR"],
        "Coordination deadlock": ["33", "0", "CD"],
        "Handoff or dependency break": ["0", "100", "BI"],
        "Unattributed": ["8", "0", "BI"],
    }
    assert sum(line.cells[0].value for line in tiers.lines) == pytest.approx(100.0)
    assert [(line.label, line.cells[0].text, line.cells[1].text) for line in entrants.lines][:3] == [
        (("a", "ufr-star"), "1", "100"), (("a", "ufr-broadcast"), "2", "50"), (("a", "cd-star"), "2", "0"),
    ]  # fmt: skip
    assert entrants.lines[-1].label == ("o †", "cd-star")


def test_drift_is_pooled_over_actions_by_tercile() -> None:
    """By hand. Late repetition: 1 of 1 and 0 of 3 that have a predecessor are 25 %, not the mean of 100 and 0."""
    early = ActionCounts(actions=2, adherent=2)
    first = (early, early, ActionCounts(actions=2, adherent=1, following=1, repeated=1, forgotten=1))
    second = (early, early, ActionCounts(actions=6, adherent=1, following=3, out_of_bounds=2))
    rows = [made_row(seed=seed, report=made_report(terciles=each)) for seed, each in enumerate((first, second))]
    (table,) = make_tables([*rows, made_row(seed=2)], ["drift"])
    rows_of_texts = [(line.label, [cell.text for cell in line.cells]) for line in table.lines]
    assert rows_of_texts[0] == (("All", "Early"), ["4", "100", "–", "0", "0"])
    assert rows_of_texts[2] == (("All", "Late"), ["8", "25", "25", "25", "12"])
    assert rows_of_texts[5] == (("e", "Late"), rows_of_texts[2][1])


def test_entrants_without_a_group_are_listed_before_the_first_heading() -> None:
    rows = [*column("m", "bi", "single", 1, group="Models"), *column("p", "bi", "single", 1)]
    (table,) = make_tables(rows, ["success"])
    for text in (to_markdown(table), to_latex(table), to_html(table)):
        assert text.index({"<": ">p<", "%": "\np &"}.get(text[0], "| p |")) < text.index("Models")
    body = to_markdown(table).splitlines()[4:]
    assert [line.split(" | ")[0].strip("| ") for line in body[:3]] == ["p", "*Models*", "m"]


def test_values_that_are_displayed_alike_are_marked_alike() -> None:
    cells = best_of([ResultCell("0", 0.33), ResultCell("0", 0.0), ResultCell("2", 2.0)], lower=True)
    assert [cell.mark for cell in cells] == ["best", "best", "second"]


def test_last_mile_delivery_has_its_five_stages() -> None:
    rows = [
        made_row(seed=seed, mission="ld", condition="A0", metrics={"last_mile": done})
        for seed, done in enumerate((5, 3))
    ]
    rows += [made_row(seed=0, mission="ld", condition="A1", condition_place=1, metrics={"last_mile": 4})]
    (table,) = make_tables(rows, ["conditions"])
    assert table.heads[-5:] == ("S1", "S2", "S3", "S4", "S5")
    assert [[cell.text for cell in line.cells[-5:]] for line in table.lines] == [
        ["100", "100", "100", "50", "50"], ["100", "100", "100", "100", "0"],
    ]  # fmt: skip


def test_a_table_names_the_entrants_with_replaced_answers() -> None:
    rows = [made_row(metrics={"substitutions": 2}), made_row(seed=1, metrics={"substitutions": 1})]
    rows += [made_row(entrant="f"), made_row(entrant="g", standing="aborted", metrics={"substitutions": 9})]
    (table,) = make_tables(rows, ["success"])
    assert table.notes[1] == "answers of policies replaced by doing nothing: e 3"


def control_row(entrant: str, seed: int, *, success: bool, mission: str = "ssr", **options: object) -> SuiteRow:
    base = msgspec.structs.replace(made_row().options, tier=1, mission=mission, **options)
    return made_row(entrant=entrant, seed=seed, success=success, mission=mission, options=base)


def test_the_controls_table_compares_controls_with_a_player_with_withheld_boxes() -> None:
    rows = []
    for seed in range(4):
        for level, share in enumerate((0.0, 0.5, 1.0)):
            args = {"withheld": share} if share else {}
            won = seed >= 2 * level
            rows.append(control_row(f"s{share}", seed, success=won, policy="sighted-reader", policy_args=args))
        rows.append(control_row("blanked", seed, success=False, policy="reader", blank_pictures=True))
        rows.append(control_row("swapped", seed, success=seed == 0, policy="sighted-reader", swap_pictures=True))
        rows.append(control_row("s0.0", seed, success=True, mission="cd", policy="sighted-reader"))
        rows.append(control_row("blanked", seed, success=True, mission="cd", policy="reader", blank_pictures=True))
    (table,) = make_tables(rows, ["controls"])
    assert table.heads == (
        "All boxes", "50 % withheld", "100 % withheld", "Trend p", "blanked", "swapped", "Above the best control",
        "Required", "Met",
    )  # fmt: skip
    ssr, cd = table.lines
    assert [cell.text for cell in ssr.cells] == [
        "100", "50", "0", "0.012", "0", "25", "75 [9, 95]", "50", "yes",
    ]  # fmt: skip
    assert cd.label == ("cd-star",) and [cell.text for cell in cd.cells[-3:]] == ["0 [-49, 49]", "–", "–"]
    assert not make_tables([row for row in rows if row.entrant != "s0.0"], ["controls"]), "no player with all boxes"


def at_tier_1(entrant: str, *, success: bool, blank_pictures: bool = False, **metrics: int) -> SuiteRow:
    options = msgspec.structs.replace(made_row().options, tier=1, blank_pictures=blank_pictures)
    return made_row(entrant=entrant, success=success, options=options, metrics=metrics)


def test_above_tier_0_the_table_also_has_precision_and_the_chance_level() -> None:
    rows = [
        at_tier_1("sees", success=True, reports=4, detections=3, false_positives=1),
        at_tier_1("guesses", success=False, blank_pictures=True),
    ]
    (table,) = make_tables(rows, ["success"])
    assert [(line.group, line.label[0]) for line in table.lines[-3:]] == [
        ("Precision of reports (%)", "sees"),
        ("Precision of reports (%)", "guesses"),
        ("Chance level (TSR, %)", "best with black pictures"),
    ]
    assert table.lines[-1].cells[0].value == 0.0
    (alone,) = make_tables(rows[:1], ["success"])
    assert "the chance level was not measured: no entrant with `blank_pictures` was played" in alone.notes
    assert alone.lines[-1].cells[0].text == "–"


def test_the_table_of_tier_0_has_only_rates_and_a_note_on_the_paper() -> None:
    (table,) = make_tables([made_row()], ["success"])
    assert len(table.lines) == 1
    assert "tier 0 is comparable with the paper by protocol and never by number" in table.notes
