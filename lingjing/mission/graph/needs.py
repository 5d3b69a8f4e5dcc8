"""The nodes that a condition reads, from the survey of conditions."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission.conditions.quantities import Quantity
from lingjing.mission.conditions.survey import Condition
from lingjing.mission.graph.builder import GraphBuilder

DECIDED = ("rule:", "event:", "inspection:", "stage:")
"""Prefixes of ids of nodes that become true. Such a node unlocks a waiting command; any other one is required by it."""


def needs(condition: Condition, draft: GraphBuilder) -> tuple[str, ...]:
    """The nodes that the text of a condition names, once each, in order."""
    named = (node for leaf in condition.own for quantity in leaf.quantities for node in _named(quantity, draft))
    return tuple(dict.fromkeys(node for node in named if node))


# -- private


def _named(quantity: Quantity, draft: GraphBuilder) -> Iterator[str | None]:
    match quantity.kind:
        case "rule":
            yield draft.find(quantity.name, "rule")
        case "event":
            yield draft.find(quantity.name, "event")
        case "region":
            yield draft.find(quantity.name, "region", "grid")
        case "route" | "counter":
            yield draft.find(quantity.owner, "inspection", "resource")
        case "assignment":
            yield from (draft.find(cause.name, "channel") for cause in quantity.causes if cause.kind == "message")
        case _ if not quantity.indirect:
            yield draft.find(quantity.owner, "channel", "target", "asset")
