"""Hidden values: each place where one becomes visible gives an error with its path."""

from __future__ import annotations

import pytest

from lingjing import Mission
from lingjing.dsl.checking.checker import check
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax.parser import parse
from lingjing.testing import compile_text
from lingjing.testing.missions import SourceText


def checked(text: str) -> Mission:
    """The mission that the checker makes of a text without errors, playable or not."""
    report = Reporter(SourceText(text, "m.ljs"))
    mission = check(parse(report), report)
    assert mission is not None and report.diagnostics == []
    return mission


LEAKS = [
    ('"Find everybody."', '"Find {victim.position}."', 7, "`victim.position` → the goal's text"),
    ("observes boat.*, events", "observes victim[1].position", 28, "`victim.position` → "),
    ("forward <= 50 m", "forward <= distance_xy(victim[1], boat)", 24, "→ the bound of the action `forward`"),
    ("uavs = 2 in", "uavs = distance_xy(victim[1], boat) / 9 m in", 13, "→ the param `uavs`"),
    ("when mode == broadcast", "when distance_xy(victim[1], boat) < 5 m", 30, "→ a declaration's condition"),
    ("visibility = 8 km", "visibility = distance_xy(victim[1], boat)", 11, "→ `visibility` of `weather`"),
    ("observes boat.*, events }", 'observes boat.*, events\n prompt "{victim.position}" }', 29, "→ the prompt's text"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "way"), LEAKS)
def test_a_hidden_value_in_a_visible_place_is_an_error(small: str, old: str, new: str, line: int, way: str) -> None:
    diagnostics = compile_text(small.replace(old, new, 1)).diagnostics
    assert [(item.code, item.span.line) for item in diagnostics] == [("LJ0401", line)]
    assert way in diagnostics[0].message
    assert diagnostics[0].related[0].message.endswith("is hidden here")


def test_values_computed_from_hidden_ones_are_hidden(small: str) -> None:
    raft = "  target raft : person_in_water { position = (1 m, 2 m) + victim[1].position }\n"
    seen = small.replace("  asset boat", raft + "  asset boat").replace("observes cells }", "observes raft.position }")
    (leak,) = compile_text(seen).diagnostics
    assert leak.code == "LJ0401"
    assert leak.message.endswith("`victim.position` → `raft.position` → an observation")
    unseen = small.replace("  asset boat", raft + "  asset boat")
    group = next(group for group in checked(unseen).groups if group.name == "raft")
    assert next(prop for prop in group.properties if prop.name == "position").hidden


BUOY = "  asset buoy : lifeboat { position = (0 m, 0 m) + victim[1].position }\n  agent skipper"
FAR = "  region far = circle(buoy, 9 m)\n  grid cells"
FROM_AFAR = "distance_xy(victim[1], uav[1])"
COMPUTED = [
    ("heading = 30 deg", f"heading = {FROM_AFAR} / 1 m * 1 deg", "heading"),
    ("heading = 30 deg", f"heading ~ uniform(0 deg, {FROM_AFAR} / 1 m * 1 deg)", "heading"),
    ("heading = 30 deg", f"heading = at(1 + {FROM_AFAR} / 900 m, [1 deg, 2 deg])", "heading"),
    ("heading = 30 deg", "heading = distance_xy((0 m, 0 m), victim[2]) / 1 m * 1 deg", "heading"),
    ("position = (12.4 m, -51.8 m)", f"position = ({FROM_AFAR}, 0 m)", "position"),
    ("position = (12.4 m, -51.8 m)", f"position ~ sites(search, apart >= {FROM_AFAR})", "position"),
    ("position = (12.4 m, -51.8 m)", f"position ~ sites(search, clear >= {FROM_AFAR})", "position"),
]


