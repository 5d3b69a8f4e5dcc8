"""The overview is drawn for whole, cut, empty and odd traces, and its labels keep out of each other's way."""

import dataclasses
import itertools
from pathlib import Path

import msgspec
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from lingjing.analysis.overview import draw_overview, style
from lingjing.analysis.overview.pictures import best_views, whole_frame
from lingjing.analysis.overview.timeline import draw_events
from lingjing.analysis.story import Happened, Story, tell
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import Outcome

replace = msgspec.structs.replace


def drawn(trace: Trace, path: Path) -> np.ndarray:
    draw_overview(trace, path)
    return np.asarray(Image.open(path).convert("RGB"))


def test_it_is_a_full_page_with_something_in_every_panel(trace: Trace, tmp_path: Path) -> None:
    page = drawn(trace, tmp_path / "overview.png")
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


def test_it_is_the_same_page_twice(trace: Trace, tmp_path: Path) -> None:
    draw_overview(trace, tmp_path / "a.png")
    draw_overview(trace, tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize("count", [0, 1, 2, 10])
def test_a_cut_trace_is_drawn_too(trace: Trace, tmp_path: Path, count: int) -> None:
    cut = Trace(trace.path, trace.header, trace.boundaries[:count], None, False, trace.places)
    assert drawn(cut, tmp_path / "o.png").shape == (1200, 1800, 3)


def test_an_abort_a_bare_mission_and_lost_pictures_are_drawn(trace: Trace, tmp_path: Path) -> None:
    aborted = Outcome(
        success=False, reason="infrastructure-abort", scr=0.0, ticks=3, digest="", frames_digest="", detail="x"
    )
    instance = replace(trace.header.instance, regions=(), cells=(), stages=(), rules=())
    odd = Trace(trace.path, replace(trace.header, instance=instance), trace.boundaries[:12], aborted, False, {})
    assert drawn(odd, tmp_path / "o.png").shape == (1200, 1800, 3)


def test_a_place_that_cannot_be_written_is_a_usage_error(trace: Trace, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        draw_overview(trace, tmp_path / "missing" / "o.png")


def test_each_found_target_is_shown_before_anything_else(trace: Trace) -> None:
    story = tell(trace)
    views = best_views(story, 4)
    assert {view.entity for view in views[:3]} == {"victim[1]", "victim[2]", "victim[3]"}
    assert views[3].truth is None and "false report" in views[3].caption
    assert all(view.overlap > 0.5 for view in views[:3])
    frame = whole_frame(story)
    assert frame is not None and frame.boxes


def test_missed_targets_are_shown_when_nothing_was_reported(trace: Trace) -> None:
    quiet = tuple(replace(record, messages=(), events=()) for record in trace.boundaries)
    story = tell(Trace(trace.path, trace.header, quiet, trace.outcome, True, trace.places))
    views = best_views(story, 4)
    assert len(views) == 3 and all("visible, not reported" in view.caption for view in views)


def test_the_story_knows_every_fate(trace: Trace) -> None:
    assert set(tell(trace).fate.values()) == {"completed"}
    early = Trace(trace.path, trace.header, trace.boundaries[:10], None, False, trace.places)
    assert tell(early).fate == {"victim[1]": "found", "victim[2]": "found", "victim[3]": "found"}
    assert set(tell(Trace(trace.path, trace.header, trace.boundaries[:5], None, False)).fate.values()) == {"missed"}


def test_labels_do_not_cover_each_other() -> None:
    figure = Figure(figsize=(8, 6))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.05, 0.05, 0.9, 0.9))
    axes.set_xlim(0, 100)
    axes.set_ylim(0, 100)
    labels = style.Labels(axes)
    for place in range(12):
        labels.add(f"victim[{place}] completed", (50 + place % 4, 50 + place // 4), style.INK)
    for a, b in itertools.combinations(labels.taken, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_colours_are_distinct_and_shades_end_at_white() -> None:
    colours = style.asset_colours([f"uav[{place}]" for place in range(16)])
    assert len(set(colours.values())) == 16
    assert style.shaded("#123456", 1.0) == "#123456" and style.shaded("#123456", 0.0) == "#ffffff"


def marks(story: Story, *entities: str) -> list[str]:
    """What stands in the dots of events about `entities`."""
    figure = Figure(figsize=(8, 2))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    happened = tuple(Happened("rescued", tick, entity) for tick, entity in enumerate(entities))
    draw_events(axes, dataclasses.replace(story, happened=happened))
    return [text.get_text() for text in axes.texts]


def test_a_dot_holds_its_targets_own_number(trace: Trace) -> None:
    """A depot before twenty stops must not shift their numbers; two groups that share numbers are told apart."""
    story = tell(trace)
    victims = [entity for entity in story.instance.entities if entity.group == "victim"]
    depot = replace(victims[0], id="depot", group="depot")
    tracks = {"depot": dataclasses.replace(story.tracks["victim[1]"], entity="depot"), **story.tracks}
    with_depot = dataclasses.replace(
        story, instance=replace(story.instance, entities=(depot, *story.instance.entities)), tracks=tracks
    )
    assert marks(with_depot, "depot", "victim[1]", "victim[3]") == ["D", "1", "3"]
    jam = replace(victims[0], id="jam[1]", group="jam", index=1)
    tracks = {**story.tracks, "jam[1]": dataclasses.replace(story.tracks["victim[1]"], entity="jam[1]")}
    with_jam = dataclasses.replace(
        story, instance=replace(story.instance, entities=(*story.instance.entities, jam)), tracks=tracks
    )
    assert marks(with_jam, "jam[1]", "victim[1]") == ["J1", "V1"]
