"""Timelines over ticks: messages between agents, adjudicated events, and the charge of batteries."""

from __future__ import annotations

from collections import defaultdict

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from lingjing.analysis.history import History
from lingjing.analysis.overview import style
from lingjing.trace.admitted_messages import AdmittedMessage

_NAMED = 14
"""Most entries of a legend over a panel. Chosen: more do not fit side by side."""


def draw_messages(axes: Axes, history: History) -> None:
    """Draw a lane for each agent, and a line from the sender's dot to the recipients' lanes for each message."""
    agents = [agent.id for agent in history.instance.agents]
    lanes = {agent: place for place, agent in enumerate(agents)}
    for lane in lanes.values():
        axes.axhline(lane, color=style.RULE, linewidth=0.8, zorder=1)
    for message, x in _spread(history):
        _message(axes, message, x, lanes)
    for tick, sender in history.refusals:
        if sender in lanes:
            axes.plot(tick, lanes[sender], "|", ms=9, mec=style.FATES["missed"], mew=1.4, zorder=3)
    style.lanes(axes, agents)
    axes.set_ylim(len(agents) - 0.5, -0.5)
    used = dict.fromkeys(message.category for message in history.messages)
    entries = [_dot(style.CATEGORIES[name], name.replace("_", " ")) for name in style.CATEGORIES if name in used]
    if history.refusals:
        entries.append(
            Line2D([], [], linestyle="none", marker="|", mec=style.FATES["missed"], ms=8, mew=1.4, label="refused")
        )
    _finish(axes, history, "Messages", entries)


def draw_events(axes: Axes, history: History) -> None:
    """Draw a lane for each kind of event, and a dot in the target's colour for each event.

    The dot contains the target's index within its group, preceded by the group's letter if several groups have indices.
    A target without an index has only the letter. The changes of the mission's own events are grey dots. An event with
    a condition has a lane with a bar for each time in force; a hollow end marks that it was undone. Incidents are
    crosses in their own lane.
    """
    kinds = [rule.name for rule in history.instance.rules]
    kinds += [span.name for span in history.spans if span.name not in kinds]
    kinds += [event.kind for event in history.events if event.kind not in kinds]
    kinds += ["incident"] if history.incidents else []
    lanes = {kind: place for place, kind in enumerate(dict.fromkeys(kinds))}
    targets = [track.entity for track in history.tracks_of("target")]
    marks = _marks(history)
    crowd: dict[tuple[str, int], list[str]] = defaultdict(list)
    for event in history.events:
        crowd[event.kind, event.tick].append(event.entity)
    for lane in lanes.values():
        axes.axhline(lane, color=style.RULE, linewidth=0.8, zorder=1)
    for span in history.spans:
        lane = lanes[span.name]
        axes.plot((span.begin, span.end), (lane, lane), "-", color=style.FAINT, linewidth=5, alpha=0.5, zorder=2)
        axes.plot(span.begin, lane, "o", ms=8, mfc=style.FAINT, mec="white", mew=0.7, zorder=3)
        if span.undone:
            axes.plot(span.end, lane, "o", ms=7, mfc="white", mec=style.FAINT, mew=1.4, zorder=3)
    for (kind, tick), entities in crowd.items():
        for place, entity in enumerate(entities):
            x = tick + 0.55 * (place - (len(entities) - 1) / 2)
            index = targets.index(entity) if entity in targets else -1
            colour = style.target_colour(index) if index >= 0 else style.FAINT
            axes.plot(x, lanes[kind], "o", ms=10, mfc=colour, mec="white", mew=0.7, zorder=3)
            if index >= 0:
                axes.text(
                    x, lanes[kind], marks[entity], color="white", fontsize=7, ha="center", va="center_baseline",
                    fontweight="bold", zorder=4,
                )  # fmt: skip
    for incident in history.incidents:
        x = incident.time_s / history.instance.clock.tick_s
        axes.plot(x, lanes["incident"], "X", ms=9, mfc=style.INCIDENT, mec="white", mew=0.7, zorder=5)
    style.lanes(axes, list(lanes))
    if lanes:
        axes.set_ylim(len(lanes) - 0.4, -0.6)
    few = targets if len(targets) <= style.CROWD else []  # the indices in the dots identify the targets of a crowd
    entries = [_dot(style.target_colour(place), name) for place, name in enumerate(few)]
    if history.incidents:
        entries.append(
            Line2D([], [], linestyle="none", marker="X", mfc=style.INCIDENT, mec="white", ms=8, label="incident")
        )
    _finish(axes, history, "Events", entries)


