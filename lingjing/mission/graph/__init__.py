"""The mission graph: one mission as typed nodes and typed edges.

Modules in the order a mission passes them:

- `types`: `GraphNode`, `GraphEdge`, `MissionGraph`, and the closed lists of their kinds.
- `guards`: the modes a guarded declaration exists in.
- `builder`: the graph while it is drawn up.
- `needs`: the nodes a condition reads.
- `entities`, `rules`, `limits`: the passes, one small function a kind of declaration. A new kind of declaration is a
  new function here and a line in `PASSES`.

Sweeps and parameters are not drawn: they say which missions are played, not what one is.

In: a `Mission`. Out: a `MissionGraph`, equal for equal missions. `lingjing.mission.draw` makes pictures of it,
attribution walks it. Nothing heavy is imported.
"""

from __future__ import annotations

from collections.abc import Callable

from lingjing.errors import UsageError
from lingjing.mission.graph import entities, limits, rules
from lingjing.mission.graph.builder import GraphBuilder
from lingjing.mission.graph.types import EdgeKind, GraphEdge, GraphNode, MissionGraph, NodeKind
from lingjing.mission.model import Mission
from lingjing.suggest import nearest_or

__all__ = ["PASSES", "EdgeKind", "GraphEdge", "GraphNode", "MissionGraph", "NodeKind", "graph"]

PASSES: tuple[Callable[[Mission, GraphBuilder], None], ...] = (
    entities.add_roles,
    entities.add_agents,
    entities.add_regions,
    entities.add_grids,
    entities.add_entities,
    entities.add_messages,
    rules.add_rules,
    rules.add_events,
    limits.add_happenings,
    limits.add_inspections,
    rules.add_stages,
    rules.add_outcomes,
    limits.add_allowances,
    limits.add_limits,
    entities.add_controls,
    entities.add_observations,
    entities.add_reveals,
    rules.add_unlocks,
    rules.add_judgements,
    rules.add_completions,
    limits.add_permits,
    limits.add_constraints,
    rules.add_relations,
)
"""Nodes before the edges that name them; within that, the order of a mission file."""


def graph(mission: Mission, mode: str | None = None) -> MissionGraph:
    """The graph of a mission: of all its modes with guards as labels, or as it is in one mode, guards settled.

    Raises `UsageError` for a mode the mission does not have, `MissionError` if a declaration names what is not there.
    """
    allowed = mission.modes.allowed
    if mode is not None and mode not in allowed:
        hint = nearest_or(mode, allowed, f"choose one of {', '.join(allowed)}")
        raise UsageError(f"mission `{mission.name}` has no mode `{mode}`", hint=hint)
    draft = GraphBuilder(mission, allowed if mode is None else (mode,))
    for add in PASSES:
        add(mission, draft)
    return draft.done()
