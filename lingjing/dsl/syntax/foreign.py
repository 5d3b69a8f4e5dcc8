"""Spellings of other languages and keyboards, and what they are in `.ljs`.

The lexer, the parser and the checkers read these tables where a text is faulty, to name the right spelling and to go on
as if it stood there. No table is read for a text without errors.
"""

from __future__ import annotations

SIGNS: dict[str, str] = {
    **{chr(code): chr(code - 0xFEE0) for code in range(0xFF01, 0xFF5F) if not chr(code).isalnum()},
    "\u2212": "-", "\u2010": "-", "\u2011": "-", "\u2012": "-", "\u2013": "-", "\u2014": "-",
    "≥": ">=", "≧": ">=", "⩾": ">=", "≤": "<=", "≦": "<=", "⩽": "<=", "≠": "!=", "≡": "==",
    "→": "->", "⟶": "->", "⇒": "->", "↔": "<->", "⇔": "<->", "×": "*", "✕": "*", "·": "*", "÷": "/", "…": "..",
    "∧": "and", "∨": "or", "¬": "not", "∀": "forall", "∃": "exists", "∈": "in", "≈": "~", "∼": "~",
    "&&": "and", "&": "and", "||": "or", "|": "or", "!": "not", "===": "==", "!==": "!=", "<>": "!=", ":=": "=",
    "=>": ">=", "=<": "<=", "-->": "->", "...": "..", "、": ",", "；": ",", ";": ",", "。": "", "【": "[", "】": "]",
    "！": "not", "＆": "and", "｜": "or",
}  # fmt: skip
"""Sign → the sign or word that it stands for; "" for one that stands for nothing."""
GUESSED = frozenset(("=>", "=<"))
"""Signs that may have been meant otherwise, so that their fix is not safe."""

QUOTES: dict[str, str] = {
    "'": "'", "`": "`'", "\u2018": "\u2019'", "\u2019": "\u2019'", "\u201c": '\u201d"', "\u201d": '\u201d"',
    "\u201e": '\u201c\u201d"', "「": "」", "『": "』", "«": "»", "\uff02": '\uff02"',
}  # fmt: skip
"""Quote that begins a text elsewhere → the quotes that may end it."""

BLANKS = "\u00a0\u1680\u2000-\u200a\u202f\u205f\u3000"
"""Blanks other than space and tab, as a class of a pattern."""
UNSEEN = "\u200b-\u200d\u2060\ufeff"
"""Characters without a width, as a class of a pattern."""

STATEMENTS: dict[str, str] = {
    **dict.fromkeys(("import", "include", "require", "using", "load"), "use"),
    **dict.fromkeys(("let", "var", "const", "set", "parameter", "define", "variable", "constant"), "param"),
    **dict.fromkeys(("rule", "def", "function", "func", "predicate", "fn"), "adjudicate"),
    **dict.fromkeys(("zone", "area", "polygon", "place"), "region"),
    **dict.fromkeys(("objective", "description", "task_description", "brief"), "goal"),
    **dict.fromkeys(("win", "succeed", "victory"), "success"),
    **dict.fromkeys(("lose", "fail", "loss", "defeat"), "failure"),
    **dict.fromkeys(("phase", "step", "subgoal", "milestone", "task"), "stage"),
    **dict.fromkeys(("vehicle", "robot", "drone", "uav", "boat", "unit", "platform"), "asset"),
    **dict.fromkeys(("object", "entity", "victim", "npc"), "target"),
    **dict.fromkeys(("actor", "policy", "player"), "agent"),
    **dict.fromkeys(("map", "world", "environment", "place_in"), "scene"),
    **dict.fromkeys(("channel", "msg"), "message"),
    **dict.fromkeys(("invariant", "forbid", "must"), "constraint"),
    **dict.fromkeys(("trigger", "schedule", "at_time"), "event"),
    **dict.fromkeys(("communication", "network", "radio"), "comms"),
    **dict.fromkeys(("sensor",), "camera"),
    **dict.fromkeys(("scenario", "project"), "mission"),
    **dict.fromkeys(("observe", "sees", "observations"), "observes"),
    **dict.fromkeys(("struct", "schema"), "record"),
    **dict.fromkeys(("time", "timing"), "clock"),
    **dict.fromkeys(("sequence", "seq", "in_order"), "serial"),
    **dict.fromkeys(("terminate", "abort"), "failure"),
    **dict.fromkeys(("block", "shut", "barricade"), "close"),
    **dict.fromkeys(("unblock", "unclose", "open"), "reopen"),
    **dict.fromkeys(("complete", "completed", "finished", "satisfied"), "done"),
    "version": "ljs",
}
"""Word that begins a statement elsewhere → the keyword."""

