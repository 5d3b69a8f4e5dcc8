"""The map: regions and cells, tracks that darken with time, true positions of targets, and reported positions."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle

from lingjing.analysis.detection import MatchedReport
from lingjing.analysis.history import History, Track
from lingjing.analysis.overview import style
from lingjing.scene.city import City
from lingjing.scene.plan import ground_plan, paint

STRAY_M = 400.0
"""Largest distance from tracks, regions and entities at which a report extends the map. Chosen. Reports farther away
are drawn at the edge."""

STILL_M = 0.05
"""Length of a macro-step below which the body counts as waiting. Chosen."""

UNDONE = "not done"
"""The printed word for `missed` if reports are not judged."""


def draw_map(axes: Axes, history: History, city: City | None = None, credit: str = "", legend_columns: int = 0) -> None:
    """Draw the episode's map into `axes`, in metres, east to the right, on `city` or on blank ground.

    `credit` is drawn in the corner. The legend below has one row, or `legend_columns` columns.
    """
    axes.set_facecolor(style.PANEL)
    west, south, east, north = _bounds(history, axes)
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_aspect("equal", adjustable="box")  # only after the limits, because it shrinks the panel to them
    if city is not None:
        paint(axes, ground_plan(city, (west, south, east, north)), style.CITY)
    _ground(axes, history)
    labels = style.Labels(axes)
    _assets(axes, history, labels)
    _reports(axes, history, (west, south, east, north), labels)
    _targets(axes, history, labels)
    _incidents(axes, history, labels)
    _names(axes, history, labels)
    _scale(axes, west, south, east - west, north - south)
    _legend(axes, history, legend_columns)
    if credit:
        _credit(axes, credit)
    style.bare(axes, "Map: tracks darken with time")


def _bounds(history: History, axes: Axes) -> tuple[float, float, float, float]:
    """Return west, south, east and north of the map: the box around all content plus a margin, in the panel's shape."""
    points = [point for track in history.tracks.values() for point in track.points]
    points += [point for region in history.instance.regions for point in region.polygon]
    points += [entity.position[:2] for entity in history.instance.entities]
    spots = np.array(points)
    low, high = spots.min(axis=0), spots.max(axis=0)
    for report in history.reports:
        if report.position is not None and _stray(report.position, low, high) <= STRAY_M:
            low, high = np.minimum(low, report.position), np.maximum(high, report.position)
    size = np.maximum((high - low) * 1.12, 100.0)
    shape = style.panel_shape(axes)
    size = np.array([max(size[0], size[1] * shape), max(size[1], size[0] / shape)])
    middle = (low + high) / 2
    return (*(middle - size / 2), *(middle + size / 2))


def _stray(point: tuple[float, float], low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.maximum(np.maximum(low - point, np.array(point) - high), 0.0)))


def _ground(axes: Axes, history: History) -> None:
    for cell in history.instance.cells:
        seen = cell.name in history.visited
        colour = style.VISITED if seen else "none"
        axes.add_patch(Polygon(cell.polygon, facecolor=colour, alpha=0.55, edgecolor="none", zorder=1))
        axes.add_patch(
            Polygon(cell.polygon, facecolor="none", edgecolor="#9fb4c4", linewidth=0.6, linestyle=(0, (4, 3)), zorder=2)
        )
    for region in history.instance.regions:
        axes.add_patch(Polygon(region.polygon, facecolor="none", edgecolor=style.REGION, linewidth=1.8, zorder=2))
    for cell in history.instance.cells:
        name = f"{cell.row}-{cell.column}"
        axes.text(*cell.centre, name, fontsize=8, color="#8ba1b2", ha="center", va="center", zorder=2)


