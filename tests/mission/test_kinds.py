"""Kinds of scenes and engines: the contents of a plug-in's `kinds.json` are used without importing the plug-in."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lingjing.causal.faculties import faculties_of
from lingjing.cli import installed
from lingjing.errors import ExitCode, PluginError
from lingjing.mission import kinds, kinds_file
from lingjing.mission.conditions.motion import Air, ceiling
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import builtin_scenes, engine_kind, extent_m, lacks, reach_m, scene_faults
from lingjing.mission.kinds_format import KindsFile, SceneKind
from lingjing.testing import compile_text, instantiate, run_command

CANYON = {
    "name": "canyon",
    "extent_m": 6000,
    "lacks": ["road"],
    "options": {"depth": {"type": "metres", "low": 10, "high": 300, "default": 80}},
}


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An installed plug-in with a module that cannot be imported. The test writes its file of kinds."""
    package, info = tmp_path / "acme", tmp_path / "acme-1.0.dist-info"
    (package / "inner").mkdir(parents=True)
    for folder in (package, package / "inner"):
        (folder / "__init__.py").write_text("raise RuntimeError('imported')\n")
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing]\nacme = acme.inner.plugin\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    kinds._describing.cache_clear()
    yield package / "inner" / "kinds.json"
    kinds._describing.cache_clear()
    assert "acme" not in sys.modules


