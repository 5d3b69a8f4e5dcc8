"""Bodies of types: measures, colour, shape, look, mounts and parts; their errors, and their text."""

from __future__ import annotations

import pytest

from lingjing.dsl.printing.printer import round_trip_losses, to_ljs
from lingjing.testing import compile_text, instantiate
from lingjing.testing.declarations import BodyPart, CameraMount, Group

BUOY = """target beacon : person_in_water {
  length = 2 m, width = 1 m, height = 3 m
  colour = yellow
  mount front { ahead = 20 cm, above = 1 m, tilt = -10 deg, gimbal = false }
  part lamp : cone { length = 0.2 m, width = 0.2 m, height = 30 cm, above = 3 m, heading = 45 deg, colour = red }
}
"""
MEASURE = "must be at least 0.001 m and at most 1000 m"
MASS = "must be above 0 kg and at most 10000000 kg"


def with_type(small: str, text: str) -> str:
    """The small mission, preceded by a declaration of the type `beacon`, with targets of it."""
    mission = small.replace(": person_in_water {", ": beacon {")
    return mission.replace("mission ", f"{text}mission ", 1)


def group_of(text: str) -> Group:
    compilation = compile_text(text)
    assert compilation.mission is not None, [item.message for item in compilation.diagnostics]
    return next(group for group in compilation.mission.groups if group.name == "victim")


def test_mounts_and_parts_are_values_of_the_group(small: str) -> None:
    text = with_type(small, BUOY)
    group = group_of(text)
    assert group.mounts == (CameraMount(view="front", ahead_m=0.2, above_m=1.0, tilt_deg=-10.0, gimbal=False),)
    (lamp,) = group.parts
    assert lamp == BodyPart(name="lamp", shape="cone", length_m=0.2, width_m=0.2, height_m=0.3, above_m=3.0,
                            heading_deg=45.0, colour="red")  # fmt: skip
    names = {prop.name for prop in group.properties}
    assert {"length_m", "width_m", "height_m", "colour"} <= names and "look" not in names


def test_a_part_can_glow(small: str) -> None:
    text = with_type(small, BUOY.replace("colour = red", "colour = amber, glow = 0.5"))
    (lamp,) = group_of(text).parts
    assert (lamp.colour, lamp.glow) == ("amber", 0.5)
    compilation = compile_text(text)
    assert compilation.mission is not None
    assert round_trip_losses(compilation.mission, to_ljs(compilation.mission)) == ()
    bright = compile_text(text.replace("glow = 0.5", "glow = 2"))
    assert [item.code for item in bright.diagnostics if item.severity == "error"] == ["LJ0206"]


def test_a_type_keeps_the_look_of_its_base_unless_its_body_differs(small: str) -> None:
    def look(extra: str) -> set[str]:
        text = f"target beacon : person_in_water {{\n{extra}\n}}\n"
        made = group_of(with_type(small, text))
        return {getattr(prop.value, "name", "") for prop in made.properties if prop.name == "look"}

    assert look("colour = red") == {"person_in_water"}
    assert look("length = 2 m") == look("shape = cone") == set()
    assert look("length = 2 m\nlook = car") == {"car"}


def test_an_entity_can_have_its_own_measures_and_colour(small: str) -> None:
    text = small.replace(
        "  target victim[1..3] : person_in_water {",
        "  target victim[1..3] : person_in_water {\n    height ~ uniform(1 m, 2 m)\n    colour = pink",
    )
    compilation = compile_text(text)
    assert compilation.mission is not None
    first, second, _ = (
        entity for entity in instantiate(compilation.mission, seed=3).entities if entity.group == "victim"
    )
    assert 1.0 <= float(first.properties["height_m"]) <= 2.0  # type: ignore[arg-type]
    assert first.properties["height_m"] != second.properties["height_m"] and first.properties["colour"] == "pink"
    assert "look" not in first.properties and round_trip_losses(compilation.mission, to_ljs(compilation.mission)) == ()


def test_a_colour_is_drawn_from_a_list(small: str) -> None:
    text = small.replace("  target victim[1..3] : person_in_water {",
                         "  target victim[1..3] : person_in_water {\n    colour ~ choice([red, blue])")  # fmt: skip
    mission = compile_text(text).mission
    assert mission is not None and round_trip_losses(mission, to_ljs(mission)) == ()
    drawn = [
        entity for seed in range(4) for entity in instantiate(mission, seed=seed).entities if entity.group == "victim"
    ]
    assert {entity.properties["colour"] for entity in drawn} == {"red", "blue"}


def test_a_draw_within_the_bounds_is_accepted(small: str) -> None:
    lines = "length ~ normal(2 m, 1 m, low >= 1 mm, high <= 3 m)\nmass ~ uniform(1 kg, 3 kg)\nwidth = 1 mm"
    assert group_of(with_type(small, f"target beacon : person_in_water {{\n{lines}\n}}\n")).properties


