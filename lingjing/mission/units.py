"""Dimensions as exponent vectors, and the units that an author may write.

A dimension is a tuple of eight exponents over metre, second, kilogram, degree, byte, tick, money and token. Angles are
a dimension of their own, in degrees. Other values are in SI base units, data in bytes, per cent as a fraction.
`unit_of("km/h")` gives factor and dimension. It returns None for an unknown unit, which the checker reports.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache

import msgspec

from lingjing.patterns import pattern

Dimension = tuple[int, int, int, int, int, int, int, int]

NONE: Dimension = (0, 0, 0, 0, 0, 0, 0, 0)
LENGTH: Dimension = (1, 0, 0, 0, 0, 0, 0, 0)
TIME: Dimension = (0, 1, 0, 0, 0, 0, 0, 0)
MASS: Dimension = (0, 0, 1, 0, 0, 0, 0, 0)
ANGLE: Dimension = (0, 0, 0, 1, 0, 0, 0, 0)
DATA: Dimension = (0, 0, 0, 0, 1, 0, 0, 0)
TICKS: Dimension = (0, 0, 0, 0, 0, 1, 0, 0)
MONEY: Dimension = (0, 0, 0, 0, 0, 0, 1, 0)
TOKENS: Dimension = (0, 0, 0, 0, 0, 0, 0, 1)
SPEED: Dimension = (1, -1, 0, 0, 0, 0, 0, 0)
ACCELERATION: Dimension = (1, -2, 0, 0, 0, 0, 0, 0)
TURN_RATE: Dimension = (0, -1, 0, 1, 0, 0, 0, 0)
AREA: Dimension = (2, 0, 0, 0, 0, 0, 0, 0)
VOLUME: Dimension = (3, 0, 0, 0, 0, 0, 0, 0)
FORCE: Dimension = (1, -2, 1, 0, 0, 0, 0, 0)
ENERGY: Dimension = (2, -2, 1, 0, 0, 0, 0, 0)
POWER: Dimension = (2, -3, 1, 0, 0, 0, 0, 0)
DATA_RATE: Dimension = (0, -1, 0, 0, 1, 0, 0, 0)
RATE: Dimension = (0, -1, 0, 0, 0, 0, 0, 0)


class Named(msgspec.Struct, frozen=True):
    """A dimension with a name."""

    name: str
    """Its name in messages and as a type."""
    dimension: Dimension
    suffix: str
    """The suffix of its properties, such as `_kg`."""
    unit: str
    """The unit in which it is shown."""


NAMED = (
    Named("number", NONE, "", ""),
    Named("length", LENGTH, "_m", "m"),
    Named("duration", TIME, "_s", "s"),
    Named("mass", MASS, "_kg", "kg"),
    Named("angle", ANGLE, "_deg", "deg"),
    Named("data", DATA, "_bytes", "B"),
    Named("ticks", TICKS, "_ticks", "tick"),
    Named("money", MONEY, "_usd", "USD"),
    Named("tokens", TOKENS, "_tokens", "token"),
    Named("speed", SPEED, "_mps", "m/s"),
    Named("acceleration", ACCELERATION, "_mps2", "m/s^2"),
    Named("turn_rate", TURN_RATE, "_degps", "deg/s"),
    Named("area", AREA, "_m2", "m^2"),
    Named("volume", VOLUME, "_m3", "m^3"),
    Named("force", FORCE, "_n", "N"),
    Named("energy", ENERGY, "_j", "J"),
    Named("power", POWER, "_w", "W"),
    Named("data_rate", DATA_RATE, "_bps", "B/s"),
    Named("rate", RATE, "_hz", "Hz"),
)
"""The dimensions with names. Each name may be the type of a record's field or of a verb's argument."""

BY_DIMENSION = {entry.dimension: entry for entry in NAMED}
"""The entry of each named dimension."""
BY_NAME = {entry.name: entry for entry in NAMED}
"""The entries of the named dimensions, by name."""
_SUFFIXES = tuple(sorted((entry.suffix for entry in NAMED if entry.suffix), key=len, reverse=True))

LARGEST = 1e15
"""Larger numbers, in SI units and degrees, are rejected (chosen): no mission needs them, and a double has no exact
millimetres at that size."""

_SYMBOLS = ("m", "s", "kg", "deg", "B", "tick", "USD", "token")
"""The base units in the order of a dimension's exponents."""


class Unit(msgspec.Struct, frozen=True):
    """`value_in_si = number * factor`."""

    factor: float
    """Exact if the definition is."""
    dimension: Dimension


