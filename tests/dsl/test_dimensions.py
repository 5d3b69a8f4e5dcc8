"""Quantities: dimensions are computed, bare numbers are no lengths, and unknown units give proposals."""

from __future__ import annotations

import pytest

from lingjing.mission.units import NAMED, UNITS, dimension_unit, si_value, unit_of
from lingjing.testing import compile_text


@pytest.mark.parametrize(
    ("expression", "code"),
    [
        ("100 m in 40 m..160 m", None),
        ("50 m + 50 m in 40 m..160 m", None),
        ("2 * 50 m in 40 m..160 m", None),
        ("10 m/s * 10 s in 40 m..160 m", None),
        ("5000 m^2 / 50 m in 40 m..160 m", None),
        ("min(100 m, 0.1 km) in 40 m..160 m", None),
        ("5 m * 3 m in 40 m..160 m", "LJ0203"),
        ("100 in 40 m..160 m", "LJ0203"),
        ("100 m + 1 s in 40 m..160 m", "LJ0203"),
        ("100 m in 40..160", "LJ0203"),
        ("100 m in 40 m..160 s", "LJ0203"),
        ("min(100 m, 1 s) in 40 m..160 m", "LJ0203"),
        ("100 meter in 40 m..160 m", "LJ0204"),
        ("not 100 m in 40 m..160 m", "LJ0201"),
    ],
)
def test_dimensions_of_expressions_are_computed_and_checked(small: str, expression: str, code: str | None) -> None:
    diagnostics = compile_text(small.replace("100 m in 40 m..160 m", expression)).diagnostics
    assert {item.code for item in diagnostics} == ({code} if code else set())
    assert {item.span.line for item in diagnostics} <= {14}


def test_a_bare_number_gets_a_fix(small: str) -> None:
    (diagnostic,) = compile_text(small.replace("heading = 30 deg", "heading = 30")).diagnostics
    assert diagnostic.code == "LJ0202"
    assert diagnostic.fix is not None and diagnostic.fix.edits[0].text == "30 deg"


def test_every_unit_has_a_dimension_with_a_name() -> None:
    named = {entry.dimension for entry in NAMED}
    assert all(unit.dimension in named for unit in UNITS.values())
    assert all(unit_of(entry.unit) is not None for entry in NAMED if entry.unit)


@pytest.mark.parametrize(
    ("number", "unit", "value"),
    [(36.0, "km/h", 10.0), (1.0, "rad", 57.29577951308232), (20.0, "%", 0.2), (4.0, "kB", 4000.0), (2.5, "min", 150.0),
     (0.1, "km", 100.0), (500.0, "ms", 0.5), (9.81, "m/s^2", 9.81), (1.0, "kn", 1852 / 3600)],
)  # fmt: skip
def test_values_are_converted_to_the_base_units(number: float, unit: str, value: float) -> None:
    assert si_value(number, unit) == pytest.approx(value, rel=1e-15)


def test_unnamed_dimensions_have_a_compound_unit() -> None:
    unit = unit_of("kg*m^2/s")
    assert unit is not None and dimension_unit(unit.dimension) == "m^2*kg/s"
    assert unit_of("m/x") is None and unit_of("") is None and unit_of("m//s") is None


@pytest.mark.parametrize("written", ["8 + 3", "2 * (3 + 4)", "max(2, 20)", "round(10.6)"])
def test_a_computed_default_must_be_within_its_bounds(written: str) -> None:
    diagnostics = compile_text(f"ljs 1\nmission m {{\n  param n = {written} in 1..10\n}}\n").diagnostics
    assert ("LJ0206", 3) in [(diagnostic.code, diagnostic.span.line) for diagnostic in diagnostics]
