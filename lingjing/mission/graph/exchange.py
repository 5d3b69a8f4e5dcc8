"""`exchange`: the mission graph with action spaces, radii and conditions, for programs that do not know this project.

Every attribute is a text, a number or a flag, so that one graph can be written as GraphML and as node-link JSON, which
networkx and other libraries read. Names of modes are separated by spaces.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Literal

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.conditions.declarations import default_scope
from lingjing.mission.conditions.listing import ConditionList, ListedCondition, list_conditions
from lingjing.mission.conditions.quantities import Cause, Quantity
from lingjing.mission.conditions.survey import Gate
from lingjing.mission.evaluate import Scope, number
from lingjing.mission.graph import graph
from lingjing.mission.graph.types import EdgeKind, GraphEdge, GraphNode, MissionGraph, NodeKind
from lingjing.mission.instance import ArgumentSpec
from lingjing.mission.spec_schema import argument_bounds

ExchangeNodeKind = NodeKind | Literal["verb", "argument", "condition", "leaf", "quantity"]
"""The kinds of the mission graph, and those of action spaces and conditions."""

ExchangeEdgeKind = EdgeKind | Literal["offers", "commands", "takes", "decides", "contains", "reads"]
"""The kinds of the mission graph, and these, from source to target:

`offers`: asset → verb. `commands`: role → verb. `takes`: verb → argument. `decides`: condition → node. `contains`:
condition → leaf. `reads`: leaf → quantity. `changes` also leads from verbs, channels and events to quantities.
"""


class ExchangeNode(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    """One node. Attributes that do not apply to its kind are absent."""

    id: str
    """`<kind>:<name>`."""
    kind: ExchangeNodeKind
    name: str
    title: str = ""
    detail: str = ""
    text: str = ""
    count: int | None = None
    """Size of a group at the default parameters; 0 if it is drawn in a run."""
    within: str = ""
    """Id of the node that contains it."""
    per: str = ""
    """Id of a group: the node exists once for each of its members."""
    when: str = ""
    """Its guard as written."""
    modes: str = ""
    """The modes in which it can exist."""
    unit: str = ""
    """SI unit of an argument."""
    least: float | None = None
    """Lower bound of an argument, or of a quantity over the episode; absent if there is none."""
    most: float | None = None
    """Upper bound, likewise."""
    default: float | None = None
    """The value of an argument that a command leaves out."""
    optional: bool = False
    """True for an argument that a command may leave out."""
    hidden: bool = False
    """True for a hidden field, a hidden quantity, and a condition or a leaf that reads one."""
    radius_m: float | None = None
    """Metres: reach of an inspection or of the bus, extent of a target, or the distance that a leaf compares with."""
    changed_by: str = ""
    """The causes of changes of a quantity."""
    declassified: str = ""
    """The author's reasons why agents may infer a hidden value from what the condition decides."""