@pytest.mark.parametrize(("old", "new", "field"), COMPUTED)
def test_an_entity_named_without_a_field_is_read_as_its_place(small: str, old: str, new: str, field: str) -> None:
    text = small.replace(old, new, 1)
    boat = next(group for group in checked(text).groups if group.name == "boat")
    assert next(prop for prop in boat.properties if prop.name.startswith(field)).hidden
    (leak,) = compile_text(text.replace("boat.*, events", f"boat.{field}, events")).diagnostics
    assert leak.code == "LJ0401" and f"→ `boat.{field}` → an observation" in leak.message


@pytest.mark.parametrize(
    ("old", "new", "sink"),
    [
        ("uavs = 2 in", "uavs = distance_xy(buoy, boat) / 9 m in", "the param `uavs`"),
        ("uavs = 2 in", "uavs = buoy.position.east / 9 m in", "the param `uavs`"),
        ('"Find everybody."', '"Find {far}."', "the goal's text"),
        ("position = (12.4 m, -51.8 m)", "position = (0 m, 0 m) + far.centre", "an observation"),
    ],
)
def test_a_leak_through_several_computed_values_is_reported_with_its_path(
    small: str, old: str, new: str, sink: str
) -> None:
    text = small.replace("  agent skipper", BUOY).replace("  grid cells", FAR).replace(old, new, 1)
    (leak,) = compile_text(text.replace("boat.*, events", "boat.position, events")).diagnostics
    assert leak.code == "LJ0401" and "`victim.position` → `buoy.position` → " in leak.message
    assert leak.message.endswith(f" → {sink}")


def test_receipts_reveal_a_band(small: str) -> None:
    hidden = small.replace("camera nadir", f"band = 20 m..{FROM_AFAR.replace('uav[1]', 'boat')}\n    camera nadir")
    (leak,) = compile_text(hidden).diagnostics
    assert leak.code == "LJ0401" and leak.message.endswith("`uav.band` → the receipts of commands")


def test_receipts_reveal_the_speed_of_an_asset(small: str) -> None:
    hidden = small.replace("heading = 30 deg, speed <= 3 m/s", "heading = 30 deg, hidden speed = 3 m/s")
    (leak,) = compile_text(hidden).diagnostics
    assert leak.code == "LJ0401" and leak.message.endswith("`boat.speed` → the receipts of commands")
    assert compile_text(hidden.replace("3 m/s }", "3 m/s, actions {} }")).diagnostics == ()


def test_a_hidden_drift_leaks_where_the_position_is_observed(small: str) -> None:
    raft = "  target raft : person_in_water { position = (1 m, 2 m), hidden drift = 0.3 m/s }\n"
    text = small.replace("  asset boat", raft + "  asset boat")
    for channel in ("raft.*", "raft.position", "raft.velocity"):
        (leak,) = compile_text(text.replace("observes cells }", f"observes {channel} }}")).diagnostics
        assert leak.code == "LJ0401" and leak.message.endswith("the observation of `raft` by `commander`: `raft.drift`")
    assert compile_text(text.replace("observes cells }", "observes raft.status }")).diagnostics == ()
    unplaced = text.replace("position = (1 m, 2 m), hidden drift", "hidden position = (1 m, 2 m), hidden drift")
    assert compile_text(unplaced.replace("observes cells }", "observes raft.* }")).diagnostics == ()


def test_a_region_around_a_hidden_place_leaks_through_its_grid(small: str) -> None:
    text = small.replace("region search = ", "region near = circle(victim[1], 50 m)\n  region search = ")
    assert compile_text(text).diagnostics == ()
    (leak,) = compile_text(text.replace("grid cells over search", "grid cells over near")).diagnostics[:1]
    assert leak.code == "LJ0401"
    assert "region `near`" in leak.message and "grid `cells`" in leak.message


def test_rules_may_read_everything(small: str) -> None:
    assert compile_text(small.replace("distance_xy(boat, v) <= 50 m", "v.position in search")).diagnostics == ()


def test_observing_a_whole_target_excludes_hidden_values(small: str) -> None:
    assert compile_text(small.replace("observes cells }", "observes victim[1].* }")).diagnostics == ()
