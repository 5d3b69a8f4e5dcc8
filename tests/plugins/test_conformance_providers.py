"""The conformance kit on scenes, files of kinds, thin bodies and cases with unknown commands."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest

from lingjing.errors import PluginError, UsageError
from lingjing.mission import kinds
from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins import conformance as kit
from lingjing.plugins.hookspecs import ScenePlugin, hookimpl
from lingjing.scene.city import City, Land, Road, Water
from lingjing.scene.city import Lane as CityLane
from lingjing.testing import PluginHost, city_of, compile_text, instantiate
from lingjing.trace.records import Command

MISSION = """\
ljs 1
use std.air { quadrotor }
target thing { engine = city, on = ground, length = %g m, width = %g m, height = %g m, colour = blue }
mission thin "Thin" {
  goal "Look."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 5, policy <= 9 s, engine <= 30 s, capture <= 10 s }
  mode single
  target thing : thing { position = (330 m, -600 m, 1 m) }
  asset uav : quadrotor { position = (0 m, -700 m, 20 m), band = 10 m..60 m, actions { takeoff, stop } }
  agent pilot as flyer controls uav { observes uav.* }
  adjudicate aloft() { when uav.position.z >= 59 m }
  success when aloft()
}
"""


def instance_with(length: float = 1.0, width: float = 1.0, height: float = 1.0) -> Instance:
    mission = compile_text(MISSION % (length, width, height)).mission
    assert mission is not None
    return instantiate(mission)


@pytest.mark.parametrize("size", [(100.0, 0.5, 0.5), (0.5, 0.5, 100.0), (0.3, 0.3, 0.3)])
def test_long_tall_and_small_bodies_pass_the_checks_of_bodies(size: tuple[float, float, float]) -> None:
    mission = compile_text(MISSION % size).mission
    assert mission is not None
    kit.check_body(mission, "thing")


# -- cases


def engine_case(*commands: Command) -> kit.EngineCase:
    plugin = PluginHost().engine("multirotor")
    return kit.EngineCase(plugin, instance_with(), city_of(SceneSpec(kind="bay", datum_m=-3.5)), commands, seconds=2.0)


def order(resource: str, verb: str, **arguments: float) -> Command:
    return Command(id="c0-1", tick=0, sender="test", resource=resource, verb=verb, arguments=arguments)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (order("uaw", "takeoff"), "the engine owns uav and no `uaw`"),
        (order("thing", "takeoff"), "the engine owns uav and no `thing`"),
        (order("uav", "tkeoff"), "`uav` has no verb `tkeoff`, it has takeoff, stop"),
    ],
)
def test_a_case_with_an_unknown_entity_or_verb_fails(command: Command, message: str) -> None:
    with pytest.raises(
        kit.ConformanceError, match=f"breaks its contract: commands: the case's command c0-1: {message}"
    ):
        case = engine_case(command)
        kit.check_engine(case.plugin, case.instance, case.city, case.commands, seconds=2.0)


def test_a_case_whose_commands_the_engine_rejects_as_unknown_fails() -> None:
    """If an entity declares no verbs, the engine decides which verbs exist."""
    case = engine_case(order("uav", "somersault"))
    entities = tuple(msgspec.structs.replace(entity, verbs=()) for entity in case.instance.entities)
    bare = msgspec.structs.replace(case.instance, entities=entities)
    with pytest.raises(kit.ConformanceError, match="the case's command c0-1 is rejected: unknown_verb"):
        kit.check_commands(kit.EngineCase(case.plugin, bare, case.city, case.commands, seconds=2.0))
    kit.check_commands(engine_case(order("uav", "takeoff")))


# -- scenes


@pytest.mark.parametrize(
    "spec",
    [
        SceneSpec(kind="bay", datum_m=-3.5, seed=3),
        SceneSpec(kind="residential", options={"extent_m": 300.0}, seed=3),
        SceneSpec(kind="coastal", datum_m=-3.0, options={"extent_m": 400.0}, seed=3),
    ],
    ids=lambda spec: spec.kind,
)
def test_the_built_in_scenes_conform(spec: SceneSpec) -> None:
    kit.check_scene(spec)


def scenes(*cities: City) -> PluginHost:
    """A host. Each build of its scene `moon` returns the next of these cities."""
    left = list(cities)
    offered = [ScenePlugin(name="moon", build=lambda spec: left.pop(0))]
    hook = staticmethod(hookimpl(lambda: offered, specname="lingjing_scenes"))
    return PluginHost(entry_points=False, extra=(type("Wrong", (), {"lingjing_scenes": hook, "__name__": "Wrong"}),))


GOOD = City(id="moon", origin=(0.0, 0.0), bounds=(-50.0, -50.0, 50.0, 50.0))
SQUARE = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))
WIDE = ((-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0))
HOLE = ((-1.0, -1.0), (10.0, -1.0), (10.0, 10.0), (-1.0, 10.0))


def _changed(**changes: object) -> City:
    return msgspec.structs.replace(GOOD, **changes)


@pytest.mark.parametrize(
    ("city", "message"),
    [
        (_changed(bounds=(50.0, -50.0, -50.0, 50.0)), "are no \\(west, south, east, north\\)"),
        (_changed(origin=(120.0, 30.0)), "is no latitude and longitude"),
        (_changed(datum_m=2.0), "its water lies at 2 m, the mission says 0 m"),
        (_changed(waters=(Water(polygon=SQUARE[:2], level_m=0.0),)), r"waters\[0\].polygon has 2 points, 3 are due"),
        (_changed(waters=(Water(polygon=SQUARE, level_m=float("nan")),)), r"waters\[0\].level_m is nan"),
        (
            _changed(waters=(Water(polygon=WIDE, level_m=0.0),), lands=(Land(polygon=SQUARE, top_m=0.0),)),
            r"lands\[0\] has its top at 0 m and waters\[0\] its level at 0 m, and they overlap by .*: raise the land",
        ),
        (
            _changed(roads=(Road(id="r", lanes=()), Road(id="r", lanes=(CityLane(id="l", shape=(), width_m=3.0),)))),
            r"2 of its roads are called `r`; roads\[1\].lanes\[0\].shape has 0 points",
        ),
    ],
)
def test_an_invalid_city_fails(city: City, message: str) -> None:
    with pytest.raises(kit.ConformanceError, match=message):
        kit.check_scene(SceneSpec(kind="moon"), scenes(city, city))


@pytest.mark.parametrize(
    ("water", "top_m"),
    [
        (Water(polygon=WIDE, level_m=0.0), 0.1),
        (Water(polygon=WIDE, level_m=0.0, holes=(HOLE,)), -1.0),
        (Water(polygon=tuple((x + 49.0, y) for x, y in WIDE), level_m=0.0), 0.0),
    ],
)
def test_land_above_the_water_or_beside_it_passes(water: Water, top_m: float) -> None:
    city = _changed(waters=(water,), lands=(Land(polygon=SQUARE, top_m=top_m),))
    kit.check_scene(SceneSpec(kind="moon"), scenes(city, city))


def test_a_scene_that_builds_another_city_the_second_time_fails() -> None:
    kit.check_scene(SceneSpec(kind="moon"), scenes(GOOD, GOOD))
    with pytest.raises(kit.ConformanceError, match="builds another city"):
        kit.check_scene(SceneSpec(kind="moon"), scenes(GOOD, _changed(attribution="x")))


# -- kinds.json


def test_the_built_in_kinds_are_the_offered_kinds() -> None:
    kit.check_kinds("builtin")


def test_kinds_that_are_not_offered_or_not_described_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package, info = tmp_path / "acme_kinds", tmp_path / "acme_kinds-1.0.dist-info"
    package.mkdir()
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-kinds\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing]\nacme = acme_kinds\n")
    (package / "__init__.py").write_text(
        "from lingjing.plugins.hookspecs import ScenePlugin, hookimpl\n"
        "@hookimpl\ndef lingjing_scenes():\n    yield ScenePlugin(name='moon', build=lambda spec: None)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    kinds._describing.cache_clear()
    with pytest.raises(kit.ConformanceError, match="does not describe the scenes moon that `acme` offers"):
        kit.check_kinds("acme")
    file = package / "kinds.json"
    file.write_text(json.dumps({"scenes": [{"name": "moon"}]}))
    kit.check_kinds("acme")
    file.write_text(json.dumps({"scenes": [{"name": "moon"}], "engines": [{"name": "rover"}]}))
    with pytest.raises(kit.ConformanceError, match="describes engines that `acme` does not offer: rover"):
        kit.check_kinds("acme")
    file.write_text(json.dumps({"scenes": [{"name": "moon", "extent_m": -1, "lacks": ["air"]}]}))
    with pytest.raises(PluginError) as caught:
        kit.check_kinds("acme")
    assert {fault.where for fault in caught.value.faults} == {"scenes[0].extent_m", "scenes[0].lacks[0]"}
    kinds._describing.cache_clear()


def test_a_name_that_no_entry_point_has_fails() -> None:
    for name in ("nope", "", "builtin.py"):
        with pytest.raises(kit.ConformanceError, match=f"no installed entry point .* is called `{name}`"):
            kit.check_kinds(name)
    with pytest.raises(kit.ConformanceError) as caught:
        kit.check_kinds("bulitin")
    assert caught.value.hint == "did you mean `builtin`?"


def test_the_example_scene_of_the_page_conforms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text("utf-8")
    code, flooded = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (file,) = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    package, info = tmp_path / "page_canyon", tmp_path / "page_canyon-1.0.dist-info"
    package.mkdir()
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: page-canyon\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing]\npage = page_canyon\n")
    (package / "__init__.py").write_text(code)
    (package / "kinds.json").write_text(file)
    monkeypatch.syspath_prepend(str(tmp_path))
    kinds._describing.cache_clear()
    kit.check_kinds("page")
    kit.check_scene(SceneSpec(kind="canyon", options={"depth_m": 50.0}))
    with pytest.raises(UsageError, match="`depth` is 5"):
        kit.check_scene(SceneSpec(kind="canyon", options={"depth_m": 5.0}))
    kinds._describing.cache_clear()
    names: dict[str, Any] = {}
    exec(code + flooded, names)
    sea = SceneSpec(kind="moon", datum_m=-3.0)
    kit.check_scene(sea, scenes(names["flooded"](sea), names["flooded"](sea)))
