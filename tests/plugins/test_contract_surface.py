"""The public surface of the plug-in contract is the stored one, and a version means one surface.

`golden/contract.txt` holds every public name of the contract with its signature or fields, under the version that it
belongs to. A change of the surface needs another `API_VERSION`; then store it:
`python -m pytest tests/plugins/test_contract_surface.py --update`.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator
from importlib import import_module
from pathlib import Path

import pytest

from lingjing.plugins.contract import API_VERSION, CONTRACT_MODULES

STORE = Path(__file__).parent / "golden" / "contract.txt"
HEAD = "version "


def sources() -> Iterator[tuple[str, Path]]:
    """The modules of the contract and their files; a package counts with its modules."""
    for name in CONTRACT_MODULES:
        file = Path(str(import_module(name).__file__))
        if file.name != "__init__.py":
            yield name, file
            continue
        for part in sorted(file.parent.glob("*.py")):
            yield (name if part == file else f"{name}.{part.stem}"), part


def surface() -> str:
    """The surface as text: a line for each module, definition and member."""
    lines = [HEAD + API_VERSION]
    for name, file in sources():
        lines.append(f"\n{name}")
        lines += described(ast.parse(file.read_text(encoding="utf-8")))
    return "\n".join(lines) + "\n"


def described(tree: ast.Module) -> Iterator[str]:
    """The public definitions of a module, by name."""
    exported = exports(tree)
    parts = [(name, node) for node in tree.body for name in (*defined(node), *imported(node, exported or ()))]
    for name, node in sorted(parts, key=lambda part: part[0]):
        if (name in exported) if exported is not None else not name.startswith("_"):
            yield from rendered(name, node, "  ")


def exports(tree: ast.Module) -> frozenset[str] | None:
    """The names in `__all__`; None where there is none."""
    for node in tree.body:
        match node:
            case ast.Assign(targets=[ast.Name(id="__all__")], value=value):
                return frozenset(ast.literal_eval(value))
    return None


def defined(node: ast.stmt) -> tuple[str, ...]:
    """The names that a statement of a module defines; imports define none of the module's own."""
    match node:
        case ast.ClassDef(name=name) | ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
            return (name,)
        case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
            return () if name == "__all__" else (name,)
    return ()


def imported(node: ast.stmt, exported: Collection[str]) -> tuple[str, ...]:
    """The names that a statement imports and the module exports as its own."""
    match node:
        case ast.ImportFrom(names=names):
            return tuple(name for alias in names if (name := alias.asname or alias.name) in exported)
    return ()


def rendered(name: str, node: ast.stmt, indent: str) -> Iterator[str]:
    """The lines of one definition."""
    match node:
        case ast.ClassDef():
            bases = [ast.unparse(base) for base in (*node.bases, *node.keywords)]
            yield f"{indent}class {name}({', '.join(bases)})"
            for part in node.body:
                for member in defined(part):
                    if not member.startswith("_") or member == "__init__":
                        yield from rendered(member, part, indent + "  ")
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            marks = "".join(f"@{ast.unparse(mark)} " for mark in node.decorator_list)
            word = "async def" if isinstance(node, ast.AsyncFunctionDef) else "def"
            returns = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
            yield f"{indent}{marks}{word} {name}({ast.unparse(node.args)}){returns}"
        case ast.AnnAssign():
            default = f" = {ast.unparse(node.value)}" if node.value is not None else ""
            yield f"{indent}{name}: {ast.unparse(node.annotation)}{default if indent > '  ' else ''}"
        case ast.Assign():
            yield f"{indent}{name}"
        case ast.ImportFrom(module=module):
            yield f"{indent}{name} from {module}"


def test_the_surface_equals_the_stored_surface(request: pytest.FixtureRequest) -> None:
    current, stored = surface(), STORE.read_text(encoding="utf-8") if STORE.is_file() else ""
    if request.config.getoption("--update"):
        version = stored.partition("\n")[0].removeprefix(HEAD)
        assert version != API_VERSION or stored == current, (
            f"the surface differs and is version {version} still: set another `lingjing.plugins.contract.API_VERSION`"
        )
        STORE.parent.mkdir(exist_ok=True)
        STORE.write_text(current, encoding="utf-8")
        return
    assert current.splitlines() == stored.splitlines(), (
        "another surface needs another version; see the docstring of this module"
    )


def test_a_definition_is_rendered_with_its_bases_fields_and_signatures() -> None:
    text = '''
__all__ = ["LIMIT", "Body", "act"]
LIMIT: float = 3.0
HIDDEN = 4
class Body(Base, frozen=True):
    """Docstrings may change."""
    mass_kg: float
    name: str = ""
    _private: int = 0
    def __init__(self, mass_kg: float) -> None: ...
    @property
    def weight_n(self) -> float: ...
async def act(body: Body, *, tick: int = 0) -> None: ...
'''
    assert list(described(ast.parse(text))) == [
        "  class Body(Base, frozen=True)",
        "    mass_kg: float",
        "    name: str = ''",
        "    def __init__(self, mass_kg: float) -> None",
        "    @property def weight_n(self) -> float",
        "  LIMIT: float",
        "  async def act(body: Body, *, tick: int=0) -> None",
    ]
