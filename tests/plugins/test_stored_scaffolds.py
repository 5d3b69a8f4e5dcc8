"""Plug-ins and policies of earlier versions of the contract: stored copies of the output of `lingjing new` still work,
and the message about a plug-in for another version has a hint."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

from lingjing import read as read_trace
from lingjing.errors import PluginError
from lingjing.plugins.contract import API_VERSION, version_fault
from lingjing.plugins.hookspecs import hookimpl
from lingjing.testing import PluginHost, mission_file
from tools.python_forks import run_python

DATA = Path(__file__).parent / "data"
LINGJING = ("-m", "lingjing.cli.main")
PIP = ("-m", "pip", "--disable-pip-version-check", "install", "-q", "--no-deps", "--no-build-isolation")


def call(*command: object, cwd: Path, site: Path | None = None, code: int = 0) -> tuple[str, str]:
    """Run Python with arguments. Return standard output and error."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if site is not None:
        env["PYTHONPATH"] = str(site)
    done = run_python([sys.executable, *map(str, command)], cwd=cwd, env=env)
    assert done.returncode == code, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout, done.stderr


def restored(name: str, folder: Path) -> Path:
    """A stored package in a folder, its files under their own names."""
    for file in (DATA / name).rglob("*.txt"):
        target = folder / file.relative_to(DATA / name).with_suffix("")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(file.read_bytes())
    return folder


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return restored("engine-1.0", tmp_path_factory.mktemp("stored") / "hovercraft")


@pytest.fixture(scope="module")
def site(package: Path) -> Path:
    """A folder that the package is installed into."""
    target = package.parent / "site"
    call(*PIP, "--target", target, package, cwd=package.parent)
    return target


def test_an_engine_of_version_1_0_passes_its_own_tests(package: Path, site: Path) -> None:
    pytest_ = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "asyncio_default_fixture_loop_scope=function")
    out, _ = call("-P", *pytest_, cwd=package, site=site)
    assert "21 passed" in out


def test_a_policy_of_version_1_0_plays(tmp_path: Path) -> None:
    (tmp_path / "scout.py").write_bytes((DATA / "agent-1.0.py.txt").read_bytes())
    text = mission_file("ssr").read_text(encoding="utf-8")
    (tmp_path / "ssr.ljs").write_text(text.replace("ticks <= 60", "ticks <= 12"), encoding="utf-8")
    run = (*LINGJING, "run", "ssr.ljs", "--policy", "./scout.py:Scout", "--world", "inline", "--no-overview", "--json")
    out, _ = call(*run, "-o", "out", cwd=tmp_path)
    assert json.loads(out)["ticks"] == 12
    decisions = [made for record in read_trace(tmp_path / "out" / "trace.mcap").boundaries for made in record.decisions]
    assert decisions
    assert [made.detail for made in decisions if made.substituted] == []


def test_a_plugin_for_another_version_is_left_out_with_a_message(package: Path, site: Path, tmp_path: Path) -> None:
    plugin = site / "lingjing_hovercraft" / "plugin.py"
    sound = plugin.read_text(encoding="utf-8")
    plugin.write_text(f'{sound}\n\n@hookimpl\ndef lingjing_api_version() -> str:\n    return "2.0"\n', encoding="utf-8")
    try:
        out, listed = call(*LINGJING, "plugins", cwd=tmp_path, site=site, code=2)
        _, message = call(
            *LINGJING, "run", package / "missions" / "tour.ljs", "--policy", "hovercraft", cwd=tmp_path, site=site,
            code=2,
        )  # fmt: skip
    finally:
        plugin.write_text(sound, encoding="utf-8")
    reason = f"it is written for version 2.0 of the contract and this is {API_VERSION}"
    assert f"{reason}\nhint: install a newer lingjing-sim\n" in listed
    assert "oracle" in out
    assert f"{reason}; it is left out\nhint: install a newer lingjing-sim\n" in message


def hosted(version: object) -> PluginHost:
    """A host with one plug-in that is written for a version."""
    hook = staticmethod(hookimpl(lambda: version, specname="lingjing_api_version"))
    plugin = type("Stranger", (), {"lingjing_api_version": hook, "__name__": "Stranger"})
    return PluginHost(entry_points=False, extra=(plugin,))


def test_a_version_is_compatible_with_later_minor_versions_of_the_same_major(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lingjing.plugins.contract.API_VERSION", "2.3")
    assert [version_fault(version) for version in ("2.0", "2.3")] == ["", ""]
    assert version_fault("2.4").endswith("this is 2.3: install a newer lingjing-sim")
    assert version_fault("3.0").endswith("install a newer lingjing-sim")
    assert version_fault("1.9").endswith("install a newer version of the plug-in")


@pytest.mark.parametrize("version", ["", "1", "1.0.0", "one", 1.0, None, "1.\u0660", "9" * 9 + ".0"])
def test_an_invalid_version_is_an_error(version: object) -> None:
    with pytest.raises(PluginError, match=r"plug-in `Stranger`: it names .* as the version of the contract"):
        hosted(version)


def test_the_current_version_is_accepted() -> None:
    hosted(API_VERSION)
