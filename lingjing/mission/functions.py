"""The operators, functions and distributions of the language, in one table.

A `Signature` holds the types for the checker. An `Operation` holds the function over values (`operations`) and over
bounds (`intervals`), its wording, and properties such as whether its value changes with time or reveals hidden values.
The evaluations that use the table are `evaluate` (before the run), the kernel's rules (in the run), `certain` (bounds
for every run), `conditions.condition_needs` and `condition_words`. A type is a kind with, for quantities, a dimension
(None: any dimension, the same for every parameter with `same`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal

import msgspec

from lingjing.mission import intervals, operations
from lingjing.mission.expression import (
    Aggregate,
    Binary,
    Call,
    Draw,
    Expr,
    Index,
    Point,
    Quantified,
    Range,
    Ref,
    Sequence,
    Unary,
    children,
)
from lingjing.mission.units import ANGLE, LENGTH, NONE, SPEED, TIME, Dimension

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
    "status",
    "happening",
    "any",
]


class Type(msgspec.Struct, frozen=True):
    """The type of a value."""

    kind: Kind
    dimension: Dimension | None = None
    """The dimension of a quantity or range; None for any."""
    item: Kind | None = None
    """Kind of a list's items; None for any."""
    of: str = ""
    """Name of the entity's group or of the message kind."""


class FunctionParameter(msgspec.Struct, frozen=True):
    """One positional parameter."""

    name: str
    type: Type
    optional: bool = False
    same: bool = False
    """True if its dimension must equal that of all such parameters and of the result."""


class FunctionOption(msgspec.Struct, frozen=True):
    """One named argument: `spread 8 m`, `spread = 8 m`, or with `relation` ">=": `apart >= 80 m`."""

    name: str
    type: Type
    relation: Literal["=", ">=", "<="] = "="


class Operation(msgspec.Struct, frozen=True):
    """The meaning of an operator or a function."""

    name: str
    value: Callable[..., Any]
    """Function of the world and the operands' values."""
    bounds: Callable[..., Any] | None = None
    """Function of the operands' bounds; None if the result is known for exact operands only."""
    words: str = ""
    """Its wording: `{0}` is the first operand. Text in brackets belongs to the last operand and is left out
    without it."""
    rank: int = 0
    """Binding strength of an operator: a higher rank binds tighter."""
    of_time: bool = False
    """True if its value changes during the mission."""
    secret: bool = False
    """True if it may reveal values that its operands do not name."""
    running: bool = False
    """True if only a running mission has a value for it."""
    stable: bool = True
    """True if its value for the same operands is the same at every later boundary."""
    about: tuple[Literal["event", "inspection", "resource"], ...] = ()
    """Kinds of graph nodes that its first operand names."""
    at_start: bool | float | None = None
    """Its value at boundary 0; None if unknown."""
    measure: str | None = None
    """Prefix of a bound of its result in a list of bounds; None if such bounds are not listed."""


class Signature(msgspec.Struct, frozen=True):
    """The types and the places of a built-in function."""

    name: str
    parameters: tuple[FunctionParameter, ...]
    result: Type
    options: tuple[FunctionOption, ...] = ()
    """Named arguments."""
    where: Literal["anywhere", "static", "draw", "rule"] = "anywhere"
    """Its allowed places: any expression, expressions before the run only, after `~`, rules only."""
    variadic: bool = False
    """True if the last parameter may be repeated."""
    least: int = 0
    """The smallest number of arguments of a variadic function."""
    same: bool = False
    """True if the result's dimension is that of the parameters with `same`."""
    doc: str = ""


ANY = Type("any")
NUMBER = Type("quantity", NONE)
QUANTITY = Type("quantity")
METRES = Type("quantity", LENGTH)
SECONDS = Type("quantity", TIME)
MPS = Type("quantity", SPEED)
DEGREES = Type("quantity", ANGLE)
FLAG = Type("flag")
TEXT = Type("text")
NAME = Type("name")
STATUS = Type("status")
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
"""Fields of `truth(entity, frame)`: the entity in the frame's ground truth at capture time."""

