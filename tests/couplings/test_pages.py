"""`docs/engines.md` and `docs/scenes.md` list exactly the engines, refusals and scenes that exist."""

import re
from pathlib import Path

import pytest

from lingjing.mission.kinds import builtin_scenes
from lingjing.testing import PluginHost

ROOT = Path(__file__).parents[2]
ENGINES = (ROOT / "docs" / "engines.md").read_text("utf-8")
SCENES = (ROOT / "docs" / "scenes.md").read_text("utf-8")
PACKAGES = {"plane": "fixed_wing"}
NAMES = list(PluginHost().engines)


def rows(name: str) -> str:
    """Return all rows of the page's tables that begin with an engine."""
    return "\n".join(line for line in ENGINES.splitlines() if line.startswith(f"| `{name}` |"))


@pytest.mark.parametrize("name", [name for name in NAMES if name != "camera"])
def test_every_reason_for_a_refusal_is_on_the_page(name):
    folder = ROOT / "lingjing" / "engines" / PACKAGES.get(name, name)
    code = "\n".join(path.read_text("utf-8") for path in sorted(folder.glob("*.py")))
    reasons = {*re.findall(r'Refusal\("(\w+)"', code), *re.findall(r'\.fail\([^"]*?"(\w+)"', code)}
    common = {"unknown_resource", "unknown_verb", "bad_argument"}
    assert reasons
    assert {reason for reason in reasons - common if f"`{reason}`" not in rows(name)} == set()
    assert all(f"`{reason}`" in ENGINES for reason in common)


def test_every_engine_and_scene_is_on_its_page():
    assert [name for name in NAMES if not rows(name)] == []
    scenes = list(PluginHost().scenes)
    assert [name for name in scenes if f"`{name}`" not in SCENES and f"scene {name} " not in SCENES] == []
    assert [name for kind in builtin_scenes().values() for name in kind.options if f"`{name}`" not in SCENES] == []