def _assets(axes: Axes, history: History, labels: style.Labels) -> None:
    tracks = history.tracks_of("asset")
    colours = style.asset_colours(track.entity for track in tracks)
    for track in tracks:
        _line(axes, track, colours[track.entity])
        if track.points:
            start, end = track.points[0], track.points[-1]
            axes.plot(*start, "o", ms=6, mfc="white", mec=colours[track.entity], mew=1.5, zorder=6)
            axes.plot(*end, "o", ms=8, mfc=colours[track.entity], mec="white", mew=1.2, zorder=6)
            labels.block(start, 5)
            labels.block(end, 7)
    for frame in history.frames.values():
        if frame.entity in colours:  # reference pictures belong to no asset
            axes.plot(*frame.pose.position[:2], ".", ms=3, color=colours[frame.entity], zorder=5)


def _line(axes: Axes, track: Track, colour: str) -> None:
    points = np.array(track.points)
    if len(points) < 2:
        return
    # without the waiting times, so that the shades spread over the track
    moved = np.r_[True, np.hypot(*np.diff(points, axis=0).T) > STILL_M]
    points = np.concatenate([points[moved], points[-1:]])
    step = max(1, len(points) // 400)
    points = np.concatenate([points[::step], points[-1:]])
    segments = np.stack([points[:-1], points[1:]], axis=1)
    shades = [style.lighten(colour, 0.25 + 0.75 * at / len(segments)) for at in range(len(segments))]
    axes.add_collection(LineCollection(list(segments), colors=shades, linewidths=1.8, capstyle="round", zorder=4))


def _targets(axes: Axes, history: History, labels: style.Labels) -> None:
    for track in history.tracks_of("target"):
        if not track.points:
            continue
        colour = style.FATES[history.fate[track.entity]]
        points = np.array(track.points)
        axes.plot(points[:, 0], points[:, 1], "-", color=colour, linewidth=1.2, alpha=0.6, zorder=6)
        axes.plot(*points[0], "D", ms=5, mfc="white", mec=colour, mew=1.4, zorder=7)
        place = _fate_place(history, track)
        axes.plot(*place, "*", ms=15, mfc=colour, mec="white", mew=1.0, zorder=8)
        labels.block(place, 10)


def _incidents(axes: Axes, history: History, labels: style.Labels) -> None:
    """Draw a cross for each incident, with kind and time for the first few."""
    for incident in history.incidents:
        if incident.position is not None:
            axes.plot(*incident.position[:2], "X", ms=10, mfc=style.INCIDENT, mec="white", mew=0.9, zorder=9)
            labels.block(incident.position[:2], 6)
    for incident in history.incidents[: style.CROWD]:
        if incident.position is not None:
            text = f"{incident.kind.replace('_', ' ')} {incident.time_s:.0f} s"
            labels.add(text, incident.position[:2], style.INCIDENT, 8.0)


def _fate_place(history: History, track: Track) -> tuple[float, float]:
    """Return the position of a target at its completion, else its last one.

    A completed target may be carried away afterwards.
    """
    tick = history.completed.get(track.entity)
    if tick is None:
        return track.points[-1]
    time_s = tick * history.instance.clock.tick_s
    index = min(range(len(track.times)), key=lambda at: abs(track.times[at] - time_s))
    return track.points[index]


def _reports(axes: Axes, history: History, bounds: tuple[float, float, float, float], labels: style.Labels) -> None:
    for report in history.reports:
        if report.position is None:
            continue
        place = _clamped(report.position, bounds)
        truth = _truth(history, report)
        if truth is not None:
            axes.plot(*zip(place, truth, strict=True), "-", color=style.CLAIM, linewidth=0.8, alpha=0.7, zorder=7)
        marker, size = ("x", 6) if report.false else ("+", 8)
        colour = style.FATES["missed"] if report.false else style.CLAIM
        axes.plot(*place, marker, ms=size, mec=colour, mew=1.4, zorder=8)
        labels.block(place, 4)


def _clamped(point: tuple[float, float], bounds: tuple[float, float, float, float]) -> tuple[float, float]:
    west, south, east, north = bounds
    dx, dy = (east - west) * 0.01, (north - south) * 0.01
    return min(max(point[0], west + dx), east - dx), min(max(point[1], south + dy), north - dy)


def _truth(history: History, report: MatchedReport) -> tuple[float, float] | None:
    frame = history.frames.get(report.frame)
    if report.target is None or frame is None:
        return None
    track = history.tracks[report.target]
    index = min(range(len(track.times)), key=lambda at: abs(track.times[at] - frame.time_s))
    return track.points[index]


def _names(axes: Axes, history: History, labels: style.Labels) -> None:
    assets = history.tracks_of("asset")
    colours = style.asset_colours(track.entity for track in assets)
    targets = history.tracks_of("target")
    for track in targets:
        if track.points:
            fate = history.fate[track.entity]
            plain = fate == "aside" or len(targets) > style.CROWD  # the colour shows the fate
            name = track.entity if plain else f"{track.entity} {_word(history, track.entity)}"
            labels.add(name, _fate_place(history, track), style.FATES[fate], 8.5)
    for track in assets:
        if track.points:
            labels.add(track.entity, track.points[-1], colours[track.entity])


def _word(history: History, target: str) -> str:
    """Return the printed state of a target. Without judged reports no target can be missed."""
    fate = history.fate[target]
    return (
        UNDONE
        if fate == "missed" and not history.judging
        else history.deeds.get(target, fate)
        if fate == "found"
        else fate
    )


def _scale(axes: Axes, west: float, south: float, width: float, height: float) -> None:
    rough = width / 6
    unit = 10 ** math.floor(math.log10(rough))
    length = unit * max(step for step in (1, 2, 5) if step * unit <= rough)
    x, y = west + width * 0.03, south + height * 0.035
    axes.add_patch(
        Rectangle(
            (x - width * 0.012, y - height * 0.016), length + width * 0.059, height * 0.096,
            facecolor="white", alpha=0.8, edgecolor="none", zorder=9.5,
        )
    )  # fmt: skip
    axes.plot((x, x + length), (y, y), color=style.INK, linewidth=2.5, solid_capstyle="butt", zorder=10)
    axes.text(x + length / 2, y + height * 0.012, f"{length:g} m", ha="center", va="bottom", fontsize=8.5, zorder=10)
    axes.annotate(
        "N",
        (x + length + width * 0.03, y + height * 0.055),
        (x + length + width * 0.03, y),
        ha="center",
        va="center",
        fontsize=9,
        fontweight="bold",
        arrowprops={"arrowstyle": "-|>", "color": style.INK, "linewidth": 1.2},
        zorder=10,
    )


def _credit(axes: Axes, credit: str) -> None:
    box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "alpha": 0.75, "edgecolor": "none"}
    axes.text(
        0.995, 0.008, credit, transform=axes.transAxes, fontsize=7.5, color=style.INK, ha="right", va="bottom",
        zorder=10, bbox=box,
    )  # fmt: skip


