"""The bay fits the sea-rescue listing, is a pure function of its spec, and depends on the seed."""

import os
import subprocess
import sys
from math import hypot

import msgspec
import pytest
import shapely

from lingjing.errors import UsageError
from lingjing.mission.instance import SceneSpec
from lingjing.scene.bay import apron_top_m, build
from lingjing.scene.city import City
from lingjing.scene.outlines import within

UAVS = ((306.6, -620.2), (310.0, -590.1), (278.7, -590.1))
SEARCH = shapely.box(-200.0, -1120.0, 750.0, -740.0)


def bay(seed: int = 7, **options: object) -> City:
    return build(SceneSpec(kind="bay", datum_m=-3.5, seed=seed, options=options))


def land(city: City) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(part.polygon) for part in city.lands])


def test_the_bay_has_water_in_the_search_area_and_land_at_the_start_of_the_uavs() -> None:
    city = bay()
    ground = land(city)
    assert not ground.intersects(SEARCH)
    assert ground.distance(shapely.Point(12.4, -1351.8)) > 50.0
    assert city.waters[0].level_m == -3.5 and shapely.Polygon(city.waters[0].polygon).contains(SEARCH)
    for east, north in UAVS:
        for turn in ((0, 0), (24, 0), (-24, 0), (0, 24), (0, -24)):
            spot = shapely.Point(east + turn[0], north + turn[1])
            tops = [part.top_m for part in city.lands if shapely.Polygon(part.polygon).contains(spot)]
            assert max(tops) == 0.9
            assert not any(shapely.Polygon(s.polygon).contains(spot) for s in city.solids if s.top_m > 1.0)


def test_open_water_extends_far_enough_for_other_search_areas() -> None:
    ground = land(bay())
    point = shapely.box(85.0, -712.0, 586.0, -425.0)
    assert ground.difference(point).distance(shapely.Point(0.0, 0.0)) > 1560.0


def test_polygons_are_simple_and_anticlockwise() -> None:
    city = bay()
    for polygon in [p.polygon for p in (*city.waters, *city.lands, *city.solids)]:
        ring = shapely.LinearRing(polygon)
        assert ring.is_simple and ring.is_ccw and polygon[0] != polygon[-1]


def test_distractors_float_on_open_water_also_in_the_search_area() -> None:
    city = bay()
    ground = shapely.union_all([shapely.Polygon(part.polygon) for part in city.lands[2:]])
    afloat = [prop for prop in city.props if prop.floating]
    assert len(afloat) > 400 and len({prop.id for prop in city.props}) == len(city.props)
    assert not any(ground.contains(shapely.Point(prop.position[:2])) for prop in afloat)
    assert {prop.position[2] for prop in afloat} == {-3.5}
    for seed in range(5):
        here = [p for p in bay(seed).props if p.floating and SEARCH.contains(shapely.Point(p.position[:2]))]
        assert 5 <= len(here) <= 40
        assert {p.cls for p in here} >= {"buoy", "debris"}
        assert not any("person" in p.cls or "person" in p.model for p in here)
    assert not any(hypot(p.position[0] - 12.4, p.position[1] + 1351.8) < 25.0 for p in city.props)


def test_the_seed_changes_only_props_and_wrong_options_are_refused() -> None:
    assert bay(1) == bay(1)
    assert bay(1).props != bay(2).props and bay(1).lands == bay(2).lands
    assert not any(p.id.startswith("afloat") for p in bay(1, distractors=0).props)
    with pytest.raises(UsageError, match="`fog`"):
        bay(1, fog=True)
    with pytest.raises(UsageError, match="distractors"):
        bay(1, distractors="many")


def test_the_apron_stays_above_the_water_for_another_datum() -> None:
    high = build(SceneSpec(kind="bay", datum_m=0.0))
    assert apron_top_m(0.0) == 1.5 and max(p.top_m for p in high.lands if p.surface == "concrete") == 1.5
    assert apron_top_m(-3.5) == 0.9


def test_within_applies_the_margin_to_the_outline() -> None:
    square = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
    assert within(square, 5, 5) and not within(square, 12, 5)
    assert (
        within(square, 12, 5, margin_m=3)
        and not within(square, 9, 5, margin_m=-2)
        and within(square, 5, 5, margin_m=-2)
    )


def test_the_bay_is_the_same_in_another_process_and_needs_no_numpy() -> None:
    code = (
        "import sys, hashlib, msgspec; from lingjing.scene.bay import build;"
        "from lingjing.mission.instance import SceneSpec;"
        "c = build(SceneSpec(kind='bay', datum_m=-3.5, seed=7)); assert 'numpy' not in sys.modules;"
        "print(hashlib.sha256(msgspec.json.encode(c)).hexdigest())"
    )
    out = [
        subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": h}, check=True,
                       capture_output=True, text=True).stdout
        for h in ("1", "2")
    ]  # fmt: skip
    assert out[0] == out[1]
    assert msgspec.json.decode(msgspec.json.encode(bay()), type=City) == bay()
