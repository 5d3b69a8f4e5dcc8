"""The graph as an SVG document that stands alone: one file, no fonts, no scripts, for light and dark pages.

Every box and line carries a `<title>`, which browsers show to the pointer and read to those who cannot see it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lingjing.mission.draw.cards import DETAIL, PAD, STACK, TAG, TITLE
from lingjing.mission.draw.drawing import LABEL, LINE, MARGIN, Band, Box, Curve, Drawing, Label, draw, label_lines
from lingjing.mission.draw.lettering import fitted, width
from lingjing.mission.draw.reading import edge_sentence, node_sentence, printable, readable
from lingjing.mission.draw.styles import EDGES, NODES
from lingjing.mission.graph.types import EdgeKind, MissionGraph

_HEAD, _LEGEND_LINE, _SAMPLE = 62.0, 22.0, 34.0
_DASHES = "6 4"
_PLAIN: EdgeKind = "requires"
"""The kind whose line stands for any in the legend."""
_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#39;"}

_LIGHT = {
    ".page": "fill:#ffffff",
    ".band": "fill:#f8fafc;stroke:#e2e8f0",
    ".title": "fill:#0f172a",
    ".muted": "fill:#5b6878",
    ".halo": "stroke:#ffffff",
}
_DARK = {
    ".page": "fill:#0d1117",
    ".band": "fill:#141a23;stroke:#242c38",
    ".title": "fill:#e6edf3",
    ".muted": "fill:#9aa7b6",
    ".halo": "stroke:#0d1117",
}


def svg(graph: MissionGraph) -> str:
    """The document's text; the same graph gives the same text."""
    shown = readable(graph)
    drawing = draw(shown)
    kinds = _kinds(drawing)
    page = max(drawing.width, 720.0)
    legend = list(_legend(kinds, shown, page))
    height = _HEAD + drawing.height + len(legend) * _LEGEND_LINE + 2 * MARGIN
    lines = [
        _opening(page, height),
        f'<title id="title">{escape(f"Mission graph: {shown.title or shown.mission}")}</title>',
        f'<desc id="desc">{escape(_description(shown))}</desc>',
        f"<style>{_style()}</style>",
        "<defs>",
        *_markers(dict.fromkeys((*kinds, _PLAIN))),
        "</defs>",
        f'<rect class="page" width="{_n(page)}" height="{_n(height)}"/>',
        *_heading(shown, page),
        f'<g transform="translate(0 {_n(_HEAD)})">',
        *(line for band in drawing.bands for line in _band(band, drawing)),
        *(line for box in drawing.boxes if not box.inner for line in _box(box)),
        *(_curve(curve) for curve in drawing.curves if _from_cards(curve)),
        *(line for box in drawing.boxes if box.inner for line in _box(box)),
        *(_curve(curve) for curve in drawing.curves if not _from_cards(curve)),
        *(line for label in drawing.labels for line in _label(label)),
        "</g>",
        f'<g class="legend" transform="translate({_n(MARGIN)} {_n(_HEAD + drawing.height + MARGIN)})">',
        *(item for place, row in enumerate(legend) for item in _legend_row(place, row)),
        "</g>",
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def escape(text: str) -> str:
    """Text for between tags or quotes."""
    return "".join(_ESCAPES.get(letter, letter) for letter in printable(text))


# -- private


def _opening(page: float, height: float) -> str:
    size = f'width="{_n(page)}" height="{_n(height)}" viewBox="0 0 {_n(page)} {_n(height)}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-labelledby="title desc" {size}>'


def _from_cards(curve: Curve) -> bool:
    return not (curve.link.near.inner or curve.link.far.inner)


def _kinds(drawing: Drawing) -> tuple[EdgeKind, ...]:
    """The kinds of edges that are drawn as lines, in the order of the legend."""
    found = {curve.link.edge.kind for curve in drawing.curves}
    return tuple(kind for kind in EDGES if kind in found)


def _style() -> str:
    light = [*_rules(_LIGHT)]
    light += [f".n-{kind}{{fill:{look.light[0]};stroke:{look.light[1]}}}" for kind, look in NODES.items()]
    light += [f".e-{kind}{{stroke:{s.light};stroke-width:{s.width}}}" for kind, s in EDGES.items()]
    light += [f".f-{kind}{{fill:{s.light}}}" for kind, s in EDGES.items()]
    dark = [*_rules(_DARK)]
    dark += [f".n-{kind}{{fill:{look.dark[0]};stroke:{look.dark[1]}}}" for kind, look in NODES.items()]
    dark += [f".e-{kind}{{stroke:{s.dark}}}" for kind, s in EDGES.items()]
    dark += [f".f-{kind}{{fill:{s.dark}}}" for kind, s in EDGES.items()]
    fixed = (
        'text{font-family:system-ui,-apple-system,"Segoe UI",Helvetica,Arial,"DejaVu Sans",sans-serif}',
        ".edge path{fill:none;stroke-linecap:round}.edge.guarded path{stroke-dasharray:" + _DASHES + "}",
        ".halo{stroke-width:4px;stroke-linejoin:round;paint-order:stroke}",
        ".edge:hover path{stroke-width:4}",
    )
    return "".join((*fixed, *light)) + "@media (prefers-color-scheme:dark){" + "".join(dark) + "}"


def _rules(looks: dict[str, str]) -> Iterator[str]:
    return (f"{selector}{{{look}}}" for selector, look in looks.items())


def _markers(kinds: Iterable[EdgeKind]) -> Iterator[str]:
    for kind in kinds:
        yield (
            f'<marker id="to-{kind}" viewBox="0 0 10 10" refX="9.5" refY="5" markerUnits="userSpaceOnUse"'
            ' markerWidth="9" markerHeight="9" orient="auto-start-reverse">'
            f'<path class="f-{kind}" d="M0 0.8 10 5 0 9.2 2.4 5Z"/></marker>'
        )


def _heading(graph: MissionGraph, page: float) -> Iterator[str]:
    room = page - 2 * MARGIN
    yield _text(MARGIN, 32, fitted(graph.title or graph.mission, 20, room, bold=True), 20, "title", bold=True)
    modes = " and ".join(f"{mode} (default)" if mode == graph.default else mode for mode in graph.modes)
    yield _text(MARGIN, 51, fitted(f"{graph.mission} · mode {modes} · {graph.goal}", 12, room), 12, "muted")


def _band(band: Band, drawing: Drawing) -> Iterator[str]:
    yield (
        f'<rect class="band" x="{_n(band.x)}" y="0" width="{_n(band.width)}" height="{_n(drawing.height)}" rx="10"/>'
    )
    yield _text(band.x + band.width / 2, 23, fitted(band.title, 12, band.width, bold=True), 12, "muted", "middle", True)


def _box(box: Box) -> Iterator[str]:
    node = box.row.node
    yield f'<g class="node" id="{escape(node.id)}"><title>{escape(node_sentence(node))}</title>'
    for sheet in (2, 1) if box.row.stacked else ():
        step = sheet * STACK / 2
        yield _rect(box, step, step)
    yield _rect(box, 0, 0)
    x, y = box.x + PAD, box.y + PAD + TITLE - 4
    yield _text(x, y, box.row.title, TITLE, "title", bold=True)
    yield _text(box.x + box.width - PAD, y - 0.5, box.row.tag, TAG, "muted", "end")
    if box.row.detail:
        yield _text(x, y + DETAIL + 5, box.row.detail, DETAIL, "muted")
    yield "</g>"


def _rect(box: Box, right: float, down: float) -> str:
    guarded = f' stroke-dasharray="{_DASHES}"' if box.row.node.when else ""
    return (
        f'<rect class="n-{box.row.node.kind}" x="{_n(box.x + right)}" y="{_n(box.y + down)}" width="{_n(box.width)}"'
        f' height="{_n(box.height)}" rx="{5 if box.inner else 8}"{guarded}/>'
    )


def _curve(curve: Curve) -> str:
    edge = curve.link.edge
    line = f"M{_xy(curve.start)}" + "".join(f"C{_xy(a)} {_xy(b)} {_xy(c)}" for a, b, c in curve.pieces)
    both = f' marker-start="url(#to-{edge.kind})"' if edge.mutual else ""
    return (
        f'<g class="edge{" guarded" if edge.when else ""}"><title>{escape(edge_sentence(edge))}</title>'
        f'<path class="e-{edge.kind}" d="{line}" marker-end="url(#to-{edge.kind})"{both}/></g>'
    )


def _label(label: Label) -> Iterator[str]:
    lines = label_lines(label.link)
    first = label.y - LINE * (len(lines) - 1) / 2 + LABEL * 0.35
    for place, words in enumerate(lines):
        name = len(lines) > 1 and place == 0
        look = f"halo f-{label.link.edge.kind}"
        yield _text(label.x, first + LINE * place, words, LABEL, look, label.anchor, name)


def _legend(kinds: tuple[EdgeKind, ...], graph: MissionGraph, page: float) -> Iterator[list[tuple[float, str, str]]]:
    """Rows of (x, kind or sign, words), as many to a row as fit."""
    items: list[tuple[str, str]] = [(kind, f"{EDGES[kind].words}: {EDGES[kind].means}") for kind in kinds]
    if any(node.when for node in graph.nodes) or any(edge.when for edge in graph.edges):
        items.append(("guarded", "dashed: only where its guard holds"))
    if any(node.kind == "fact" for node in graph.nodes):
        items.append(("fact", "hidden: no policy may read it"))
    if any(node.count is not None for node in graph.nodes):
        items.append(("stack", "a group of several"))
    widest = max((width(words, LABEL) for _, words in items), default=0.0) + _SAMPLE + 26
    columns = max(1, int((page - 2 * MARGIN) // widest))
    for first in range(0, len(items), columns):
        yield [(place * widest, *item) for place, item in enumerate(items[first : first + columns])]


def _legend_row(place: int, row: list[tuple[float, str, str]]) -> Iterator[str]:
    y = place * _LEGEND_LINE
    for x, sign, words in row:
        yield from _sample(x, y, sign)
        yield _text(x + _SAMPLE + 8, y + 4, words, LABEL, "muted")


def _sample(x: float, y: float, sign: str) -> Iterator[str]:
    if sign == "fact":
        yield f'<rect class="n-fact" x="{_n(x)}" y="{_n(y - 7)}" width="{_n(_SAMPLE)}" height="14" rx="4"/>'
    elif sign == "stack":
        for step in (4, 2, 0):
            yield f'<rect class="n-asset" x="{_n(x + step)}" y="{_n(y - 8 + step)}" width="28" height="11" rx="3"/>'
    else:
        guarded, kind = (" guarded", _PLAIN) if sign == "guarded" else ("", sign)
        yield (
            f'<g class="edge{guarded}"><path class="e-{kind}" d="M{_n(x)} {_n(y)}H{_n(x + _SAMPLE)}"'
            f' marker-end="url(#to-{kind})"/></g>'
        )


def _description(graph: MissionGraph) -> str:
    return f"{graph.goal} {len(graph.nodes)} nodes, {len(graph.edges)} edges."


def _text(x: float, y: float, words: str, size: float, look: str, anchor: str = "start", bold: bool = False) -> str:
    weight = ' font-weight="600"' if bold else ""
    stand = f' text-anchor="{anchor}"' if anchor != "start" else ""
    return f'<text class="{look}" x="{_n(x)}" y="{_n(y)}" font-size="{_n(size)}"{stand}{weight}>{escape(words)}</text>'


def _xy(point: tuple[float, float]) -> str:
    return f"{_n(point[0])} {_n(point[1])}"


def _n(value: float) -> str:
    """A coordinate to a tenth of a pixel, without a needless `.0` or a negative zero."""
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text