CONTROL: dict[str, str] = {
    **dict.fromkeys(
        ("if", "else", "elif", "switch", "case", "unless"),
        "there are no `if` statements: a condition stands behind `when`, as in `permit … when …` or `success when …`",
    ),
    **dict.fromkeys(
        ("for", "foreach", "repeat", "loop"),
        "there are no loops: `asset uav[i in 1..n]` declares several, `stage … per v in group` and "
        "`forall v in group: …` go over them",
    ),
    "pass": "remove it: a block may be empty",
    **dict.fromkeys(("end", "endif", "fi"), "remove it: a block ends with `}`"),
    **dict.fromkeys(
        ("spawn", "create", "instantiate", "summon"),
        "write `asset NAME : TYPE { position = (… m, … m) }`, or `target …` for what agents do not command",
    ),
    **dict.fromkeys(("private", "secret", "invisible"), "write `hidden` before the property: `hidden position ~ …`"),
    **dict.fromkeys(
        ("timeout", "time_limit", "max_steps", "max_ticks", "horizon", "duration", "episode_length"),
        "write `budget { ticks <= … }`",
    ),
    **dict.fromkeys(
        ("while", "until", "wait", "do", "return", "print", "try", "class", "async", "await"),
        "the language is declarative: it has no such statement; a `stage` waits for its condition",
    ),
}
"""Word that begins a statement of a program → the way to say it here."""

CLAUSES: dict[str, str] = {
    **dict.fromkeys(("if", "where", "provided", "once"), "when"),
    **dict.fromkeys(("foreach", "each", "for"), "per"),
    **dict.fromkeys(("plays", "is"), "as"),
    **dict.fromkeys(("drives", "commands", "operates", "flies", "with", "uses", "owns"), "controls"),
    **dict.fromkeys(("after", "on"), "at"),
    **dict.fromkeys(("counting", "counted", "of"), "counts"),
    **dict.fromkeys(("can", "might"), "may"),
    **dict.fromkeys(("inherits", "from"), "extends"),
}
"""Word inside a statement → the keyword, where the grammar permits that."""
PHRASES: dict[tuple[str, str], str] = {("for", "all"): "forall", ("there", "exists"): "exists", ("such", "that"): ":"}
"""Two words → the word or sign that they stand for."""
VALUE_TYPES = frozenset(("int", "float", "double", "number", "string", "str", "bool", "boolean", "integer", "real"))
"""Names of types before a declared name, which a param does not have."""

