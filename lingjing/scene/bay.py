"""The `bay` scene: open water around a small harbour point, inside a wide ring of coast that is open to the south.

The layout fits the paper's sea-rescue listing: the UAVs start on the apron near (300, -600), the lifeboat at (12,
-1352), and the search area lies south of -750. Water reaches 1.6 km around the origin, so other search polygons fit as
well; only the point itself, inside (85..585, -712..-425), is land. The layout is fixed. The seed decides the floating
objects, the places of rocks and trees, and the headings of boats.

Options: `distractors` (floating objects per square kilometre) and `centre` (the place of the bay's centre).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from math import cos, hypot, pi, radians, sin
from random import Random

from lingjing.mission.geometry2d import Polygon, rectangle
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import builtin_scenes, centre_m, check_scene, reach_m
from lingjing.scene.city import City, Land, Prop, Solid, Water
from lingjing.scene.districts.draft import stream
from lingjing.scene.outlines import within
from lingjing.scene.translation import translate

APRON_TOP_M = 0.9
"""Elevation of the UAV apron, metres: the listing's 1.1 m less the height of a quadrotor's legs."""

_KIND = builtin_scenes()["bay"]
REACH_M = reach_m(SceneSpec(kind=_KIND.name)) or 0.0
"""Half side of the city about the origin, metres."""

OPEN_WATER_M = 1600.0
"""Distance from the origin within which floating objects and moored boats are placed, metres (chosen)."""

(POINT,) = _KIND.land
POINT_GRASS: Polygon = (
    (128.0, -600.0), (150.0, -628.0), (196.0, -640.0), (250.0, -622.0), (350.0, -622.0), (412.0, -646.0),
    (460.0, -640.0), (498.0, -584.0), (500.0, -532.0), (462.0, -488.0), (404.0, -466.0), (330.0, -458.0),
    (256.0, -466.0), (190.0, -496.0), (146.0, -546.0),
)  # fmt: skip
"""Grass of the harbour point."""
HEADLAND: Polygon = (
    (462.0, -700.0), (498.0, -706.0), (548.0, -682.0), (578.0, -634.0), (572.0, -584.0), (536.0, -556.0),
    (502.0, -584.0), (478.0, -640.0),
)  # fmt: skip
"""Rock of the harbour point."""
APRON: Polygon = ((228.0, -676.0), (362.0, -676.0), (362.0, -548.0), (228.0, -548.0))
"""Concrete on which the UAVs start."""
WATERSIDE_ROCKS = ((96.0, -628.0), (430.0, -702.0), (470.0, -706.0), (540.0, -692.0), (574.0, -650.0), (580.0, -604.0))
"""Centres about which rocks lie at the waterside."""

KEPT = 8
"""Cached bays of a process (chosen): episodes of one mission and seed, and the trials of a check, share one."""

AFLOAT: tuple[tuple[str, str, int], ...] = (
    ("buoy", "buoy_orange", 5),
    ("buoy", "buoy_red", 4),
    ("buoy", "buoy_yellow", 2),
    ("debris", "life_ring", 3),
    ("debris", "driftwood", 5),
    ("debris", "crate", 3),
    ("debris", "barrel", 2),
    ("debris", "jerrycan", 2),
    ("debris", "seaweed", 4),
    ("debris", "tarpaulin", 2),
)
"""(class, model, weight) of the floating objects. Some are orange or as large as a person; none is a person."""


def build(spec: SceneSpec) -> City:
    """The bay of a spec. Raises `UsageError` for an unknown option.

    Objects on land depend on the layout alone and are the same in every episode. Floating objects depend on the seed.
    """
    return _built(spec.datum_m, _density(spec), spec.seed, spec.layout, spec.origin, centre_m(spec))


@lru_cache(KEPT, typed=True)
def _built(
    level: float, density: float, seed: int, layout: int, origin: tuple[float, float], centre: tuple[float, float]
) -> City:
    east, north = centre
    lands = _lands(level)
    city = City(
        id=f"bay-{seed}",
        origin=origin,
        bounds=(east - REACH_M, north - REACH_M, east + REACH_M, north + REACH_M),
        datum_m=level,
        waters=(Water(polygon=_box(-REACH_M, -REACH_M, REACH_M, REACH_M), level_m=level),),
        lands=lands,
        solids=tuple(_solids(level)),
        props=(
            *_harbour(level, stream(seed, "bay/harbour")),
            *_trees(level, stream(layout, "bay/trees")),
            *_rocks(level, stream(layout, "bay/rocks")),
            *_anchored(level, stream(seed, "bay/anchored")),
            *_afloat(level, density, stream(seed, "bay/afloat")),
        ),
        attribution="procedural",
    )
    return translate(city, (east, north))


def _density(spec: SceneSpec) -> float:
    check_scene(spec)
    return float(spec.options.get("distractors", sum(_KIND.default("distractors"))))  # type: ignore[arg-type]


def apron_top_m(level_m: float) -> float:
    """Elevation of the apron's surface over water at `level_m`: the listing's, or 1.5 m above higher water."""
    return APRON_TOP_M if level_m <= APRON_TOP_M - 1.0 else level_m + 1.5


def _lands(level: float) -> tuple[Land, ...]:
    top = apron_top_m(level)
    return (
        Land(polygon=_coast(1690.0, 0.0), top_m=level + 2.0, surface="sand"),
        Land(polygon=_coast(1760.0, 60.0), top_m=level + 34.0, surface="grass"),
        Land(polygon=POINT, top_m=level + 1.7, surface="sand"),
        Land(polygon=POINT_GRASS, top_m=top - 0.4, surface="grass"),
        Land(polygon=HEADLAND, top_m=level + 7.5, surface="rock"),
        Land(polygon=APRON, top_m=top, surface="concrete"),
    )


def _coast(radius: float, inset: float) -> Polygon:
    """A ring sector around the origin, open to the south, with a wavy inner edge."""
    span = [radians(-118.0 + 236.0 * k / 72) for k in range(73)]
    inner = [(a, radius + 45.0 * sin(7.0 * a) + 30.0 * sin(17.0 * a + 1.0) + 12.0 * sin(41.0 * a)) for a in span]
    outer = [(a, REACH_M - 40.0 - inset) for a in span[::6]]
    return tuple((r * sin(a), r * cos(a)) for a, r in (*inner, *outer[::-1]))


def _box(west: float, south: float, east: float, north: float) -> Polygon:
    return rectangle((west, south), (east, north))


def _solids(level: float) -> Iterator[Solid]:
    top = apron_top_m(level)
    yield from _pier(level, east=62.0, west_to=148.0, north=-652.0)
    yield Solid(id="hut", polygon=_box(238.0, -568.0, 254.0, -556.0), base_m=top, top_m=top + 4.2, material="plaster")
    yield Solid(id="hut-roof", polygon=_box(237.0, -569.0, 255.0, -555.0), base_m=top + 4.2, top_m=top + 4.7,
                material="tile")  # fmt: skip
    yield Solid(id="shed", polygon=_box(330.0, -566.0, 356.0, -553.0), base_m=top, top_m=top + 6.0, material="metal")
    for k, east in enumerate(range(232, 361, 16)):
        yield Solid(id=f"bollard-{k}", polygon=_box(east, -675.4, east + 0.5, -674.9), base_m=top, top_m=top + 0.6,
                    material="iron")  # fmt: skip
    for k, (column, row) in enumerate(((340.0, -640.0), (340.0, -636.5), (346.0, -600.0), (232.0, -600.0))):
        yield Solid(id=f"container-{k}", polygon=_box(column, row, column + 12.2, row + 2.44), base_m=top,
                    top_m=top + 2.6, material=("red", "blue", "green", "blue")[k])  # fmt: skip
    yield Solid(id="edge-line", polygon=_box(230.0, -673.6, 360.0, -673.2), base_m=top, top_m=top + 0.01,
                material="paint")  # fmt: skip
    tower = tuple((531.0 + 3.0 * cos(k * pi / 6), -620.0 + 3.0 * sin(k * pi / 6)) for k in range(12))
    gallery = tuple((531.0 + 3.6 * cos(k * pi / 6), -620.0 + 3.6 * sin(k * pi / 6)) for k in range(12))
    base = level + 7.0
    yield Solid(id="lighthouse", polygon=tower, base_m=base, top_m=base + 9.0, material="white")
    yield Solid(id="lighthouse-band", polygon=tower, base_m=base + 9.0, top_m=base + 12.0, material="red")
    yield Solid(id="lighthouse-top", polygon=tower, base_m=base + 12.0, top_m=base + 16.0, material="white")
    yield Solid(id="lighthouse-gallery", polygon=gallery, base_m=base + 16.0, top_m=base + 17.0, material="red")


def _pier(level: float, east: float, west_to: float, north: float) -> Iterator[Solid]:
    deck = level + 2.1
    yield Solid(id="pier", polygon=_box(east - 48.0, north - 2.0, west_to, north + 2.0), base_m=deck - 0.35, top_m=deck,
                material="wood")  # fmt: skip
    yield Solid(id="pier-head", polygon=_box(east - 54.0, north - 12.0, east - 46.0, north + 12.0), base_m=deck - 0.35,
                top_m=deck, material="wood")  # fmt: skip
    for k in range(16):
        x = east - 46.0 + 8.0 * k
        for side in (-1.8, 1.8):
            yield Solid(id=f"pile-{k}-{'s' if side < 0 else 'n'}",
                        polygon=_box(x - 0.2, north + side - 0.2, x + 0.2, north + side + 0.2),
                        base_m=level - 3.0, top_m=deck + 0.7, material="wood")  # fmt: skip


def _harbour(level: float, chance: Random) -> Iterator[Prop]:
    top = apron_top_m(level)
    for k, (east, north) in enumerate(((306.6, -620.2), (310.0, -590.1), (278.7, -590.1))):
        yield Prop(id=f"pad-{k}", cls="concrete", model="helipad", position=(east, north, top))
    for k in range(7):
        east = 22.0 + 11.0 * k
        side = -1.0 if k % 2 else 1.0
        model = chance.choice(("dinghy", "fishing_boat", "rowing_boat"))
        yield Prop(id=f"berth-{k}", cls="moored_boat", model=model, floating=True,
                   position=(east, -652.0 + side * (5.0 + chance.random()), level),
                   heading_deg=90.0 + chance.uniform(-4.0, 4.0) + (180.0 if chance.random() < 0.5 else 0.0),
                   scale=chance.uniform(0.9, 1.1), options={"variant": k})  # fmt: skip


def _trees(level: float, chance: Random) -> Iterator[Prop]:
    ground = apron_top_m(level) - 0.4
    for k in range(130):
        east, north = chance.uniform(140.0, 500.0), chance.uniform(-640.0, -460.0)
        scale, model = chance.uniform(0.7, 1.35), "pine" if chance.random() < 0.45 else "tree"
        clear = within(APRON, east, north, margin_m=7.0) or within(HEADLAND, east, north, margin_m=4.0)
        if within(POINT_GRASS, east, north, margin_m=-8.0) and not clear:
            yield Prop(id=f"tree-{k}", cls="tree", model=model, position=(east, north, ground - 0.3), scale=scale,
                       heading_deg=chance.uniform(0.0, 360.0), options={"variant": k})  # fmt: skip
    for k in range(170):
        angle, radius = radians(chance.uniform(-112.0, 112.0)), chance.uniform(2150.0, 2500.0)
        yield Prop(id=f"wood-{k}", cls="tree", model="pine", scale=chance.uniform(1.6, 2.6),
                   position=(radius * sin(angle), radius * cos(angle), level + 32.0),
                   options={"variant": k})  # fmt: skip


def _rocks(level: float, chance: Random) -> Iterator[Prop]:
    for k in range(70):
        east, north = chance.choice(WATERSIDE_ROCKS)
        at = (east + chance.gauss(0.0, 9.0), north + chance.gauss(0.0, 6.0))
        size = chance.uniform(0.5, 2.4)
        if at[1] > -722.0:
            yield Prop(id=f"rock-{k}", cls="rock", model="rock", position=(*at, level + 0.1), scale=size,
                       heading_deg=chance.uniform(0.0, 360.0), options={"variant": k})  # fmt: skip
    for k in range(9):
        at = _open_water(chance)
        for part in range(chance.randint(1, 3)):
            spot = (at[0] + chance.gauss(0.0, 2.0), at[1] + chance.gauss(0.0, 2.0), level - 0.2)
            yield Prop(id=f"skerry-{k}-{part}", cls="rock", model="rock", position=spot,
                       scale=chance.uniform(0.4, 1.3), heading_deg=chance.uniform(0.0, 360.0),
                       options={"variant": k + part})  # fmt: skip


def _anchored(level: float, chance: Random) -> Iterator[Prop]:
    for k in range(14):
        east, north = _open_water(chance)
        model = chance.choice(("dinghy", "fishing_boat", "sailboat", "rowing_boat"))
        yield Prop(id=f"anchored-{k}", cls="moored_boat", model=model, position=(east, north, level), floating=True,
                   heading_deg=chance.uniform(0.0, 360.0), options={"variant": k})  # fmt: skip


def _afloat(level: float, density: float, chance: Random) -> Iterator[Prop]:
    models = [(cls, model) for cls, model, weight in AFLOAT for _ in range(weight)]
    for k in range(round(density * (2 * OPEN_WATER_M / 1000.0) ** 2)):
        cls, model = chance.choice(models)
        east, north = _open_water(chance)
        scale, heading = chance.uniform(0.8, 1.25), chance.uniform(0.0, 360.0)
        yield Prop(id=f"afloat-{k}", cls=cls, model=model, position=(east, north, level), heading_deg=heading,
                   scale=scale, floating=True, options={"variant": k})  # fmt: skip


def _open_water(chance: Random) -> tuple[float, float]:
    """A random point on open water, clear of the harbour point, the pier and the lifeboat's berth, inside the coast."""
    while True:
        east, north = chance.uniform(-OPEN_WATER_M, OPEN_WATER_M), chance.uniform(-OPEN_WATER_M, OPEN_WATER_M)
        dry = within(POINT, east, north, margin_m=12.0) or (0.0 < east < 150.0 and -675.0 < north < -630.0)
        berth = hypot(east - 12.4, north + 1351.8) < 25.0
        if hypot(east, north) < OPEN_WATER_M and not dry and not berth:
            return round(east, 2), round(north, 2)


__all__ = ["APRON_TOP_M", "apron_top_m", "build"]
