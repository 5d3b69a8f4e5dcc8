"""The numbers of figures against rows made by hand, and the parts of each figure."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lingjing import PlayOptions
from lingjing import read as read_trace
from lingjing.analysis.behaviour import ActionCounts
from lingjing.analysis.detection import PerceptionCounts
from lingjing.analysis.messages import admitted_messages
from lingjing.analysis.metrics import StageMetric
from lingjing.bench.frame_sets.balance import class_set
from lingjing.bench.frame_sets.folder import write_set
from lingjing.bench.frame_sets.probe import ProbedFrame, probe_cell
from lingjing.bench.frame_sets.twins import TWINS, TwinRecord, TwinSet
from lingjing.bench.prompt_search import RESULTS, KeptSearch, PromptCandidate, PromptEpisode
from lingjing.bench.statistics import drawn_samples
from lingjing.bench.table_cells import ResultTable
from lingjing.report.estimates import MANY, pooled, share, unmatched
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigurePart
from lingjing.report.figure_kinds import FIGURES, figure_named
from lingjing.report.gathering import gather
from lingjing.report.painting import painted
from tests.bench.frame_kit import VICTIM, made_frame, picture, pictures_of
from tests.bench.suite_kit import SuiteRow, made_row
from tests.play.report_kit import blank_metrics, made_report
from tests.report.conftest import lines_of, tooltips_of

PERSON = VICTIM.cls


def parts_of(name: str, evidence: ReportEvidence) -> list[FigurePart]:
    return list(figure_named(name).make(evidence))


def entries(table: ResultTable) -> dict[tuple[str, ...], dict[str, str]]:
    """The texts of a table by the labels of lines and the heads of columns."""
    return {
        line.label: {head: cell.text for head, cell in zip(table.heads, line.cells, strict=True)}
        for line in table.lines
    }


def words_of(part: FigurePart) -> list[str]:
    return [line for drawing in part.drawings for line in lines_of(drawing)]


def row(*, metrics: dict[str, object] | None = None, settings: dict[str, float] | None = None,
        args: dict[str, object] | None = None, success: bool = True, family: str | None = None,
        terciles: tuple[ActionCounts, ...] = (), perceived: PerceptionCounts | None = None,
        **changes: object) -> SuiteRow:  # fmt: skip
    """A counted row with the given fields of its metrics, settings and options."""
    report = made_report(
        seed=changes.get("seed", 0), success=success, scr=1.0 if success else 0.5,
        metrics=blank_metrics(**(metrics or {})), family=family, terciles=terciles, perceived=perceived,
    )  # fmt: skip
    options = PlayOptions(mission="ssr", policy="p", settings=settings or {}, policy_args=args or {})
    return made_row(report=report, options=options, **changes)


# -- estimates


def test_rates_and_intervals_equal_values_computed_by_hand() -> None:
    won = share([True, True, False, False])
    assert won.value == 50.0 and won.number == 4 and won.low == pytest.approx(15.0, abs=0.1)
    assert won.text(".0f") == "50 [15, 85]"
    rate = pooled([(1, 10), (9, 10), (0, 0)])
    assert rate.value == 0.5 and rate.number == 2 and (rate.low, rate.high) == (0.1, 0.9)
    assert math.isnan(share([]).value) and share([]).text(".0f") == "N/A"
    alone = pooled([(1, 4)])
    assert alone.text(".2f") == "0.25", "one episode has no interval"
    seen = row(metrics={"f1": 0.5, "detections": 3, "false_positives": 1, "misses": 1})
    assert unmatched([seen]).value == pytest.approx(2 / 8)


def test_a_pooled_rate_over_many_has_the_interval_of_the_bootstrap() -> None:
    random = np.random.default_rng(1)
    counts = random.integers(5, 40, 2 * MANY)
    parts = [(float(random.binomial(count, 0.3)), float(count)) for count in counts]
    many, drawn = pooled(parts), np.array(parts)[drawn_samples(len(parts))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], [0.025, 0.975])
    assert many.low == pytest.approx(low, abs=0.001) and many.high == pytest.approx(high, abs=0.001)


# -- figures


def test_the_main_figure_has_the_values_of_the_main_table(results: Callable[..., Path]) -> None:
    rows = [
        row(entrant=name, mode=mode, seed=seed, success=won)
        for name, won in (("a", True), ("b", False)) for mode in ("star", "broadcast") for seed in (0, 1)
    ]  # fmt: skip
    (part,) = parts_of("main", gather([results(rows)]))
    assert [table.kind for table in part.tables] == ["success", "intervals"]
    assert entries(part.tables[1])["a",]["SSR^s"] == "100 [34, 100] (2/2)"
    assert words_of(part).count("100") == 3 and words_of(part).count("0") == 3, "two modes and the average of each"
    assert not any("episodes are counted" in note for table in part.tables for note in table.notes)


def test_entrants_have_the_same_order_in_drawings_and_tables(results: Callable[..., Path]) -> None:
    """Only the second entrant played the first column, which does not change the order."""
    rows = [
        row(entrant=name, entrant_place=place, mode=mode, seed=0, success=False, family="perception_miss")
        for place, (name, modes) in enumerate((("a", ("broadcast",)), ("b", ("star", "broadcast"))))
        for mode in modes
    ]
    evidence = gather([results(rows)])
    (main,) = parts_of("main", evidence)
    (lost,) = parts_of("failures", evidence)
    assert [line.label for line in main.tables[0].lines] == [("a",), ("b",)]
    assert [word for word in words_of(main) if word in "ab"] == ["a", "b"]
    assert [drawing.title for drawing in lost.drawings] == ["a", "b"]


def test_modes_are_compared_on_seeds_that_were_played_in_both(results: Callable[..., Path]) -> None:
    rows = [row(mode="star", seed=seed, metrics={"messages": 5}) for seed in (0, 1, 2)]
    rows += [row(mode="broadcast", seed=seed, success=False, metrics={"messages": 9 + seed}) for seed in (1, 2, 3)]
    (part,) = parts_of("communication", gather([results(rows)]))
    cells = entries(part.tables[0])
    assert cells["SSR", "Msg"] == {"Matched seeds": "2", "Star": "5.0 [5.0, 5.0]", "Broadcast": "10.5 [10.0, 11.0]"}
    assert cells["SSR", "Gap"]["Star"] == "N/A"
    assert next(line for line in part.tables[0].lines if line.label[1] == "Msg").cells[1].mark == "best"
    assert entries(part.tables[1])["e, SSR star", "e, SSR broadcast"]["Only first won"] == "2"


def test_a_sweep_contains_runs_in_which_only_its_parameter_differs(results: Callable[..., Path]) -> None:
    rows = [
        row(condition=f"{uavs} UAVs", settings={"uavs": uavs}, mode="broadcast", seed=seed, success=uavs > 1,
            baseline=uavs == 3)
        for uavs in (1, 2, 3) for seed in (0, 1)
    ]  # fmt: skip
    rows += [row(condition="low", settings={"altitude": 60.0}, mode="broadcast", metrics={"coverage": 0.64})]
    evidence = gather([results(rows)])
    (scaled,) = parts_of("scaling", evidence)
    cells = entries(scaled.tables[0])
    counts = {label: values["n"] for label, values in cells.items()}
    assert counts == {("1",): "2", ("2",): "2", ("3",): "2"}
    assert cells["1",]["Success (TSR) %"] == "0 [0, 66]" and cells["3",]["Success (TSR) %"] == "100 [34, 100]"
    (sensed,) = parts_of("robustness", evidence)
    assert sensed.heading == "SSR (broadcast) by altitude"
    assert [*entries(sensed.tables[0])] == [("60 m",), ("100 m",)], "the default is the mission's own"
    assert entries(sensed.tables[0])["60 m",]["Search coverage %"] == "64"


def test_ablations_compare_with_the_baseline_and_the_sweep(results: Callable[..., Path]) -> None:
    rows = [row(condition="Full", baseline=True, seed=seed, metrics={"tokens": 100, "calls": 1}) for seed in (0, 1)]
    rows += [row(condition="Once", args={"research": 0}, seed=seed, metrics={"tokens": 70, "calls": 1})
             for seed in (0, 1)]  # fmt: skip
    rows += [row(condition="Sweep", args={"decider": "sweep"}, seed=seed, success=False) for seed in (0, 1)]
    rows += [row(entrant="rules", condition=f"uavs = {uavs:g}", baseline=uavs == 3.0, settings={"uavs": uavs})
             for uavs in (2.0, 3.0)]  # fmt: skip
    evidence = gather([results(rows)])
    (part,) = parts_of("ablations", evidence)
    assert [*entries(part.tables[0])] == [("Full",), ("Once",), ("Sweep",)], "a fleet's size is no component of `rules`"
    assert (
        entries(part.tables[0])["Once",]["Cost x"] == "0.70" and entries(part.tables[0])["Sweep",]["Cost x"] == "0.00"
    )
    assert entries(part.tables[1])["e",]["Difference of SR"] == "+100 [+100, +100]"
    (spent,) = parts_of("cost", evidence)
    assert entries(spent.tables[0])["e (Once)",]["Cost x"] == "0.70"
    assert ("e (Sweep)",) not in entries(spent.tables[0]), "it calls no model"
    assert parts_of("prompts", evidence) == [] and parts_of("last-mile", evidence) == []


def test_prompts_and_interventions_are_recognised_by_their_options(results: Callable[..., Path]) -> None:
    rows = [
        row(condition=name, args={"prompt": name}, metrics={"json_compliance": 0.5, "answers": 4})
        for name in ("P0", "P1")
    ]
    rows += [
        row(mission="ld", condition=name, args={"intervention": name}, seed=seed, metrics={"last_mile": 3 + at})
        for at, name in enumerate(("A0", "A1")) for seed in (0, 1)
    ]  # fmt: skip
    evidence = gather([results(rows)])
    (prompts,) = parts_of("prompts", evidence)
    assert entries(prompts.tables[0])["P1",]["JSON %"] == "50"
    (mile,) = parts_of("last-mile", evidence)
    assert entries(mile.tables[0])["e (A0)",]["S4"] == "0/2" and entries(mile.tables[0])["e (A1)",]["S4"] == "2/2"
    assert parts_of("ablations", evidence) == []


def test_figures_of_stages_failures_drift_and_signatures_show_the_metrics_of_the_rows(
    results: Callable[..., Path],
) -> None:
    stages = (StageMetric(name="detect", done=3, required=3, cumulative=True),
              StageMetric(name="locate", done=2, required=3, cumulative=False))  # fmt: skip
    terciles = tuple(ActionCounts(actions=10, adherent=9 - third, following=9) for third in range(3))
    metrics = {"stages": stages, "coverage": 0.5, "first_discovery_tick": 4, "miss_rate": 0.2}
    counts = PerceptionCounts(frames=10, missing=2, errors_m=(4.0,), confidences=((0.9, True), (0.6, False)))
    families = ("perception_miss", "perception_miss", "context_drift", "unattributed")
    rows = [
        row(seed=seed, success=False, family=family, terciles=terciles, metrics=metrics, perceived=counts)
        for seed, family in enumerate(families)
    ]
    evidence = gather([results(rows)])
    (chain,) = parts_of("provenance", evidence)
    assert entries(chain.tables[0])["e",] == {"n": "4", "detect": "100 [51, 100]", "locate": "0 [0, 49]"}
    assert chain.tables[0].notes == ()
    (lost,) = parts_of("failures", evidence)
    shares = [tooltip.rpartition(": ")[2] for tooltip in tooltips_of(lost.drawings[0])]
    assert shares[0] == "Perception miss 50 %" and [share[-4:] for share in shares] == ["50 %", "25 %", "25 %"]
    (drift,) = parts_of("drift", evidence)
    assert entries(drift.tables[0])["e", "Late"]["Adher."] == "70 [70, 70]"
    (tiers,) = parts_of(
        "drift", gather([results([msgspec.structs.replace(each, group="Open models") for each in rows])])
    )
    assert [line.label[0] for line in tiers.tables[0].lines] == ["Open models"] * 3 + ["e"] * 3
    (search,) = parts_of("signatures", evidence)
    assert entries(search.tables[0])["e",]["search coverage, %"] == "50 [50, 50]"
    (panel,) = parts_of("perception", evidence)
    perception = entries(panel.tables[0])["e",]
    assert (perception["Miss"], perception["LocErr m"]) == ("0.20 [0.20, 0.20]", "4.0 [4.0, 4.0]")
    assert perception["ECE"] == "0.35 [0.35, 0.35]"  # by hand: (|1 - 0.9| + |0 - 0.6|) / 2
    assert entries(panel.tables[1])["e",]["Attn-IoU"] == "N/A"


def test_a_note_reports_episodes_that_were_won_without_a_stage(results: Callable[..., Path]) -> None:
    """Success need not require every stage, nor the reports that last-mile stages are read from."""
    stages = (StageMetric(name="assign", done=16, required=20, cumulative=False),
              StageMetric(name="execute", done=20, required=20, cumulative=False))  # fmt: skip
    rows = [row(mission="cd", seed=seed, metrics={"stages": stages}, success=seed > 0) for seed in range(3)]
    rows += [row(mission="ld", seed=seed, metrics={"last_mile": 1}) for seed in range(2)]
    evidence = gather([results(rows)])
    (chain,) = parts_of("provenance", evidence)
    assert chain.tables[0].notes == ("e: 2 of 2 that were won left assign open, which success does not require",)
    (mile,) = parts_of("last-mile", evidence)
    assert mile.tables[0].notes[1].startswith("S2 and S3 are read from typed reports")


def test_the_table_of_a_prompt_search_has_a_line_for_each_revision(tmp_path: Path) -> None:
    folder = tmp_path / "P2.txt.search"
    folder.mkdir()
    (folder / "candidate-0.txt").write_text("start")
    episode = PromptEpisode(seed=1000, success=False, scr=0.5, answers=10, valid=4)
    better = msgspec.structs.replace(episode, success=True, scr=1.0, valid=10)
    candidates = (PromptCandidate(number=0, text="start", episodes=(episode, episode)),
             PromptCandidate(number=1, text="more", episodes=(episode, better)),
             PromptCandidate(number=2, text="", fault="is empty"))  # fmt: skip
    kept = KeptSearch(
        start="start", seeds=(1000, 1001), mission="ssr", options=PlayOptions(mission="ssr"), candidates=candidates
    )
    (folder / RESULTS).write_bytes(msgspec.json.encode(kept))
    (part,) = parts_of("prompts", gather([tmp_path]))
    cells = entries(part.tables[0])
    assert cells["start",]["JSON %"] == "40 [40, 40]" and cells["revision 1",]["TSR %"] == "50 [9, 91]"
    assert len(cells) == 2 and part.notes[1] == "no prompt was given in round 2"


def test_the_appearance_figure_shows_a_probe_and_its_image_pairs(tmp_path: Path) -> None:
    answers = [ProbedFrame(detector="d", cls=PERSON, name=str(at), truth=at < 2, said=at < 2, twin_said=at < 1)
            for at in range(4)]  # fmt: skip
    (tmp_path / "probe").mkdir()
    (tmp_path / "probe" / "answers.jsonl").write_bytes(
        b"".join(msgspec.json.encode(answer) + b"\n" for answer in answers)
    )
    (tmp_path / "probe" / "counts.json").write_bytes(msgspec.json.encode([probe_cell(answers)]))
    frames = [made_frame(number, boxes=(VICTIM,) if number == 2 else ()) for number in (1, 2)]
    write_set(tmp_path / "set", [class_set(frames, PERSON)], pictures_of(frames))
    (tmp_path / "twins" / PERSON).mkdir(parents=True)
    data, file = picture(3), f"{PERSON}/twin.jpg"
    digest = hashlib.sha256(data).hexdigest()
    (tmp_path / "twins" / file).write_bytes(data)
    twins = tuple(TwinRecord(cls=PERSON, name=frame.name, file=file, sha256=digest) for frame in frames)
    (tmp_path / "twins" / TWINS).write_bytes(msgspec.json.encode(TwinSet(taken=twins, refused=())))
    probe, pairs = parts_of("appearance", gather([tmp_path]))
    assert entries(probe.tables[0])[PERSON, "d"]["F1 frames"].startswith("1.00 [")
    assert entries(probe.tables[0])[PERSON, "d"]["F1 twins"].startswith("0.67 [")
    bars = tooltips_of(probe.drawings[0])
    assert bars[0].startswith("simulator's frames: 1.00") and bars[1].startswith("twins: 0.67")
    (pair,) = pairs.drawings
    with painted(pair) as painting:
        assert len(painting.pictures) == 2
    assert pairs.notes == ("2 pairs, 0 edits rejected",)


def test_traced_episodes_give_conversation_charts_and_frame_pictures(evidence: ReportEvidence) -> None:
    (shown,) = parts_of("conversations", evidence)
    assert [drawing.title.split(",")[0] for drawing in shown.drawings] == ["SSR star", "SSR broadcast"]
    ticks = [int(word) for word in words_of(shown) if word.isdecimal()]
    assert ticks == [*range(0, 13, 5)] * 2, "multiples of five, as an axis of ticks has them"
    messages = [tooltip for drawing in shown.drawings for tooltip in tooltips_of(drawing) if " to " in tooltip]
    metrics = [episode.row.report.metrics for episode in evidence.traced]
    assert all(each is not None for each in metrics)
    assert len(messages) == sum(len(admitted_messages(read_trace(episode.path))) for episode in evidence.traced) >= 1
    (frames,) = parts_of("frames", evidence)
    for drawing in frames.drawings:
        with painted(drawing) as painting:
            assert len(painting.pictures) == 1 and painting.lines()


def test_missing_evidence_gives_no_parts_and_a_command_to_run() -> None:
    nothing = ReportEvidence()
    for kind in FIGURES:
        assert list(kind.make(nothing)) == [], kind.name
        assert kind.needs.startswith("lingjing "), kind.name
    assert len({kind.name for kind in FIGURES}) == len(FIGURES)