STATE_FIELDS: dict[str, tuple[str, Type]] = {
    "position": ("position", POSITION),
    "velocity": ("velocity", Type("velocity")),
    "heading": ("heading_deg", DEGREES),
    "status": ("status", STATUS),
}
"""State of every entity during a mission: the author's name → its name in the graph, and its type."""

GNSS = "gnss"
"""Field of a channel that shows the position and velocity that a receiver measures, in place of the true ones."""

IMU = "imu"
"""Field of a channel that shows the specific force and angular rate that an inertial unit measures."""

OBSERVED_FIELDS = ("position", "velocity", "heading", "status", "resources", "busy", "route", "assignment", GNSS, IMU)
"""Fields that an observation channel of an entity or of `peers` may name, in the author's spelling."""

MESSAGE_FIELDS: dict[str, Type] = {
    "sender": Type("name", of="agent"),
    "role": Type("name", of="role"),
    "sent": Type("quantity", TIME),
}
"""Fields of every message in rules, unless its record declares a field of that name: the agent that sent it, the
agent's role, and the time of the decision to send it."""

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


def _p(name: str, kind: Type, *, optional: bool = False, same: bool = False) -> FunctionParameter:
    return FunctionParameter(name, kind, optional, same)


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
        (FunctionOption("spread", METRES), FunctionOption("rest", ANY)),
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
    Signature("distance", (_p("a", PLACE), _p("b", PLACE)), METRES, doc="distance in space"),
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
        "integer", (_p("low", NUMBER), _p("high", NUMBER)), NUMBER, where="draw", doc="a whole number from low to high"
    ),
    Signature(
        "normal",
        (_SAME, _SAME),
        QUANTITY,
        (FunctionOption("low", QUANTITY, ">="), FunctionOption("high", QUANTITY, "<=")),
        where="draw",
        same=True,
        doc="mean and standard deviation, cut off at `low` and `high`",
    ),
    Signature("choice", (_p("items", LIST),), ANY, where="draw", doc="one of the list's items"),
    Signature(
        "subset",
        (_p("items", LIST),),
        ANY,
        (FunctionOption("apart", METRES, ">="),),
        where="draw",
        doc="one of the list's items, another one for each member of the group",
    ),
    Signature(
        "sites",
        (_p("region", REGION),),
        POSITION,
        (FunctionOption("apart", METRES, ">="), FunctionOption("clear", METRES, ">=")),
        where="draw",
        doc="a place in the region, `apart` from the group's other members",
    ),
    Signature(
        "sites_along",
        (_p("line", POSITIONS),),
        POSITION,
        (FunctionOption("apart", METRES, ">="), FunctionOption("clear", METRES, ">=")),
        where="draw",
        doc="a place on the line through the positions, `clear` of its ends and `apart` from the group's other members",
    ),
    Signature("iou", (_p("a", BOX), _p("b", BOX)), NUMBER, where="rule", doc="intersection over union, 0 to 1"),
    Signature(
        "ray_distance",
        (_p("frame", FRAME), _p("box", BOX), _p("place", POSITION)),
        METRES,
        where="rule",
        doc="horizontal distance of a place from the camera's ray through the middle of a box",
    ),
    Signature(
        "edge_error",
        (_p("frame", FRAME), _p("a", BOX), _p("b", BOX)),
        NUMBER,
        where="rule",
        doc="largest distance between the same edges of two boxes, in pixels of the picture",
    ),
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
    Signature("alive", (_p("asset", ENTITY),), FLAG, where="rule", doc="the asset is there and not dead"),
    Signature("speed", (_p("body", ENTITY),), MPS, where="rule", doc="its present speed, climb and descent included"),
    Signature(
        "line_of_sight",
        (_p("a", ENTITY), _p("b", ENTITY)),
        FLAG,
        where="rule",
        doc="no ground, building, bridge or wall of the city stands between the middles of the two bodies",
    ),
    Signature(
        "photographed",
        (_p("asset", ENTITY),),
        FLAG,
        where="rule",
        doc="a camera of the asset has taken a picture",
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
    Signature(
        "held",
        (_p("condition", FLAG), _p("time", SECONDS)),
        FLAG,
        where="rule",
        doc="the condition has been true for that time without a break",
    ),
    Signature(
        "within",
        (_p("first", FLAG), _p("second", FLAG), _p("time", SECONDS)),
        FLAG,
        where="rule",
        doc="the second condition has become true within that time of the first",
    ),
    Signature(
        "before",
        (_p("first", FLAG), _p("second", FLAG)),
        FLAG,
        where="rule",
        doc="the first condition became true before the second",
    ),
    Signature(
        "count",
        (_p("event", Type("happening")), _p("entity", ENTITY, optional=True)),
        NUMBER,
        where="rule",
        doc="how often an event of the mission occurred, or an interaction was performed",
    ),
)

