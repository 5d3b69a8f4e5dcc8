"""The mission graph as a value: typed nodes, typed edges, stable ids, JSON in one call of `msgspec.json.encode`.

A node's id is `<kind>:<name>` (`asset:uav`, `fact:victim.position`); a group is one node with a `count`. An edge's id
is its kind and its ends, with a number if two edges share all three. Nodes and edges are in declaration order.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import msgspec

NodeKind = Literal[
    "role",
    "agent",
    "asset",
    "target",
    "fact",
    "resource",
    "region",
    "grid",
    "channel",
    "rule",
    "event",
    "inspection",
    "constraint",
    "stage",
    "outcome",
]
"""The kinds of nodes.

A `fact` is a hidden value of an entity. A `resource` is spent (ticks, energy). A `channel` is a message kind, the bus,
or a built-in observation source. A `rule` is adjudicated by the kernel. An `event` is performed by an engine or occurs
at its time.
"""

EdgeKind = Literal[
    "plays",
    "controls",
    "may_command",
    "observes",
    "speaks_to",
    "hides",
    "reveals",
    "adjudicates",
    "unlocks",
    "requires",
    "changes",
    "information_handoff",
    "cooperation",
    "competition",
    "guidance",
    "dependency",
]
"""The kinds of edges, read from source to target: `rule:rescued requires rule:reported`.

`speaks_to` leads from a role through a channel to the roles that read it. The last five are the paper's relations.
"""


class GraphNode(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A node of the graph: one declaration of the mission."""

    id: str
    kind: NodeKind
    name: str
    title: str
    """Its label in a picture, such as `uav[1..3]`."""
    detail: str = ""
    """One short line about it."""
    text: str = ""
    """Further details: a condition, fields, verbs."""
    count: int | None = None
    """Size of a group at the default parameters; 0 if it is drawn in a run, None for a single entity."""
    within: str | None = None
    """Id of the node that contains it."""
    per: str | None = None
    """Id of a group: the node exists once for each of its members."""
    when: str = ""
    """Its guard as written; "" if it has none."""
    modes: tuple[str, ...] = ()
    """The modes in which it can exist."""


class GraphEdge(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One relation between two nodes."""

    id: str
    kind: EdgeKind
    source: str
    target: str
    label: str = ""
    """Details, such as the observed field `position`."""
    via: str | None = None
    """Id of the node that a relation carries, is over, or is by."""
    mutual: bool = False
    """True if it holds in both directions."""
    when: str = ""
    """Its guard as written; "" if it has none."""
    modes: tuple[str, ...] = ()
    """The modes in which it can exist."""


class MissionGraph(msgspec.Struct, frozen=True, kw_only=True):
    """The complete graph."""

    format: Literal["lingjing-graph/1"] = "lingjing-graph/1"
    mission: str
    title: str
    goal: str
    modes: tuple[str, ...]
    """The modes shown."""
    default: str
    """The default mode of a run."""
    nodes: tuple[GraphNode, ...]
    edges: tuple[GraphEdge, ...]

    def node(self, identity: str) -> GraphNode:
        """The node of that id. Raises `KeyError` if there is none."""
        for node in self.nodes:
            if node.id == identity:
                return node
        raise KeyError(identity)

    def out_of(self, identity: str, *kinds: EdgeKind) -> Iterator[GraphEdge]:
        """Edges that leave a node, of the given kinds or of all."""
        return (e for e in self.edges if e.source == identity and (not kinds or e.kind in kinds))
