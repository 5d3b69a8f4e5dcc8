"""A mission's page with pictures: its description, pictures of played episodes and a table of results."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.process import say
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.model import Mission

if TYPE_CHECKING:
    from lingjing.analysis.page_pictures import PageFrame
    from lingjing.bench.rows import SuiteRow
    from lingjing.trace.reader import Trace

ENDINGS = {"success": "won", "failure": "lost", "budget": "out of time", "late": "late", "constraint": "lost"}
"""Words of the page for the reasons of outcomes."""


def write_page(mission: Mission, traces: Sequence[Path], rows: Sequence[SuiteRow], folder: Path) -> Path:
    """Write `<mission>.md` with its pictures beside it into `folder`, which is created if needed.

    The map shows the first trace. The frames are the best of all traces; frames of unused cameras are rendered from
    the states of the first trace. `rows` are the mission's results (`rows_of`). Raises `UsageError` for a trace of
    another mission, or a folder that cannot be written.
    """
    from lingjing.dsl.pages.judging import HEADS, judging
    from lingjing.dsl.pages.page import page, table

    played = [_trace(path, mission) for path in traces]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lead = [
            ("An episode", list(_episode(mission, played, folder)) if played else []),
            ("What each agent sees", list(_sights(mission, played, folder))),
            ("What counts", table(HEADS, judging(mission))),
            ("How well it is played", _results(rows)),
        ]
        target = folder / f"{mission.name}.md"
        target.write_text(page(mission, lead=lead, graph_picture=_graph(mission, folder)), encoding="utf-8")
    except OSError as error:
        raise UsageError(
            f"cannot write to `{folder}`: {error.strerror}", hint="choose another folder with -o"
        ) from error
    return target


def rows_of(mission: Mission, file: Path, results: Path) -> list[SuiteRow]:
    """Return the rows of the mission in `file`. Raises `UsageError` for a place without results, and for rows of
    another version of the mission or of the benchmark: the page describes the present one.
    """
    from lingjing.bench.folder import read_results
    from lingjing.bench.version import benchmark_version, mission_version

    rows = [row for row in read_results(results) if row.mission == mission.name]
    versions = benchmark_version(), mission_version(file)
    others = [row for row in rows if (row.benchmark, row.mission_sha256) != versions]
    if others:
        changed = "mission" if others[0].benchmark == versions[0] else "benchmark"
        raise UsageError(
            f"{len(others)} of the {len(rows)} rows of `{mission.name}` in `{results}` are of another version of the "
            f"{changed}, and the page would describe the present one",
            hint="play the suite again, or name results of the present version",
        )
    return rows


# -- private


def _trace(path: Path, mission: Mission) -> Trace:
    from lingjing.trace.reader import read_trace

    trace = read_trace(path)
    played = trace.header.instance.mission
    if played != mission.name:
        raise UsageError(
            f"{path} is of the mission `{played}`, not of `{mission.name}`", hint="name traces of this mission"
        )
    return trace


def _episode(mission: Mission, traces: Sequence[Trace], folder: Path) -> Iterator[str]:
    from lingjing.analysis.page_pictures import draw_trails
    from lingjing.analysis.played_city import credit

    name = f"{mission.name}-map.png"
    draw_trails(traces[0], folder / name)
    yield f"![The map with the trails of all assets]({name})\n"
    for at, trace in enumerate(traces):
        yield f"- {'The map is' if at == 0 else 'Pictures are also from'} {_caption(trace)}"
    credited = credit(traces[0].header.attribution)
    if credited:
        yield f"\n{credited[0].upper()}{credited[1:]}."


def _caption(trace: Trace) -> str:
    instance, outcome = trace.header.instance, trace.outcome
    policies = " and ".join(f"`{name}`" for name in dict.fromkeys(binding.policy for binding in trace.header.bindings))
    privilege = (
        ", which observes the ground truth" if any(binding.privileged for binding in trace.header.bindings) else ""
    )
    ended = "cut short" if outcome is None else ENDINGS.get(outcome.reason, outcome.reason)
    score = "" if outcome is None else f", subtasks {outcome.scr:.2f}"
    ticks = trace.boundaries[-1].tick if trace.boundaries else 0
    return (
        f"seed {instance.seed}, {instance.mode}, played by {policies}{privilege}: "
        f"{ended} after {ticks} of {instance.budget.ticks} ticks{score}."
    )


def _sights(mission: Mission, traces: Sequence[Trace], folder: Path) -> Iterator[str]:
    from lingjing.analysis.page_pictures import best_frames, sort_by_camera, unrecorded_frames, write_frame
    from lingjing.causal.redraw import redraw

    frames = best_frames(traces)
    try:
        frames = sort_by_camera([*frames, *(unrecorded_frames(traces[0], frames, redraw) if traces else ())])
    except InfrastructureError as error:
        say(f"note: only the cameras that were used are shown: {error}")
    if traces and not frames:
        yield "No picture was taken: positions, states and messages are all that the agents used."
    for shown in frames:
        name = f"{mission.name}-{_plain(shown)}.jpg"
        write_frame(shown, folder / name)
        yield f"![{shown.caption}]({name})\n"
        yield f"*{shown.caption}.*\n"  # not capitalised: it begins with the name of an entity


def _plain(shown: PageFrame) -> str:
    """Return a file name for a frame, such as `uav-2-nadir`."""
    return re.sub(r"[^a-z0-9]+", "-", f"{shown.info.entity}-{shown.info.camera}".lower()).strip("-")


def _results(rows: Sequence[SuiteRow]) -> list[str]:
    from lingjing.bench.exports import to_markdown
    from lingjing.bench.tables import make_tables

    return [to_markdown(table) for table in make_tables(rows, ("intervals", "cost"))]


def _graph(mission: Mission, folder: Path) -> str:
    from lingjing.mission.draw.svg import svg
    from lingjing.mission.graph import graph

    name = f"{mission.name}-graph.svg"
    (folder / name).write_text(svg(graph(mission)), encoding="utf-8")
    return name
