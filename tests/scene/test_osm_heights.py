"""Heights of buildings without tagged heights: from their place and from their tagged neighbours."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from statistics import median

import pytest

from lingjing.scene.city import Building
from lingjing.scene.osm.buildings import RaisedBuildings, buildings, is_building
from lingjing.scene.osm.features import Features, collect
from lingjing.scene.osm.frame import choose
from lingjing.scene.osm.heights import HEIGHT_KEYS, LEVEL_KEYS, is_tagged
from lingjing.scene.osm.read import read
from lingjing.scene.osm.storeys import tallest_m
from tests.scene.osm_maps import Map, square

DATA = Path(__file__).parents[3] / "shared" / "data"
LUJIAZUI = DATA / "shanghai_lujiazui.osm"

MEDIAN_ERRORS_M = {0: 24.9, 1: 12.0, 2: 12.0, 4: 16.0}
"""Seed → median error over the hidden half of Lujiazui's tagged heights, metres, measured at commit 398c89b3, before
storeys depended on the place."""


def raised(made: Map, folder: Path, default_levels: int | None = None) -> RaisedBuildings:
    return buildings(made.features(folder), 0, default_levels)


def untagged(result: RaisedBuildings) -> list[Building]:
    return [building for building in result.buildings if result.sources[building.id] != "tagged"]


def over_20_m(result: RaisedBuildings) -> float:
    """Share of the untagged buildings above 20 m."""
    drawn = untagged(result)
    return sum(building.top_m > 20.0 for building in drawn) / len(drawn)


def rows(made: Map, x: float, y: float, count: int, wide: float, high: float, **tags: str) -> list[str]:
    """Add buildings in rows of ten, 15 m apart, and return their ids."""
    ids = []
    for number in range(count):
        row, column = divmod(number, 10)
        outline = square(x + column * (wide + 15.0), y + row * (high + 15.0), wide, high)
        ids.append(f"w{made.way(outline, {'building': 'yes', **tags})}")
    return ids


def commercial_land(made: Map) -> list[str]:
    """Add twenty untagged buildings with footprints of towers on commercial land."""
    made.way(square(-450, 150, 900, 300), {"landuse": "commercial"})
    return rows(made, -440, 160, 20, 28.0, 28.0)


# -- heights that follow from the place


@pytest.mark.parametrize(
    "place",
    [
        {"place": "town", "population": "25 000"}, {"place": "town", "name": "青山镇"}, {"place": "village"},
        {"place": "hamlet"}, {"place": "city", "population": "18,300"}, {},
    ],
)  # fmt: skip
def test_no_towers_stand_in_a_small_place(tmp_path: Path, place: dict[str, str]) -> None:
    made = Map()
    made.node(0, 0, **place)
    land = commercial_land(made)
    rows(made, -440, -440, 60, 14.0, 40.0)
    rows(made, -440, 0, 10, 20.0, 30.0, building="office")
    rows(made, 100, 0, 10, 16.0, 50.0, building="apartments")
    result = raised(made, tmp_path)
    assert over_20_m(result) <= 0.02
    tops = [building.top_m for building in result.buildings if building.id in land]
    assert len(tops) == 20
    assert max(tops) < 24.0


def test_isolated_buildings_in_fields_are_no_blocks(tmp_path: Path) -> None:
    made = Map()
    farm = made.way(square(0, 0, 24), {"building": "yes"})
    flats = made.way(square(450, 0, 24), {"building": "apartments"})
    tower = made.way(square(-450, 0, 24), {"building": "apartments", "building:levels": "9"})
    tops = {building.id: building.top_m for building in raised(made, tmp_path).buildings}
    assert tops[f"w{farm}"] <= 9.0
    assert tops[f"w{flats}"] <= 12.0
    assert tops[f"w{tower}"] == 27.0


def test_a_large_city_has_towers_only_where_tags_of_buildings_indicate_them(tmp_path: Path) -> None:
    made = Map()
    made.node(0, 0, place="city", population="24000000")
    land = commercial_land(made)
    offices = rows(made, -440, -440, 20, 30.0, 30.0, building="office")
    levels = {building.id: building.levels for building in raised(made, tmp_path).buildings}
    assert median(levels[ref] for ref in offices) >= 10
    assert max(levels[ref] for ref in land) <= 8


def test_a_metro_indicates_a_large_city_if_no_place_is_named(tmp_path: Path) -> None:
    tops = []
    for tags in ({"railway": "subway"}, {"railway": "rail"}):
        made = Map()
        made.way([(-400, 300), (400, 300)], tags)
        rows(made, -440, -440, 40, 14.0, 40.0, building="apartments")
        tops.append(median(building.top_m for building in raised(made, tmp_path).buildings))
    assert tops[0] > 20.0 > tops[1]


def test_the_nearest_place_counts_in_relation_to_its_size(tmp_path: Path) -> None:
    made = Map(half_m=6000.0)
    made.node(0, 0, place="city", population="3000000")
    made.node(5000, 0, place="village", population="500")
    made.node(-300, 0, place="suburb", population="800")
    city = rows(made, -200, -200, 20, 14.0, 40.0, building="apartments")
    village = rows(made, 4900, -100, 20, 14.0, 40.0, building="apartments")
    levels = {building.id: building.levels for building in raised(made, tmp_path).buildings}
    assert median(levels[ref] for ref in city) >= 6
    assert max(levels[ref] for ref in village) <= 3


def test_a_place_outside_of_the_built_part_counts(tmp_path: Path) -> None:
    made = Map(half_m=None)
    made.node(900, 900, place="city", population="3000000")
    ids = rows(made, -440, -440, 60, 14.0, 40.0, building="apartments")
    data = read(made.write(tmp_path / "small.osm"))
    whole = {building.id: building for building in buildings(collect(data, choose(data, None)), 0).buildings}
    west, south, east, north = choose(data, None).box
    width, height = east - west, north - south
    cut = west + 0.3 * width, south + 0.3 * height, west + 0.6 * width, south + 0.6 * height
    part = {building.id: building for building in buildings(collect(data, choose(data, cut)), 0).buildings}
    assert 3 < len(part) < len(whole) == len(ids)
    assert {ref: building.levels for ref, building in part.items()} == {ref: whole[ref].levels for ref in part}


def test_the_tallest_building_rises_with_the_population() -> None:
    heights = [tallest_m(float(10**k)) for k in range(8)]
    assert heights == sorted(heights)
    assert heights[3] == 9.0
    assert tallest_m(25_000.0) < 16.0
    assert heights[-1] == 115.0


def test_own_tags_and_footprints_limit_heights(tmp_path: Path) -> None:
    made = Map()
    made.node(0, 0, place="town", population="25000")
    made.way(square(-450, -450, 300), {"landuse": "industrial"})
    words = ("garage", "garages", "shed", "carport", "yes", "industrial", "warehouse")
    small = [made.way(square(-400 + 20 * k, -400, 7.3), {"building": word}) for k, word in enumerate(words)]
    leveled = made.way(square(-100, -400, 7.3), {"building": "garage", "building:levels": "1"})
    yard = made.way(square(-400, -300, 60, 80), {"building": "yes", "name": "Timber yard"})
    church = made.way(square(0, -300, 15, 30), {"building": "church"})
    rows(made, -440, 0, 20, 10.0, 12.0)
    shed = made.way(square(-435, 20, 5, 6), {"building": "yes"})
    tops = {building.id: building.top_m for building in raised(made, tmp_path).buildings}
    assert all(2.5 <= tops[f"w{ref}"] <= 4.0 for ref in small)
    assert tops[f"w{leveled}"] == 3.0
    assert tops[f"w{yard}"] <= 16.0
    assert 8.0 <= tops[f"w{church}"] <= 20.0
    assert tops[f"w{shed}"] <= 3.0


# -- heights that follow from the neighbours


def test_three_towers_do_not_raise_the_other_buildings_of_a_town(tmp_path: Path) -> None:
    made = Map()
    made.node(0, 0, place="town", population="25000")
    rows(made, -440, -440, 80, 14.0, 30.0)
    rows(made, 0, 100, 3, 14.0, 30.0, **{"building:levels": "14"})
    made.way(square(200, 200, 12, 12), {"building": "church", "height": "64"})
    made.way(square(200, 300, 12, 12), {"building": "silo", "height": "45"})
    assert over_20_m(raised(made, tmp_path)) <= 0.02


def test_untagged_buildings_in_an_estate_of_towers_are_towers(tmp_path: Path) -> None:
    made = Map()
    made.node(0, 0, place="town", population="25000")
    made.way(square(-450, -450, 900), {"landuse": "residential"})
    rows(made, -440, -440, 30, 22.0, 30.0, **{"building:levels": "16"})
    hidden = rows(made, -440, 100, 10, 22.0, 30.0)
    shops = rows(made, -440, 200, 5, 22.0, 30.0, shop="mall")
    result = raised(made, tmp_path)
    levels = {building.id: building.levels for building in result.buildings}
    assert all(12 <= levels[ref] <= 20 for ref in hidden)
    assert {result.sources[ref] for ref in hidden} == {"inferred"}
    assert max(levels[ref] for ref in shops) <= 5
    counts = result.counts()
    assert (counts.tagged, counts.inferred, counts.default) == (30, 10, 0)
    assert counts.drawn == 5
    assert counts.tallest_inferred_m == max(b.top_m for b in untagged(result) if b.id in hidden)
    assert counts.tallest_drawn_m == max(b.top_m for b in untagged(result) if b.id in shops)


def test_an_exceptionally_tall_tower_does_not_raise_its_neighbours(tmp_path: Path) -> None:
    made = Map()
    made.way(square(-450, -450, 900), {"landuse": "commercial"})
    rows(made, -440, -440, 10, 30.0, 30.0, **{"building:levels": "20"})
    made.way(square(0, 0, 40), {"building": "yes", "building:levels": "128"})
    near = made.way(square(60, 0, 40), {"building": "yes"})
    levels = {building.id: building.levels for building in raised(made, tmp_path).buildings}
    assert levels[f"w{near}"] <= 26


# -- heights on request


def test_default_levels_count_where_tags_state_none(tmp_path: Path) -> None:
    made = Map()
    made.node(0, 0, place="village")
    plain = rows(made, -440, -440, 20, 14.0, 30.0)
    garage = made.way(square(0, 0, 7.3), {"building": "garage"})
    tower = made.way(square(100, 0, 20), {"building": "yes", "building:levels": "9"})
    result = raised(made, tmp_path, default_levels=7)
    levels = {building.id: building.levels for building in result.buildings}
    assert {levels[ref] for ref in plain} == {7}
    assert levels[f"w{garage}"] == 1
    assert levels[f"w{tower}"] == 9
    assert result.counts().default == 20


# -- real places


@pytest.mark.parametrize("place", ["krems", "north-bayreuth", "krautsand"])
@pytest.mark.parametrize("is_named", [True, False])
def test_untagged_buildings_of_real_small_towns_are_low(place: str, is_named: bool) -> None:
    features = _features(DATA / "maps" / f"{place}.osm.gz")
    if not is_named:
        features = dataclasses.replace(features, places=())
    result = buildings(features, 0)
    assert over_20_m(result) <= 0.02
    assert max(building.top_m for building in untagged(result)) < 30.0
    garages = [b for b in features.areas if b.tags.get("building") in ("garage", "garages")]
    tops = {building.id: building.top_m for building in result.buildings}
    assert all(tops.get(garage.ref, 0.0) <= 4.0 for garage in garages)


def test_hidden_heights_of_lujiazui_are_estimated_at_least_as_well_as_before() -> None:
    features = _features(LUJIAZUI)
    true_tops = {building.id: building.top_m for building in buildings(features, 0).buildings}
    for seed, before_m in MEDIAN_ERRORS_M.items():
        pool = [area.ref for area in features.areas if is_building(area.tags) and is_tagged(area.tags)]
        hidden = set(random.Random(seed).sample(pool, len(pool) // 2))
        shown = _with_tags(features, lambda ref, hidden=hidden: ref in hidden)
        tops = {building.id: building.top_m for building in buildings(shown, 0).buildings}
        errors = [abs(tops[ref] - true_tops[ref]) for ref in sorted(hidden) if ref in tops and ref in true_tops]
        assert len(errors) >= 50
        assert median(errors) <= before_m, f"seed {seed}"


@cache
def _features(path: Path) -> Features:
    if not path.is_file():
        pytest.skip(f"there is no map at {path}")
    data = read(path)
    return collect(data, choose(data, None))


def _with_tags(features: Features, hides: Callable[[str], bool]) -> Features:
    """The features without the heights of those for which `hides` is true."""
    areas = tuple(
        dataclasses.replace(area, tags=_without_heights(area.tags)) if hides(area.ref) else area
        for area in features.areas
    )
    return dataclasses.replace(features, areas=areas)


def _without_heights(tags: Mapping[str, str]) -> dict[str, str]:
    return {key: value for key, value in tags.items() if key not in (*HEIGHT_KEYS, *LEVEL_KEYS)}
