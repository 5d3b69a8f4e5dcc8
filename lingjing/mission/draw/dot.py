"""The graph in DOT, Graphviz's language: a cluster for each lane, a table for each card.

A card is a node with the nodes inside it, one row each. An edge between two rows of one card is not drawn, because the
card shows it. Graphviz ranks nodes by the direction of edges. An edge to an earlier lane is therefore written from its
target with `dir=back`, so that lanes run from left to right and the arrow keeps its direction.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from html import escape
from itertools import pairwise

from lingjing.mission.draw.sentences import edge_sentence, edge_words, node_sentence, printable, readable
from lingjing.mission.draw.styles import EDGES, LANES, MUTED, NODES, guard_words, lane_of
from lingjing.mission.graph.types import EdgeKind, GraphEdge, GraphNode, MissionGraph

_LEGEND_COLUMNS = 5
"""Cells of one row of the legend (chosen)."""
_ARCS_ON_LEFT = (0, 2)
"""Lanes that draw their inner edges on the left side, because no other edge runs there."""

_Card = list[GraphNode]


def dot(graph: MissionGraph) -> str:
    """The digraph's text, which ends in a newline; the same graph gives the same text."""
    shown = readable(graph)
    cards = _cards(shown.nodes)
    lanes = [(title, [card for card in cards if lane_of(card[0]) == lane]) for lane, (title, _) in enumerate(LANES)]
    drawn = [edge for edge in shown.edges if edge.source == edge.target or not _within_card(edge, cards)]
    heads = [inside[0][0] for _, inside in lanes if inside]  # joined, they keep the lanes in their order
    lines = [
        f"digraph {quote(shown.mission)} {{",
        f"  graph [label=<{_heading(shown, drawn)}>, labelloc=t, bgcolor=white, fontname=Helvetica]",
        "  graph [rankdir=LR, newrank=true, forcelabels=true, nodesep=0.2, ranksep=1.6]",
        "  node [shape=plain, fontname=Helvetica, fontsize=12]",
        "  edge [fontname=Helvetica, fontsize=9, arrowsize=0.6]",
        *(line for lane, (title, inside) in enumerate(lanes) if inside for line in _lane(lane, title, inside)),
        *(f"  {quote(head.id)} -> {quote(next_head.id)} [style=invis]" for head, next_head in pairwise(heads)),
        *(f"  {_edge(edge, cards)}" for edge in drawn),
        "}",
    ]
    return "\n".join(lines) + "\n"


def quote(text: str) -> str:
    """A double-quoted string without special characters: backslashes, quotes and newlines are escaped."""
    plain = printable(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + plain.replace("\n", "\\n") + '"'


# -- private


def _cards(nodes: Iterable[GraphNode]) -> list[_Card]:
    """Each node that is inside no other, followed by the nodes inside it."""
    cards = {node.id: [node] for node in nodes if node.within is None}
    for node in nodes:
        if node.within is not None:
            cards[node.within].append(node)
    return list(cards.values())


def _within_card(edge: GraphEdge, cards: list[_Card]) -> bool:
    return any({edge.source, edge.target} <= {node.id for node in card} for card in cards)


def _heading(graph: MissionGraph, drawn: list[GraphEdge]) -> str:
    """The title, the goal and a legend of the kinds of edges that are drawn."""
    kinds: list[EdgeKind] = [kind for kind in EDGES if any(edge.kind == kind for edge in drawn)]
    signs = [(EDGES[kind].light, f"→ {EDGES[kind].words}: {EDGES[kind].means}") for kind in kinds]
    if any(node.when for node in graph.nodes) or any(edge.when for edge in drawn):
        signs.append((MUTED, "dashed: only where its guard holds"))
    cells = [f'<td align="left">{_font(words, 9, colour)}</td>' for colour, words in signs]
    rows = [cells[at : at + _LEGEND_COLUMNS] for at in range(0, len(cells), _LEGEND_COLUMNS)]
    modes = " and ".join(f"{mode} (default)" if mode == graph.default else mode for mode in graph.modes)
    header_lines = (f"<b>{_text(graph.title or graph.mission)}</b>", _font(f"mode {modes} · {graph.goal}", 10))
    lines = [f'<td colspan="{_LEGEND_COLUMNS}" align="left">{line}</td>' for line in header_lines]
    return f'<table border="0">{"".join(f"<tr>{line}</tr>" for line in (*lines, *map("".join, rows)))}</table>'


def _lane(lane: int, title: str, cards: list[_Card]) -> Iterator[str]:
    yield f"  subgraph cluster_{lane} {{"
    yield f'    graph [label={quote(title)}, rank=same, style="rounded,filled", color="#e2e8f0", fillcolor="#f8fafc"]'
    for card in cards:
        rows = "".join(f"<tr>{_row(node, port)}</tr>" for port, node in enumerate(card))
        table = f'<table border="0" cellspacing="2" cellpadding="5">{rows}</table>'
        sentences = "\n\n".join(map(node_sentence, card))
        yield f"    {quote(card[0].id)} [label=<{table}>, tooltip={quote(sentences)}]"
    yield "  }"


def _row(node: GraphNode, port: int) -> str:
    fill, border = NODES[node.kind].light
    kind = f"{node.kind} · {guard_words(node.when)}" if node.when else node.kind
    label = f"<b>{_text(node.title)}</b>  {_font(kind, 8)}"
    if node.detail:
        label += f'<br align="left"/>{_font(node.detail, 9)}'
    dashed = ' style="dashed"' if node.when else ""
    look = f'bgcolor="{fill}" color="{border}" border="1"{dashed}'
    return f'<td port="{_port(port)}" align="left" balign="left" {look}>{label}</td>'


def _edge(edge: GraphEdge, cards: list[_Card]) -> str:
    style = EDGES[edge.kind]
    places = {node.id: (card[0], port) for card in cards for port, node in enumerate(card)}
    lanes = [lane_of(places[end][0]) for end in (edge.source, edge.target)]
    attributes = {"color": style.light, "fontcolor": style.light, "penwidth": f"{style.width}"}
    attributes |= {"tooltip": edge_sentence(edge), "xlabel": edge_words(edge), "class": edge.kind}
    attributes |= {"style": "dashed"} if edge.when else {}
    attributes |= {"dir": "both"} if edge.mutual else {"dir": "back"} if lanes[1] < lanes[0] else {}
    ends = (edge.target, edge.source) if lanes[1] < lanes[0] else (edge.source, edge.target)
    sides = (":e", ":w")
    if lanes[0] == lanes[1]:
        attributes["constraint"] = "false"
        sides = (":w", ":w") if lanes[0] in _ARCS_ON_LEFT else (":e", ":e")
    written = [
        f"{quote(places[end][0].id)}:{_port(places[end][1])}{side}" for end, side in zip(ends, sides, strict=True)
    ]
    return f"{written[0]} -> {written[1]} {_attributes(attributes)}"


def _port(row: int) -> str:
    return f"row{row}"


def _text(text: str) -> str:
    """Text for Graphviz's HTML-like labels."""
    return escape(printable(text)).replace("\n", " ")


def _font(text: str, size: int, colour: str = MUTED) -> str:
    return f'<font point-size="{size}" color="{colour}">{_text(text)}</font>' if text else ""


def _attributes(attributes: Mapping[str, str]) -> str:
    return "[" + ", ".join(f"{name}={quote(value)}" for name, value in attributes.items() if value) + "]"