def test_bodies_are_kept_when_a_mission_is_printed(small: str) -> None:
    text = with_type(small, BUOY)
    mission = compile_text(text).mission
    assert mission is not None
    assert round_trip_losses(mission, to_ljs(mission)) == ()


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("look = cra", "LJ0109", "`look` cannot be `cra`"),
        ("colour = purpel", "LJ0109", "`colour` cannot be `purpel`"),
        ("shape = blob", "LJ0109", "`shape` cannot be `blob`"),
        ("origin = top", "LJ0109", "`origin` cannot be `top`"),
        ("length = 3", "LJ0202", ""),
        ("height = 0 m", "LJ0206", f"`height` {MEASURE}"),
        ("mass = -3 kg", "LJ0206", f"`mass` {MASS}"),
        ("width = 1e-7 m", "LJ0206", f"`width` {MEASURE}"),
        ("width = 1e15 m", "LJ0206", f"`width` {MEASURE}"),
        ("length ~ uniform(-8 m, -4 m)", "LJ0206", f"`length` {MEASURE}, this draw can give -8 m"),
        ("length ~ choice([1 m, 0 m])", "LJ0206", f"`length` {MEASURE}, this draw can give 0 m"),
        ("mass ~ normal(9 kg, 1 kg, low >= 1 kg)", "LJ0206", f"`mass` {MASS}, this draw has no such end"),
        ("colour ~ choice([red, blu])", "LJ0109", "`colour` cannot be `blu`"),
        ("colour ~ uniform(1, 2)", "LJ0301", "`colour` is drawn from a list of its words"),
        ("part a : box { length = 1 m, width = 1 m, height = 1e-7 m }", "LJ0206", ""),
        ("part a : box { length = 1 m, width = 1 m, height = 1 m, right = -1e15 m }", "LJ0206", ""),
        ("mount front { ahead = 101 m, above = 1 m, tilt = 0 deg }", "LJ0206", ""),
        ("mount side { ahead = 1 m, above = 1 m, tilt = 0 deg }", "LJ0109", "no view is called `side`"),
        ("mount front { ahead = 1 m, above = 1 m }", "LJ0106", "the mount `front` lacks `tilt`"),
        ("mount front { ahead = 1 kg, above = 1 m, tilt = 0 deg }", "LJ0203", ""),
        ("mount front { ahead = 1 m, above = 1 m, tilt = 91 deg }", "LJ0206", ""),
        ("part a : bax { length = 1 m, width = 1 m, height = 1 m }", "LJ0109", "no shape is called `bax`"),
        ("part a : box { length = 1 m, width = 1 m }", "LJ0106", "the part `a` lacks `height`"),
        ("part a : box { length = 1 m, width = 1 m, height = 1 m, colour = rd }", "LJ0109", "`colour` cannot be `rd`"),
        ("part a : box { length = 1 m, width = 1 m, height = 1 m, far = 1 m }", "LJ0108", ""),
    ],
)  # fmt: skip
def test_a_faulty_body_gives_one_error(small: str, line: str, code: str, message: str) -> None:
    text = with_type(small, f"target beacon : person_in_water {{\n  {line}\n}}\n")
    (diagnostic,) = compile_text(text).diagnostics
    assert (diagnostic.code, diagnostic.message if message else "") == (code, message)


def test_a_part_or_a_mount_that_is_declared_twice_is_an_error(small: str) -> None:
    part = "part a : box { length = 1 m, width = 1 m, height = 1 m }\n"
    mount = "mount front { ahead = 1 m, above = 1 m, tilt = 0 deg }\n"
    text = f"target beacon : person_in_water {{\n{part}{part}{mount}{mount}}}\n"
    diagnostics = compile_text(with_type(small, text)).diagnostics
    assert [item.code for item in diagnostics] == ["LJ0104", "LJ0104"]


@pytest.mark.parametrize(("before", "place"), [("  success when", "a mission"), ("    camera nadir", "`uav`")])
@pytest.mark.parametrize(
    "line",
    [
        "mount front { ahead = 1 m, above = 1 m, tilt = 0 deg }",
        "part a : box { length = 1 m, width = 1 m, height = 1 m }",
    ],
)
def test_a_mount_or_a_part_outside_of_a_type_is_an_error(small: str, before: str, place: str, line: str) -> None:
    """The names are those of a type's body, where both are correct."""
    assert group_of(with_type(small, f"target beacon : person_in_water {{\n  {line}\n}}\n"))
    text = small.replace(before, f"    {line}\n{before}", 1)
    errors = [(item.code, item.message, item.span.line) for item in compile_text(text).diagnostics]
    head, written = line.split()[0], text[: text.index(line)].count("\n") + 1
    assert errors == [("LJ0107", f"`{head}` has no meaning in {place}", written)]


def test_part_and_mount_stay_names_of_properties(small: str) -> None:
    group = group_of(
        with_type(
            small,
            "target beacon : person_in_water {\n  part = 3, mount = 4\n}\n",
        )
    )
    assert {"part", "mount"} <= {prop.name for prop in group.properties}
