"""The overview of whole, cut, empty and odd traces, and the placement of its labels."""

import dataclasses
import itertools
from pathlib import Path

import msgspec
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from lingjing import Trace, metrics
from lingjing.analysis import fonts
from lingjing.analysis.detection import detect
from lingjing.analysis.history import History, HistoryEvent, history_of
from lingjing.analysis.overview import draw_overview, style
from lingjing.analysis.overview.mapview import draw_map
from lingjing.analysis.overview.pictures import best_views, draw_whole, whole_frame
from lingjing.analysis.overview.score import draw_score
from lingjing.analysis.overview.timeline import draw_batteries, draw_events, draw_messages
from lingjing.errors import UsageError
from lingjing.mission.instance import InteractionSpec
from lingjing.testing import play, scripted
from lingjing.testing.expressions import Binary, Number
from lingjing.trace.records import Outcome, TaskEvent

replace = msgspec.structs.replace


def drawn(trace: Trace, path: Path) -> np.ndarray:
    draw_overview(trace, path)
    return pixels(path)


@pytest.fixture(scope="module")
def whole(trace: Trace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The overview of the whole trace. Drawing takes half a second."""
    path = tmp_path_factory.mktemp("whole") / "overview.png"
    draw_overview(trace, path)
    return path


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"))


def test_a_title_is_drawn_literally(trace: Trace, tmp_path: Path) -> None:
    """A dollar sign begins no formula, valid or not."""
    header = replace(trace.header, instance=replace(trace.header.instance, title=r"$\frac{$ of $x_1$"))
    assert drawn(dataclasses.replace(trace, header=header), tmp_path / "overview.png").shape == (1200, 1800, 3)


def titled(trace: Trace, title: str) -> Trace:
    header = replace(trace.header, instance=replace(trace.header.instance, title=title))
    return dataclasses.replace(trace, header=header, boundaries=trace.boundaries[:1], outcome=None)


def test_a_chinese_title_is_drawn_in_a_font_with_chinese_letters(trace: Trace, tmp_path: Path) -> None:
    """matplotlib's list of fonts may be old. Without the font, two titles would be drawn as equal boxes."""
    if fonts.letters_without_a_font("海上搜救"):
        pytest.skip("no font with Chinese letters is installed here: apt-get install fonts-noto-cjk")
    pages = [drawn(titled(trace, title), tmp_path / "overview.png") for title in ("海上", "搜救")]
    assert (pages[0][:60] != pages[1][:60]).any()


def test_letters_without_a_font_are_reported(trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fonts, "_font_with", lambda letters: None)
    (note,) = draw_overview(titled(trace, "海上"), tmp_path / "overview.png")
    assert note.startswith("no font here has '") and "drawn as boxes" in note
    assert draw_overview(titled(trace, "Sea"), tmp_path / "overview.png") == ()


def test_a_long_title_leaves_room_for_the_policies(trace: Trace, whole: Path, tmp_path: Path) -> None:
    header = replace(trace.header, instance=replace(trace.header.instance, title="Sea rescue " * 12))
    pages = [pixels(whole), drawn(dataclasses.replace(trace, header=header), tmp_path / "overview.png")]
    right = [page[:50, 1450:1800] for page in pages]
    assert (right[0] == right[1]).all() and (pages[0] != pages[1]).any()


def test_the_page_has_content_in_every_panel(whole: Path) -> None:
    page = pixels(whole)
    assert page.shape == (1200, 1800, 3)
    panels = {
        "map": (90, 740, 30, 1070),
        "score": (90, 390, 1110, 1770),
        "view": (430, 540, 1110, 1430),
        "whole frame": (820, 1140, 1200, 1700),
        "messages": (820, 920, 110, 1070),
        "events": (980, 1040, 110, 1070),
        "battery": (1080, 1150, 110, 1070),
    }
    for name, (top, bottom, left, right) in panels.items():
        assert page[top:bottom, left:right].std() > 3.0, name


def test_the_page_is_deterministic(trace: Trace, whole: Path, tmp_path: Path) -> None:
    draw_overview(trace, tmp_path / "again.png")
    assert (tmp_path / "again.png").read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("count", [0, 1, 2, 10])
def test_a_cut_trace_is_drawn_too(trace: Trace, tmp_path: Path, count: int) -> None:
    cut = Trace(trace.path, trace.header, trace.boundaries[:count], None, False, trace.places)
    assert drawn(cut, tmp_path / "o.png").shape == (1200, 1800, 3)


def test_an_abort_a_bare_mission_and_lost_pictures_are_drawn(trace: Trace, tmp_path: Path) -> None:
    aborted = Outcome(
        success=False, reason="infrastructure-abort", scr=0.0, ticks=3, digest="", frames_digest="", detail="x"
    )
    never = Binary(operator=">", left=Number(value=0.0), right=Number(value=1.0))
    instance = replace(trace.header.instance, regions=(), cells=(), stages=(), rules=(), success=never)
    odd = Trace(trace.path, replace(trace.header, instance=instance), trace.boundaries[:12], aborted, False, {})
    assert drawn(odd, tmp_path / "o.png").shape == (1200, 1800, 3)


def test_a_path_that_cannot_be_written_is_a_usage_error(trace: Trace, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        draw_overview(trace, tmp_path / "missing" / "o.png")


def test_each_found_target_is_shown_first(trace: Trace) -> None:
    history = history_of(trace)
    views = best_views(history, 4)
    assert {view.entity for view in views[:3]} == {"victim[1]", "victim[2]", "victim[3]"}
    assert views[3].truth is None and "false report" in views[3].caption
    assert all(view.overlap > 0.5 for view in views[:3])
    frame = whole_frame(history)
    assert frame is not None and frame.boxes


def test_missed_targets_are_shown_when_nothing_was_reported(trace: Trace) -> None:
    quiet = tuple(replace(record, messages=(), events=()) for record in trace.boundaries)
    history = history_of(Trace(trace.path, trace.header, quiet, trace.outcome, True, trace.places))
    views = best_views(history, 4)
    assert len(views) == 3 and all("visible, not reported" in view.caption for view in views)


def test_the_history_has_missed_found_and_completed_targets(trace: Trace) -> None:
    assert set(history_of(trace).fate.values()) == {"completed"}
    early = Trace(trace.path, trace.header, trace.boundaries[:10], None, False, trace.places)
    assert history_of(early).fate == {"victim[1]": "found", "victim[2]": "found", "victim[3]": "found"}
    assert set(history_of(Trace(trace.path, trace.header, trace.boundaries[:5], None, False)).fate.values()) == {
        "missed"
    }


def test_labels_do_not_cover_each_other() -> None:
    figure = Figure(figsize=(8, 6))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.05, 0.05, 0.9, 0.9))
    axes.set_xlim(0, 100)
    axes.set_ylim(0, 100)
    labels = style.Labels(axes)
    for place in range(12):
        labels.add(f"victim[{place}] completed", (50 + place % 4, 50 + place // 4), style.INK)
    for a, b in itertools.combinations(labels.occupied, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_colours_are_distinct_and_shades_end_at_white() -> None:
    colours = style.asset_colours([f"uav[{place}]" for place in range(16)])
    assert len(set(colours.values())) == 16
    assert style.lighten("#123456", 1.0) == "#123456" and style.lighten("#123456", 0.0) == "#ffffff"
    many = style.asset_colours([f"uav[{place}]" for place in range(100)]).values()
    assert all(min(int(colour[at : at + 2], 16) for at in (1, 3, 5)) < 200 for colour in many)  # none is lost on white


def test_the_labels_of_a_fleet_of_forty_do_not_overlap(trace: Trace) -> None:
    """No name covers another. Lanes have names as far as there is room; batteries only have the map's colours."""
    history = history_of(trace)
    agent, track = history.instance.agents[0], next(track for track in history.tracks_of("asset") if track.battery)
    names = [f"uav[{place}]" for place in range(1, 41)]
    agents = tuple(replace(agent, id=name) for name in names)
    body = next(entity for entity in history.instance.entities if entity.id == track.entity)
    instance = replace(history.instance, agents=agents, entities=tuple(replace(body, id=name) for name in names))
    tracks = {name: dataclasses.replace(track, entity=name) for name in names}
    fleet = dataclasses.replace(history, instance=instance, tracks=tracks, messages=(), refusals=())
    figure = Figure(figsize=(18, 12))
    canvas = FigureCanvasAgg(figure)
    messages, batteries = figure.add_axes((0.06, 0.225, 0.54, 0.095)), figure.add_axes((0.06, 0.04, 0.54, 0.055))
    draw_messages(messages, fleet)
    draw_batteries(batteries, fleet)
    canvas.draw()
    extents = [label.get_window_extent() for label in messages.get_yticklabels()]
    assert len(extents) > 5 and all(a.y0 >= b.y1 for a, b in itertools.pairwise(extents))
    assert len(batteries.lines) == 40 and batteries.get_legend() is None


def test_a_picture_that_cannot_be_decoded_is_not_reported_as_missing(trace: Trace) -> None:
    history = history_of(trace)
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    draw_whole(axes, dataclasses.replace(trace, places={}), history, whole_frame(history))
    assert [text.get_text() for text in axes.texts] == ["the picture cannot be decoded"]


def marks(history: History, *entities: str) -> list[str]:
    """Return the texts in the dots of events of `entities`."""
    figure = Figure(figsize=(8, 2))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    happened = tuple(HistoryEvent("rescued", tick, entity) for tick, entity in enumerate(entities))
    draw_events(axes, dataclasses.replace(history, events=happened))
    return [text.get_text() for text in axes.texts]


def test_the_dot_of_an_event_contains_the_index_of_its_target(trace: Trace) -> None:
    """A depot before twenty stops must not shift their indices. Two groups with equal indices have letters."""
    history = history_of(trace)
    victims = [entity for entity in history.instance.entities if entity.group == "victim"]
    depot = replace(victims[0], id="depot", group="depot")
    tracks = {"depot": dataclasses.replace(history.tracks["victim[1]"], entity="depot"), **history.tracks}
    with_depot = dataclasses.replace(
        history, instance=replace(history.instance, entities=(depot, *history.instance.entities)), tracks=tracks
    )
    assert marks(with_depot, "depot", "victim[1]", "victim[3]") == ["D", "1", "3"]
    jam = replace(victims[0], id="jam[1]", group="jam", index=1)
    tracks = {**history.tracks, "jam[1]": dataclasses.replace(history.tracks["victim[1]"], entity="jam[1]")}
    with_jam = dataclasses.replace(
        history, instance=replace(history.instance, entities=(*history.instance.entities, jam)), tracks=tracks
    )
    assert marks(with_jam, "jam[1]", "victim[1]") == ["J1", "V1"]


def unjudged(trace: Trace, *, reporting: bool = True) -> Trace:
    """Return the episode with a mission that has no matching rule, or that has no reports."""
    instance = trace.header.instance
    messages = instance.messages if reporting else tuple(m for m in instance.messages if m.category != "report")
    rules = tuple(replace(rule, matching=False) for rule in instance.rules)
    header = replace(trace.header, instance=replace(instance, rules=rules, messages=messages))
    quiet = tuple(
        replace(record, events=(), messages=record.messages if reporting else ()) for record in trace.boundaries
    )
    return Trace(trace.path, header, quiet, trace.outcome, True, trace.places)


def with_reference(trace: Trace) -> Trace:
    """Return the episode with a large reference picture of a target at its beginning."""
    frame = next(frame for frame in trace.frames.values() if frame.boxes)
    box = replace(frame.boxes[0], box=(0.0, 0.0, 1.0, 1.0), pixels=10**6)
    shown = replace(frame, id="r0", entity=box.entity, camera="reference", tick=0, time_s=0.0, boxes=(box,) * 9)
    first = replace(trace.boundaries[0], frames=(shown, *trace.boundaries[0].frames))
    return Trace(trace.path, trace.header, (first, *trace.boundaries[1:]), trace.outcome, True, trace.places)


def written(draw, *args: object, **options: object) -> list[str]:  # type: ignore[no-untyped-def]
    """Return all texts of a panel, with its legend."""
    figure = Figure(figsize=(9, 6))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    draw(axes, *args, **options)
    legend = axes.get_legend()
    return [text.get_text() for text in (*axes.texts, *(legend.get_texts() if legend else ()))]


def test_a_reference_picture_is_neither_chosen_nor_counted(trace: Trace) -> None:
    shown = with_reference(trace)
    history = history_of(shown)
    assert "r0" in history.frames
    frame = whole_frame(history)
    assert frame is not None and frame.camera != "reference"
    assert all(view.frame.camera != "reference" for view in best_views(history, 9))
    assert detect(shown) == detect(trace)
    assert metrics(shown).frames == metrics(trace).frames > 0


def test_without_reports_the_last_picture_is_shown(trace: Trace) -> None:
    silent = history_of(unjudged(trace, reporting=False))
    frame = whole_frame(silent)
    assert frame is not None and frame.tick == max(shot.tick for shot in silent.shots)


def test_without_judged_reports_nothing_is_missed_or_false(trace: Trace) -> None:
    loose = unjudged(trace)
    history = history_of(loose)
    captions = [view.caption for view in best_views(history, 99)]
    assert any("reported" in caption for caption in captions) and any("in view" in caption for caption in captions)
    assert not any("not reported" in caption or "false" in caption for caption in captions)
    score = written(draw_score, metrics(loose), complete=True, judging=history.judging)
    assert "5, none judged" in score and "matched reports" not in score and "precision" not in score
    silent = unjudged(trace, reporting=False)
    assert not {"reports", "matched reports"} & set(written(draw_score, metrics(silent), complete=True, judging=False))
    missed = dataclasses.replace(history, fate=dict.fromkeys(history.fate, "missed"))
    words = " ".join(written(draw_map, missed))
    assert "not done" in words and "missed" not in words and "false report" not in words
    judged = dataclasses.replace(missed, judging=True)
    assert "victim[1] missed" in written(draw_map, judged) and "false report" in written(draw_map, judged)


def test_a_target_that_the_engine_recorded_is_found(trace: Trace) -> None:
    """Success does not require the jam, but an asset recorded it."""
    instance = trace.header.instance
    victim = next(entity for entity in instance.entities if entity.group == "victim")
    record = InteractionSpec(name="record", by="multirotor", within_m=25.0, status="recorded")
    jams = tuple(replace(victim, id=f"jam[{n}]", group="jam", index=n, interactions=(record,)) for n in (1, 2))
    header = replace(trace.header, instance=replace(instance, entities=(*instance.entities, *jams)))
    event = TaskEvent(kind="record", entities=("jam[1]", "uav[1]"), time_s=10.0)
    first = replace(trace.boundaries[1], task_events=(*trace.boundaries[1].task_events, event))
    history = history_of(Trace(trace.path, header, (trace.boundaries[0], first, *trace.boundaries[2:]), None, False))
    assert (history.fate["jam[1]"], history.fate["jam[2]"], history.deeds["jam[1]"]) == ("found", "aside", "recorded")


def test_an_exhausted_budget_is_printed_as_out_of_time(trace: Trace) -> None:
    lost = replace(metrics(trace), success=False, reason="budget")
    assert "OUT OF TIME" in written(draw_score, lost, complete=True)
    assert "INFRASTRUCTURE ABORT" in written(draw_score, replace(lost, reason="infrastructure-abort"), complete=True)


TIDE = """ljs 2
use std.sea { lifeboat }

mission tide "Tide" {
  goal "Wait."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 8 }
  asset boat : lifeboat { position = (10 m, -1350 m), heading = 30 deg }
  agent skipper as rescuer controls boat { observes boat.*, events }
  event gale when now > 15 s until now > 35 s repeat every 20 s { weather { wind = 15 m/s from 220 deg } }
  event dusk when now > 55 s { weather { sun_elevation = 2 deg } }
  success when now > 75 s
}
"""


def test_active_events_are_drawn_as_bars_in_the_timeline(tmp_path: Path) -> None:
    played = play(TIDE, tmp_path, policy=scripted({}), seed=1)
    history = history_of(played.trace)
    spans = [(span.name, span.begin, span.end, span.undone) for span in history.spans]
    assert spans == [("gale", 2, 4, True), ("gale", 6, 7, True), ("dusk", 6, 8, False)]
    assert {event.kind for event in history.events} == {"weather"}
    axes = Figure().subplots()
    draw_events(axes, history)
    assert [label.get_text() for label in axes.get_yticklabels()] == ["gale", "dusk", "weather"]
    bars = [tuple(line.get_xdata()) for line in axes.lines if line.get_linewidth() == 5]
    assert bars == [(2, 4), (6, 7), (6, 8)]
