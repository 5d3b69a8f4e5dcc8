"""The ground of the map: shapes, their order of painting, their extent, and maps without a city."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image

import lingjing
from lingjing import Trace
from lingjing.analysis.completion import judged_targets, required_target_groups, sought_targets
from lingjing.analysis.history import history_of
from lingjing.analysis.overview import draw_overview
from lingjing.analysis.played_city import city_of, credit
from lingjing.scene.city import Bridge, Building, City, Lane, PaintedArea, Road, Solid, Water, content_sha256
from lingjing.scene.plan import PLAN, PlanShape, ground_plan, is_sea
from lingjing.testing import PluginHost, instantiate, mission_file

replace = msgspec.structs.replace
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
FAR = tuple((x + 5000.0, y) for x, y in SQUARE)


def a_city(**pieces: object) -> City:
    return City(id="c", origin=(0.0, 0.0), bounds=(-6000.0, -6000.0, 6000.0, 6000.0), **pieces)  # type: ignore[arg-type]


def test_shapes_have_layers_and_are_in_painting_order() -> None:
    lane = Lane(id="l", shape=((0.0, 0.0, 0.0), (10.0, 0.0, 1.0)), width_m=3.5)
    city = a_city(
        waters=(Water(polygon=SQUARE, level_m=0.0, holes=(SQUARE,)),),
        areas=(PaintedArea(polygon=SQUARE, surface="park"), PaintedArea(polygon=SQUARE, surface="residential")),
        solids=(
            Solid(id="wall", polygon=SQUARE, base_m=0.0, top_m=2.0),
            Solid(id="kerb", polygon=SQUARE, base_m=0.0, top_m=0.15),
        ),
        roads=(
            Road(id="r", lanes=(lane, replace(lane, kind="foot"))),
            Road(id="below", lanes=(lane,), tunnel=True),
        ),
        bridges=(Bridge(id="b", path=((0.0, 0.0, 9.0), (9.0, 0.0, 9.0)), width_m=8.0),),
        buildings=(
            Building(id="high", polygon=SQUARE, base_m=0.0, top_m=90.0),
            Building(id="far", polygon=FAR, base_m=0.0, top_m=9.0),
        ),
    )
    shapes = ground_plan(city, (-50.0, -50.0, 50.0, 50.0))
    assert [shape.layer for shape in shapes] == [
        "water", "slab", "area", "area", "path", "road", "solid", "bridge", "building",
    ]  # fmt: skip
    assert [shape.surface for shape in shapes[2:5]] == ["park", "residential", "foot"]
    assert len(ground_plan(city)) == len(shapes) + 1
    assert shapes[0].holes == (SQUARE,)
    line = ((0.0, 0.0), (10.0, 0.0))
    assert shapes[5] == PlanShape("road", line, width_m=3.5, surface="car", heights_m=(0.0, 1.0))


def test_water_is_a_sea_only_if_it_lies_under_everything_else() -> None:
    house = Building(id="b", polygon=SQUARE, base_m=0.0, top_m=9.0)
    sea = Water(polygon=tuple((200.0 * x - 1000.0, 200.0 * y - 1000.0) for x, y in SQUARE), level_m=0.0)
    river = Water(polygon=((-900.0, 0.0), (900.0, -30.0), (900.0, 0.0), (0.0, 40.0), (-900.0, 30.0)), level_m=0.0)
    pond = Water(polygon=SQUARE, level_m=0.0)
    for waters, expected in (((), False), ((river,), False), ((pond,), True), ((river, sea), True)):
        assert is_sea(ground_plan(a_city(waters=waters, buildings=(house,)))) is expected
    far = Building(id="far", polygon=FAR, base_m=0.0, top_m=9.0)
    assert not is_sea(ground_plan(a_city(waters=(pond,), buildings=(house, far))))
    island = replace(sea, holes=(SQUARE,))
    assert not is_sea(ground_plan(a_city(waters=(island,), buildings=(house,))))
    assert is_sea(ground_plan(a_city(waters=(sea,)))) and not is_sea(())


def test_higher_buildings_are_darker_on_a_plan() -> None:
    low, high = (PLAN.colour(PlanShape("building", SQUARE, top_m=top)) for top in (9.0, 90.0))
    assert low is not None and high is not None and low > high
    assert PLAN.colour(PlanShape("building", SQUARE, top_m=-1.0)) is not None


def test_only_a_map_with_an_attribution_has_a_credit() -> None:
    assert credit("procedural") == credit("") == ""
    assert credit("© OpenStreetMap contributors") == "map: © OpenStreetMap contributors"


def played_in(trace: Trace, kind: str, sha256: str) -> Trace:
    instance = replace(trace.header.instance, scene=replace(trace.header.instance.scene, kind=kind))
    header = replace(trace.header, instance=instance, city_sha256=sha256, attribution="© Somebody")
    return Trace(trace.path, header, trace.boundaries, trace.outcome, True, trace.places)


def test_a_city_is_rebuilt_only_if_its_hash_is_the_recorded_one(trace: Trace) -> None:
    city = PluginHost().scene("bay").build(trace.header.instance.scene)
    assert city_of(played_in(trace, "bay", "0" * 64)) is None
    assert city_of(played_in(trace, "atlantis", content_sha256(city))) is None
    assert city_of(played_in(trace, "bay", content_sha256(city))) == city


def test_the_city_and_its_credit_are_on_the_overview(trace: Trace, tmp_path: Path) -> None:
    city = PluginHost().scene("bay").build(trace.header.instance.scene)
    draw_overview(played_in(trace, "bay", content_sha256(city)), tmp_path / "on.png")
    draw_overview(played_in(trace, "bay", "0" * 64), tmp_path / "off.png")
    on, off = (
        np.asarray(Image.open(tmp_path / name).convert("RGB"), int)[90:740, 30:1070] for name in ("on.png", "off.png")
    )
    assert (np.abs(on - off).max(axis=2) > 8).mean() > 0.5  # the sea is drawn
    corner = off[-22:, -120:]
    assert corner.min() < 120  # the credit is drawn on blank ground too


@pytest.mark.parametrize(
    ("mission", "expected"), [("ufr", {"fire"}), ("cd", {"point"}), ("vdn", {"home"}), ("cr", set())]
)
def test_the_required_groups_follow_from_the_success_condition(mission: str, expected: set[str]) -> None:
    required = required_target_groups(instantiate(lingjing.compile(mission_file(mission)), seed=0))
    assert required >= expected
    assert "jam" not in required and "depot" not in required


@pytest.mark.parametrize("name", ["bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn"])
def test_no_rival_of_a_shipped_mission_is_sought(name: str) -> None:
    """At tier 1 missions gain targets that only resemble those of tier 0, and other obstacles."""
    mission = lingjing.compile(mission_file(name))
    plain, hard = (instantiate(mission, seed=0, tier=tier) for tier in (0, 1))
    groups = {entity.id: entity.group for entity in hard.entities}
    rivals = set(groups.values()) - {entity.group for entity in plain.entities}
    assert sought_targets(plain) and not rivals.intersection(groups[name] for name in sought_targets(hard))
    assert judged_targets(hard) <= sought_targets(hard) >= judged_targets(plain)


def test_a_target_that_success_does_not_require_is_not_missed(trace: Trace) -> None:
    target = next(e for e in trace.header.instance.entities if e.role == "target")
    depot = replace(target, id="depot", group="depot")
    instance = replace(trace.header.instance, entities=(*trace.header.instance.entities, depot))
    early = Trace(trace.path, replace(trace.header, instance=instance), trace.boundaries[:3], None, False)
    assert history_of(early).fate["depot"] == "aside"
    assert history_of(early).fate[target.id] == "missed"
