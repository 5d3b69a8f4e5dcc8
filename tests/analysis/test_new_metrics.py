"""Metrics of behaviour, search, confusion and attention, and pooled metrics, compared with counts by hand."""

import csv
import io
import json
import math
import shutil
import zipfile
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lingjing import EpisodeReport, Trace
from lingjing.analysis.attention import attention_iou, box_iou, read_attention
from lingjing.analysis.behaviour import TERCILES, actions, behaviour, count_by_tercile
from lingjing.analysis.box_conventions import convention_errors
from lingjing.analysis.detection import calibration_error, confused_with, detect, iou
from lingjing.analysis.metrics import StageMetric
from lingjing.analysis.search_marks import communication_at_discovery, discoveries, redundant_revisit_rate
from lingjing.bench.played import Played
from lingjing.cli.metrics import as_csv, domain_difference, retained, together
from lingjing.errors import UsageError
from lingjing.play.report import report_of
from lingjing.testing import run_command
from lingjing.testing.declarations import Constraint
from lingjing.testing.expressions import Flag
from lingjing.trace.records import (
    Action,
    AdjudicatedEvent,
    BoundaryRecord,
    Box,
    CameraPose,
    Decision,
    DecisionRecord,
    Envelope,
    Receipt,
    UnreadBox,
    Usage,
)
from tests.analysis.test_metrics import at, boundary, frame, matched, report

replace = msgspec.structs.replace


def played(*traces: Trace) -> Played:
    """Return the traces as the input of pooled metrics."""
    return Played(tuple(filter(retained, (report_of(trace, "someone") for trace in traces))))


@pytest.fixture
def of(trace: Trace):  # type: ignore[no-untyped-def]
    def build(*records: BoundaryRecord, header: object = None, outcome: object = None) -> Trace:
        return Trace(trace.path, header or trace.header, records, outcome, False)  # type: ignore[arg-type]

    return build


def step(tick: int, verb: str, reason: str = "", status: str = "accepted", **arguments: object) -> dict[str, object]:
    """Return the fields of a boundary with one command of scout[1]."""
    made = DecisionRecord(agent="scout[1]", decision=Decision(command=Action(verb=verb, arguments=arguments)))  # type: ignore[arg-type]
    receipt = Receipt(
        request=f"c{tick}-1", tick=tick, sender="scout[1]", resource="uav[1]", status=status, reason=reason
    )  # type: ignore[arg-type]
    return {"decisions": (made,), "receipts": (receipt,)}


def test_adherence_repetition_and_bounds_are_counted_by_action(of) -> None:  # type: ignore[no-untyped-def]
    """Six actions: good; the same within a metre; clipped; rejected as busy; rejected for its altitude; good."""
    there = of(
        boundary(0),
        boundary(1, **step(1, "forward", distance=10.2)),
        boundary(2, **step(2, "forward", distance=9.8)),
        boundary(3, **step(3, "up", "clipped", distance=70.0)),
        boundary(4, **step(4, "up", "busy", "rejected", distance=5.0)),
        boundary(5, **step(5, "down", "altitude", "rejected", distance=5.0)),
        boundary(6, **step(6, "stop")),
    )
    judged = actions(there)
    assert [action.adherent for action in judged] == [True, True, False, False, False, True]
    assert [action.out_of_bounds for action in judged] == [False, False, True, False, True, False]
    assert [action.repeated for action in judged] == [None, True, False, False, False, False]
    assert [action.third for action in judged] == [0, 0, 1, 1, 2, 2]
    rates = behaviour(judged)
    assert (rates.actions, rates.adherence, rates.repetition, rates.out_of_bounds) == (6, 3 / 6, 1 / 5, 2 / 6)
    thirds = {name: counts.rates() for name, counts in zip(TERCILES, count_by_tercile(judged), strict=True)}
    assert [thirds[name].adherence for name in ("early", "mid", "late")] == [1.0, 0.0, 0.5]
    assert [thirds[name].out_of_bounds for name in ("early", "mid", "late")] == [0.0, 0.5, 0.5]
    assert behaviour(()).adherence is None


