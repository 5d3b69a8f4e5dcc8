"""Typed signatures of the built-in functions, distributions and sensors of the language.

The checker reads this table; `lingjing.mission.evaluate` and the kernel's adjudicator give the functions their
meaning. A type is a kind with, for quantities, a dimension (None: any, the same for every `same` parameter).
"""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.mission.units import ANGLE, LENGTH, NONE, SPEED, Dimension

Kind = Literal[
    "quantity",
    "flag",
    "text",
    "name",
    "names",
    "position",
    "region",
    "grid",
    "entity",
    "group",
    "message",
    "truth",
    "frame",
    "box",
    "list",
    "range",
    "size",
    "directed",
    "level",
    "interaction",
    "verb",
    "role",
    "events",
    "peers",
    "velocity",
    "inspection",
    "limit",
    "any",
]


class Type(msgspec.Struct, frozen=True):
    """A kind, with a dimension for quantities and ranges, an item kind for lists, a name for entity and message."""

    kind: Kind
    dimension: Dimension | None = None
    item: Kind | None = None
    of: str = ""


class Parameter(msgspec.Struct, frozen=True):
    """One positional parameter. `same` ties the dimensions of all such parameters and the result together."""

    name: str
    type: Type
    optional: bool = False
    same: bool = False


class Option(msgspec.Struct, frozen=True):
    """One named argument: `spread 8 m`, `spread = 8 m`, or with `relation` ">=": `apart >= 80 m`."""

    name: str
    type: Type
    relation: Literal["=", ">=", "<="] = "="
    required: bool = False


class Signature(msgspec.Struct, frozen=True):
    """A built-in. `where` says where it may stand: in any expression, before the run only, after `~`, in rules only.

    `variadic` repeats the last parameter; `least` is then the smallest number of arguments. With `same` the result's
    dimension is that of the tied parameters.
    """

    name: str
    parameters: tuple[Parameter, ...]
    result: Type
    options: tuple[Option, ...] = ()
    where: Literal["anywhere", "static", "draw", "rule"] = "anywhere"
    variadic: bool = False
    least: int = 0
    same: bool = False
    doc: str = ""


ANY = Type("any")
NUMBER = Type("quantity", NONE)
QUANTITY = Type("quantity")
METRES = Type("quantity", LENGTH)
MPS = Type("quantity", SPEED)
DEGREES = Type("quantity", ANGLE)
FLAG = Type("flag")
TEXT = Type("text")
NAME = Type("name")
POSITION = Type("position")
REGION = Type("region")
ENTITY = Type("entity")
BOX = Type("box")
FRAME = Type("frame")
LIST = Type("list")
POSITIONS = Type("list", item="position")
INSPECTION = Type("inspection")
PLACE = Type("position", of="entity")
"""A position, or an entity or report that has one."""

TRUTH_FIELDS: dict[str, Type] = {"box": BOX}
"""What `truth(entity, frame)` tells: the entity as the frame's ground truth has it at capture time."""

STATE_FIELDS: dict[str, tuple[str, Type]] = {
    "position": ("position", POSITION),
    "velocity": ("velocity", Type("velocity")),
    "heading": ("heading_deg", DEGREES),
    "status": ("status", NAME),
}
"""What every entity has while a mission runs: the author's name → its name in the graph, and its type."""

OBSERVED_FIELDS = ("position", "velocity", "heading", "status", "resources", "busy", "route")
"""What an observation channel of an entity or of `peers` may name; the author's spelling."""

FIELD_TYPES: dict[str, Type] = {
    "name": NAME,
    "text": TEXT,
    "number": NUMBER,
    "flag": FLAG,
    "position": POSITION,
    "box": BOX,
    "frame": FRAME,
    "names": Type("names"),
}
"""Types of the fields of message records (`lingjing.mission.model.Field.type`)."""


def _p(name: str, kind: Type, *, optional: bool = False, same: bool = False) -> Parameter:
    return Parameter(name, kind, optional, same)


