"""Drawings of the mission graph: golden text for Mermaid and DOT, and the SVG that Graphviz renders.

`pytest tests/mission --update` rewrites the golden files.
"""

from __future__ import annotations

import random
import re
from functools import lru_cache
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree as ET

import msgspec
import pytest

import lingjing
from lingjing.errors import InfrastructureError
from lingjing.mission.draw.dot import dot, quote
from lingjing.mission.draw.mermaid import mermaid
from lingjing.mission.draw.sentences import printable, readable
from lingjing.mission.draw.styles import EDGES, LANES, NODES
from lingjing.mission.draw.svg import svg
from lingjing.mission.graph import EdgeKind, GraphEdge, GraphNode, MissionGraph, NodeKind, graph

HERE = Path(__file__).parent
SVG = "{http://www.w3.org/2000/svg}"
NASTY = 'a "quoted" <b>&amp; \\ back `tick` #35; {brace} [x] |pipe|\n第二行 \x00\x1b end'


@pytest.fixture(scope="module")
def ssr_graph() -> MissionGraph:
    return shipped_graph("ssr")


def random_graph(seed: int) -> MissionGraph:
    """A graph of up to 40 nodes of all kinds and up to 90 edges between any of them."""
    chance = random.Random(seed)
    nodes: list[GraphNode] = []
    for number in range(chance.randint(1, 40)):
        kind: NodeKind = chance.choice(get_args(NodeKind))
        tops = [node.id for node in nodes if node.within is None]
        nodes.append(
            GraphNode(
                id=f"{kind}:n{number}",
                kind=kind,
                name=f"n{number}",
                title="n" * chance.randint(1, 40),
                detail="d" * chance.choice((0, 9, 60)),
                count=chance.choice((None, 3)),
                within=chance.choice(tops) if tops and chance.random() < 0.3 else None,
                when=chance.choice(("", "mode == star")),
                modes=("star", "broadcast"),
            )
        )
    edges: list[GraphEdge] = []
    for number in range(chance.randint(0, 90)):
        source, target = chance.choice(nodes), chance.choice(nodes)
        sort: EdgeKind = chance.choice(get_args(EdgeKind))
        edges.append(
            GraphEdge(
                id=str(number),
                kind=sort,
                source=source.id,
                target=target.id,
                label=chance.choice(("", "over")),
                mutual=chance.random() < 0.2,
                when=chance.choice(("", "mode == star")),
                modes=("star",),
            )
        )
    return MissionGraph(
        mission="random", title="", goal="", modes=("star",), default="star", nodes=tuple(nodes), edges=tuple(edges)
    )


@lru_cache
def shipped_graph(name: str) -> MissionGraph:
    return graph(lingjing.compile(HERE.parents[1] / "scenarios" / f"{name}.ljs"))


MISSIONS = ("vdn", "bi", "idf", "upr", "ufr", "ssr", "cr", "ld", "cd")
GRAPHS = [*MISSIONS, *(pytest.param(seed, id=f"random-{seed}") for seed in range(25))]


def within_card(edge: GraphEdge, shown: MissionGraph) -> bool:
    """True if an edge joins two nodes of one card, which shows it without a line."""
    card = {node.id: node.within or node.id for node in shown.nodes}
    return card[edge.source] == card[edge.target] and edge.source != edge.target


@pytest.fixture(params=GRAPHS)
def shown(request: pytest.FixtureRequest) -> MissionGraph:
    """Each of the paper's missions as it is shipped, and graphs that no author would write."""
    made = request.param
    return readable(random_graph(made) if isinstance(made, int) else shipped_graph(made))


# -- text


@pytest.mark.parametrize(("suffix", "write"), [("mmd", mermaid), ("dot", dot)])
def test_ssr_matches_the_golden_text(
    ssr_graph: MissionGraph, suffix: str, write, request: pytest.FixtureRequest
) -> None:
    golden = HERE / "golden" / f"ssr.{suffix}"
    text = write(ssr_graph)
    if request.config.getoption("--update", default=False):
        golden.write_text(text, encoding="utf-8")
    assert text == golden.read_text(encoding="utf-8")


def test_every_kind_has_a_style_and_every_node_kind_has_a_lane() -> None:
    assert set(EDGES) == set(get_args(EdgeKind))
    assert set(NODES) == set(get_args(NodeKind))
    laned = [kind for _, kinds in LANES for kind in kinds]
    assert sorted(laned) == sorted(get_args(NodeKind))


def test_mermaid_and_dot_contain_every_node_and_edge(shown: MissionGraph) -> None:
    assert len(re.findall(r"^    \w+[\[({]", mermaid(shown), re.MULTILINE)) == len(shown.nodes)
    assert len(re.findall(r'\|".*"\| \w+$', mermaid(shown), re.MULTILINE)) == len(shown.edges)
    written = dot(shown).count(" -> ") - dot(shown).count("[style=invis]")
    assert written == sum(not within_card(edge, shown) for edge in shown.edges)
    assert dot(shown).count('<td port="') == len(shown.nodes)
    for node in shown.nodes:
        assert (f"\n    {quote(node.id)} [label=" in dot(shown)) == (node.within is None)


