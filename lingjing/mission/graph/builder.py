"""The graph under construction: passes add nodes and edges and resolve names; equal edges are kept once."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.conditions.declarations import default_scope
from lingjing.mission.conditions.survey import survey_mission
from lingjing.mission.evaluate import number, whole
from lingjing.mission.expression_text import spell
from lingjing.mission.graph.guards import Presence, presence
from lingjing.mission.graph.types import EdgeKind, GraphEdge, GraphNode, MissionGraph, NodeKind


class GraphBuilder:
    """Collects one mission's nodes and edges for the modes shown."""

    def __init__(self, mission: model.Mission, modes: tuple[str, ...]) -> None:
        self.modes = modes
        self.survey = survey_mission(mission)
        self._mission = mission
        self._defaults = default_scope(mission, modes[0] if len(modes) == 1 else mission.modes.default)
        self._nodes: dict[str, GraphNode] = {}
        self._edges: dict[str, GraphEdge] = {}

    def node(
        self,
        kind: NodeKind,
        name: str,
        *,
        title: str = "",
        detail: str = "",
        text: str = "",
        count: int | None = None,
        within: str | None = None,
        per: str | None = None,
        at: Presence | None = None,
    ) -> str:
        """Add a node and return its id. It exists in the modes of `at` in which its parent `within` exists."""
        identity = f"{kind}:{name}"
        if identity in self._nodes:
            raise MissionError(f"two things are called `{name}`, both of the kind {kind}", hint="rename one of them")
        self._nodes[identity] = GraphNode(
            id=identity,
            kind=kind,
            name=name,
            title=title or name,
            detail=detail,
            text=text,
            count=count,
            within=within,
            per=per,
            when=at.when if at else "",
            modes=self._shared(at.modes if at else self.modes, (within,) if within else ()),
        )
        return identity

    def edge(
        self,
        kind: EdgeKind,
        source: str,
        target: str,
        *,
        label: str = "",
        via: str | None = None,
        mutual: bool = False,
        at: Presence | None = None,
    ) -> None:
        """Add an edge. It exists in the modes of `at` in which both ends exist. A second equal edge is ignored, and an
        edge without modes too."""
        when = at.when if at else ""
        modes = self._shared(at.modes if at else self.modes, (source, target, *((via,) if via else ())))
        if not modes:
            return
        base = f"{kind} {source} {target}"
        edge = GraphEdge(
            id=base,
            kind=kind,
            source=source,
            target=target,
            label=label,
            via=via,
            mutual=mutual,
            when=when,
            modes=modes,
        )
        copies = 1
        while (known := self._edges.get(edge.id)) is not None:
            if _same(known, edge):
                return
            copies += 1
            edge = msgspec.structs.replace(edge, id=f"{base} #{copies}")
        self._edges[edge.id] = edge

    def has(self, identity: str) -> bool:
        """True if there is such a node."""
        return identity in self._nodes

    def find(self, name: str, *kinds: NodeKind) -> str | None:
        """The id of the node called `name` of the first of these kinds that has one."""
        return next((f"{kind}:{name}" for kind in kinds if f"{kind}:{name}" in self._nodes), None)

    def need(self, name: str, what: str, *kinds: NodeKind) -> str:
        """Return the node of `find`. Raises a `MissionError` that names `what` if there is none."""
        identity = self.find(name, *kinds)
        if identity is None:
            raise MissionError(
                f"{what} names `{name}`, and the mission has no such {' or '.join(kinds)}",
                hint=f"declare `{name}`, or correct the name",
            )
        return identity

    def all_of(self, kind: NodeKind) -> tuple[str, ...]:
        """The ids of all nodes of a kind, in order."""
        return tuple(node.id for node in self._nodes.values() if node.kind == kind)

    def presence(self, guard: model.Guard | None) -> Presence | None:
        """The modes of a guarded declaration, or None if it exists in none of the modes shown."""
        return presence(guard, self.modes)

    def count(self, expr: ex.Expr | None) -> int | None:
        """The size of a group at the default parameters; 0 if it is drawn in a run, None for a single entity."""
        if expr is None:
            return None
        try:
            return whole(expr, self._defaults)
        except MissionError:
            return 0

    def value(self, expr: ex.Expr) -> str:
        """A small whole number at the default parameters, else the expression as written."""
        try:
            return str(whole(expr, self._defaults))
        except MissionError:
            return spell(expr)

    def share(self, expr: ex.Expr) -> str:
        """A share in per cent at the default parameters, else the expression as written."""
        try:
            return f"{100 * number(expr, self._defaults):g} %"
        except MissionError:
            return spell(expr)

    def group_title(self, name: str, expr: ex.Expr | None) -> str:
        """The title of a group: `uav[1..3]`, or `uav[1..n]` if its size is drawn in a run."""
        if expr is None:
            return name
        return f"{name}[1..{self.count(expr) or spell(expr)}]"

    def build(self) -> MissionGraph:
        """The complete graph."""
        return MissionGraph(
            mission=self._mission.name,
            title=self._mission.title,
            goal=self._mission.goal,
            modes=self.modes,
            default=self._mission.modes.default,
            nodes=tuple(self._nodes.values()),
            edges=tuple(self._edges.values()),
        )

    def _shared(self, modes: tuple[str, ...], others: Iterable[str]) -> tuple[str, ...]:
        limits = [self._nodes[identity].modes for identity in others]
        return tuple(mode for mode in modes if all(mode in limit for limit in limits))


def _same(first: GraphEdge, second: GraphEdge) -> bool:
    return msgspec.structs.replace(first, id="") == msgspec.structs.replace(second, id="")
