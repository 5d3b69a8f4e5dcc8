"""The wheels, installed with pip into a bare environment, outside the repository, compile and play the mission."""

from __future__ import annotations

import json
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def call(*command: object, cwd: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = subprocess.run([*map(str, command)], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{command}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The core's wheel and the agents' wheel."""
    folder = tmp_path_factory.mktemp("wheels")
    build = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder)
    call(*build, ROOT, cwd=folder)
    call(*build, ROOT / "agents", cwd=folder)
    (core,) = folder.glob("lingjing-*.whl")
    (agents,) = folder.glob("lingjing_agents-*.whl")
    return core, agents


@pytest.fixture(scope="module")
def bare(wheels: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The `bin` folder of an environment that holds the wheels and what they ask for."""
    folder = tmp_path_factory.mktemp("bare")
    venv.create(folder, with_pip=True)
    constraints = ROOT / "constraints.txt"
    pip = (folder / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "install", "-q", "-c", constraints)
    call(*pip, *wheels, cwd=folder)
    return folder / "bin"


def test_the_wheel_carries_the_library_the_missions_and_the_schemas(wheels: tuple[Path, Path]) -> None:
    names = set(zipfile.ZipFile(wheels[0]).namelist())
    for folder in ("scenarios", "schemas", "suites"):
        shipped = {path for path in (ROOT / folder).rglob("*") if path.is_file()}
        assert shipped
        assert {f"lingjing/_data/{path.relative_to(ROOT).as_posix()}" for path in shipped} <= names
    for pattern in ("*.xml", "*.glsl", "*.js", "*.css", "assets/*.html"):  # airframes, shaders, the player
        data = set((ROOT / "lingjing").rglob(pattern))
        assert data
        assert {path.relative_to(ROOT).as_posix() for path in data} <= names
    assert not {name for name in names if name.startswith(("tests/", "agents/", "scenarios/"))}


def test_every_wheel_carries_the_licence(wheels: tuple[Path, Path]) -> None:
    for wheel in wheels:
        held = zipfile.ZipFile(wheel)
        (name,) = [name for name in held.namelist() if name.endswith(".dist-info/licenses/LICENSE")]
        assert held.read(name) == (ROOT / "LICENSE").read_bytes()


def test_the_mission_validates_and_plays_without_the_repository(bare: Path, tmp_path: Path) -> None:
    lingjing = bare / "lingjing"
    source = ROOT / "scenarios" / "ssr.ljs"
    mission = tmp_path / "ssr.ljs"
    mission.write_text(source.read_text(encoding="utf-8").replace("ticks <= 60", "ticks <= 10"), encoding="utf-8")
    call(lingjing, "validate", mission, cwd=tmp_path)
    done = call(lingjing, "run", mission, "--seed", 7, "--json", "-o", tmp_path / "out", cwd=tmp_path)
    answer = json.loads(done.stdout)
    assert (answer["mission"], answer["seed"], answer["mode"], answer["ticks"]) == ("ssr", 7, "broadcast", 10)
    assert Path(answer["trace"]).is_file()
    assert (tmp_path / "out" / "overview.png").is_file()
    where = call(bare / "python", "-c", "import lingjing; print(lingjing.__file__)", cwd=tmp_path).stdout
    assert str(ROOT) not in where


def test_a_shipped_mission_is_found_by_its_name(bare: Path, tmp_path: Path) -> None:
    done = call(bare / "lingjing", "run", "ssr", "--set", "victims=99", "--json", cwd=tmp_path, code=2)
    assert "victims" in done.stderr
    assert not (tmp_path / "runs").exists()
