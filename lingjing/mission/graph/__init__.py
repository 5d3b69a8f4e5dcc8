"""The mission graph: one mission as typed nodes and typed edges (DESIGN section 2).

Modules in the order a mission passes them:

- `types`: `Node`, `Edge`, `MissionGraph`, and the closed lists of their kinds.
- `spelling`, `guards`: conditions in the language's spelling; the modes a guarded declaration exists in.
- `draft`: the graph while it is drawn up.
- `needs`: the nodes a condition reads.
- `things`, `course`, `terms`: the passes, one small function a kind of declaration. A new kind of declaration is a new
  function here and a line in `PASSES`.

Sweeps and parameters are not drawn: they say which missions are played, not what one is.

In: a `Mission`. Out: a `MissionGraph`, equal for equal missions. `lingjing.mission.draw` makes pictures of it,
attribution walks it. Nothing heavy is imported.
"""

from __future__ import annotations

from collections.abc import Callable

from lingjing.errors import UsageError
from lingjing.mission.graph import course, terms, things
from lingjing.mission.graph.draft import Draft
from lingjing.mission.graph.types import Edge, EdgeKind, MissionGraph, Node, NodeKind
from lingjing.mission.model import Mission

__all__ = ["PASSES", "Edge", "EdgeKind", "MissionGraph", "Node", "NodeKind", "graph"]

PASSES: tuple[Callable[[Mission, Draft], None], ...] = (
    things.add_roles,
    things.add_agents,
    things.add_regions,
    things.add_grids,
    things.add_entities,
    things.add_messages,
    course.add_rules,
    course.add_events,
    terms.add_happenings,
    terms.add_inspections,
    course.add_stages,
    course.add_outcomes,
    terms.add_allowances,
    terms.add_limits,
    things.add_controls,
    things.add_observations,
    things.add_reveals,
    course.add_unlocks,
    course.add_judgements,
    course.add_completions,
    terms.add_permits,
    terms.add_constraints,
    course.add_relations,
)
"""Nodes before the edges that name them; within that, the order of a mission file."""


def graph(mission: Mission, mode: str | None = None) -> MissionGraph:
    """The graph of a mission: of all its modes with guards as labels, or as it is in one mode, guards settled.

    Raises `UsageError` for a mode the mission does not have, `MissionError` if a declaration names what is not there.
    """
    allowed = mission.modes.allowed
    if mode is not None and mode not in allowed:
        raise UsageError(f"mission `{mission.name}` has no mode `{mode}`", hint=f"choose one of {', '.join(allowed)}")
    draft = Draft(mission, allowed if mode is None else (mode,))
    for add in PASSES:
        add(mission, draft)
    return draft.done()
