"""`lingjing new` for each kind that is a package: it is clean, installs, is listed, and its own tests pass."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from lingjing.cli.new import KINDS
from lingjing.cli.newpackage import PACKAGES, plugin_name, write_package
from lingjing.dsl.formatting.formatter import format_text
from lingjing.errors import UsageError
from tools.python_forks import run_python

PLACEHOLDERS = ("NAME0", "Name0", "Title0", "CORE0", "API0")
PIP = ("-m", "pip", "--disable-pip-version-check", "install", "-q", "--no-deps", "--no-build-isolation")
PYTEST = ("-P", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "asyncio_default_fixture_loop_scope=function")
LISTED = {"backbone": 2, "evaluator": 1, "scaffold": 1, "scene": 1, "types": 1}
"""Lines of `lingjing plugins` that name the plug-in."""
OWN = sorted(LISTED)


def call(*command: object, cwd: Path, site: Path | None = None) -> str:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if site is not None:
        env["PYTHONPATH"] = str(site)
    done = run_python([sys.executable, *map(str, command)], cwd=cwd, env=env)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("packages")
    return {kind: write_package(kind, f"my-{kind}", folder / kind) for kind in OWN}


@pytest.fixture(scope="module")
def site(packages: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which all packages are installed, with their entry points."""
    target = tmp_path_factory.mktemp("installed") / "site"
    call(*PIP, "--target", target, *packages.values(), cwd=target.parent)
    return target


@pytest.fixture(scope="module")
def listed(site: Path) -> list[str]:
    """The lines of `lingjing plugins`."""
    return call("-m", "lingjing.cli.main", "plugins", cwd=site.parent, site=site).splitlines()


def test_every_kind_is_known_to_the_command() -> None:
    assert set(PACKAGES) | {"agent", "mission"} == set(KINDS)
    assert {*OWN, "engine"} == set(PACKAGES)


@pytest.mark.parametrize("kind", OWN)
def test_a_package_has_no_placeholders_and_passes_the_formatters_and_ruff(kind: str, packages: dict[str, Path]) -> None:
    files = [path for path in packages[kind].rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    assert {"README.md", "pyproject.toml"} <= {path.name for path in files}
    for path in files:
        text = path.read_text(encoding="utf-8")
        assert not [word for word in PLACEHOLDERS if word in text]
        if path.suffix == ".ljs":
            assert format_text(text).text == text
    style = ("--isolated", "--line-length", "120")
    call("-m", "ruff", "check", *style, "--select", "E,F,I,B,UP", ".", cwd=packages[kind])
    call("-m", "ruff", "format", *style, "--check", ".", cwd=packages[kind])


@pytest.mark.slow
@pytest.mark.parametrize("kind", OWN)
def test_a_package_installs_is_listed_and_passes_its_own_tests(
    kind: str, packages: dict[str, Path], site: Path, listed: list[str], tmp_path: Path
) -> None:
    assert len([line for line in listed if f"my_{kind}" in line]) == LISTED[kind]
    for mission in packages[kind].glob("missions/*.ljs"):
        assert call("-m", "lingjing.cli.main", "validate", mission, cwd=tmp_path, site=site) == ""
    assert " passed" in call(*PYTEST, cwd=packages[kind], site=site)


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("backbone", "direct", r"a plug-in called `direct` \(backbone\) exists already"),
        ("evaluator", "mission", "cannot be the name of an evaluator"),
        ("scene", "bay", r"a plug-in called `bay` \(scene\) exists already"),
        ("scaffold", "react", "cannot be the name of a scaffold"),
        ("types", "std", "cannot be the name of a package of types"),
    ],
)
def test_a_name_that_is_in_use_or_reserved_is_refused(kind: str, name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=message):
        write_package(kind, name, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_name_with_capitals_and_a_hyphen_becomes_an_identifier() -> None:
    assert plugin_name("My-Scene", "scene") == "my_scene"
