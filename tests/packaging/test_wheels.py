"""The wheels hold what a mission needs: installed outside the repository they compile and play it.

Tests that are marked `wheels` resolve and download requirements; `make wheels` runs them.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from importlib.util import cache_from_source
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
PIP = ("-m", "pip", "--disable-pip-version-check", "install", "-q", "-c", ROOT / "constraints.txt")
UNPINNED = {"inspect"}
"""Extras that the pinned versions exclude: Inspect requires an earlier fsspec than the pinned one."""
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def call(*command: object, cwd: Path, code: int = 0, **variables: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PIP_NO_COMPILE": "1", **variables}  # modules are compiled when they are imported
    done = subprocess.run([*map(str, command)], cwd=cwd, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{command}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The core's wheel and the agents' wheel."""
    folder = tmp_path_factory.mktemp("wheels")
    build = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder)
    call(*build, ROOT, cwd=folder)
    call(*build, ROOT / "agents", cwd=folder)
    (core,) = folder.glob("lingjing_sim-*.whl")
    (agents,) = folder.glob("lingjing_sim_agents-*.whl")
    return core, agents


@pytest.fixture(scope="module")
def bare(wheels: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The `bin` folder of an environment that holds the wheels and what they require."""
    folder = tmp_path_factory.mktemp("bare")
    venv.create(folder, with_pip=True)
    call(folder / "bin" / "python", *PIP, *wheels, cwd=folder)
    return folder / "bin"


def test_the_wheel_carries_the_library_the_missions_and_the_schemas(wheels: tuple[Path, Path]) -> None:
    names = set(zipfile.ZipFile(wheels[0]).namelist())
    for folder in ("scenarios", "schemas", "suites"):
        shipped = {path for path in (ROOT / folder).rglob("*") if path.is_file()}
        assert shipped
        assert {f"lingjing/_data/{path.relative_to(ROOT).as_posix()}" for path in shipped} <= names
    for pattern in ("*.xml", "*.glsl", "*.js", "*.css", "assets/*.html", "*.lark", "*.tables"):  # shaders, grammar, …
        data = set((ROOT / "lingjing").rglob(pattern))
        assert data
        assert {path.relative_to(ROOT).as_posix() for path in data} <= names
    assert not {name for name in names if name.startswith(("tests/", "agents/", "scenarios/"))}


def test_every_wheel_carries_the_licence(wheels: tuple[Path, Path]) -> None:
    for wheel in wheels:
        held = zipfile.ZipFile(wheel)
        (name,) = [name for name in held.namelist() if name.endswith(".dist-info/licenses/LICENSE")]
        assert held.read(name) == (ROOT / "LICENSE").read_bytes()


def short(folder: Path) -> Path:
    """Write the sea rescue with six ticks and small pictures. The boat starts nearer: else they are proved too few."""
    text = (ROOT / "scenarios" / "ssr.ljs").read_text(encoding="utf-8").replace("ticks <= 60", "ticks <= 6")
    text = text.replace("1920 by 1080", "480 by 270").replace("1280 by 720", "320 by 180")
    mission = folder / "ssr.ljs"
    mission.write_text(text.replace("(12.4 m, -1351.8 m)", "(270 m, -920 m)"), encoding="utf-8")
    return mission


def check_that_it_plays(*lingjing: object, folder: Path, **variables: str) -> None:
    """Validate and play a mission with a command, and check the files that a run leaves."""
    mission = short(folder)
    call(*lingjing, "validate", mission, cwd=folder, **variables)
    run = (*lingjing, "run", mission, "--seed", 7, "--json", "-o", folder / "out")
    answer = json.loads(call(*run, cwd=folder, **variables).stdout)
    assert (answer["mission"], answer["seed"], answer["mode"], answer["ticks"]) == ("ssr", 7, "broadcast", 6)
    assert answer["metrics"]["frames"] > 0
    assert Path(answer["trace"]).is_file()
    assert (folder / "out" / "overview.png").is_file()


def copy_bytecode(here: Path, installed: Path) -> None:
    """Give installed modules the bytecode of equal modules here. Each process of a run would compile hundreds."""
    for module in installed.rglob("*.py"):
        source = here / module.relative_to(installed)
        made, copied = (Path(cache_from_source(str(path))) for path in (source, module))
        if made.is_file() and source.read_bytes() == module.read_bytes():
            os.utime(module, ns=(source.stat().st_atime_ns, source.stat().st_mtime_ns))
            copied.parent.mkdir(exist_ok=True)
            shutil.copyfile(made, copied)


def test_the_mission_plays_from_the_files_of_the_wheels(wheels: tuple[Path, Path], tmp_path: Path) -> None:
    """With the requirements of this environment: nothing is read from the repository."""
    site = tmp_path / "site"
    call(sys.executable, *PIP, "--no-index", "--no-deps", "--target", site, *wheels, cwd=tmp_path)
    copy_bytecode(ROOT / "lingjing", site / "lingjing")
    copy_bytecode(ROOT / "agents" / "lingjing_agents", site / "lingjing_agents")
    code = "import lingjing, lingjing_agents; print(lingjing.__file__, lingjing_agents.__file__)"
    where = call(sys.executable, "-c", code, cwd=tmp_path, PYTHONPATH=str(site)).stdout
    assert where.count(str(site)) == 2
    lingjing = (sys.executable, "-m", "lingjing.cli.main")
    check_that_it_plays(*lingjing, folder=tmp_path, PYTHONPATH=str(site))
    refused = call(*lingjing, "run", "ssr", "--set", "victims=99", cwd=tmp_path, code=2, PYTHONPATH=str(site)).stderr
    assert "victims" in refused


@pytest.mark.wheels
def test_the_mission_plays_in_a_bare_environment(bare: Path, tmp_path: Path) -> None:
    check_that_it_plays(bare / "lingjing", folder=tmp_path)
    where = call(bare / "python", "-c", "import lingjing; print(lingjing.__file__)", cwd=tmp_path).stdout
    assert str(ROOT) not in where


@pytest.mark.wheels
def test_a_shipped_mission_is_found_by_its_name(bare: Path, tmp_path: Path) -> None:
    done = call(bare / "lingjing", "run", "ssr", "--set", "victims=99", "--json", cwd=tmp_path, code=2)
    assert "victims" in done.stderr
    assert not (tmp_path / "runs").exists()


@pytest.mark.wheels
@pytest.mark.parametrize("extra", sorted(EXTRAS.keys() - {"dev"}))
def test_every_extra_can_be_installed_from_the_two_wheels(
    extra: str, wheels: tuple[Path, Path], bare: Path, tmp_path: Path
) -> None:
    """As pip resolves it, in a bare environment that has the wheels: what is added, and nothing of another party's."""
    resolve = (
        bare / "python",
        *(PIP if extra not in UNPINNED else PIP[:-2]),
        "--dry-run",
        "--report",
        tmp_path / "report.json",
        "--find-links",
        wheels[0].parent,
    )
    call(*resolve, f"{wheels[0]}[{extra}]", cwd=tmp_path)
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    added = {canonical(item["metadata"]["name"]) for item in report["install"]}
    here = json.loads(call(bare / "python", "-m", "pip", "list", "--format", "json", cwd=tmp_path).stdout)
    present = {canonical(item["name"]) for item in here}
    assert not {"lingjing", "lingjing-agents"} & (added | present)
    requirements = {canonical(re.split(r"[^\w.-]", line)[0]) for line in EXTRAS[extra]} - {"lingjing-sim"}
    assert requirements <= added | present


@pytest.mark.wheels
def test_the_command_of_an_install_hint_installs_the_missing_package(bare: Path, tmp_path: Path) -> None:
    refused = call(bare / "lingjing", "lsp", cwd=tmp_path, code=2).stderr
    assert "the language server needs pygls" in refused
    (line,) = re.findall(r"install it: pip install (.+)", refused)
    assert "lingjing" not in line
    call(bare / "python", *PIP, *shlex.split(line), cwd=tmp_path)
    assert call(bare / "lingjing", "lsp", "--stdio", cwd=tmp_path).returncode == 0


@pytest.mark.wheels
def test_a_foreign_package_installed_over_the_wheel_is_named(wheels: tuple[Path, Path], tmp_path: Path) -> None:
    venv.create(tmp_path / "env")
    environment = tmp_path / "env" / "bin"
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", environment / "python")
    install = (*pip, "install", "-q", "--no-index", "--no-deps")
    call(*install, wheels[0], cwd=tmp_path)
    call(*install, foreign_wheel(tmp_path), cwd=tmp_path)
    refused = call(environment / "lingjing", "--version", cwd=tmp_path, code=2).stderr
    assert "another package `lingjing` was installed over this project's" in refused
    (hint,) = re.findall(r"hint: (.+)", refused)
    assert hint == f"pip uninstall -y lingjing && pip install --force-reinstall --no-deps {wheels[0]}"
    for line in hint.split(" && "):
        call(*pip, *shlex.split(line)[1:], cwd=tmp_path)
    assert call(environment / "lingjing", "--version", cwd=tmp_path).stdout.startswith("lingjing ")


def foreign_wheel(folder: Path) -> Path:
    """A wheel with the earlier name of the core, of another party: one module without missions."""
    path, info = folder / "lingjing-1.0.0-py3-none-any.whl", "lingjing-1.0.0.dist-info"
    files = {
        "lingjing/__init__.py": "name = 'another'\n",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: lingjing\nVersion: 1.0.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = "".join(f"{name},,\n" for name in (*files, f"{info}/RECORD"))
    with zipfile.ZipFile(path, "w") as wheel:
        for name, text in (*files.items(), (f"{info}/RECORD", record)):
            wheel.writestr(name, text)
    return path


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
