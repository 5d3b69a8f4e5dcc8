"""A check of the imports in tests: a part of `make check`.

A test that imports an internal module must be rewritten when the module moves, also if its behaviour stays. So tests
prefer the public surface: `lingjing`, `lingjing.testing`, `lingjing.envs`, the modules of the plug-in contract
(`lingjing.plugins.contract.CONTRACT_MODULES`) and the command. The tool counts import statements of other modules for
each folder of tests. `tools/internals_limits.json` holds the counts that are accepted, and no count may rise above its
limit; `--update` lowers limits to what is counted and raises none. `--list` prints each import.

Exit codes: 0 no count is above its limit, 1 at least one is, 2 the arguments are wrong.
"""

from __future__ import annotations

import argparse
import ast
import json
import sys
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from lingjing.plugins.contract import CONTRACT_MODULES

ROOT = Path(__file__).resolve().parent.parent
LIMITS = ROOT / "tools" / "internals_limits.json"
TREES = ("tests", "agents/tests")

PUBLIC = frozenset({"lingjing", "lingjing.envs", *CONTRACT_MODULES})
"""The public modules. A public package counts with its modules; `lingjing` and `lingjing.envs` count alone."""

OPEN_PACKAGES = ("lingjing.testing", "lingjing.plugins.conformance")
"""The packages of the contract with public modules."""


def internals(source: str, public: Collection[str] = PUBLIC) -> Iterator[tuple[int, str]]:
    """Yield the line and the module of each statement that imports an internal module of `lingjing`.

    `from PACKAGE import NAME` imports `PACKAGE.NAME` if that is a module. Raises `SyntaxError` for what is not Python.
    """
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Import(names=names):
                modules = [alias.name for alias in names]
            case ast.ImportFrom(module=str(package), names=names, level=0):
                modules = [_module(package, alias.name) for alias in names]
            case _:
                continue
        for module in modules:
            if module.partition(".")[0] == "lingjing" and not _is_public(module, public):
                yield node.lineno, module
                break


def _module(package: str, name: str) -> str:
    """Return the module that `from package import name` imports: `package.name` if it is one, else `package`."""
    path = ROOT.joinpath(*package.split("."), name)
    return f"{package}.{name}" if path.with_suffix(".py").is_file() or path.is_dir() else package


def _is_public(module: str, public: Collection[str]) -> bool:
    return module in public or module.startswith(tuple(f"{package}." for package in OPEN_PACKAGES))


def places() -> Iterator[tuple[str, Path, int, str]]:
    """Yield the folder, file, line and module of each import of an internal module."""
    for tree in TREES:
        for path in sorted((ROOT / tree).rglob("*.py")):
            relative = path.relative_to(ROOT)
            folder = tree if tree != "tests" or len(relative.parts) < 3 else f"tests/{relative.parts[1]}"
            for line, module in internals(path.read_text(encoding="utf-8")):
                yield folder, relative, line, module


def above(counts: Mapping[str, int], limits: Mapping[str, int]) -> list[str]:
    """Return a line for each folder with a count above its limit."""
    return [
        f"internals: {folder} imports internal modules {count} times, and at most {limits.get(folder, 0)} are "
        f"accepted: use lingjing, lingjing.testing or the contract (tools/internals.py --list shows them)"
        for folder, count in sorted(counts.items())
        if count > limits.get(folder, 0)
    ]


def lowered(counts: Mapping[str, int], limits: Mapping[str, int]) -> dict[str, int]:
    """Return the limits, lowered to the counts."""
    return {folder: min(limit, counts.get(folder, 0)) for folder, limit in sorted(limits.items())}


def main(argv: list[str] | None = None) -> int:
    """Count, compare with the limits, and return the exit code."""
    parser = argparse.ArgumentParser(prog="internals", description="Check the imports in tests.")
    parser.add_argument("--update", action="store_true", help="lower the limits to what is counted")
    parser.add_argument("--list", action="store_true", help="print each import of an internal module")
    options = parser.parse_args(argv)
    imports = list(places())
    counts = Counter(folder for folder, *_ in imports)
    if options.list:
        print("\n".join(f"{path}:{line}: {module}" for _, path, line, module in imports))
        return 0
    limits: dict[str, int] = json.loads(LIMITS.read_text(encoding="utf-8"))
    if options.update:
        LIMITS.write_text(json.dumps(lowered(counts, limits), indent=2) + "\n", encoding="utf-8")
        return 0
    messages = above(counts, limits)
    print("\n".join(messages) or f"internals: {sum(counts.values())} imports, none above its limit")
    return 1 if messages else 0


if __name__ == "__main__":
    sys.exit(main())
