"""Appearance of every kind of node and edge, the same in all formats: lanes, colours, words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.mission.graph.types import EdgeKind, GraphNode, NodeKind


@dataclass(frozen=True, slots=True)
class EdgeStyle:
    """The appearance of a kind of edge."""

    words: str
    """Its name in a legend."""
    means: str
    """Its explanation in a legend."""
    light: str
    """Its colour on a light page, `#rrggbb`."""
    dark: str
    """Its colour on a dark page, `#rrggbb`."""
    width: float = 1.6
    """Line width, pixels."""
    relation: bool = False
    """True for a relation between agents (such as `guidance`), which the label names."""


@dataclass(frozen=True, slots=True)
class NodeStyle:
    """The fill and the border of a node's box."""

    light: tuple[str, str]
    """(fill, border) on a light page, `#rrggbb`."""
    dark: tuple[str, str]
    """(fill, border) on a dark page, `#rrggbb`."""


MUTED = "#5b6878"
"""The colour of small letters."""

PLAIN = "#ffffff"
"""The fill of nodes that differ from others by their border alone."""

EDGES: dict[EdgeKind, EdgeStyle] = {
    "plays": EdgeStyle("plays", "the agent plays the role", "#94a3b8", "#64748b", 1.2),
    "controls": EdgeStyle("controls", "embodies the asset", "#1d4ed8", "#7aa5ff", 2.2),
    "may_command": EdgeStyle("may command", "may command what another embodies", "#0284c7", "#56c7f7", 1.8),
    "observes": EdgeStyle("observes", "has it as an observation channel", "#0d9488", "#3bd0bd"),
    "speaks_to": EdgeStyle("speaks to", "sends on the channel, or reads from it", "#7c3aed", "#b99bfb"),
    "hides": EdgeStyle("hides", "no policy may read it", "#9f1239", "#fb7185", 1.4),
    "reveals": EdgeStyle("reveals", "the audited way out of hidden", "#e11d48", "#ff6b88", 2.0),
    "adjudicates": EdgeStyle("adjudicates", "judges against ground truth", "#ea580c", "#fb923c"),
    "unlocks": EdgeStyle("unlocks", "lets an engine perform it", "#a16207", "#eab308", 2.2),
    "requires": EdgeStyle("requires", "needs what the arrow points at", "#64748b", "#93a1b5", 1.3),
    "changes": EdgeStyle("changes", "an event lets it appear or vanish", "#0e7490", "#22d3ee", 1.8),
    "information_handoff": EdgeStyle("information handoff", "passes evidence on", "#be185d", "#f472b6", 2.4, True),
    "cooperation": EdgeStyle("cooperation", "does complementary work", "#15803d", "#4ade80", 2.4, True),
    "competition": EdgeStyle("competition", "contends for a resource", "#b91c1c", "#f87171", 2.4, True),
    "guidance": EdgeStyle("guidance", "assigns work", "#4338ca", "#a5b4fc", 2.4, True),
    "dependency": EdgeStyle("dependency", "must come first", "#1e293b", "#e2e8f0", 2.4, True),
}
"""The style of every kind of edge, in the order of the legend. Colours are chosen for contrast on both pages."""

NODES: dict[NodeKind, NodeStyle] = {
    "role": NodeStyle(("#eef2ff", "#818cf8"), ("#1e2140", "#6670d6")),
    "agent": NodeStyle((PLAIN, "#818cf8"), ("#2a2e57", "#7f88ea")),
    "asset": NodeStyle(("#eff6ff", "#60a5fa"), ("#162440", "#4a86d8")),
    "resource": NodeStyle((PLAIN, "#94a3b8"), ("#27303f", "#64748b")),
    "channel": NodeStyle(("#f5f3ff", "#a78bfa"), ("#251d40", "#8163d0")),
    "region": NodeStyle(("#f0fdfa", "#2dd4bf"), ("#10302d", "#22a594")),
    "grid": NodeStyle((PLAIN, "#2dd4bf"), ("#163d39", "#22a594")),
    "target": NodeStyle(("#fff1f2", "#fb7185"), ("#3a1620", "#d1536a")),
    "fact": NodeStyle(("#ffe4e6", "#be123c"), ("#521a28", "#fb7185")),
    "rule": NodeStyle(("#fff7ed", "#fb923c"), ("#38210f", "#cf7428")),
    "event": NodeStyle(("#fefce8", "#d4a50c"), ("#352c0b", "#b8900f")),
    "inspection": NodeStyle(("#fff7ed", "#d97706"), ("#33240c", "#c27c16")),
    "constraint": NodeStyle(("#fef2f2", "#ef4444"), ("#3a1414", "#d14545")),
    "stage": NodeStyle(("#f7fee7", "#84cc16"), ("#212e0c", "#6ba314")),
    "outcome": NodeStyle(("#dcfce7", "#16a34a"), ("#0f331d", "#22a352")),
}
"""The style of every kind of node. Colours are chosen for contrast on both pages."""

LANES: tuple[tuple[str, tuple[NodeKind, ...]], ...] = (
    ("Roles and agents", ("role", "agent")),
    ("Resources and channels", ("asset", "resource", "channel")),
    ("World", ("region", "grid", "target", "fact")),
    ("Rules and events", ("rule", "event", "inspection", "constraint")),
    ("Stages", ("stage",)),
    ("Outcome", ("outcome",)),
)
"""Lanes from left to right: title and kinds of nodes."""

_LANE_OF = {kind: place for place, (_, kinds) in enumerate(LANES) for kind in kinds}


def lane_of(node: GraphNode) -> int:
    """The lane of a node; a node inside another has the lane of that node."""
    if node.within is not None:
        kind = node.within.partition(":")[0]
        return next(place for known, place in _LANE_OF.items() if known == kind)
    return _LANE_OF[node.kind]


def dark_colours() -> Iterator[tuple[str, str, str]]:
    """(`fill` or `stroke`, colour on a light page, colour on a dark page), each once."""
    page = [("fill", "white", "#0d1117"), ("fill", "#f8fafc", "#141a23"), ("stroke", "#e2e8f0", "#242c38")]
    page += [("fill", MUTED, "#9aa7b6"), ("fill", PLAIN, "#232b3a")]
    nodes = [
        (what, light, dark)
        for style in NODES.values()
        for what, light, dark in zip(("fill", "stroke"), style.light, style.dark, strict=True)
        if light != PLAIN
    ]
    edges = [(what, style.light, style.dark) for style in EDGES.values() for what in ("stroke", "fill")]
    yield from dict.fromkeys((*page, *nodes, *edges))


def guard_words(when: str) -> str:
    """The short form of a guard: `star` for `mode == star`."""
    return when.removeprefix("mode == ") if when.count("==") == 1 else when
