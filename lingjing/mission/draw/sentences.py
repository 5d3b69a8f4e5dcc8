"""Words and sentences of the picture. An edge from a channel to every role is replaced by `to all` on the node."""

from __future__ import annotations

from unicodedata import category

import msgspec

from lingjing.mission.draw.styles import EDGES, guard_words
from lingjing.mission.graph.types import GraphEdge, GraphNode, MissionGraph

_UNHELD = frozenset(("Cc", "Cs", "Cn"))
"""Unicode categories of code points without a glyph: control characters, surrogates, unassigned code points."""


def readable(graph: MissionGraph) -> MissionGraph:
    """The graph with `to all` on each channel that every role reads, in place of an edge to each role."""
    public = {node.id for node in graph.nodes if node.kind == "channel" and _read_by_all(node, graph)}
    return msgspec.structs.replace(
        graph,
        nodes=tuple(_to_all(node) if node.id in public else node for node in graph.nodes),
        edges=tuple(edge for edge in graph.edges if not (edge.kind == "speaks_to" and edge.source in public)),
    )


def edge_words(edge: GraphEdge, *, always: bool = False) -> str:
    """The label of an edge. Its colour shows its kind; the label adds a relation's name and medium, a guard, other
    details.

    With `always`, the label names the kind of any edge, for pictures without a legend.
    """
    style = EDGES[edge.kind]
    words = [style.words] if always or style.relation or (edge.when and not edge.label) else []
    if edge.label and (always or edge.kind != "controls"):
        words.append(f"{edge.label} {_name(edge.via)}" if edge.via else edge.label)
    if edge.when:
        words.append(f"({guard_words(edge.when)})")
    return " ".join(words)


def edge_sentence(edge: GraphEdge) -> str:
    """The edge as a sentence for its tooltip: `searcher may command boat, when mode == broadcast`."""
    words = EDGES[edge.kind].words
    both = "↔" if edge.mutual else "→"
    sentence = f"{_name(edge.source)} {words} {_name(edge.target)}"
    if EDGES[edge.kind].relation:
        sentence = f"{words}: {_name(edge.source)} {both} {_name(edge.target)}"
    if edge.label:
        sentence += f" ({edge.label} {_name(edge.via)})" if edge.via else f" ({edge.label})"
    return f"{sentence}, when {edge.when}" if edge.when else sentence


def node_sentence(node: GraphNode) -> str:
    """All details of a node, one a line."""
    lines = [f"{node.kind} {node.title}", node.detail, node.text, f"when {node.when}" if node.when else ""]
    return "\n".join(line for line in lines if line)


def printable(text: str) -> str:
    """The text with a space for each character that no format can hold: control characters but newlines, lone
    surrogates."""
    return "".join(letter if letter == "\n" or category(letter) not in _UNHELD else " " for letter in text)


def _read_by_all(node: GraphNode, graph: MissionGraph) -> bool:
    roles = {other.id: set(other.modes) & set(node.modes) for other in graph.nodes if other.kind == "role"}
    readers = {edge.target: set(edge.modes) for edge in graph.out_of(node.id, "speaks_to")}
    return len(roles) > 1 and all(modes <= readers.get(role, set()) for role, modes in roles.items())


def _to_all(node: GraphNode) -> GraphNode:
    return msgspec.structs.replace(node, detail=f"{node.detail}, to all" if node.detail else "to all")


def _name(identity: str | None) -> str:
    return identity.partition(":")[2] if identity else ""
