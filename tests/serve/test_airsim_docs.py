"""The table of docs/airsim.md: it lists every method of the client and whether the method is served."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path

import pytest

from lingjing.serve.airsim.methods import METHODS

ROOT = Path(__file__).parents[2]


def table() -> dict[str, str]:
    text = (ROOT / "docs" / "airsim.md").read_text()
    return dict(re.findall(r"^\| `(\w+)` \| (yes|part|no) \|", text, re.MULTILINE))


def wire_names() -> dict[str, list[str]]:
    """The methods of the client with the names that they send."""
    spec = importlib.util.find_spec("cosysairsim")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("the client is not installed: `make setup` installs it")
    source = (Path(spec.submodule_search_locations[0]) / "client.py").read_text()
    methods: dict[str, list[str]] = {}
    for kind in ast.parse(source).body:
        for method in kind.body if isinstance(kind, ast.ClassDef) else ():
            if isinstance(method, ast.FunctionDef) and method.name != "__init__":
                methods[method.name] = [
                    node.args[0].value
                    for node in ast.walk(method)
                    if isinstance(node, ast.Call)
                    and isinstance(node.func, ast.Attribute)
                    and node.func.attr in ("call", "call_async")
                    and isinstance(node.args[0], ast.Constant)
                ]
    return methods


def test_the_table_lists_every_method_and_marks_the_served_methods() -> None:
    listed, client = table(), wire_names()
    assert listed.keys() == client.keys()
    for method, names in client.items():
        if names:
            assert (listed[method] != "no") == all(name in METHODS for name in names), method


def test_no_served_method_is_unknown_to_the_client() -> None:
    assert METHODS.keys() <= {name for names in wire_names().values() for name in names}