def _legend(axes: Axes, history: History, columns: int) -> None:
    def mark(marker: str, label: str, **options: object) -> Line2D:
        return Line2D([], [], linestyle="none", marker=marker, label=label, **options)  # type: ignore[arg-type]

    entries = [
        mark("o", "start", mfc="white", mec=style.INK, ms=6),
        mark("o", "end", mfc=style.INK, mec="white", ms=8),
        mark(".", "picture taken", color=style.INK, ms=5),
        mark("D", "target at start", mfc="white", mec=style.INK, ms=5),
        *(
            mark("*", "other place" if fate == "aside" else f"target {word}", mfc=style.FATES[fate], mec="white", ms=12)
            for fate in style.FATES
            for word in (UNDONE if fate == "missed" and not history.judging else fate,)
            if fate in history.fate.values() or (fate != "aside" and history.judging)
        ),
        *([mark("+", "report, line to truth", mec=style.CLAIM, ms=8, mew=1.4)] if history.reporting else []),
        *([mark("X", "incident", mfc=style.INCIDENT, mec="white", ms=9)] if history.incidents else []),
        *([mark("x", "false report", mec=style.FATES["missed"], ms=6, mew=1.4)] if history.judging else []),
    ]
    axes.legend(
        handles=entries,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.008),
        ncols=columns or len(entries),
        fontsize=8,
        frameon=False,
        handletextpad=0.2,
        columnspacing=1.2,
        borderaxespad=0.2,
    )