def test_a_scene_of_a_plugin_is_checked_against_its_kinds_file(acme: Path) -> None:
    acme.write_text(json.dumps({"scenes": [CANYON]}))
    deep = SceneSpec(kind="canyon", options={"depth_m": 5.0})
    assert [(fault.option, fault.hint) for fault in scene_faults(deep)] == [("depth", "give 10 to 300")]
    assert lacks(deep, "road") and not lacks(deep, "roof")
    assert reach_m(deep) == 3000.0
    shipped = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text("utf-8")
    text = re.sub(r"scene +bay \{", "scene canyon { depth = 5 m,", shipped)
    (diagnostic,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert (diagnostic.code, diagnostic.hint) == ("LJ0508", "give 10 to 300")
    assert "`depth` is 5.0" in diagnostic.message
    text = re.sub(r"scene +bay \{", "scene canyon { wide = 5 m,", shipped)
    (diagnostic,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert (diagnostic.code, diagnostic.hint) == ("LJ0108", "known: datum, depth, displacement, layout, origin")


def test_validate_imports_no_plug_in_whose_kinds_are_described(
    acme: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plug-in's module raises when it is imported, so that a successful validation did not import it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    acme.write_text(json.dumps({"scenes": [{"name": "canyon", "extent_m": 6000}], "engines": [{"name": "balloon"}]}))
    shipped = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text("utf-8")
    file = tmp_path / "m.ljs"
    text = re.sub(r"scene +bay \{[^}]*\}", "scene canyon", shipped)
    text = text.replace("mission ssr", "asset blimp { engine = balloon }\n\nmission ssr", 1)
    file.write_text(text.replace("asset boat :", "asset float : blimp { position = (0 m, 0 m) }\n  asset boat :", 1))
    compiled = str(tmp_path / "m.json")
    for command in (["validate", str(file)], ["compile", str(file), "-o", compiled], ["validate", compiled]):
        assert run_command(command) == ExitCode.OK and "acme" not in sys.modules
        output = capsys.readouterr()
        assert "installed" not in output.out + output.err
    acme.unlink()  # the mission is not known to be good once the plug-in has changed
    kinds._describing.cache_clear()
    installed._offers.cache_clear()
    assert "canyon" not in installed.offers("scene")
    assert "warning: plug-in `acme` (acme 1.0): does not load: RuntimeError: imported" in capsys.readouterr().err
    assert run_command(["validate", str(file)]) == ExitCode.OK
    assert "no engine called `balloon` is installed" in capsys.readouterr().out


def test_an_engine_of_a_plugin_declares_where_its_bodies_may_be(acme: Path) -> None:
    acme.write_text(json.dumps({"engines": [{"name": "balloon", "anywhere": True}]}))
    assert engine_kind("balloon").anywhere
    assert not engine_kind("submarine").anywhere and engine_kind("submarine").acts


def test_an_engine_of_a_plugin_declares_the_motion_of_its_verbs_and_its_top_speed(acme: Path) -> None:
    verbs = {"glide": {"motion": "straight", "doc": "glides there"}, "ascend": {"motion": "up"}}
    speed = {"property": "speed_mps", "factor": 1.5, "wind": 1.0}
    acme.write_text(json.dumps({"engines": [{"name": "balloon", "verbs": verbs, "top_speed": speed}]}))
    shipped = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text("utf-8")
    verb = "verb glide(x: length, y: length, z: length)\n  verb ascend(distance: length)\n  verb sing()"
    text = shipped.replace(
        "mission ssr", f"asset blimp {{\n  engine = balloon\n  speed = 4 m/s\n  {verb}\n}}\n\nmission ssr", 1
    )
    rider = "agent rider as rider controls float { observes float.* }"
    held = f"asset float : blimp {{ position = (0 m, 0 m) }}\n  {rider}\n  asset boat :"
    mission = compile_text(text.replace("asset boat :", held, 1)).mission
    assert mission is not None
    instance = instantiate(mission, seed=1)
    blimp = next(entity for entity in instance.entities if entity.id == "float")
    assert [(verb.name, verb.motion, verb.doc) for verb in blimp.verbs] == [
        ("glide", "straight", "glides there"), ("ascend", "up", ""), ("sing", "", ""),
    ]  # fmt: skip
    agent = next(agent for agent in instance.agents if agent.id == "rider")
    assert faculties_of(instance, agent) == ("waypoint", "execution")
    assert ceiling(blimp, {}, Air(wind_mps=3.0), driven=True) == 9.0
    assert ceiling(blimp, {}, Air(wind_mps=3.0), driven=False) == math.inf


def test_a_scene_without_a_kinds_file_has_no_known_properties(acme: Path) -> None:
    spec = SceneSpec(kind="moon", options={"depth_m": 5.0})
    assert list(scene_faults(spec)) == []
    assert extent_m(spec) is None and reach_m(spec) is None and not lacks(spec, "road")


def test_a_kind_inherits_from_the_kind_that_it_is_like(acme: Path) -> None:
    rift = {"name": "rift", "like": "canyon", "options": {"depth": {"high": 900}, "width": {"type": "metres"}}}
    acme.write_text(json.dumps({"scenes": [CANYON, rift]}))
    kind = kinds.scene_kind("rift")
    assert isinstance(kind, SceneKind) and kind.extent_m == 6000
    assert (kind.options["depth"].low, kind.options["depth"].high) == (10, 900)
    assert kind.spelled() == {"depth_m": "depth", "width_m": "width"}


@pytest.mark.parametrize(
    "text",
    [
        "{",
        '{"engines": [{"name": "x", "verbs": {"go": {"motion": "sideways"}}}]}',
        '{"scenes": [{"nam": 1}]}',
        '{"scenes": [{"name": "x", "like": "y"}]}',
        "[]",
    ],
)
def test_a_malformed_kinds_file_is_named_in_the_error(acme: Path, text: str) -> None:
    acme.write_text(text)
    with pytest.raises(PluginError, match=r"inner/kinds\.json does not describe kinds"):
        kinds.described_by("acme")
    assert kinds.scene_kind("canyon") is None  # the file does not name it, so it may belong to another plug-in


def test_a_kind_that_a_faulty_file_names_is_an_error(acme: Path) -> None:
    acme.write_text('{"scenes": [{"name": "canyon", "extent_m": "wide"}], "engines": [{"name": "balloon"}]}')
    for described in (kinds.scene_kind, kinds.engine_kind):
        with pytest.raises(PluginError, match=r"inner/kinds\.json does not describe kinds"):
            described("canyon")


def kinds_document(**scene: object) -> str:
    return json.dumps({"scenes": [{"name": "canyon", **scene}]})


def faults_of(acme: Path, text: str) -> list[tuple[str, str]]:
    """The faults of a file: path and message."""
    acme.write_text(text)
    with pytest.raises(PluginError, match=r"plug-in `acme`: .*kinds\.json does not") as raised:
        kinds.described_by("acme")
    assert raised.value.hint
    return [(fault.where, fault.message) for fault in raised.value.faults]


def test_a_range_needs_no_default(acme: Path) -> None:
    acme.write_text(kinds_document(options={"width": {"type": "range"}, "height": {"type": "range", "low": 1}}))
    good = SceneSpec(kind="canyon", options={"width_low_m": 3.0, "width_high_m": 9.0})
    assert list(scene_faults(good)) == []
    half = SceneSpec(kind="canyon", options={"width_low_m": 3.0})
    assert list(scene_faults(half)) == []
    swapped = SceneSpec(kind="canyon", options={"width_low_m": 9.0, "width_high_m": 3.0})
    assert [(fault.option, fault.hint) for fault in scene_faults(swapped)] == [("width", "give 9 or more")]
    short = SceneSpec(kind="canyon", options={"height_low_m": 0.0, "height_high_m": 3.0})
    assert [(fault.option, fault.hint) for fault in scene_faults(short)] == [("height", "give 1 or more")]


@pytest.mark.parametrize(("kind", "least"), [("positions", 1), ("region", 3)])
def test_options_of_positions_and_regions_have_a_least_number_of_points(acme: Path, kind: str, least: int) -> None:
    acme.write_text(kinds_document(options={"rim": {"type": kind}}))
    corners = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))
    for count in range(1, 4):
        spec = SceneSpec(kind="canyon", options={"rim": corners[:count]})
        assert bool(list(scene_faults(spec))) == (count < least)


def test_every_fault_of_a_file_is_reported_with_its_path(acme: Path) -> None:
    depth = {"type": "metres", "low": "deep"}
    scenes = [{"name": "canyon", "options": {"depth": depth, "width": {"type": "range", "default": 3}}}, {"nam": 1}, 7]
    listed = faults_of(acme, json.dumps({"scenes": scenes, "engines": {}}))
    assert ("scenes[1]", "'name' is missing") in listed and ("scenes[1]", "there is no field 'nam'") in listed
    messages = dict(listed)
    assert messages["scenes[0].options.depth.low"] == "a number or null is due, this is the text 'deep'"
    assert messages["scenes[0].options.width.default"] == "an option of type range has two numbers"
    assert messages["scenes[2]"] == "an object is due, this is the number 7"
    assert messages["engines"] == "a list is due, this is an object"


METRES = {"type": "metres", "low": 1, "high": 9}


@pytest.mark.parametrize(
    ("scene", "where"),
    [
        ({"options": {"depth": {"type": "metres", "low": 9, "high": 1}}}, "options.depth.low"),
        ({"options": {"depth": METRES | {"default": 10}}}, "options.depth.default"),
        ({"options": {"depth": METRES | {"default": [2, 3]}}}, "options.depth.default"),
        ({"options": {"depth": METRES | {"type": "range", "default": [3, 2]}}}, "options.depth.default"),
        ({"options": {"rim": {"type": "positions", "default": 3}}}, "options.rim.default"),
        ({"options": {"the rim": METRES}}, "options.the rim"),
        ({"options": {"datum": METRES}}, "options.datum"),
        ({"options": {"origin": METRES}}, "options.origin"),
        ({"options": {"depth": METRES | {"without": "rim"}}}, "options.depth.without"),
        ({"options": {"depth": METRES}, "one_of": ["depth_m", "rim"]}, "one_of[1]"),
        ({"extent_m": -1}, "extent_m"),
        ({"lacks": ["road", "rails"]}, "lacks[1]"),
        ({"like": "canyon"}, "like"),
        ({"like": "moon"}, "like"),
    ],
)
def test_an_invalid_value_in_a_kinds_file_is_reported_with_its_path(
    acme: Path, scene: dict[str, object], where: str
) -> None:
    assert [path for path, _ in faults_of(acme, kinds_document(**scene))] == [f"scenes[0].{where}"]


def test_common_verbs_and_invalid_names_and_motions_of_verbs_are_refused(acme: Path) -> None:
    verbs = {"stop": {"motion": "up"}, "takePhoto": {}, "go there": {}, "rise": {"motion": "fly"}, "sink": {}}
    messages = dict(faults_of(acme, json.dumps({"engines": [{"name": "lift", "verbs": verbs}]})))
    at = "engines[0].verbs"
    assert set(messages) == {f"{at}.stop", f"{at}.takePhoto", f"{at}.go there", f"{at}.rise.motion"}
    assert messages[f"{at}.stop"] == "`stop` means the same for all engines"
    assert messages[f"{at}.rise.motion"].startswith("an empty text, down, route")


def test_a_fault_is_reported_at_the_kind_that_contains_the_value(acme: Path) -> None:
    scenes = [{"name": "canyon", "extent_m": -1, "options": {"depth": METRES | {"default": 10}}}]
    scenes += [{"name": "rift", "like": "canyon"}, {"name": "gorge", "like": "rift", "lacks": ["rails"]}]
    paths = [path for path, _ in faults_of(acme, json.dumps({"scenes": scenes}))]
    assert paths == ["scenes[0].extent_m", "scenes[2].lacks[0]", "scenes[0].options.depth.default"]


def test_the_built_in_kinds_file_has_no_invalid_value() -> None:
    document = kinds.joined(json.loads(Path(kinds._BUILTIN).read_text("utf-8")))
    assert list(kinds_file._value_faults(document, KindsFile())) == []


def test_the_name_of_a_kind_must_be_unique(acme: Path) -> None:
    scenes = [{"name": "bay"}, {"name": "rift", "like": "gorge"}, {"name": "rift"}, {"name": "gorge", "like": "rift"}]
    faults = faults_of(acme, json.dumps({"scenes": scenes, "engines": [{"name": "road"}]}))
    assert ("scenes[0].name", "`bay` is built in") in faults
    assert ("scenes[1].name", "`rift` is described 2 times") in faults
    assert ("scenes[2].name", "`rift` is described 2 times") in faults
    assert ("engines[0].name", "`road` is built in") in faults


def test_kinds_that_are_like_each_other_in_a_circle_are_refused(acme: Path) -> None:
    scenes = [{"name": "rift", "like": "gorge"}, {"name": "gorge", "like": "rift"}]
    assert [path for path, _ in faults_of(acme, json.dumps({"scenes": scenes}))] == ["scenes[0].like", "scenes[1].like"]


def test_every_default_of_a_built_in_scene_is_within_its_bounds() -> None:
    for kind in builtin_scenes().values():
        for spelled, option in kind.options.items():
            assert option.help, (kind.name, spelled)
            assert all((option.low or 0) <= value <= (option.high or 1e9) for value in kind.default(spelled))
