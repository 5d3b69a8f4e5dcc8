"""The graph as a Mermaid flowchart: a subgraph for each lane, a colour for each kind of edge."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lingjing.mission.draw.sentences import edge_words, printable, readable
from lingjing.mission.draw.styles import EDGES, LANES, NODES, guard_words, lane_of
from lingjing.mission.graph.types import GraphEdge, GraphNode, MissionGraph

_SHAPES = {"role": ("([", "])"), "fact": ("{{", "}}"), "rule": ("[/", "/]"), "outcome": ("([", "])")}
_ENTITIES = {"#": "#35;", '"': "#quot;", "<": "#lt;", ">": "#gt;", "`": "#96;", "&": "#amp;", "\n": " "}


def mermaid(graph: MissionGraph) -> str:
    """The flowchart's text, which ends in a newline; the same graph gives the same text."""
    shown = readable(graph)
    names = _names(shown.nodes)
    lines = ["---", f"title: {_yaml(shown.title or shown.mission)}", "---", "flowchart LR"]
    for place, (title, _) in enumerate(LANES):
        inside = [node for node in shown.nodes if lane_of(node) == place]
        if inside:
            lines.append(f'  subgraph lane{place}["{title}"]')
            lines.extend(f"    {_node(node, names)}" for node in inside)
            lines.append("  end")
    lines.extend(f"  {_edge(edge, names)}" for edge in shown.edges)
    lines.extend(f"  {line}" for line in _styles(shown, names))
    return "\n".join(lines) + "\n"


def escape(text: str) -> str:
    """Text for a quoted label: Mermaid's only special syntax there is entities with `#`."""
    return "".join(_ENTITIES.get(letter, letter) for letter in printable(text))


def _node(node: GraphNode, names: Mapping[str, str]) -> str:
    opening, closing = _SHAPES.get(node.kind, ("[", "]"))
    lines = [node.title, node.detail, f"when {guard_words(node.when)}" if node.when else ""]
    label = "<br/>".join(escape(line) for line in lines if line)
    return f'{names[node.id]}{opening}"{label}"{closing}'


def _edge(edge: GraphEdge, names: Mapping[str, str]) -> str:
    arrow = "-.->" if edge.when else "==>" if EDGES[edge.kind].relation else "-->"
    arrow = f"<{arrow}" if edge.mutual else arrow
    return f'{names[edge.source]} {arrow}|"{escape(edge_words(edge, always=True))}"| {names[edge.target]}'


def _styles(graph: MissionGraph, names: Mapping[str, str]) -> Iterator[str]:
    for sort, style in NODES.items():
        names_of_kind = [names[node.id] for node in graph.nodes if node.kind == sort]
        if names_of_kind:
            fill, border = style.light
            yield f"classDef {sort} fill:{fill},stroke:{border},color:#0f172a"
            yield f"class {','.join(names_of_kind)} {sort}"
    for kind, look in EDGES.items():
        places = [str(place) for place, edge in enumerate(graph.edges) if edge.kind == kind]
        if places:
            yield f"linkStyle {','.join(places)} stroke:{look.light},stroke-width:{look.width}px,color:{look.light}"


def _names(nodes: tuple[GraphNode, ...]) -> dict[str, str]:
    """An id of ASCII letters, digits and underscores for each node. Equal ids get a number."""
    identities: dict[str, str] = {}
    for node in nodes:
        plain = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in node.id)
        name, copies = plain, 1
        while name in identities:
            copies += 1
            name = f"{plain}_{copies}"
        identities[name] = node.id
    return {identity: name for name, identity in identities.items()}


def _yaml(text: str) -> str:
    """A double-quoted YAML string."""
    plain = " ".join(printable(text).split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'