TEMPORAL: Mapping[str, int] = {"held": 1, "within": 2, "before": 2}
"""Functions over time, with the number of conditions among their arguments, which stand first."""


def conditions_of(call: Call) -> tuple[Expr, ...]:
    """The conditions among the arguments of a function over time."""
    return call.arguments[: TEMPORAL[call.function]]


def free_names(expr: Expr) -> tuple[str, ...]:
    """The bound names that an expression reads and does not bind itself, sorted."""
    return tuple(sorted(_free(expr, frozenset())))


def _free(expr: Expr, bound: frozenset[str]) -> frozenset[str]:
    if isinstance(expr, Quantified | Aggregate):
        bound |= {expr.variable}
    if isinstance(expr, Ref) and expr.kind == "local" and expr.name not in bound:
        return frozenset({expr.name})
    return frozenset().union(*(_free(child, bound) for child in children(expr)))


AGGREGATES: dict[str, Type] = {"count": FLAG, "sum": QUANTITY, "min": QUANTITY, "max": QUANTITY}
"""Functions over a group, `sum(o.demand for o in order)`, with the type of their body. They stand in rules only."""

FUNCTIONS: dict[str, Signature] = {s.name: s for s in _SIGNATURES if s.where != "draw"}
"""Functions of expressions, by name."""

DISTRIBUTIONS: dict[str, Signature] = {s.name: s for s in _SIGNATURES if s.where == "draw"}
"""Distributions after `~`, by name."""


def _fact(name: str, *, stable: bool = False, **fields: Any) -> Operation:
    return Operation(name, operations.fact(name), running=True, stable=stable, **fields)


def _plain(name: str, function: Callable[..., float], bounds: Callable[..., Any], words: str = "") -> Operation:
    return Operation(name, operations.numeric(name, function), bounds, words)