def test_an_action_that_breaks_a_constraint_is_out_of_bounds(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    instance = replace(
        trace.header.instance, constraints=(Constraint(name="fence", kind="hard", condition=Flag(True)),)
    )
    header = replace(trace.header, instance=instance)
    broken = AdjudicatedEvent(id="e1", kind="fence", tick=1, time_s=10.0, bindings=("uav[1]",))
    other = replace(broken, bindings=("uav[2]",))
    for event, expected in ((broken, True), (other, False)):
        (action,) = actions(of(boundary(0), boundary(1, events=(event,), **step(1, "stop")), header=header))
        assert (action.out_of_bounds, action.adherent) == (expected, not expected)


def test_a_constraint_is_broken_by_the_running_action_and_not_by_a_rejected_one(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """The body leaves the fence two ticks after its command. Another command was rejected as busy in between."""
    fence = Constraint(name="fence", kind="hard", condition=Flag(True))
    header = replace(trace.header, instance=replace(trace.header.instance, constraints=(fence,)))
    event = AdjudicatedEvent(id="e3", kind="fence", tick=3, time_s=30.0, bindings=("uav[1]",))
    judged = actions(
        of(
            boundary(0),
            boundary(1, **step(1, "forward", distance=40.0)),
            boundary(2, **step(2, "takePhoto", "busy", "rejected")),
            boundary(3, events=(event,)),
            header=header,
        )
    )
    assert [(action.verb, action.out_of_bounds, action.adherent) for action in judged] == [
        ("forward", True, False), ("takePhoto", False, False)
    ]  # fmt: skip


def test_idle_ticks_and_substituted_decisions_are_no_actions(of) -> None:  # type: ignore[no-untyped-def]
    idle = DecisionRecord(agent="scout[1]", decision=Decision())
    lost = DecisionRecord(agent="scout[1]", decision=Decision(command=Action(verb="stop")), substituted="malformed")
    assert actions(of(boundary(0), boundary(1, decisions=(idle,)), boundary(2, decisions=(lost,)))) == ()


def test_an_action_towards_a_completed_or_unassigned_target_is_a_forgotten_subgoal(of) -> None:  # type: ignore[no-untyped-def]
    """The boat goes to victim[1], is assigned victim[2], goes to victim[1] until its rescue, and goes there again."""
    here = at(0, v1=(0.0, 0.0), v2=(500.0, 0.0), boat=(900.0, 0.0))

    def go(tick: int, east: float) -> dict[str, object]:
        command = Action(verb="moveTo", arguments={"x": east, "y": 0.0})
        made = DecisionRecord(agent="skipper", decision=Decision(command=command))
        receipt = Receipt(request=f"c{tick}-1", tick=tick, sender="skipper", resource="boat", status="accepted")
        return {"decisions": (made,), "receipts": (receipt,), "snapshots": (replace(here, time_s=10.0 * tick),)}

    assigned = Envelope(
        id="m2-1", tick=2, sender="scout[1]", recipient="skipper", kind="assignment", category="assignment",
        body={"assignee": "skipper", "position": (500.0, 0.0, 0.0)}, bytes=9, deliver_at=3,
    )  # fmt: skip
    rescued = AdjudicatedEvent(id="e4", kind="rescued", tick=4, time_s=40.0, bindings=("victim[1]",))
    judged = actions(
        of(
            boundary(0, snapshots=(here,)),
            boundary(1, **go(1, 0.0)),
            boundary(2, snapshots=(here,), messages=(assigned,)),
            boundary(3, **go(3, 0.0)),
            boundary(4, snapshots=(here,), events=(rescued,)),
            boundary(5, **go(5, 0.0)),
            boundary(6, **go(6, 500.0)),
            boundary(7, **go(7, 700.0)),
        )
    )
    assert [action.forgotten for action in judged] == [False, True, True, False, False]


def test_redundant_revisits_count_entries_of_covered_cells(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """Over A, still over A, over B, over A again, and over B by another UAV: four visits, two redundant."""
    cells = list(trace.header.instance.cells)
    first, second = (
        cells[0],
        next(cell for cell in cells if cell.row != cells[0].row and cell.column != cells[0].column),
    )

    def over(number: int, cell: object, entity: str = "uav[1]") -> object:
        pose = CameraPose(position=(*cell.centre[:2], 100.0), heading_deg=0.0, tilt_deg=90.0)  # type: ignore[attr-defined]
        return replace(frame(f"f{number}", number), pose=pose, entity=entity)

    places = [(1, first), (2, first), (3, second), (4, first), (5, second)]
    frames = [over(number, cell, "uav[2]" if number == 5 else "uav[1]") for number, cell in places]
    there = of(boundary(0), *(boundary(n, frames=(picture,)) for n, picture in enumerate(frames, 1)))
    assert redundant_revisit_rate(there) == 2 / 4
    front = replace(frames[0], pose=CameraPose(position=(0.0, 0.0, 10.0), heading_deg=0.0, tilt_deg=0.0))
    assert redundant_revisit_rate(of(boundary(0), boundary(1, frames=(front,)))) is None


def test_communication_at_discovery_counts_messages_of_the_tick_of_a_first_match(of) -> None:  # type: ignore[no-untyped-def]
    there = of(
        boundary(0),
        boundary(1, frames=(frame("a", 1, "victim[1]"),), messages=report(1, "a", 1, recipients=1)),
        boundary(2, messages=report(1, "a", 2, recipients=3), events=(matched(2, "victim[1]", "m2-1"),)),
        boundary(3, messages=report(1, "a", 3, recipients=4), events=(matched(3, "victim[1]", "m3-1"),)),
    )
    assert discoveries(there) == {"victim[1]": 2}
    assert communication_at_discovery(there) == 3 / 8
    assert communication_at_discovery(of(boundary(0))) is None


def test_a_report_of_another_object_is_a_confusion_and_one_of_nothing_is_not(of) -> None:  # type: ignore[no-untyped-def]
    """Four frames: a buoy reported as a person, a person, water reported as a person, no report."""
    buoy = Box(entity="buoy[1]", cls="buoy", box=(0.4, 0.4, 0.5, 0.52), pixels=40)
    there = of(
        boundary(0),
        boundary(1, frames=(replace(frame("a", 1), boxes=(buoy,)),)),
        boundary(2, frames=(frame("b", 2, "victim[1]"),), messages=report(1, "a", 2)),
        boundary(3, frames=(frame("c", 3),), messages=report(1, "b", 3), events=(matched(3, "victim[1]", "m3-1"),)),
        boundary(4, frames=(frame("d", 4),), messages=report(1, "c", 4)),
    )
    detection = detect(there)
    assert iou((0.4, 0.4, 0.5, 0.5), buoy.box) == pytest.approx(0.1 * 0.1 / (0.1 * 0.12))
    assert [confused_with(there, report) for report in detection.reports] == ["buoy[1]", None, None]
    assert (detection.confusion_rate, detection.hallucination_rate) == (1 / 4, 2 / 4)


def test_a_report_of_a_thing_without_an_entity_is_a_confusion(of) -> None:  # type: ignore[no-untyped-def]
    """Driftwood reported as a person, and a passer-by of the class that the report names."""
    wood = Box(entity="", cls="debris", box=(0.4, 0.4, 0.5, 0.52), pixels=40)
    there = of(
        boundary(0),
        boundary(1, frames=(replace(frame("a", 1), others=(wood,)),)),
        boundary(2, frames=(replace(frame("b", 2), others=(replace(wood, cls="person_in_water"),)),),
                 messages=report(1, "a", 2)),
        boundary(3, messages=report(1, "b", 3)),
    )  # fmt: skip
    detection = detect(there)
    assert [confused_with(there, report) for report in detection.reports] == ["debris", None]
    assert (detection.confusion_rate, detection.hallucination_rate) == (1 / 2, 2 / 2)


@pytest.mark.parametrize(
    ("numbers", "convention"),
    [
        ((0.4, 0.3, 0.6, 0.5), ""),
        ((0.3, 0.4, 0.5, 0.6), "shares, y first"),
        ((0.4, 0.3, 0.2, 0.2), "shares, x first, width and height"),
        ((400, 300, 600, 500), "thousandths, x first"),
        ((300, 400, 500, 600), "thousandths, y first"),
        ((768, 324, 1152, 540), "pixels, x first"),
        ((324, 768, 540, 1152), "pixels, y first"),
        ((768, 324, 384, 216), "pixels, x first, width and height"),
        ((100, 100, 120, 110), ""),
        ((math.inf, 0, 1, 1), ""),
    ],
)
def test_a_box_of_another_convention_is_distinguished_from_a_miss(of, numbers, convention) -> None:  # type: ignore[no-untyped-def]
    """The target lies at (0.4, 0.3) to (0.6, 0.5) of a picture of 1920 x 1080 pixels."""
    person = Box(entity="victim[1]", cls="person_in_water", box=(0.4, 0.3, 0.6, 0.5), pixels=9)
    seen = replace(frame("a", 1), boxes=(person,))
    unread = Usage(answers=1, unread_boxes=(UnreadBox(frame="a", numbers=tuple(map(float, numbers))),))
    made = DecisionRecord(agent="scout[1]", decision=Decision(usage=unread))
    there = of(boundary(0), boundary(1, frames=(seen,)), boundary(2, decisions=(made,)))
    assert [error.convention for error in convention_errors(there)] == [convention] * bool(convention)
    assert [error.target for error in convention_errors(there)] == ["victim[1]"] * bool(convention)


def test_attention_is_thresholded_at_mean_plus_one_deviation(of, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """One of 5 by 5 cells has attention: mean 0.04, deviation 0.196. The cell is (0.4, 0.4) to (0.6, 0.6)."""
    cells = np.zeros((5, 5))
    cells[2, 2] = 1.0
    assert box_iou(cells, (0.4, 0.4, 0.6, 0.6)) == pytest.approx(1.0)
    assert box_iou(cells, (0.4, 0.4, 0.5, 0.5)) == pytest.approx(0.25)  # a quarter of the attended cell
    assert box_iou(cells, (0.5, 0.4, 0.7, 0.6)) == pytest.approx(0.02 / 0.06)
    assert box_iou(np.ones((3, 3)), (0.0, 0.0, 0.5, 0.5)) == 0.0  # nothing is above its own mean
    there = of(boundary(0), boundary(1, frames=(frame("a", 1, "victim[1]"), frame("b", 1, "victim[1]"))))
    file = tmp_path / "maps.npz"
    np.savez(file, a=cells)
    assert attention_iou(there, read_attention(file)) == pytest.approx(0.25)
    assert attention_iou(there, {}) is None


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((2, 2, 2)), "shape"),
        (np.array([["a"]]), "not numbers"),
        (np.ones((2, 2), complex), "not numbers"),
        (np.array([[-1.0]]), "negative"),
        (np.array([[np.nan]]), "not finite"),
    ],
)
def test_an_invalid_attention_map_is_rejected_with_the_reason(array: object, words: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "m.npz", f1=array)
    with pytest.raises(UsageError, match=words):
        read_attention(tmp_path / "m.npz")
    (tmp_path / "n.npz").write_bytes(b"no archive")
    with pytest.raises(UsageError, match="no attention maps"):
        read_attention(tmp_path / "n.npz")


def test_the_error_for_an_invalid_archive_of_attention_maps_names_the_file(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.ones((3, 3)))
    (tmp_path / "empty.npz").touch()
    np.savez_compressed(tmp_path / "damaged.npz", f1=np.arange(900.0).reshape(30, 30))
    damaged = bytearray((tmp_path / "damaged.npz").read_bytes())
    damaged[300:400] = b"\xff" * 100
    (tmp_path / "damaged.npz").write_bytes(damaged)
    claims = io.BytesIO()
    shape = {"descr": "<f8", "fortran_order": False, "shape": (1 << 31, 1 << 31)}
    np.lib.format.write_array_header_1_0(claims, shape)
    with zipfile.ZipFile(tmp_path / "huge.npz", "w") as archive:
        archive.writestr("f1.npy", claims.getvalue())
    for name in ("one.npy", "empty.npz", "damaged.npz", "huge.npz"):
        with pytest.raises(UsageError, match=f"{name} holds no attention maps"):
            read_attention(tmp_path / name)


def test_pooled_metrics_sum_counts_and_weight_missions_equally(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """SSR is won in star (1 of 1) and in half of the broadcast episodes, BI is lost: ((1 + 0.5) / 2 + 0) / 2."""
    assert trace.outcome is not None

    def episode(mission: str, mode: str, seed: int, won: bool, reason: str = "") -> Trace:
        comms = replace(trace.header.instance.comms, mode=mode)
        instance = replace(trace.header.instance, mission=mission, comms=comms, seed=seed)
        outcome = replace(trace.outcome, success=won, reason=reason or ("success" if won else "budget"))
        return of(boundary(0), header=replace(trace.header, instance=instance), outcome=outcome)

    pooled = together(played(
        episode("ssr", "star", 1, True), episode("ssr", "broadcast", 1, True), episode("ssr", "broadcast", 2, False),
        episode("bi", "single", 1, False), episode("bi", "single", 2, False, "infrastructure-abort"),
    ))  # fmt: skip
    assert pooled["retained"] == 4
    assert pooled["tsr"] == 2 / 4 and pooled["macro_average"] == 0.375
    nothing = together(played())
    assert nothing["tsr"] is None and nothing["macro_average"] is None


def test_perception_is_pooled_over_the_frames_of_retained_episodes(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """One picture has a match with an error of (3, 4) m, two have none. An episode that was cut short is left out."""
    over = replace(trace.outcome, reason="budget", success=False)
    detected = of(
        boundary(0, snapshots=(at(0, v1=(0.0, 0.0), boat=(900.0, 0.0)),)),
        boundary(1, frames=(frame("a", 1, "victim[1]"),), snapshots=(at(1, v1=(0.0, 0.0), boat=(900.0, 0.0)),)),
        boundary(2, messages=report(1, "a", 2), events=(matched(2, "victim[1]", "m2-1"),)),
        outcome=over,
    )
    blind = of(boundary(0), boundary(1, frames=(frame("a", 1, "victim[1]"), frame("b", 1, "victim[2]"))), outcome=over)
    cut = of(boundary(0), boundary(1, frames=(frame("a", 1, "victim[1]"),)), outcome=replace(over, reason="error"))
    perception = together(played(detected, blind, cut))["perception"]
    assert (perception["precision"], perception["recall"], perception["f1"], perception["miss_rate"]) == (
        1.0,
        1 / 3,
        0.5,
        2 / 3,
    )
    assert (perception["hallucination_rate"], perception["confusion_rate"]) == (0.0, 0.0)
    assert (perception["localisation_error_m"], perception["calibration_error"]) == (5.0, None)
    assert together(played(cut))["perception"]["miss_rate"] is None


def test_the_calibration_error_weighs_ten_bins_by_their_reports() -> None:
    """0.95 and 0.91 are in one bin with one hit: |1 - 1.86| = 0.86. 0.25 is false: 0.25. The sum is divided by three.
    A confidence outside 0..1 counts in the nearest bin."""
    assert calibration_error([(0.95, True), (0.91, False), (0.25, False)]) == pytest.approx((0.86 + 0.25) / 3)
    assert calibration_error([(1.0, True), (0.95, True)]) == pytest.approx(0.05 / 2)
    assert calibration_error([(1e308, False), (-0.5, False)]) is not None
    assert calibration_error([]) is None


def test_repeated_events_and_stages_are_pooled(trace: Trace) -> None:
    """1 of 2 and 0 of 8 events are 0.1; the mean of rates would be 0.25. One of two episodes has its first stage."""
    (template,) = played(trace).episodes

    def episode(rep: float, events: int, detected: bool) -> EpisodeReport:
        done = {"detect": detected, "locate": False}
        stages = tuple(StageMetric(name=name, done=0, required=1, cumulative=whole) for name, whole in done.items())
        return replace(template, metrics=replace(template.metrics, rep=rep, target_events=events, stages=stages))

    pooled = together(Played((episode(0.5, 2, True), episode(0.0, 8, False))))
    assert pooled["repeated_target_rate"] == 0.1 and pooled["stages"] == {"ssr": {"detect": 0.5, "locate": 0.0}}
    assert together(Played(()))["repeated_target_rate"] is None


def test_domain_difference_is_real_minus_simulated_on_matched_episodes(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    over = trace.outcome
    good = of(
        boundary(0),
        boundary(1, frames=(frame("a", 1, "victim[1]"),)),
        boundary(2, messages=report(1, "a", 2), events=(matched(2, "victim[1]", "m2-1"),)),
        outcome=over,
    )
    blind = of(boundary(0), boundary(1, frames=(frame("a", 1, "victim[1]"),)), outcome=over)
    other = of(boundary(0), header=replace(good.header, instance=replace(good.header.instance, seed=99)), outcome=over)
    assert (played(good).f1(), played(blind).f1(), played(good, blind).f1()) == (1.0, 0.0, 2 / 3)
    assert domain_difference(played(good), played(blind)) == -1.0
    with pytest.raises(UsageError, match="not matched"):
        domain_difference(played(good), played(other))
    with pytest.raises(UsageError, match="not matched"):
        domain_difference(played(good), played(good, good))


def test_the_cost_factor_is_a_ratio_of_tokens(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    def spent(prompt: int, completion: int) -> Trace:
        usage = Usage(calls=1, prompt_tokens=prompt, completion_tokens=completion)
        made = DecisionRecord(agent="scout[1]", decision=Decision(usage=usage))
        return of(boundary(0), boundary(1, decisions=(made,)), outcome=trace.outcome)

    some, more, cut = spent(100, 20), spent(200, 40), of(boundary(0))
    assert played(some).cost_factor(played(more)) == 0.5
    assert math.isnan(played(some).cost_factor(played(of(boundary(0), outcome=trace.outcome))))
    assert played(some, cut).cost_factor(played(more, cut)) == 0.5
    assert played(some, cut).cost_factor(played(more, more)) == 0.5  # one of two was aborted
    assert math.isnan(played(cut).cost_factor(played(more)))


def test_the_command_prints_a_table_json_and_csv(
    trace: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["metrics", str(trace.path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "mission: ssr" and "tsr: 1" in lines and "json_compliance: N/A" in lines
    copy = shutil.copy(trace.path, tmp_path / "copy.mcap")
    assert run_command(["metrics", "-j", "2", "--output-format", "json", str(trace.path), str(copy)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(document["episodes"]) == 2 and document["together"]["tsr"] == 1.0
    assert set(document["together"]["terciles"]) == {"early", "mid", "late"}
    assert run_command(["metrics", "--output-format", "csv", "-o", str(tmp_path / "m.csv"), str(trace.path)]) == 0
    (row,) = csv.DictReader((tmp_path / "m.csv").open(encoding="utf-8"))
    assert row["mission"] == "ssr" and row["stages"].startswith("detect 3/3; ") and row["json_compliance"] == ""
    assert document["together"]["repeated_target_rate"] == document["episodes"][0]["rep"]
    assert document["together"]["perception"]["f1"] == document["episodes"][0]["f1"]
    assert document["together"]["stages"]["ssr"]["detect"] == 1.0
    assert run_command(["metrics", "--attention", "x.npz", str(trace.path), str(trace.path)]) == 2
    assert run_command(["metrics", str(trace.path), "--baseline", "none.mcap"]) == 2


def test_a_spreadsheet_formula_in_a_name_is_written_as_text() -> None:
    stages = [{"name": "=cmd|' /C calc'!A0", "done": 0, "required": 1}]
    (cells,) = list(csv.reader(io.StringIO(as_csv([{"policy": "=1+1", "stages": stages}]))))[1:]
    assert all(cell.startswith("'=") for cell in cells)
    (cells,) = list(csv.reader(io.StringIO(as_csv([{"policy": "=1+1", "ticks": -3}]))))[1:]
    assert cells == ["'=1+1", "-3"]
