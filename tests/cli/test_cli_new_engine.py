"""`lingjing new engine`: the package installs, is found, plays its mission, and its own tests pass."""

from __future__ import annotations

import json
import os
import re
import sys
import tomllib
from pathlib import Path

import pytest

from lingjing.cli.newpackage import plugin_name, write_package
from lingjing.dsl.formatting.formatter import format_text
from lingjing.errors import UsageError
from lingjing.installation import CORE, name_of
from tools.python_forks import run_python


def call(*command: object, cwd: Path, site: Path | None = None, code: int = 0) -> str:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if site is not None:
        env["PYTHONPATH"] = str(site)
    done = run_python([sys.executable, *map(str, command)], cwd=cwd, env=env)
    assert done.returncode == code, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("new")
    output = call("-m", "lingjing.cli.main", "new", "engine", "hover-craft", cwd=where)
    assert "wrote hover_craft" in output
    assert "play it: lingjing run hover_craft/missions/tour.ljs --policy hover_craft" in output
    return where / "hover_craft"


@pytest.fixture(scope="module")
def site(package: Path) -> Path:
    """A folder that the package is installed into, with its entry points."""
    target = package.parent / "site"
    pip = ("-m", "pip", "--disable-pip-version-check", "install", "-q", "--no-deps", "--no-build-isolation")
    call(*pip, "--target", target, package, cwd=package.parent)
    return target


def test_the_package_has_no_placeholders_and_its_missions_are_formatted(package: Path) -> None:
    files = [path for path in package.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    assert {path.suffix for path in files} <= {".py", ".ljs", ".toml", ".md", ".json"}
    for path in files:
        text = path.read_text(encoding="utf-8")
        assert not [word for word in ("NAME0", "Name0", "Title0", "CORE0") if word in text]
        if path.suffix == ".ljs":
            assert format_text(text).text == text
    assert "class HoverCraftEngine(FleetEngine)" in (package / "lingjing_hover_craft" / "engine.py").read_text()


def test_the_package_requires_the_installed_distribution(package: Path) -> None:
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["dependencies"] == [name_of(CORE)] != ["lingjing"]


def test_the_code_of_the_package_passes_ruff(package: Path) -> None:
    call("-m", "ruff", "check", "--isolated", "--line-length", "120", "--select", "E,F,I,B,UP", package, cwd=package)
    call("-m", "ruff", "format", "--isolated", "--line-length", "120", "--check", package, cwd=package)


@pytest.mark.slow
def test_the_package_installs_is_listed_and_plays_its_mission(package: Path, site: Path, tmp_path: Path) -> None:
    listed = call("-m", "lingjing.cli.main", "plugins", cwd=tmp_path, site=site)
    assert len(re.findall("hover_craft +hover_craft", listed)) == 2
    output = call("-m", "lingjing.cli.main", "plugins", "hover_craft", cwd=tmp_path, site=site)
    assert [line.split()[0] for line in output.splitlines() if "distance of arrival" in line] == ["arrived"]
    mission = package / "missions" / "tour.ljs"
    assert call("-m", "lingjing.cli.main", "validate", mission, cwd=tmp_path, site=site) == ""
    run = ("-m", "lingjing.cli.main", "run", mission, "--policy", "hover_craft", "--seed", 3, "--json", "--no-overview")
    answers = [
        json.loads(call(*run, "-o", tmp_path / world, "--world", world, cwd=tmp_path, site=site).splitlines()[0])
        for world in ("process", "inline")
    ]
    assert all(answer["success"] for answer in answers)
    assert answers[0]["digest"] == answers[1]["digest"]


@pytest.mark.slow
def test_the_tests_of_the_package_pass_and_detect_a_fault(package: Path, site: Path) -> None:
    pytest_ = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "asyncio_default_fixture_loop_scope=function")
    assert "21 passed" in call("-P", *pytest_, cwd=package, site=site)
    engine = site / "lingjing_hover_craft" / "engine.py"
    sound = engine.read_text()
    assert sound.count("% 360.0 % 360.0") == 1
    engine.write_text(sound.replace("% 360.0 % 360.0", "+ 360.0"))
    try:
        output = call("-P", *pytest_, "tests/test_engine.py", cwd=package, site=site, code=1)
    finally:
        engine.write_text(sound)
    assert "ConformanceError: `beacon[1]` at 0.0 s: heading 360.0 not in 0..360" in output


def test_the_types_of_the_package_are_unknown_without_installation(package: Path, tmp_path: Path) -> None:
    output = call("-m", "lingjing.cli.main", "validate", package / "missions" / "tour.ljs", cwd=tmp_path, code=1)
    assert "hover_craft.vehicles" in output


@pytest.mark.parametrize("name", ["two words", "mission", "1st", "", "../up", "std", "scenarios", "class", "水", "_x"])
def test_an_invalid_package_name_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="cannot be the name") as mistake:
        plugin_name(name)
    assert mistake.value.hint


def test_new_engine_overwrites_no_folder_and_refuses_a_name_that_is_in_use(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    assert write_package("engine", "mine", tmp_path / "mine") == tmp_path / "mine"
    with pytest.raises(UsageError, match="already exists"):
        write_package("engine", "mine", tmp_path / "mine")
    for name in ("plane", "oracle"):
        with pytest.raises(UsageError, match=f"a plug-in called `{name}`"):
            write_package("engine", name, tmp_path / name)
        assert not (tmp_path / name).exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="already exists"):
        write_package("engine", "other", tmp_path / "file")
