"""Pictures of the mission graph: golden text for Mermaid and DOT, geometry for SVG.

`pytest tests/mission --update` rewrites the golden files.
"""

from __future__ import annotations

import itertools
import random
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree as ET

import msgspec
import pytest

from lingjing.dsl.load import load_mission
from lingjing.mission.draw.cards import DETAIL, PAD, TAG, TITLE
from lingjing.mission.draw.dot import dot, quote
from lingjing.mission.draw.drawing import LINE, Box, Curve, draw, label_lines
from lingjing.mission.draw.lettering import fitted, width
from lingjing.mission.draw.mermaid import mermaid
from lingjing.mission.draw.placing import spread
from lingjing.mission.draw.reading import readable
from lingjing.mission.draw.styles import EDGES, LANES, NODES
from lingjing.mission.draw.svg import svg
from lingjing.mission.graph import Edge, EdgeKind, MissionGraph, Node, NodeKind, graph

HERE = Path(__file__).parent
SVG = "{http://www.w3.org/2000/svg}"
NASTY = 'a "quoted" <b>&amp; \\ back `tick` #35; {brace} [x] |pipe|\n第二行 \x00\x1b end'


@pytest.fixture(scope="module")
def ssr_graph() -> MissionGraph:
    return shipped_graph("ssr")


