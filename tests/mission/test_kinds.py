"""Kinds of scenes and engines: what a plug-in's `kinds.json` says is known without importing the plug-in."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lingjing.dsl import compile_text
from lingjing.errors import PluginError
from lingjing.mission import kinds
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import SceneKind, builtin_scenes, engine_kind, extent_m, lacks, reach_m, scene_faults

CANYON = {
    "name": "canyon",
    "extent_m": 6000,
    "lacks": ["road"],
    "options": {"depth": {"type": "metres", "low": 10, "high": 300, "default": 80}},
}


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An installed plug-in whose module cannot be imported; its file of kinds is to be written by the test."""
    package, info = tmp_path / "acme", tmp_path / "acme-1.0.dist-info"
    (package / "inner").mkdir(parents=True)
    for folder in (package, package / "inner"):
        (folder / "__init__.py").write_text("raise RuntimeError('imported')\n")
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing]\nacme = acme.inner.plugin\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    kinds._plugins.cache_clear()
    yield package / "inner" / "kinds.json"
    kinds._plugins.cache_clear()
    assert "acme" not in sys.modules


def test_a_strangers_scene_is_checked_by_its_file(acme: Path) -> None:
    acme.write_text(json.dumps({"scenes": [CANYON]}))
    deep = SceneSpec(kind="canyon", options={"depth_m": 5.0})
    assert [(fault.option, fault.hint) for fault in scene_faults(deep)] == [("depth", "give 10 to 300")]
    assert lacks(deep, "road") and not lacks(deep, "roof")
    assert reach_m(deep) == 3000.0
    shipped = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text("utf-8")
    text = re.sub(r"scene +bay \{", "scene canyon { depth = 5 m,", shipped)
    (found,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert (found.code, found.hint) == ("LJ0508", "give 10 to 300")
    assert "`depth` is 5.0" in found.message


def test_a_strangers_engine_says_where_its_bodies_may_be(acme: Path) -> None:
    acme.write_text(json.dumps({"engines": [{"name": "balloon", "anywhere": True}]}))
    assert engine_kind("balloon").anywhere
    assert not engine_kind("submarine").anywhere and engine_kind("submarine").acts


def test_of_a_scene_without_a_file_nothing_is_known(acme: Path) -> None:
    spec = SceneSpec(kind="moon", options={"depth_m": 5.0})
    assert list(scene_faults(spec)) == []
    assert extent_m(spec) is None and reach_m(spec) is None and not lacks(spec, "road")


def test_a_kind_may_be_like_another(acme: Path) -> None:
    rift = {"name": "rift", "like": "canyon", "options": {"depth": {"high": 900}, "width": {"type": "metres"}}}
    acme.write_text(json.dumps({"scenes": [CANYON, rift]}))
    found = kinds.scene_kind("rift")
    assert isinstance(found, SceneKind) and found.extent_m == 6000
    assert (found.options["depth"].low, found.options["depth"].high) == (10, 900)
    assert found.spelled() == {"depth_m": "depth", "width_m": "width"}


@pytest.mark.parametrize("text", ["{", '{"scenes": [{"nam": 1}]}', '{"scenes": [{"name": "x", "like": "y"}]}', "[]"])
def test_a_file_that_is_none_is_named(acme: Path, text: str) -> None:
    acme.write_text(text)
    with pytest.raises(PluginError, match=r"inner/kinds\.json does not describe kinds"):
        kinds.scene_kind("canyon")


def test_every_default_of_a_built_in_scene_is_within_its_bounds() -> None:
    for kind in builtin_scenes().values():
        for spelled, option in kind.options.items():
            assert option.help, (kind.name, spelled)
            assert all((option.low or 0) <= value <= (option.high or 1e9) for value in kind.default(spelled))
