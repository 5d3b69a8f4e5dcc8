"""The page of the overview: map on the left, metrics and pictures on the right, timelines at the bottom."""

from __future__ import annotations

import warnings
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lingjing.analysis.fonts import note_of_boxes
from lingjing.analysis.history import History, history_of
from lingjing.analysis.metrics import metrics
from lingjing.analysis.overview import style
from lingjing.analysis.overview.mapview import draw_map
from lingjing.analysis.overview.pictures import best_views, draw_nothing, draw_view, draw_whole, whole_frame
from lingjing.analysis.overview.score import draw_score
from lingjing.analysis.overview.timeline import draw_batteries, draw_events, draw_messages
from lingjing.analysis.played_city import credit
from lingjing.errors import UsageError
from lingjing.scene.city import City
from lingjing.trace.reader import Trace
from lingjing.whole_files import written_whole

WIDTH, HEIGHT, DPI = 18.0, 12.0, 100
"""Size in inches, and resolution. Chosen."""
VIEWS = 4
"""Number of crops. Chosen: two rows of two fill the panel."""


def draw_sheet(trace: Trace, path: Path, city: City | None) -> tuple[str, ...]:
    """Draw the page. See `lingjing.analysis.overview.draw_overview`."""
    words = "".join((trace.header.instance.title, _players(trace), credit(trace.header.attribution)))
    with style.literal_text(words), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # the note covers it
        _draw(trace, path, city)
    return note_of_boxes(words)


def _draw(trace: Trace, path: Path, city: City | None) -> None:
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI, facecolor=style.PAPER)
    FigureCanvasAgg(figure)  # without pyplot there is no global state and no display
    history = history_of(trace)
    _title(figure, trace)
    draw_map(_panel(figure, 0.012, 0.375, 0.588, 0.555), history, city, credit(trace.header.attribution))
    score = _panel(figure, 0.615, 0.675, 0.373, 0.255)
    draw_score(score, metrics(trace), complete=trace.complete, judging=history.judging)
    _pictures(figure, trace, history)
    left, width = 0.06, 0.54
    draw_messages(_panel(figure, left, 0.225, width, 0.095), history)
    draw_events(_panel(figure, left, 0.125, width, 0.065), history)
    draw_batteries(_panel(figure, left, 0.04, width, 0.055), history)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    try:
        with written_whole(path) as partial:
            figure.savefig(partial, format="png", dpi=DPI, metadata={"Software": "lingjing"})
    except OSError as error:
        raise UsageError(
            f"cannot write {path}: {error.strerror}", hint="make room, or choose another folder"
        ) from error


def _pictures(figure: Figure, trace: Trace, history: History) -> None:
    views = best_views(history, VIEWS)
    if not views:
        draw_nothing(_panel(figure, 0.615, 0.37, 0.373, 0.28), "no target was reported or in view")
    for place, view in enumerate(views):
        row, column = divmod(place, 2)
        left, bottom = 0.615 + column * 0.19, 0.535 - row * 0.165
        draw_view(_panel(figure, left, bottom, 0.183, 0.115), trace, view)
    draw_whole(_panel(figure, 0.615, 0.04, 0.373, 0.295), trace, history, whole_frame(history))


def _title(figure: Figure, trace: Trace) -> None:
    instance = trace.header.instance
    title = figure.text(
        0.012, 0.972, instance.title or instance.mission, fontsize=19, fontweight="bold", color=style.INK
    )
    privileged = " (privileged)" if any(binding.privileged for binding in trace.header.bindings) else ""
    details = f"{instance.mission} · seed {instance.seed} · {instance.mode} · policy {_players(trace)}{privileged}"
    aside = figure.text(0.988, 0.972, details, fontsize=11, color=style.FAINT, ha="right")
    room = aside.get_window_extent().x0 - title.get_window_extent().x0 - 20.0
    if (wide := title.get_window_extent().width) > room:
        title.set_fontsize(max(19.0 * room / wide, 7.0))


def _players(trace: Trace) -> str:
    return ", ".join(dict.fromkeys(binding.policy for binding in trace.header.bindings))


def _panel(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    return figure.add_axes((left, bottom, width, height))
