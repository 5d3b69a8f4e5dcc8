"""The graph as people read it: what every reader can add in his head is said on the node, not drawn as an edge."""

from __future__ import annotations

from unicodedata import category

import msgspec

from lingjing.mission.draw.styles import EDGES, guard_words
from lingjing.mission.graph.types import GraphEdge, GraphNode, MissionGraph

_UNHELD = frozenset(("Cc", "Cs", "Cn"))
"""Unicode categories: control characters, surrogates, and code points that are no characters."""


def readable(graph: MissionGraph) -> MissionGraph:
    """The same graph with `to all` on a channel that every role reads, in place of an edge to each of them."""
    public = {node.id for node in graph.nodes if node.kind == "channel" and _read_by_all(node, graph)}
    return msgspec.structs.replace(
        graph,
        nodes=tuple(_to_all(node) if node.id in public else node for node in graph.nodes),
        edges=tuple(edge for edge in graph.edges if not (edge.kind == "speaks_to" and edge.source in public)),
    )


def edge_words(edge: GraphEdge, *, always: bool = False) -> str:
    """What stands beside an edge whose kind its colour says: a relation's name and means, a guard, other particulars.

    With `always` the kind of any edge, for pictures without a legend.
    """
    style = EDGES[edge.kind]
    said = [style.words] if always or style.relation or (edge.when and not edge.label) else []
    if edge.label and (always or edge.kind != "controls"):
        said.append(f"{edge.label} {_name(edge.via)}" if edge.via else edge.label)
    if edge.when:
        said.append(f"({guard_words(edge.when)})")
    return " ".join(said)


def edge_sentence(edge: GraphEdge) -> str:
    """The edge as a sentence for whoever points at it: `searcher may command boat, when mode == broadcast`."""
    words = EDGES[edge.kind].words
    both = "↔" if edge.mutual else "→"
    says = f"{_name(edge.source)} {words} {_name(edge.target)}"
    if EDGES[edge.kind].relation:
        says = f"{words}: {_name(edge.source)} {both} {_name(edge.target)}"
    if edge.label:
        says += f" ({edge.label} {_name(edge.via)})" if edge.via else f" ({edge.label})"
    return f"{says}, when {edge.when}" if edge.when else says


def node_sentence(node: GraphNode) -> str:
    """Everything about a node, a line each."""
    lines = [f"{node.kind} {node.title}", node.detail, node.text, f"when {node.when}" if node.when else ""]
    return "\n".join(line for line in lines if line)


def printable(text: str) -> str:
    """The text with a space for whatever no format can hold: control characters but newlines, lone surrogates."""
    return "".join(letter if letter == "\n" or category(letter) not in _UNHELD else " " for letter in text)


def _read_by_all(node: GraphNode, graph: MissionGraph) -> bool:
    roles = {other.id: set(other.modes) & set(node.modes) for other in graph.nodes if other.kind == "role"}
    readers = {edge.target: set(edge.modes) for edge in graph.out_of(node.id, "speaks_to")}
    return len(roles) > 1 and all(modes <= readers.get(role, set()) for role, modes in roles.items())


def _to_all(node: GraphNode) -> GraphNode:
    return msgspec.structs.replace(node, detail=f"{node.detail}, to all" if node.detail else "to all")


def _name(identity: str | None) -> str:
    return identity.partition(":")[2] if identity else ""