class ExchangeEdge(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    """An edge between two nodes of the graph."""

    source: str
    target: str
    key: str
    """Its id, unique in the graph."""
    kind: ExchangeEdgeKind
    label: str = ""
    via: str = ""
    """Id of the node that a relation carries, is over, or is by."""
    mutual: bool = False
    """True if it holds in both directions."""
    when: str = ""
    """Its guard as written."""
    modes: str = ""
    """The modes in which it can exist."""
    radius_m: float | None = None
    """Largest distance of an interaction between actor and target, metres."""
    lasting_s: float | None = None
    """Seconds that the actor of an interaction must stay."""


class ExchangeGraph(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A directed multigraph in the node-link form."""

    directed: Literal[True] = True
    multigraph: Literal[True] = True
    graph: dict[str, str]
    """`format`, `mission`, `title`, `goal`, `modes` and `default`, the default mode."""
    nodes: tuple[ExchangeNode, ...]
    edges: tuple[ExchangeEdge, ...]


def exchange(mission: model.Mission, listed: ConditionList | None = None) -> ExchangeGraph:
    """The graph of a mission in all its modes. `listed` are its conditions, if they are known already."""
    shown = graph(mission)
    draft = _Draft(mission, shown)
    draft.action_spaces()
    draft.conditions(list_conditions(mission) if listed is None else listed)
    return ExchangeGraph(
        graph={
            "format": "lingjing-exchange/1",
            "mission": shown.mission,
            "title": shown.title,
            "goal": shown.goal,
            "modes": " ".join(shown.modes),
            "default": shown.default,
        },
        nodes=tuple(draft.nodes.values()),
        edges=tuple(draft.edges.values()),
    )


# -- private


class _Draft:
    """The nodes and edges added so far, by id and key."""

    def __init__(self, mission: model.Mission, shown: MissionGraph) -> None:
        self.mission = mission
        self.scope = default_scope(mission, mission.modes.default)
        radii = _node_radii(mission, self.scope)
        reaches = _reaches(mission, self.scope)
        self.nodes = {node.id: _node(node, radii.get(node.id)) for node in shown.nodes}
        self.edges = {edge.id: _edge(edge, reaches) for edge in shown.edges}

    def action_spaces(self) -> None:
        """Add the verbs of every asset with their arguments, and the roles that may give them as commands."""
        commanders = self._commanders()
        for group in self.mission.groups:
            asset = f"asset:{group.name}"
            if asset not in self.nodes:
                continue
            for verb in group.verbs:
                node = self.verb(group, verb)
                self.edge("offers", asset, node)
                for role, edges in commanders.get(asset, {}).items():
                    present = {mode for edge in edges for mode in edge.modes.split()}
                    modes = " ".join(mode for mode in self.mission.modes.allowed if mode in present)
                    self.edge("commands", role, node, modes=modes, label=edges[0].label)

    def verb(self, group: model.Group, verb: model.Verb) -> str:
        """Add a verb and its arguments."""
        modes = self.nodes[f"asset:{group.name}"].modes
        name = f"{group.name}.{verb.name}"
        node = self.node("verb", name, title=verb.name, text=verb.doc, modes=modes, within=f"asset:{group.name}")
        band = {prop.name: _value(prop.value, self.scope) for prop in group.properties if prop.name in _BAND}
        for argument in verb.arguments:
            spec = ArgumentSpec(
                name=argument.name,
                unit=argument.dimension,
                minimum=_value(argument.minimum, self.scope),
                maximum=_value(argument.maximum, self.scope),
            )
            low, high = argument_bounds(spec, band)
            argument_node = self.node(
                "argument",
                f"{name}.{argument.name}",
                title=argument.name,
                unit=argument.dimension,
                least=_finite(low),
                most=_finite(high),
                default=_value(argument.default, self.scope),
                optional=argument.optional or argument.default is not None,
                modes=modes,
                within=node,
            )
            self.edge("takes", node, argument_node)
        return node

    def conditions(self, listed: ConditionList) -> None:
        """Add the conditions, their leaves, and the quantities that these read."""
        for condition in listed.conditions:
            declaration = self.nodes.get(f"{condition.kind}:{condition.name}")
            node = self.node(
                "condition",
                condition.at,
                text=condition.text,
                detail=condition.kind,
                hidden=condition.hidden,
                declassified="; ".join(f"{what}: {reason}" for what, reason in condition.declassified.items()),
                modes=declaration.modes if declaration else "",
            )
            for gate in condition.gates:
                for decided in self._decided(condition, gate):
                    self.edge("decides", node, decided, label=gate.kind)
            self._leaves(condition, node)

    def node(
        self,
        kind: ExchangeNodeKind,
        name: str,
        *,
        title: str = "",
        detail: str = "",
        text: str = "",
        within: str = "",
        modes: str = "",
        unit: str = "",
        least: float | None = None,
        most: float | None = None,
        default: float | None = None,
        optional: bool = False,
        hidden: bool = False,
        radius_m: float | None = None,
        changed_by: str = "",
        declassified: str = "",
    ) -> str:
        """Add a node, unless it exists, and return its id."""
        identity = f"{kind}:{name}"
        self.nodes.setdefault(
            identity,
            ExchangeNode(
                id=identity,
                kind=kind,
                name=name,
                title=title or name,
                detail=detail,
                text=text,
                within=within,
                modes=modes or " ".join(self.mission.modes.allowed),
                unit=unit,
                least=least,
                most=most,
                default=default,
                optional=optional,
                hidden=hidden,
                radius_m=radius_m,
                changed_by=changed_by,
                declassified=declassified,
            ),
        )
        return identity

    def edge(self, kind: ExchangeEdgeKind, source: str, target: str, *, modes: str = "", label: str = "") -> None:
        """Add an edge that exists where both its ends do, unless it exists."""
        key = f"{kind} {source} {target}"
        ends = self.nodes[source].modes.split(), self.nodes[target].modes.split()
        shared = [mode for mode in (modes.split() or ends[0]) if all(mode in end for end in ends)]
        self.edges.setdefault(
            key,
            ExchangeEdge(source=source, target=target, key=key, kind=kind, label=label, modes=" ".join(shared)),
        )

    def _commanders(self) -> dict[str, dict[str, list[ExchangeEdge]]]:
        """Asset → role → the edges by which the role may command the asset."""
        edges = tuple(self.edges.values())
        role_of = {edge.source: edge.target for edge in edges if edge.kind == "plays"}
        commanders: dict[str, dict[str, list[ExchangeEdge]]] = {}
        for edge in edges:
            if edge.kind in ("controls", "may_command"):
                role = role_of.get(edge.source, edge.source)
                commanders.setdefault(edge.target, {}).setdefault(role, []).append(edge)
        return commanders

    def _leaves(self, condition: ListedCondition, node: str) -> None:
        for place, leaf in enumerate(condition.leaves, 1):
            contained = self.node(
                "leaf",
                f"{condition.at}#{place}",
                title=f"not {leaf.text}" if leaf.negated else leaf.text,
                text=leaf.text,
                detail=" ".join(leaf.via),
                hidden=leaf.hidden,
                radius_m=leaf.radius_m,
                within=node,
                modes=self.nodes[node].modes,
            )
            self.edge("contains", node, contained)
            for quantity in leaf.quantities:
                self.edge("reads", contained, self._quantity(quantity))

    def _quantity(self, quantity: Quantity) -> str:
        node = self.node(
            "quantity",
            quantity.key,
            detail=quantity.kind,
            least=quantity.least,
            most=quantity.most,
            hidden=quantity.hidden,
            changed_by="; ".join(_words(cause) for cause in quantity.causes),
        )
        for cause in quantity.causes:
            for source in self._sources(cause, quantity):
                if source in self.nodes:
                    self.edge("changes", source, node)
        return node

    def _sources(self, cause: Cause, quantity: Quantity) -> tuple[str, ...]:
        """The ids of nodes that may stand for a cause. A verb is that of the owner, or else of every asset."""
        match cause.kind:
            case "verb":
                own = f"verb:{quantity.owner}.{cause.name}", f"verb:{quantity.name}.{cause.name}"
                owned = tuple(identity for identity in own if identity in self.nodes)
                return owned or self._verbs.get(cause.name, ())
            case "message":
                return (f"channel:{cause.name}",)
            case "interaction":
                return (f"event:{cause.name}",)
            case "event":
                return (f"event:{cause.name}@", f"event:{cause.name}")
        return ()

    @cached_property
    def _verbs(self) -> dict[str, tuple[str, ...]]:
        """Name of a verb → the ids of the nodes of that verb, once the action spaces are complete."""
        ids: dict[str, tuple[str, ...]] = {}
        for node in self.nodes.values():
            if node.kind == "verb":
                ids[node.title] = (*ids.get(node.title, ()), node.id)
        return ids

    def _decided(self, condition: ListedCondition, gate: Gate) -> Iterator[str]:
        """The nodes that a condition decides; the end of an episode is decided by its outcome node or itself."""
        names = {
            "end": (f"outcome:{condition.kind}",),
            "event": (f"rule:{gate.name}", f"constraint:{gate.name}"),
            "interaction": (f"event:{gate.name}",),
            "stage": (f"stage:{gate.name}",),
            "count": (f"resource:{condition.name}.{gate.name}",),
            "command": self._permitted(gate.name),
            "penalty": (),
            "world": (f"event:{gate.name}@",) if f"event:{gate.name}@" in self.nodes else (f"event:{gate.name}",),
        }[gate.kind]
        yield from (name for name in names if name in self.nodes)

    def _permitted(self, name: str) -> tuple[str, ...]:
        """The verbs of `uav.takePhoto`, `uav[1].takePhoto` or `uav.*`."""
        resource, _, verb = name.rpartition(".")
        group = resource.partition("[")[0]
        ids = (identity for named in self._verbs.values() for identity in named)
        return tuple(
            identity
            for identity in ids
            if identity == f"verb:{group}.{verb}" or (verb == "*" and self.nodes[identity].within == f"asset:{group}")
        )


_BAND = ("band_low_m", "band_high_m")


def _node(node: GraphNode, radius_m: float | None) -> ExchangeNode:
    return ExchangeNode(
        id=node.id,
        kind=node.kind,
        name=node.name,
        title=node.title,
        detail=node.detail,
        text=node.text,
        count=node.count,
        within=node.within or "",
        per=node.per or "",
        when=node.when,
        modes=" ".join(node.modes),
        hidden=node.kind == "fact",
        radius_m=radius_m,
    )


def _edge(edge: GraphEdge, reaches: Mapping[tuple[str, str], tuple[float | None, float | None]]) -> ExchangeEdge:
    radius_m, lasting_s = reaches.get((edge.source, edge.target), (None, None))
    return ExchangeEdge(
        source=edge.source,
        target=edge.target,
        key=edge.id,
        kind=edge.kind,
        label=edge.label,
        via=edge.via or "",
        mutual=edge.mutual,
        when=edge.when,
        modes=" ".join(edge.modes),
        radius_m=radius_m,
        lasting_s=lasting_s,
    )


def _node_radii(mission: model.Mission, scope: Scope) -> dict[str, float | None]:
    """Reaches of inspections and of the bus, and extents of targets, by the id of their nodes."""
    radii = {f"inspection:{spec.name}": _value(spec.within, scope) for spec in mission.inspections}
    radii["channel:comms"] = _value(mission.comms.range, scope)
    for group in mission.groups:
        for prop in group.properties:
            if prop.name == "radius_m" and not prop.hidden:
                radii[f"{group.role}:{group.name}"] = _value(prop.value, scope)
    return radii


def _reaches(mission: model.Mission, scope: Scope) -> dict[tuple[str, str], tuple[float | None, float | None]]:
    """(radius, duration) of each interaction with each group, by the ends of its edge."""
    return {
        (f"event:{spec.name}", f"{group.role}:{group.name}"): (_value(spec.within, scope), _value(spec.lasting, scope))
        for group in mission.groups
        for spec in group.interactions
    }


def _words(cause: Cause) -> str:
    by = f" by {', '.join(cause.by)}" if cause.by else ""
    return f"{cause.kind} {cause.name}{by}"


def _value(expr: ex.Expr | None, scope: Scope) -> float | None:
    """A number at the default settings; None if it is absent, drawn, or differs between the members of a group."""
    if expr is None:
        return None
    try:
        return number(expr, scope)
    except MissionError:
        return None


def _finite(bound: float) -> float | None:
    return bound if abs(bound) != float("inf") else None