OPERATIONS: Mapping[str, Operation] = {
    entry.name: entry
    for entry in (
        Operation("+", operations.plus, intervals.plus, rank=6),
        Operation("-", operations.minus, intervals.minus, rank=6),
        Operation("*", operations.times, intervals.times, rank=7),
        Operation("/", operations.over, intervals.over, rank=7),
        Operation("<", operations.less, intervals.less, "{0} is less than {1}", rank=4),
        Operation("<=", operations.at_most, intervals.at_most, "{0} is at most {1}", rank=4),
        Operation(">", operations.more, intervals.more, "{0} is more than {1}", rank=4),
        Operation(">=", operations.at_least, intervals.at_least, "{0} is at least {1}", rank=4),
        Operation("==", operations.same, intervals.same, "{0} is {1}", rank=4),
        Operation("!=", operations.different, intervals.different, "{0} is not {1}", rank=4),
        Operation("in", operations.within, words="{0} lies in {1}", rank=4),
        Operation("not", operations.inverse, words="it is not so that {0}", rank=3),
        Operation("negative", operations.negative, intervals.negative),
        Operation("point", operations.point),
        Operation("list", operations.listed),
        Operation("range", operations.interval),
        Operation("member", operations.member),
        Operation("polygon", operations.polygon),
        Operation("circle", operations.circle),
        Operation("box", operations.box),
        Operation("at", operations.item_at),
        Operation("buffer", operations.buffer),
        Operation("union", operations.union),
        Operation("road", operations.of_the_map("road")),
        Operation("along", operations.of_the_map("along")),
        Operation("distance", operations.distance, words="the distance from {0} to {1}", of_time=True, measure=""),
        Operation(
            "distance_xy",
            operations.distance_xy,
            intervals.distance,
            words="the horizontal distance from {0} to {1}",
            of_time=True,
            measure="",
        ),
        _plain("min", min, intervals.least, "the smaller of {0} and {1}"),
        _plain("max", max, intervals.greatest, "the larger of {0} and {1}"),
        _plain("abs", abs, intervals.magnitude),
        _plain("sqrt", math.sqrt, intervals.monotone(math.sqrt)),
        _plain("floor", math.floor, intervals.monotone(math.floor)),
        _plain("ceil", math.ceil, intervals.monotone(math.ceil)),
        _plain("round", round, intervals.monotone(round)),
        Operation("iou", operations.iou, intervals.share, words="the overlap of {0} with {1}", measure="IoU "),
        _fact("ray_distance", words="the distance of {2} from the ray of the camera through {1} in {0}", stable=True),
        _fact(
            "edge_error",
            words="the greatest distance of an edge of {1} from the same edge of {2} in {0}, in pixels of the whole "
            "picture,",
            stable=True,
        ),
        _fact("truth", words="the true box of {0} in {1}", secret=True, stable=True),
        _fact("emitted", words="an engine has performed {0}[ on {1}]", of_time=True, about=("event",), at_start=False),
        _fact("assigned", words="{0} is assigned to {1}", at_start=False),
        _fact("alive", words="{0} is alive", of_time=True, at_start=True),
        _fact("speed", words="the speed of {0}", of_time=True, measure="speed "),
        _fact("line_of_sight", words="nothing of the city stands between {0} and {1}", of_time=True),
        _fact("photographed", words="{0} has taken a picture", at_start=False),
        _fact("inspected", words="the whole route of {0} has been inspected", of_time=True, about=("inspection",)),
        _fact("clear", words="nothing blocks the route of {0}", of_time=True, secret=True, about=("inspection",)),
        _fact("replans", words="the number of replans of {0}", about=("inspection",), at_start=0.0),
        _fact("used", words="what {0} has counted", about=("resource",), at_start=0.0),
        _fact("held", words="for {1} without a break, {0}", of_time=True),
        _fact("within", words="{1}, at most {2} after {0}", of_time=True),
        _fact("before", words="{0}, before {1}", of_time=True),
        _fact("count", words="the number of times of {0}[ on {1}]", about=("event",)),
    )
}
"""The meaning of every operator and function, by name."""

RANKS: Mapping[str, int] = {
    "from": 0,
    "to": 0,
    "at": 0,
    "or": 1,
    "and": 2,
    "..": 5,
    "by": 5,
    **{name: entry.rank for name, entry in OPERATIONS.items() if entry.rank},
}
"""Binding strength of every operator and connecting word of the language: a higher rank binds tighter."""


def operation(node: Expr) -> Operation | None:
    """The operation of a node that is no name, literal, field or quantifier. None for a call of a rule, for a draw, and
    for a function that this version does not have."""
    match node:
        case Binary(operator=symbol):
            return OPERATIONS.get(symbol)
        case Unary(operator="not"):
            return OPERATIONS["not"]
        case Unary():
            return OPERATIONS["negative"]
        case Index():
            return OPERATIONS["member"]
        case Point():
            return OPERATIONS["point"]
        case Sequence():
            return OPERATIONS["list"]
        case Range():
            return OPERATIONS["range"]
        case Call(rule=False, function=name):
            return OPERATIONS.get(name)
        case Draw() | _:
            return None
