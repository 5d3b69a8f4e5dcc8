"""The page on the architecture names only existing definitions, and the docstring of a package all its modules."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "docs" / "architecture.md", ROOT / "CONTRIBUTING.md")
PLACE = re.compile(r"`([\w/]+\.py):([\w.]+)`")
PACKAGES = sorted(
    init.parent
    for top in ("lingjing", "agents/lingjing_agents")
    for init in (ROOT / top).rglob("__init__.py")
    if "templates" not in init.parts
)


def _names(node: ast.Module | ast.ClassDef) -> dict[str, ast.AST]:
    """The names that a module or class defines or declares at its own level."""
    nodes: dict[str, ast.AST] = {}
    for item in node.body:
        match item:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                nodes[name] = item
            case ast.AnnAssign(target=ast.Name(id=name)):
                nodes[name] = item
            case ast.Assign(targets=[ast.Name(id=name)]):
                nodes[name] = item
    return nodes


def is_defined(path: Path, dotted: str) -> bool:
    node: ast.AST | None = ast.parse(path.read_text(encoding="utf-8"))
    for part in dotted.split("."):
        node = _names(node).get(part) if isinstance(node, (ast.Module, ast.ClassDef)) else None
    return node is not None


def test_a_reference_to_a_missing_definition_is_detected() -> None:
    step = ROOT / "lingjing/kernel/step.py"
    assert is_defined(step, "Kernel.step")
    assert not is_defined(step, "Kernel.leap")
    assert not is_defined(step, "Kernel.step.inner")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_names_only_existing_definitions(page: Path) -> None:
    places = PLACE.findall(page.read_text(encoding="utf-8"))
    assert len(places) >= 6
    wrong = [f"{path}:{name}" for path, name in places if not is_defined(ROOT / path, name)]
    assert not wrong


def test_the_page_names_every_package() -> None:
    text = PAGES[0].read_text(encoding="utf-8")
    tops = [path for path in PACKAGES if path.parent == ROOT / "lingjing" and path.name not in ("cli", "envs", "lsp")]
    assert not [path.name for path in tops if f"`lingjing/{path.name}`" not in text]


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: str(package.relative_to(ROOT)))
def test_a_package_names_all_its_modules(package: Path) -> None:
    docstring = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8"))) or ""
    named = set(re.findall(r"`(\w+)/?`", docstring))
    modules = {path.stem for path in package.glob("*.py")} - {"__init__", "__main__"}
    modules |= {path.parent.name for path in package.glob("*/__init__.py")}
    assert not modules - named
