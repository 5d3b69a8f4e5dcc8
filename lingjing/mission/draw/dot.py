"""The graph in DOT, Graphviz's language: a cluster a lane, a colour an edge kind. Plain text, ends in a newline.

Graphviz ranks by the direction of an edge. So that lanes run from left to right, an edge that leads back to an earlier
lane is written from its target with `dir=back`: the arrow drawn is the edge's own.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission.draw.reading import edge_sentence, edge_words, node_sentence, printable, readable
from lingjing.mission.draw.styles import EDGES, LANES, NODES, guard_words, lane_of
from lingjing.mission.graph.types import Edge, MissionGraph, Node

_SHAPES = {"role": "box", "fact": "octagon", "rule": "note", "stage": "cds"}


def dot(graph: MissionGraph) -> str:
    """The digraph's text; the same graph gives the same text."""
    shown = readable(graph)
    lines = [
        f"digraph {quote(shown.mission)} {{",
        f"  graph [label={quote(shown.title)}, labelloc=t, rankdir=LR, fontname=Helvetica, newrank=true]",
        '  node [shape=box, style="rounded,filled", fontname=Helvetica, fontsize=11]',
        "  edge [fontname=Helvetica, fontsize=9]",
    ]
    for place, (title, _) in enumerate(LANES):
        inside = [node for node in shown.nodes if lane_of(node) == place]
        if inside:
            lines.append(f"  subgraph cluster_{place} {{")
            lines.append(f'    graph [label={quote(title)}, style=rounded, color="#cbd5e1"]')
            lines.extend(f"    {_node(node)}" for node in inside)
            lines.append("  }")
    lanes = {node.id: lane_of(node) for node in shown.nodes}
    lines.extend(f"  {_edge(edge, lanes)}" for edge in shown.edges)
    lines.append("}")
    return "\n".join(lines) + "\n"


def quote(text: str) -> str:
    """A double-quoted string in which nothing is special: backslashes, quotes and newlines are escaped."""
    plain = printable(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + plain.replace("\n", "\\n") + '"'


def _node(node: Node) -> str:
    fill, border = NODES[node.kind].light
    lines = [node.title, node.detail, f"when {guard_words(node.when)}" if node.when else ""]
    given = {"label": "\n".join(line for line in lines if line), "tooltip": node_sentence(node)}
    given |= {"fillcolor": fill, "color": border}
    if node.kind in _SHAPES:
        given["shape"] = _SHAPES[node.kind]
    if node.count is not None or node.kind == "outcome":
        given["peripheries"] = "2"
    return f"{quote(node.id)} {_attributes(given)}"


def _edge(edge: Edge, lanes: Mapping[str, int]) -> str:
    style = EDGES[edge.kind]
    given = {"label": edge_words(edge, always=True), "color": style.light, "fontcolor": style.light}
    given |= {"penwidth": f"{style.width}", "tooltip": edge_sentence(edge)}
    if edge.when:
        given["style"] = "dashed"
    ends = (edge.source, edge.target)
    if edge.mutual:
        given["dir"] = "both"
    elif lanes[edge.target] < lanes[edge.source]:
        given["dir"] = "back"
        ends = (edge.target, edge.source)
    return f"{quote(ends[0])} -> {quote(ends[1])} {_attributes(given)}"


def _attributes(given: Mapping[str, str]) -> str:
    return "[" + ", ".join(f"{name}={quote(value)}" for name, value in given.items()) + "]"
