"""`lingjing.plugins` is the contract alone: its exports are listed, and it names no shipped type and no mission."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import msgspec
import pytest

from lingjing import testing
from lingjing.data import data_path
from lingjing.plugins.engine import Boundary

ROOT = Path(__file__).parents[2]
MODULES = sorted((ROOT / "lingjing" / "plugins").rglob("*.py"))
_TYPE = re.compile(r"^\s*(?:asset|target)\s+(\w+)", re.MULTILINE)


def shipped_types() -> frozenset[str]:
    """The assets and targets of the standard library."""
    texts = [path.read_text(encoding="utf-8") for path in data_path("std").glob("*.ljs")]
    return frozenset(name for text in texts for name in _TYPE.findall(text))


def shipped_missions() -> frozenset[str]:
    """The missions by name."""
    return frozenset(path.stem for path in testing.shipped_missions())


def identifiers(tree: ast.AST) -> set[str]:
    """Every name that code defines or uses."""
    fields = {ast.Name: "id", ast.Attribute: "attr", ast.arg: "arg", ast.FunctionDef: "name", ast.ClassDef: "name"}
    return {getattr(node, fields[type(node)]) for node in ast.walk(tree) if type(node) in fields}


def texts(tree: ast.Module) -> set[str]:
    """The words of all string constants, except docstrings."""
    bare = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    strings = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in bare
    ]
    return {word for text in strings for word in re.findall(r"\w+", text)}


def test_the_sets_of_shipped_types_and_missions_are_not_empty() -> None:
    assert {"quadrotor", "lifeboat", "person_in_water"} <= shipped_types()
    assert {"ssr", "queue"} <= shipped_missions()


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_contract_names_no_shipped_type_and_no_mission(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    known = {name.lower() for name in identifiers(tree) | texts(tree)}
    assert not known & shipped_types()
    assert not texts(tree) & shipped_missions()


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_exports_of_a_module_are_sorted_and_exist(path: Path) -> None:
    module = import_module(".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"))
    assert module.__all__ == sorted(module.__all__, key=lambda name: (not name.isupper(), not name[0].isupper(), name))
    missing = [
        name for name in module.__all__ if not hasattr(module, name) and not (path.parent / f"{name}.py").is_file()
    ]
    assert [name for name in missing if not (path.parent / name / "__init__.py").is_file()] == []


def test_the_old_name_of_the_unreachable_links_is_accepted_with_a_warning() -> None:
    pairs = (("boat", "dog"),)
    with pytest.warns(DeprecationWarning, match="use `unreachable_links`"):
        boundary = Boundary(engine="city", time_s=1.0, unheard=pairs)
    assert boundary == Boundary(engine="city", time_s=1.0, unreachable_links=pairs)
    with pytest.warns(DeprecationWarning, match="use `unreachable_links`"):
        assert boundary.unheard == pairs
    encoded = msgspec.msgpack.encode(boundary)
    assert msgspec.msgpack.decode(encoded)["unheard"] == [["boat", "dog"]]
    assert msgspec.msgpack.decode(encoded, type=Boundary) == boundary