def test_dot_draws_backwards_edges_from_their_target(ssr_graph: MissionGraph) -> None:
    line = next(line for line in dot(ssr_graph).splitlines() if '"rule:rescued"' in line and "adjudicates" in line)
    assert line.strip().startswith('"target:victim":row0:e -> "rule:rescued":row0:w')
    assert 'dir="back"' in line


def nasty() -> MissionGraph:
    """A graph with hostile texts in all its fields."""
    base = random_graph(3)
    nodes = tuple(msgspec.structs.replace(n, title=NASTY, detail=NASTY, text=NASTY, when=NASTY) for n in base.nodes)
    edges = tuple(msgspec.structs.replace(e, label=NASTY, when=NASTY) for e in base.edges)
    return msgspec.structs.replace(base, title=NASTY, goal=NASTY, mission=NASTY, nodes=nodes, edges=edges)


def test_mermaid_escapes_hostile_text() -> None:
    head, _, body = mermaid(nasty()).partition("flowchart LR\n")
    assert len(head.splitlines()) == 3
    for line in body.splitlines():
        if '"' in line:
            label = line[line.index('"') + 1 : line.rindex('"')]
            assert not set('"<>`\\&') & set(label.replace("<br/>", "").replace("\\", ""))
            assert re.fullmatch(r"[\w (\[{/<.=>|-]*", line[: line.index('"')])
            assert re.fullmatch(r"[\w )\]}/|]*", line[line.rindex('"') + 1 :])


def test_mermaid_names_are_unique_and_ascii() -> None:
    base = random_graph(1).nodes[0]
    names = ("a_b", "a b", "甲", "乙", "a.b", "end")
    nodes = tuple(msgspec.structs.replace(base, id=f"rule:{name}", kind="rule", within=None) for name in names)
    text = mermaid(MissionGraph(mission="x", title="", goal="", modes=(), default="", nodes=nodes, edges=()))
    written = re.findall(r"^    (\w+)\[/", text, re.MULTILINE)
    assert len(set(written)) == len(names)
    assert "".join(written).isascii()


def test_dot_quotes_hostile_text_correctly() -> None:
    string = r'"(?:[^"\\\n]|\\.)*"'
    for line in dot(nasty()).splitlines():
        assert '"' not in re.sub(string, "", re.sub("<table.*</table>", "", line))
    assert quote('a"b\\n\n') == '"a\\"b\\\\n\\n"'


# -- SVG


@pytest.mark.parametrize("make", [nasty, lambda: random_graph(7)], ids=["nasty", "random"])
def test_svg_is_well_formed_and_contains_every_node_and_edge(make) -> None:
    shown = readable(make())
    root = ET.fromstring(svg(shown))
    groups = [g.get("class", "") for g in root.iter(f"{SVG}g")]
    drawn = [edge for edge in shown.edges if not within_card(edge, shown)]
    assert groups.count("node") == sum(node.within is None for node in shown.nodes)
    assert sorted(name for name in groups if name.startswith("edge ")) == sorted(f"edge {edge.kind}" for edge in drawn)
    content = " ".join(text for text in root.itertext())
    assert all(" ".join(printable(node.title).split()) in " ".join(content.split()) for node in shown.nodes)


def test_svg_refers_to_no_external_resource(ssr_graph: MissionGraph) -> None:
    text = svg(ssr_graph)
    assert "prefers-color-scheme: dark" in text
    assert not re.search(r"<script|<image|(?<!xlink:)href|@import|url\(|<foreignObject|<!DOCTYPE", text)
    assert text == svg(ssr_graph)


def test_every_colour_of_the_light_theme_has_a_dark_counterpart(ssr_graph: MissionGraph) -> None:
    style, _, drawing = svg(ssr_graph).partition("</style>")
    used = set(re.findall(r'(?:fill|stroke)="(#[0-9a-f]{6}|white)"', drawing))
    assert len(used) > 10
    assert {colour for colour in used if f'="{colour}"]' not in style} == set()


def test_lanes_are_ordered_from_left_to_right(ssr_graph: MissionGraph) -> None:
    root = ET.fromstring(svg(ssr_graph))
    lefts = []
    for place, _ in enumerate(LANES):
        lane = next(g for g in root.iter(f"{SVG}g") if g.findtext(f"{SVG}title") == f"cluster_{place}")
        outline = lane.find(f"{SVG}path")
        assert outline is not None
        lefts.append(min(float(x) for x in re.findall(r"(-?[\d.]+),", outline.get("d", ""))))
    assert lefts == sorted(lefts)


def test_without_graphviz_the_error_names_the_package_to_install(
    ssr_graph: MissionGraph, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    with pytest.raises(InfrastructureError) as caught:
        svg(ssr_graph)
    assert "pip install graphviz-pure" in str(caught.value.hint)


def test_a_message_to_all_is_stated_on_the_node_without_edges(ssr_graph: MissionGraph) -> None:
    shown = readable(ssr_graph)
    assert shown.node("channel:detection").detail == "report, to all"
    assert not list(shown.out_of("channel:detection", "speaks_to"))
    assert any(edge.kind == "speaks_to" and edge.target == "channel:detection" for edge in shown.edges)
    some = msgspec.structs.replace(
        ssr_graph, edges=tuple(e for e in ssr_graph.edges if e.id != "speaks_to channel:detection role:rescuer")
    )
    assert len(list(readable(some).out_of("channel:detection", "speaks_to"))) == 2