UNITS: dict[str, str] = {
    **dict.fromkeys(("sec", "secs", "second", "seconds", "S", "秒"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds", "毫秒"), "ms"),
    **dict.fromkeys(("mins", "minute", "minutes", "分钟"), "min"),
    **dict.fromkeys(("hr", "hrs", "hour", "hours", "H", "小时"), "h"),
    **dict.fromkeys(("meter", "meters", "metre", "metres", "mtr", "M", "米"), "m"),
    **dict.fromkeys(("kilometer", "kilometers", "kilometre", "kilometres", "KM", "Km", "公里", "千米"), "km"),
    **dict.fromkeys(("centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("feet", "foot"), "ft"),
    **dict.fromkeys(("degree", "degrees", "Deg", "度"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("percent", "pct", "百分"), "%"),
    **dict.fromkeys(("kilogram", "kilograms", "kilo", "kilos", "KG", "Kg", "公斤"), "kg"),
    **dict.fromkeys(("gram", "grams"), "g"),
    **dict.fromkeys(("ton", "tons", "tonne", "tonnes"), "t"),
    **dict.fromkeys(("knot", "knots", "kt", "kts"), "kn"),
    **dict.fromkeys(("mps", "mpers"), "m/s"),
    **dict.fromkeys(("kmh", "kph", "kmph"), "km/h"),
    **dict.fromkeys(("KB", "Kb", "kb", "K"), "kB"),
    **dict.fromkeys(("mb", "Mb"), "MB"),
    **dict.fromkeys(("byte", "bytes"), "B"),
    **dict.fromkeys(("kilobyte", "kilobytes"), "kB"),
    **dict.fromkeys(("megabyte", "megabytes"), "MB"),
    **dict.fromkeys(("pixel", "pixels"), "px"),
    **dict.fromkeys(("watt", "watts"), "W"),
    **dict.fromkeys(("dollar", "dollars", "usd"), "USD"),
    **dict.fromkeys(("step", "steps"), "ticks"),
}
"""Name of a unit elsewhere → the unit. Each factor of a compound unit may be one of them."""

NAMES: dict[str, str] = {
    "True": "true", "False": "false", "TRUE": "true", "FALSE": "false", "yes": "true", "no": "false",
    **dict.fromkeys(("time", "t", "sim_time", "elapsed", "current_time"), "now"),
    **dict.fromkeys(("everyone", "everybody", "any", "broadcast_all"), "all"),
}  # fmt: skip
"""Name elsewhere → the word of the language."""
NOTHING = frozenset(("None", "null", "nil", "undefined", "NaN", "nan", "NULL"))
"""Names of a missing value elsewhere."""
FUNCTIONS: dict[str, str] = {
    "all": "write `forall v in …: …`", "every": "write `forall v in …: …`",
    "any": "write `exists v in …: …`", "some": "write `exists v in …: …`",
    "len": "write `count(true for v in …)`", "size": "write `count(true for v in …)`",
    **dict.fromkeys(("Vector", "vec", "vec2", "vec3", "point", "Point", "Location", "pos"), "write `(… m, … m)`"),
    "range": "write `1..4`",
    **dict.fromkeys(
        ("rectangle", "Rectangle", "rect", "bbox", "RectangularRegion", "BoxRegion"),
        "write `box((… m, … m), (… m, … m))`, two corners",
    ),
    **dict.fromkeys(("disk", "disc", "CircularRegion", "Circle"), "write `circle((… m, … m), … m)`, centre and radius"),
    **dict.fromkeys(
        ("random", "rand", "randint", "uniform_random", "Uniform"),
        "draw with `~`: `position ~ sites(REGION)`, `heading ~ uniform(0 deg, 90 deg)`",
    ),
    "Range": "write `param … ~ uniform(40 m, 100 m)`, a draw, or `in 40 m..100 m`, a bound",
    **dict.fromkeys(("battery", "energy", "charge", "soc"), "write `uav.battery`, a share: `uav.battery >= 20 %`"),
    "fuel": "write `plane.fuel`, a share: `plane.fuel >= 20 %`",
}  # fmt: skip
"""Function elsewhere → the way to write it."""
CALLS: dict[str, str] = {
    **dict.fromkeys(("dist", "distance_to", "distance2d", "dist_xy", "euclidean"), "distance_xy"),
    **dict.fromkeys(("distance_3d", "distance3d", "dist3d"), "distance"),
    **dict.fromkeys(("sees", "visible", "can_see", "los", "has_line_of_sight"), "line_of_sight"),
    **dict.fromkeys(("velocity", "speed_of"), "speed"),
    **dict.fromkeys(("overlap", "IoU", "IOU"), "iou"),
    **dict.fromkeys(("done", "performed", "completed", "happened"), "emitted"),
}
"""Function elsewhere → the function of the language."""
FIELDS: dict[str, str] = {
    **{name: f"position.{name}" for name in ("x", "y", "z", "east", "north", "elevation")},
    **dict.fromkeys(("altitude", "alt", "height", "elev"), "position.elevation"),
    **dict.fromkeys(("pos", "location", "place", "coordinates", "xy"), "position"),
    **dict.fromkeys(("yaw", "bearing", "direction"), "heading"),
    **dict.fromkeys(("state", "condition"), "status"),
    "vel": "velocity",
    **dict.fromkeys(("battery_level", "battery_percent", "battery_pct", "charge", "soc", "energy"), "battery"),
}
"""Field of an entity elsewhere → the field."""
AXES: dict[str, str] = {"altitude": "elevation", "alt": "elevation", "height": "elevation", "up": "elevation"}
"""Field of a position elsewhere → the field."""
KEYS: dict[str, str] = {
    "color": "colour", "name": "label", "yaw": "heading", "location": "position", "pos": "position",
    "max_steps": "ticks", "max_ticks": "ticks", "steps": "ticks",
}  # fmt: skip
"""Property elsewhere → the property."""


PREFIXES: dict[str, str] = dict.fromkeys(
    ("hidden", "secret", "private", "visible"), "write `hidden` before the property: `hidden position ~ …`"
)
"""Property elsewhere that is a word before a property here → the way to write it."""


def unit_for(unit: str) -> str | None:
    """The unit of the language for a unit of another spelling, factor by factor; None if there is none."""
    if unit in UNITS:
        return UNITS[unit]
    upper, slash, lower = unit.partition("/")
    if not slash:
        return None
    factors = (UNITS.get(upper, upper), UNITS.get(lower, lower))
    return None if factors == (upper, lower) else "/".join(factors)