def _marks(history: History) -> dict[str, str]:
    """Return the text in the dot of each target."""
    targets = [entity for entity in history.instance.entities if entity.role == "target"]
    numbered = {entity.group for entity in targets if entity.id != entity.group}
    letter = {entity.group: entity.group[:1].upper() for entity in targets}
    return {
        entity.id: letter[entity.group]
        if entity.id == entity.group
        else f"{letter[entity.group] if len(numbered) > 1 else ''}{entity.index}"
        for entity in targets
    }


def draw_batteries(axes: Axes, history: History) -> None:
    """Draw the charge of each asset's battery in percent of the initial charge."""
    tracks = history.tracks_of("asset")
    colours = style.asset_colours(track.entity for track in tracks)
    tick_s = history.instance.clock.tick_s
    powered = [track for track in tracks if track.battery]
    for track in powered:
        times = [time_s / tick_s for time_s in track.times[-len(track.battery) :]]
        axes.plot(times, [100 * share for share in track.battery], color=colours[track.entity], linewidth=1.6)
    axes.set_ylim(0, 105)
    axes.set_yticks([0, 50, 100], ["0", "50", "100 %"])
    axes.grid(axis="y", color=style.RULE, linewidth=0.6)
    entries = [Line2D([], [], color=colours[track.entity], linewidth=1.8, label=track.entity) for track in powered]
    entries = entries if len(entries) <= _NAMED else []  # the map has their names in the same colours
    _finish(axes, history, "Battery" if powered else "Battery: no asset has one", entries)
    axes.set_xlabel(f"tick ({tick_s:g} s each)", fontsize=9, color=style.INK, labelpad=2)
    axes.tick_params(labelbottom=True)


def _spread(history: History) -> list[tuple[AdmittedMessage, float]]:
    """Return each message with its x coordinate. The messages of one tick are spread around it side by side."""
    by_tick: dict[int, list[AdmittedMessage]] = defaultdict(list)
    for message in history.messages:
        by_tick[message.tick].append(message)
    return [
        (message, tick + 0.8 * ((place + 0.5) / len(group) - 0.5))
        for tick, group in by_tick.items()
        for place, message in enumerate(group)
    ]


def _message(axes: Axes, message: AdmittedMessage, x: float, lanes: dict[str, int]) -> None:
    colour = style.CATEGORIES.get(message.category, style.FAINT)
    sender = message.sender
    ends = [lanes[name] for name in (sender, *message.recipients) if name in lanes]
    if not ends or sender not in lanes:
        return
    axes.plot((x, x), (min(ends), max(ends)), "-", color=colour, linewidth=0.9, alpha=0.6, zorder=2)
    for name in message.recipients:
        if name in lanes:
            axes.plot(x, lanes[name], "v" if lanes[name] > lanes[sender] else "^", ms=3.5, color=colour, zorder=3)
    axes.plot(x, lanes[sender], "o", ms=5.5, mfc=colour, mec="white", mew=0.6, zorder=4)


def _dot(colour: str, label: str) -> Line2D:
    return Line2D([], [], linestyle="none", marker="o", mfc=colour, mec="white", ms=7, label=label)


def _finish(axes: Axes, history: History, title: str, entries: list[Line2D]) -> None:
    axes.set_facecolor(style.PANEL)
    axes.set_xlim(-0.8, max(history.ticks, 1) + 0.8)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=20))
    axes.tick_params(labelsize=8, colors=style.INK, length=2, labelbottom=False)
    for name, side in axes.spines.items():
        side.set_visible(name in ("left", "bottom"))
        side.set_color(style.RULE)
    style.heading(axes, title)
    if entries:
        axes.legend(
            handles=entries, loc="lower right", bbox_to_anchor=(1.0, 0.985), ncols=len(entries), fontsize=8,
            frameon=False, handletextpad=0.3, columnspacing=1.2, borderaxespad=0.1,
        )  # fmt: skip