def random_graph(seed: int) -> MissionGraph:
    """A graph of up to 40 nodes of all kinds and up to 90 edges between any of them."""
    chance = random.Random(seed)
    nodes: list[Node] = []
    for number in range(chance.randint(1, 40)):
        kind: NodeKind = chance.choice(get_args(NodeKind))
        tops = [node.id for node in nodes if node.within is None]
        nodes.append(
            Node(
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
    edges: list[Edge] = []
    for number in range(chance.randint(0, 90)):
        source, target = chance.choice(nodes), chance.choice(nodes)
        sort: EdgeKind = chance.choice(get_args(EdgeKind))
        edges.append(
            Edge(
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
    return graph(load_mission(HERE.parents[1] / "scenarios" / f"{name}.ljs"))


MISSIONS = ("vdn", "bi", "idf", "upr", "ufr", "ssr", "cr", "ld", "cd")
GRAPHS = [*MISSIONS, *(pytest.param(seed, id=f"random-{seed}") for seed in range(25))]


@pytest.fixture(params=GRAPHS)
def shown(request: pytest.FixtureRequest) -> MissionGraph:
    """Each of the paper's missions as it is shipped, and graphs that no author would write."""
    made = request.param
    return readable(random_graph(made) if isinstance(made, int) else shipped_graph(made))


# -- text


@pytest.mark.parametrize(("suffix", "write"), [("mmd", mermaid), ("dot", dot)])
def test_ssr_is_the_golden_text(ssr_graph: MissionGraph, suffix: str, write, request: pytest.FixtureRequest) -> None:
    golden = HERE / "golden" / f"ssr.{suffix}"
    text = write(ssr_graph)
    if request.config.getoption("--update", default=False):
        golden.write_text(text, encoding="utf-8")
    assert text == golden.read_text(encoding="utf-8")


def test_every_kind_has_a_look_and_a_lane() -> None:
    assert set(EDGES) == set(get_args(EdgeKind))
    assert set(NODES) == set(get_args(NodeKind))
    laned = [kind for _, kinds in LANES for kind in kinds]
    assert sorted(laned) == sorted(get_args(NodeKind))


def test_mermaid_and_dot_say_every_node_and_edge(shown: MissionGraph) -> None:
    assert len(re.findall(r"^    \w+[\[({]", mermaid(shown), re.MULTILINE)) == len(shown.nodes)
    assert len(re.findall(r'\|".*"\| \w+$', mermaid(shown), re.MULTILINE)) == len(shown.edges)
    assert dot(shown).count(" -> ") == len(shown.edges)
    for node in shown.nodes:
        assert f"\n    {quote(node.id)} [label=" in dot(shown)


def test_dot_draws_backwards_edges_from_their_target(ssr_graph: MissionGraph) -> None:
    line = next(line for line in dot(ssr_graph).splitlines() if '"rule:rescued"' in line and "adjudicates" in line)
    assert line.strip().startswith('"target:victim" -> "rule:rescued"')
    assert 'dir="back"' in line


def nasty() -> MissionGraph:
    """A graph whose every text is hostile."""
    base = random_graph(3)
    nodes = tuple(msgspec.structs.replace(n, title=NASTY, detail=NASTY, text=NASTY, when=NASTY) for n in base.nodes)
    edges = tuple(msgspec.structs.replace(e, label=NASTY, when=NASTY) for e in base.edges)
    return msgspec.structs.replace(base, title=NASTY, goal=NASTY, mission=NASTY, nodes=nodes, edges=edges)


def test_mermaid_escapes() -> None:
    head, _, body = mermaid(nasty()).partition("flowchart LR\n")
    assert len(head.splitlines()) == 3
    for line in body.splitlines():
        if '"' in line:
            label = line[line.index('"') + 1 : line.rindex('"')]
            assert not set('"<>`\\&') & set(label.replace("<br/>", "").replace("\\", ""))
            assert re.fullmatch(r"[\w (\[{/<.=>|-]*", line[: line.index('"')])
            assert re.fullmatch(r"[\w )\]}/|]*", line[line.rindex('"') + 1 :])


def test_mermaid_names_never_clash_nor_leave_ascii() -> None:
    base = random_graph(1).nodes[0]
    names = ("a_b", "a b", "甲", "乙", "a.b", "end")
    nodes = tuple(msgspec.structs.replace(base, id=f"rule:{name}", kind="rule", within=None) for name in names)
    text = mermaid(MissionGraph(mission="x", title="", goal="", modes=(), default="", nodes=nodes, edges=()))
    found = re.findall(r"^    (\w+)\[/", text, re.MULTILINE)
    assert len(set(found)) == len(names)
    assert "".join(found).isascii()


def test_dot_strings_close_where_they_should() -> None:
    string = r'"(?:[^"\\\n]|\\.)*"'
    for line in dot(nasty()).splitlines():
        assert '"' not in re.sub(string, "", line)
    assert quote('a"b\\n\n') == '"a\\"b\\\\n\\n"'


# -- SVG


@pytest.mark.parametrize("make", [nasty, lambda: random_graph(7)], ids=["nasty", "random"])
def test_svg_is_well_formed_and_says_everything(make) -> None:
    shown = readable(make())
    root = ET.fromstring(svg(shown))
    assert root.find(f"{SVG}title") is not None
    assert root.find(f"{SVG}desc") is not None
    nodes = [g for g in root.iter(f"{SVG}g") if g.get("class") == "node"]
    assert sorted(g.get("id", "") for g in nodes) == sorted(node.id for node in shown.nodes)
    lines = [
        g for g in root.iter(f"{SVG}g") if g.get("class", "").startswith("edge") and g.find(f"{SVG}title") is not None
    ]
    assert len(lines) == len(draw(shown).curves)
    assert all((g.findtext(f"{SVG}title") or "").strip() for g in (*nodes, *lines))


def test_svg_needs_nothing_from_outside(ssr_graph: MissionGraph) -> None:
    text = svg(ssr_graph)
    assert "prefers-color-scheme:dark" in text
    assert not re.search(r"<script|<image|href|@import|url\((?!#)|<foreignObject", text)
    assert text == svg(ssr_graph)


def test_every_marker_used_is_defined(shown: MissionGraph) -> None:
    text = svg(shown)
    defined = set(re.findall(r'<marker id="([\w-]+)"', text))
    used = set(re.findall(r"url\(#([\w-]+)\)", text))
    assert used <= defined


def test_what_is_not_a_line_is_a_box_within_a_box(shown: MissionGraph) -> None:
    """Every edge is a curve, unless it joins a node to another of the same card."""
    drawn = [curve.link.edge.id for curve in draw(shown).curves]
    parent = {node.id: node.within or node.id for node in shown.nodes}
    nested = [e.id for e in shown.edges if parent[e.source] == parent[e.target] and e.source != e.target]
    assert sorted(drawn + nested) == sorted(edge.id for edge in shown.edges)


def test_boxes_do_not_overlap(shown: MissionGraph) -> None:
    drawing = draw(shown)
    for one, other in itertools.combinations(drawing.boxes, 2):
        if parent_of(one) == other.row.node.id or parent_of(other) == one.row.node.id:
            continue
        assert apart(one, other), (one.row.node.id, other.row.node.id)


def test_inner_boxes_lie_within_their_card(shown: MissionGraph) -> None:
    boxes = {box.row.node.id: box for box in draw(shown).boxes}
    for box in boxes.values():
        if box.inner:
            outer = boxes[str(box.row.node.within)]
            assert outer.x < box.x
            assert box.x + box.width < outer.x + outer.width
            assert outer.y < box.y
            assert box.y + box.height < outer.y + outer.height


def test_every_edge_ends_on_the_sides_of_its_nodes(shown: MissionGraph) -> None:
    drawing = draw(shown)
    boxes = {box.row.node.id: box for box in drawing.boxes}
    for curve in drawing.curves:
        edge = curve.link.edge
        assert on_side(curve.start, boxes[edge.source]), edge.id
        assert on_side(curve.end, boxes[edge.target]), edge.id


def test_no_two_edges_end_on_one_spot(shown: MissionGraph) -> None:
    ends = [end for curve in draw(shown).curves for end in (curve.start, curve.end)]
    for one, other in itertools.combinations(ends, 2):
        assert abs(one[0] - other[0]) + abs(one[1] - other[1]) > 3.0


def test_no_edge_runs_behind_a_card_of_others(shown: MissionGraph) -> None:
    drawing = draw(shown)
    cards = [box for box in drawing.boxes if not box.inner]
    for curve in drawing.curves:
        edge = curve.link.edge
        own = {within for n in shown.nodes if n.id in (edge.source, edge.target) for within in (n.within or n.id,)}
        for x, y in points(curve):
            hit = [box.row.node.id for box in cards if inside(x, y, box) and box.row.node.id not in own]
            assert not hit, (edge.id, hit)


def test_everything_lies_within_the_page(shown: MissionGraph) -> None:
    drawing = draw(shown)
    for x, y in (point for curve in drawing.curves for point in points(curve)):
        assert 0 <= x <= drawing.width
        assert 0 <= y <= drawing.height
    for box in drawing.boxes:
        assert box.x >= 0
        assert box.x + box.width <= drawing.width
        assert box.y + box.height <= drawing.height
    for label in drawing.labels:
        room = max(width(line, 11.0) for line in label_lines(label.link))
        left = {"end": label.x - room, "middle": label.x - room / 2, "start": label.x}[label.anchor]
        assert left >= 0
        assert left + room <= drawing.width


def test_words_fit_their_boxes(shown: MissionGraph) -> None:
    for box in draw(shown).boxes:
        room = box.width - 2 * PAD
        assert width(box.row.title, TITLE, bold=True) <= room
        assert width(box.row.detail, DETAIL) <= room
        assert width(box.row.title, TITLE, bold=True) + width(box.row.tag, TAG) <= room


def test_labels_of_one_column_stand_apart(ssr_graph: MissionGraph) -> None:
    drawing = draw(readable(ssr_graph))
    assert len(drawing.labels) > 5
    spots = [(label.x, label.y, LINE * len(label_lines(label.link))) for label in drawing.labels]
    for (ax, ay, ah), (bx, by, bh) in itertools.combinations(spots, 2):
        if abs(ax - bx) < 40:
            assert abs(ay - by) >= (ah + bh) / 2


def test_stages_and_rules_read_from_top_to_bottom(ssr_graph: MissionGraph) -> None:
    top = {box.row.node.id: box.y for box in draw(readable(ssr_graph)).boxes}
    stages = [top[f"stage:{name}"] for name in ("detect", "locate", "handoff", "execute")]
    rules = [top[name] for name in ("rule:matched", "rule:reported", "event:rescue", "rule:rescued")]
    assert stages == sorted(stages)
    assert rules == sorted(rules)


def test_what_is_joined_to_nothing_stands_close_to_the_rest() -> None:
    """The tied nodes come last, then in the middle: neither may leave the others far behind."""
    loose = [Node(id=f"rule:r{n}", kind="rule", name=f"r{n}", title=f"r{n}") for n in range(5)]
    stage = Node(id="stage:s", kind="stage", name="s", title="s")
    for tied in (0, 2, 4):
        edge = Edge(id="e", kind="requires", source="stage:s", target=f"rule:r{tied}")
        shown = MissionGraph(
            mission="x", title="", goal="", modes=(), default="", nodes=(*loose, stage), edges=(edge,)
        )  # fmt: skip
        tops = [box.y for box in draw(shown).boxes if box.row.node.kind == "rule"]
        assert all(0 < below - above < 80 for above, below in itertools.pairwise(tops))
        assert draw(shown).height < 500


def test_a_message_to_all_is_said_on_the_node(ssr_graph: MissionGraph) -> None:
    shown = readable(ssr_graph)
    assert shown.node("channel:detection").detail == "report, to all"
    assert not list(shown.out_of("channel:detection", "speaks_to"))
    assert list(shown.into("channel:detection", "speaks_to"))
    some = msgspec.structs.replace(
        ssr_graph, edges=tuple(e for e in ssr_graph.edges if e.id != "speaks_to channel:detection role:rescuer")
    )
    assert len(list(readable(some).out_of("channel:detection", "speaks_to"))) == 2


def test_spread_is_the_nearest_order() -> None:
    assert spread([1.0, 5.0, 3.0, 9.0], [1.0] * 4) == [1.0, 4.0, 4.0, 9.0]
    assert spread([4.0, 1.0], [1.0, 3.0]) == [1.75, 1.75]
    assert spread([], []) == []


def test_text_is_cut_to_its_room() -> None:
    assert fitted("short", 12, 100) == "short"
    cut = fitted("a name far too long for its card", 12, 80)
    assert cut.endswith("…")
    assert width(cut, 12) <= 80
    assert width("搜救区域", 12) > width("area", 12)


# -- geometry


def parent_of(box: Box) -> str | None:
    return box.row.node.within


def apart(one: Box, other: Box) -> bool:
    return (
        one.x + one.width <= other.x
        or other.x + other.width <= one.x
        or one.y + one.height <= other.y
        or other.y + other.height <= one.y
    )


def inside(x: float, y: float, box: Box) -> bool:
    return box.x < x < box.x + box.width and box.y < y < box.y + box.height


def on_side(point: tuple[float, float], box: Box) -> bool:
    x, y = point
    return min(abs(x - box.x), abs(x - box.x - box.width)) < 1e-6 and box.y <= y <= box.y + box.height


def points(curve: Curve) -> Iterator[tuple[float, float]]:
    """25 points of each piece."""
    x, y = curve.start
    for (ax, ay), (bx, by), (cx, cy) in curve.pieces:
        for step in range(25):
            t = step / 24
            u = 1 - t
            a, b, c, d = u**3, 3 * u * u * t, 3 * u * t * t, t**3
            yield a * x + b * ax + c * bx + d * cx, a * y + b * ay + c * by + d * cy
        x, y = cx, cy
