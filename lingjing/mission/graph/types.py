"""The mission graph as a value: typed nodes, typed edges, stable ids, JSON in one call of `msgspec.json.encode`.

A node's id is `<kind>:<name>` (`asset:uav`, `fact:victim.position`); a group is one node with a `count`. An edge's id
is its kind and its ends, numbered where two edges share all three. Nodes and edges stand in declaration order.
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
"""What a node stands for.

`fact` is a hidden value of an entity; `resource` is what is spent (ticks, energy); `channel` is a message kind, the
bus, or a built-in observation source; a `rule` is adjudicated by the kernel, an `event` is performed by an engine or
happens at its time.
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
"""What an edge says, read from source to target: `rule:rescued requires rule:reported`.

`speaks_to` leads from a role through a channel to the roles that read it. The last five are the paper's relations.
"""


class GraphNode(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One declaration.

    `title` is what it is called where it is drawn (`uav[1..3]`), `detail` one short line about it, `text` the rest
    (a condition, fields, verbs). `count` is the size of a group at the default parameters (0: not known before the
    run, None: a single thing). `within` is the node it is part of, `per` the group it exists once per member of.
    `when` is the guard as written, `modes` are the modes it can exist in.
    """

    id: str
    kind: NodeKind
    name: str
    title: str
    detail: str = ""
    text: str = ""
    count: int | None = None
    within: str | None = None
    per: str | None = None
    when: str = ""
    modes: tuple[str, ...] = ()


class GraphEdge(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One statement about two nodes. `label` is its particulars (`position`), `via` the node a relation names
    (what it carries, is over, or is by), `mutual` holds both ways. `when` and `modes` as in `GraphNode`."""

    id: str
    kind: EdgeKind
    source: str
    target: str
    label: str = ""
    via: str | None = None
    mutual: bool = False
    when: str = ""
    modes: tuple[str, ...] = ()


class MissionGraph(msgspec.Struct, frozen=True, kw_only=True):
    """The whole graph. `modes` are the modes it shows, `default` the one a run takes unless told otherwise."""

    format: Literal["lingjing-graph/1"] = "lingjing-graph/1"
    mission: str
    title: str
    goal: str
    modes: tuple[str, ...]
    default: str
    nodes: tuple[GraphNode, ...]
    edges: tuple[GraphEdge, ...]

    def node(self, identity: str) -> GraphNode:
        """The node of that id; `KeyError` if there is none."""
        for node in self.nodes:
            if node.id == identity:
                return node
        raise KeyError(identity)

    def out_of(self, identity: str, *kinds: EdgeKind) -> Iterator[GraphEdge]:
        """Edges that leave a node, of the given kinds or of all."""
        return (e for e in self.edges if e.source == identity and (not kinds or e.kind in kinds))