_SAME = _p("value", QUANTITY, same=True)
_SIGNATURES = (
    Signature(
        "polygon", (_p("corner", POSITION),), REGION, variadic=True, least=3, where="static", doc="corners in order"
    ),
    Signature("circle", (_p("centre", PLACE), _p("radius", METRES)), REGION, where="static"),
    Signature("box", (_p("corner", PLACE), _p("corner", PLACE)), REGION, where="static", doc="an upright rectangle"),
    Signature(
        "at",
        (_p("index", NUMBER), _p("items", LIST)),
        ANY,
        (Option("spread", METRES), Option("rest", ANY)),
        where="static",
        doc="the index-th item; of points, further members stand `spread` apart around them, else they are `rest`",
    ),
    Signature(
        "buffer",
        (_p("shape", ANY), _p("distance", METRES)),
        REGION,
        where="static",
        doc="what lies within the distance of a region or of the line through a list of positions",
    ),
    Signature(
        "union", (_p("region", REGION),), REGION, variadic=True, least=2, where="static", doc="regions that meet"
    ),
    Signature(
        "road", (_p("name", TEXT),), REGION, where="static", doc="the carriageway of the map's roads of that name"
    ),
    Signature(
        "along",
        (_p("road", REGION), _p("width", METRES)),
        REGION,
        where="static",
        doc="what lies within the width of a road",
    ),
    Signature("distance", (_p("a", PLACE), _p("b", PLACE)), METRES, where="static"),
    Signature("distance_xy", (_p("a", PLACE), _p("b", PLACE)), METRES, doc="horizontal distance"),
    Signature("min", (_SAME,), QUANTITY, variadic=True, least=2, same=True),
    Signature("max", (_SAME,), QUANTITY, variadic=True, least=2, same=True),
    Signature("abs", (_SAME,), QUANTITY, same=True),
    Signature("sqrt", (_p("value", NUMBER),), NUMBER, where="static"),
    Signature("floor", (_p("value", NUMBER),), NUMBER, where="static"),
    Signature("ceil", (_p("value", NUMBER),), NUMBER, where="static"),
    Signature("round", (_p("value", NUMBER),), NUMBER, where="static"),
    Signature("uniform", (_SAME, _SAME), QUANTITY, where="draw", same=True, doc="between low and high"),
    Signature(
        "normal",
        (_SAME, _SAME),
        QUANTITY,
        (Option("low", QUANTITY, ">="), Option("high", QUANTITY, "<=")),
        where="draw",
        same=True,
        doc="mean and standard deviation, cut off at `low` and `high`",
    ),
    Signature("choice", (_p("items", LIST),), ANY, where="draw", doc="one of the list's items"),
    Signature(
        "subset",
        (_p("items", LIST),),
        ANY,
        (Option("apart", METRES, ">="),),
        where="draw",
        doc="one of the list's items, another one for each member of the group",
    ),
    Signature(
        "sites",
        (_p("region", REGION),),
        POSITION,
        (Option("apart", METRES, ">="), Option("clear", METRES, ">=")),
        where="draw",
        doc="a place in the region, `apart` from the group's other members",
    ),
    Signature("iou", (_p("a", BOX), _p("b", BOX)), NUMBER, where="rule", doc="intersection over union, 0 to 1"),
    Signature("truth", (_p("entity", ENTITY), _p("frame", FRAME)), Type("truth"), where="rule"),
    Signature(
        "emitted",
        (_p("interaction", Type("interaction")), _p("entity", ENTITY, optional=True)),
        FLAG,
        where="rule",
        doc="an engine has reported that the interaction was performed",
    ),
    Signature(
        "assigned",
        (_p("asset", ENTITY), _p("target", ENTITY)),
        FLAG,
        where="rule",
        doc="an assignment of the asset to the target was delivered, or a command for it admitted",
    ),
    Signature(
        "inspected",
        (_p("inspection", INSPECTION),),
        FLAG,
        where="rule",
        doc="every waypoint of the route as it is now has been inspected",
    ),
    Signature(
        "clear",
        (_p("inspection", INSPECTION),),
        FLAG,
        where="rule",
        doc="nothing blocks the route as it is now: no target that is there stands within reach of its waypoints",
    ),
    Signature(
        "replans", (_p("inspection", INSPECTION),), NUMBER, where="rule", doc="how often the route was replanned"
    ),
    Signature("used", (_p("limit", Type("limit")),), NUMBER, where="rule", doc="what a counted budget has counted"),
)

AGGREGATES: dict[str, Type] = {"count": FLAG, "sum": QUANTITY, "min": QUANTITY, "max": QUANTITY}
"""Functions over a group: `sum(o.demand for o in order)`, and what their body is. They stand in rules only."""

FUNCTIONS: dict[str, Signature] = {s.name: s for s in _SIGNATURES if s.where != "draw"}
"""What may be called in expressions, by name."""

DISTRIBUTIONS: dict[str, Signature] = {s.name: s for s in _SIGNATURES if s.where == "draw"}
"""What may stand after `~`, by name."""
