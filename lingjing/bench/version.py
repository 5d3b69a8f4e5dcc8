"""The version of the benchmark: hashes over everything that decides which task an episode poses and how it is scored.

There are two, and a row has both. `benchmark_version` covers what all missions share: prompts, looks, the drawing of
instances and the modules that judge. `mission_version` covers one mission: its text, libraries, maps and looks. Two
commits with equal hashes pose the same task, with the same prompts and the same looks, and judge alike. Rows of two
versions never stand in one table, but a change of one mission leaves the rows of the others valid (ADR 0065). The code
that decides nothing of it, such as a faster engine, has no part in the version; `rows.code_sha256` covers all code.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import lingjing
from lingjing.data import data_path
from lingjing.dsl.feasibility.providers import named_files
from lingjing.dsl.loading.cache import libraries_of
from lingjing.dsl.loading.load import is_document, load_mission
from lingjing.dsl.source.text import read_source

_JUDGING = (
    "kernel/adjudication.py", "kernel/claims.py", "kernel/evaluation.py", "kernel/evaluators.py", "kernel/rules.py",
    "kernel/stages.py", "kernel/subtasks.py", "kernel/temporal.py", "kernel/budgets.py", "kernel/constraints.py",
    "kernel/registry.py", "mission/evaluate.py", "mission/functions.py", "mission/intervals.py",
    "analysis/metrics.py", "analysis/completion.py", "analysis/detection.py",
)  # fmt: skip
"""The modules that judge: rules, claims, stages, budgets, the evaluator and the metrics."""

_LOOKS = ("kinds.json", "mission/appearance.py", "engines/camera", "scene/own_models.py", "scene/shapes.py",
          "scene/places_alike.py", "scene/surroundings.py")  # fmt: skip
"""The files that decide looks: kinds and their classes, drawn appearances, meshes, light and the renderer."""

_DRAWING = ("mission/draws.py", "mission/seeding.py", "mission/instantiate.py", "mission/tiers.py", "mission/salts.py")
"""The modules that draw instances from seeds."""

_WORDS = ("mission/phrases.zh.json", "plugins/phrases.zh.json", "kernel/phrases.zh.json")
"""The texts for agents in other languages than English."""

_PROMPTS = "prompts"
"""The folders of prompts in the packages of this project's policies."""


@cache
def benchmark_version() -> str:
    """Return the SHA-256 of what all missions share.

    Comments, docstrings and the layout of Python files do not count.
    """
    root, digest = Path(lingjing.__file__).parent, hashlib.sha256()
    files = [(name, path) for part in (*_JUDGING, *_LOOKS, *_DRAWING, *_WORDS) for name, path in _files(root, part)]
    files += list(_prompts())
    for name, path in files:
        content = path.read_bytes()
        digest.update(f"{name}\n".encode() + (_meaning(content) if path.suffix == ".py" else content))
    return digest.hexdigest()


def mission_version(mission: Path) -> str:
    """Return the SHA-256 of a mission: its file, the libraries that it uses, directly or through others, and the maps
    and looks that it names.

    A `resetScenario` document is read by templates: for it, the shipped missions and those beside it count. Names of
    files and folders have no part in the version. Raises `UsageError` for a file that cannot be read, and
    `MissionError` for a mission with errors.
    """
    source = read_source(str(mission))
    digest = hashlib.sha256(source.text.encode("utf-8", "surrogatepass"))
    if is_document(source):
        used = [_sha256(path) for path in _templates(mission)]
    else:
        used = [sha256 for _, sha256 in libraries_of(source)]
    used += [_sha256(path) for name in named_files(load_mission(mission)) for path in _inside(Path(name))]
    for sha256 in used:
        digest.update(f"\n{sha256}".encode())
    return digest.hexdigest()


def _templates(document: Path) -> Iterator[Path]:
    """Yield the files by which a document may be read, in order."""
    shipped = data_path("scenarios")
    yield from sorted(document.parent.glob("*.ljs"))
    yield from (path for folder in (shipped, shipped / "reset") for path in sorted(folder.glob("*.ljs")))
    yield from sorted(data_path("std").glob("*.ljs"))
    yield from shipped.glob("reset-templates.json")


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _files(root: Path, part: str) -> Iterator[tuple[str, Path]]:
    """Yield the files of a part with their names; a folder's in order."""
    for path in _inside(root / part):
        yield path.relative_to(root).as_posix(), path


def _inside(place: Path) -> Iterator[Path]:
    """Yield a file, or the files of a folder in order."""
    inside = sorted(place.rglob("*")) if place.is_dir() else [place]
    yield from (path for path in inside if path.is_file() and "__pycache__" not in path.parts)


def _prompts() -> Iterator[tuple[str, Path]]:
    from importlib.util import find_spec

    agents = find_spec("lingjing_agents")
    for place in (agents.submodule_search_locations or []) if agents else []:
        for folder in sorted(Path(place).rglob(_PROMPTS)):
            yield from _files(Path(place), folder.relative_to(place).as_posix())


def _meaning(source: bytes) -> bytes:
    """Return a form of a Python file that comments, docstrings and layout do not change."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            kept = [part for part in node.body if not _is_text(part)]
            node.body = kept or [ast.Pass()]
    return ast.dump(tree).encode()


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


__all__ = ["benchmark_version", "mission_version"]
