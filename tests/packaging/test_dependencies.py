"""Tests of dependencies: declared and imported packages are the same, versions are pinned in one place, and imports
follow the layers.
"""

from __future__ import annotations

import ast
import functools
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE, AGENTS = ROOT / "lingjing", ROOT / "agents" / "lingjing_agents"
BY_NAME = {"cv2": "opencv-python-headless", "google": "protobuf"}  # packages that share an import name with others


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def imports(path: Path) -> Iterator[str]:
    """Top-level names of every absolute import in a file, wherever it stands."""
    statements: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    for node in statements:  # expressions, which are most of a file, hold no imports
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            statements += getattr(node, name, ())
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def foreign(root: Path) -> dict[str, set[str]]:
    """Imported packages that are neither ours nor the standard library's, with the modules that import them."""
    importers: dict[str, set[str]] = {}
    for path in root.rglob("*.py"):
        for name in imports(path):
            if name not in sys.stdlib_module_names and not name.startswith("lingjing"):
                importers.setdefault(name, set()).add(path.relative_to(root.parent).as_posix())
    return importers


def distributions(names: set[str]) -> set[str]:
    known = installed()
    return {canonical(BY_NAME.get(name) or known[name][0]) for name in names}


installed = functools.cache(packages_distributions)
"""Import name → distributions. Reading all installed packages takes a second."""


def declared(pyproject: Path, *extras: str) -> set[str]:
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *(project["optional-dependencies"][extra] for extra in extras)]
    return {canonical(re.match(r"[\w.-]+", line)[0]) for requirements in lists for line in requirements}  # type: ignore[index]


def test_the_core_declares_what_it_imports_and_nothing_else() -> None:
    run_as_programs = {"eclipse-sumo", "graphviz-pure"}  # netconvert, and the layout of graphs
    requirements = declared(
        ROOT / "pyproject.toml",
        "bench",
        "film",
        "foxglove",
        "lsp",
        "road",
        "quadruped",
        "maps",
        "models",
        "envs",
        "airsim",
    )
    used = foreign(CORE)
    assert used.pop("ray") == {"lingjing/bench/on_ray.py"}  # not installed by `make setup`, for its size
    assert "ray" in declared(ROOT / "pyproject.toml", "ray")
    assert used.pop("rerun") == {"lingjing/viewer/rerun_recording.py"}  # the same
    assert "rerun-sdk" in declared(ROOT / "pyproject.toml", "rerun")
    assert used.pop("inspect_ai") == {"lingjing/bench/inspect_task.py", "lingjing/viewer/inspect_log.py"}  # the same
    assert {"inspect_ai", "inspect-ai"} & declared(ROOT / "pyproject.toml", "inspect")
    assert distributions(set(used)) == requirements - run_as_programs


def test_the_agents_declare_what_they_import_and_nothing_else() -> None:
    needed = declared(ROOT / "agents" / "pyproject.toml", "litellm") - {"lingjing-sim"}
    assert distributions(set(foreign(AGENTS))) == needed


def test_the_import_contracts_hold() -> None:
    done = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=900,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert " 0 broken" in done.stdout


@pytest.mark.parametrize(
    "name",
    [
        "constraints.txt",
        "benchmarks/constraints.txt",
        "benchmarks/requirements.txt",
        "requirements-nodeps.txt",
        "requirements-nodeps-dev.txt",
    ],
)
def test_pins_are_names_and_versions_and_no_hosts(name: str) -> None:
    lines = [line for line in (ROOT / name).read_text().splitlines() if not line.startswith("#")]
    assert lines
    for line in lines:
        assert re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.!+_-]+", line), line


def test_every_dependency_is_pinned() -> None:
    pins = {canonical(line.partition("==")[0]) for line in (ROOT / "constraints.txt").read_text().splitlines()}
    requirements = declared(ROOT / "pyproject.toml", "dev") | declared(ROOT / "agents" / "pyproject.toml", "litellm")
    assert requirements - {"lingjing-sim"} <= pins