UNITS: dict[str, Unit] = {
    "%": Unit(0.01, NONE),
    "px": Unit(1.0, NONE),
    "m": Unit(1.0, LENGTH),
    "mm": Unit(0.001, LENGTH),
    "cm": Unit(0.01, LENGTH),
    "km": Unit(1000.0, LENGTH),
    "ft": Unit(0.3048, LENGTH),
    "NM": Unit(1852.0, LENGTH),
    "nmi": Unit(1852.0, LENGTH),
    "s": Unit(1.0, TIME),
    "ms": Unit(0.001, TIME),
    "us": Unit(1e-6, TIME),
    "min": Unit(60.0, TIME),
    "h": Unit(3600.0, TIME),
    "kg": Unit(1.0, MASS),
    "g": Unit(0.001, MASS),
    "t": Unit(1000.0, MASS),
    "deg": Unit(1.0, ANGLE),
    "°": Unit(1.0, ANGLE),
    "rad": Unit(57.29577951308232, ANGLE),
    "B": Unit(1.0, DATA),
    "kB": Unit(1000.0, DATA),
    "MB": Unit(1e6, DATA),
    "GB": Unit(1e9, DATA),
    "KiB": Unit(1024.0, DATA),
    "MiB": Unit(1048576.0, DATA),
    "tick": Unit(1.0, TICKS),
    "ticks": Unit(1.0, TICKS),
    "USD": Unit(1.0, MONEY),
    "token": Unit(1.0, TOKENS),
    "tokens": Unit(1.0, TOKENS),
    "kn": Unit(1852.0 / 3600.0, SPEED),
    "N": Unit(1.0, FORCE),
    "J": Unit(1.0, ENERGY),
    "kJ": Unit(1000.0, ENERGY),
    "Wh": Unit(3600.0, ENERGY),
    "kWh": Unit(3.6e6, ENERGY),
    "W": Unit(1.0, POWER),
    "kW": Unit(1000.0, POWER),
    "Hz": Unit(1.0, RATE),
}
"""The simple units. Compounds are written without spaces: `m/s`, `km/h`, `m/s^2`, `deg/s`, `kB/s`."""

_FACTOR = pattern(r"([^\W\d]+|[%°])(?:\^?(-?\d))?")
"""A unit with its exponent."""


def multiply(left: Dimension, right: Dimension, sign: int = 1) -> Dimension:
    """The dimension of `left * right` (`sign` = 1) or `left / right` (`sign` = -1)."""
    a, b = left, right
    return (
        a[0] + sign * b[0],
        a[1] + sign * b[1],
        a[2] + sign * b[2],
        a[3] + sign * b[3],
        a[4] + sign * b[4],
        a[5] + sign * b[5],
        a[6] + sign * b[6],
        a[7] + sign * b[7],
    )


@lru_cache(maxsize=1024)
def unit_of(text: str) -> Unit | None:
    """The unit spelt `text`, simple or compound; None if any part of it is unknown."""
    known = UNITS.get(text)
    if known is not None:
        return known
    factor, dimension = 1.0, NONE
    for position, part in enumerate(text.replace("*", "/*").split("/")):
        divides = position > 0 and not part.startswith("*")
        match = _FACTOR.fullmatch(part.lstrip("*"))
        unit = UNITS.get(match[1]) if match else None
        if match is None or unit is None:
            return None
        exponent = int(match[2] or 1) * (-1 if divides else 1)
        factor *= unit.factor**exponent
        for _ in range(abs(exponent)):
            dimension = multiply(dimension, unit.dimension, 1 if exponent > 0 else -1)
    return Unit(factor, dimension)


def dimension_name(dimension: Dimension) -> str:
    """A dimension in words for messages: `length`, `speed`, or `m^2/s` if it has no name."""
    known = BY_DIMENSION.get(dimension)
    return known.name if known else dimension_unit(dimension)


def dimension_unit(dimension: Dimension) -> str:
    """The SI unit of a dimension as text: `m`, `m/s^2`, `kg*m^2`, or the empty string for a bare number."""
    known = BY_DIMENSION.get(dimension)
    if known:
        return known.unit
    above = "*".join(_power(s, e) for s, e in zip(_SYMBOLS, dimension, strict=True) if e > 0)
    below = "/".join(_power(s, -e) for s, e in zip(_SYMBOLS, dimension, strict=True) if e < 0)
    return f"{above or '1'}/{below}" if below else above


def _power(symbol: str, exponent: int) -> str:
    return symbol if exponent == 1 else f"{symbol}^{exponent}"


def si_value(number: float, unit: str) -> float:
    """`number unit` in SI; the unit must be known. Decimal fractions stay exact: 2.3 km is 2300.0, 4 kB is 4000.0."""
    known = unit_of(unit) if unit else None
    if known is None or known.factor == 1.0:
        return number
    inverse = 1.0 / known.factor
    if known.factor < 1.0 and inverse == round(inverse):
        return number / round(inverse)
    return number * known.factor


def field_named(name: str, fields: Collection[str]) -> str | None:
    """The element of `fields` that is `name`, or `name` with a unit suffix: `payload_kg` for `payload`. None if there
    is none."""
    return next((name + end for end in ("", *_SUFFIXES) if name + end in fields), None)


def unit_behind(name: str, field: str) -> str:
    """The unit in the suffix of `field` after `name`: `kg` for `payload` and `payload_kg`, "" for `payload` itself."""
    return next(entry.unit for entry in NAMED if name + entry.suffix == field)


@lru_cache(maxsize=1024)
def without_unit(name: str) -> str:
    """A property's name without the unit suffix: `demand` for `demand_kg`."""
    return next((name.removesuffix(end) for end in _SUFFIXES if name.endswith(end) and len(name) > len(end)), name)
