"""The exchange graph as GraphML, the XML format of graphs that networkx, igraph, Gephi and yEd read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET

import msgspec

from lingjing.mission.draw.sentences import printable
from lingjing.mission.graph.exchange import ExchangeEdge, ExchangeGraph, ExchangeNode

_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
"""The XML namespace of the GraphML standard; nothing is loaded from it."""

_ENDS = ("id", "source", "target", "key")
"""Fields that GraphML writes as attributes of its own."""

_TYPES = {"bool": "boolean", "int": "double", "float": "double", "str": "string"}
"""Types of attributes. Every number is a `double`, because one attribute has one type in the whole document."""


def graphml(graph: ExchangeGraph) -> str:
    """The document's text, ending in a newline. Characters that XML cannot hold become spaces."""
    root = ET.Element("graphml", {"xmlns": _NAMESPACE})
    written = ET.Element("graph", {"id": printable(graph.graph["mission"]), "edgedefault": "directed"})
    keys = _Keys(root)
    keys.data(written, "graph", graph.graph)
    for node in graph.nodes:
        keys.data(ET.SubElement(written, "node", {"id": printable(node.id)}), "node", _attributes(node))
    for edge in graph.edges:
        ends = {"id": edge.key, "source": edge.source, "target": edge.target}
        attributes = {name: printable(text) for name, text in ends.items()}
        keys.data(ET.SubElement(written, "edge", attributes), "edge", _attributes(edge))
    root.append(written)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


# -- private


class _Keys:
    """The declarations of attributes, each written into the root when it is first used."""

    def __init__(self, root: ET.Element) -> None:
        self._root = root
        self._ids: dict[tuple[str, str], str] = {}

    def data(self, element: ET.Element, kind: str, attributes: Mapping[str, object]) -> None:
        """Write attributes of a graph, a node or an edge."""
        for name, value in attributes.items():
            data = ET.SubElement(element, "data", {"key": self._key(kind, name, value)})
            data.text = str(value).lower() if isinstance(value, bool) else printable(str(value))

    def _key(self, kind: str, name: str, value: object) -> str:
        identity = self._ids.get((kind, name))
        if identity is None:
            identity = self._ids[kind, name] = f"{kind}.{name}"
            declared = {"id": identity, "for": kind, "attr.name": name, "attr.type": _TYPES[type(value).__name__]}
            ET.SubElement(self._root, "key", declared)
        return identity


def _attributes(part: ExchangeNode | ExchangeEdge) -> dict[str, object]:
    """The fields of a node or an edge that differ from their defaults."""
    return dict(_set_fields(part, msgspec.structs.fields(part)))


def _set_fields(
    part: ExchangeNode | ExchangeEdge, fields: Iterable[msgspec.structs.FieldInfo]
) -> Iterable[tuple[str, object]]:
    for field in fields:
        value = getattr(part, field.name)
        if field.name not in _ENDS and value != field.default:
            yield field.name, value
