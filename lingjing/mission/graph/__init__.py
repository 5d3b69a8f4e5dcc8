"""The mission graph: one mission as typed nodes and typed edges.

A pass adds the nodes or edges of one kind of declaration. Modules in control-flow order:

- `types`: `GraphNode`, `GraphEdge`, `MissionGraph`, and the closed lists of their kinds.
- `guards`: the modes in which a guarded declaration exists.
- `builder`: the graph under construction.
- `needs`: the nodes that a condition reads.
- `entities`, `rules`, `limits`: the passes, one small function for each kind of declaration. A new kind of declaration
  is a new function there and a line in `PASSES`.
- `exchange`: the graph with action spaces, radii and conditions, for other programs.

Sweeps and parameters have no nodes: they select which missions are played and are no part of one.

In: a `Mission`. Out: a `MissionGraph`, equal for equal missions. `lingjing.mission.draw` draws it, and attribution
follows its edges. No heavy dependency is imported.
"""

from __future__ import annotations

from collections.abc import Callable

from lingjing.errors import UsageError
from lingjing.mission.alternatives import at_tier
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
"""The passes in order: nodes before the edges that name them, otherwise in the order of a mission file."""


def graph(mission: Mission, mode: str | None = None, tier: int = 0) -> MissionGraph:
    """The graph of a mission at a tier: of all its modes with guards as labels, or of one mode with guards evaluated.

    Raises `UsageError` for a mode or a tier that the mission does not have, `MissionError` if a declaration names an
    unknown element.
    """
    allowed = mission.modes.allowed
    if mode is not None and mode not in allowed:
        hint = nearest_or(mode, allowed, f"choose one of {', '.join(allowed)}")
        raise UsageError(f"mission `{mission.name}` has no mode `{mode}`", hint=hint)
    mission = at_tier(mission, tier)
    draft = GraphBuilder(mission, allowed if mode is None else (mode,))
    for add in PASSES:
        add(mission, draft)
    return draft.build()
