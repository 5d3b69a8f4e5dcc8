"""A check of the English in the code: a part of `make check`.

Three habits make docstrings hard to read for an engineer who meets the project today (see
`CONTRIBUTING.md`): a headless opening ("What the bus holds" instead of "The messages on the bus"), a word for persons
where a program is meant ("nobody asks"), and a local name that does not say what it holds (`found`, `told`). The tool
counts them for each package. `tools/prose_limits.json` holds the counts that are accepted, and no count may rise
above its limit; `--update` lowers limits to what is counted and raises none. `--list` prints each place.

Exit codes: 0 no count is above its limit, 1 at least one is, 2 the arguments are wrong.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

ROOT = Path(__file__).resolve().parent.parent
LIMITS = ROOT / "tools" / "prose_limits.json"
TREES = ("lingjing", "agents/lingjing_agents", "agents/tests", "benchmarks", "examples", "tests", "tools")

Habit = Literal["headless", "persons", "names"]

HEADLESS = re.compile(r"(What|Who|Whom|Whose|Whether|Where|How|Why|That|Whatever|Whoever|Wherever)\b(?![^.\n]*\?)")
"""A summary line that opens with a subordinate clause. A question is none."""

PERSONS = re.compile(
    r"\b(who|whom|whose|whoever|nobody|somebody|someone|anybody|everybody|anyone|lest)\b", re.IGNORECASE
)

VAGUE = frozenset({"one", "found", "said", "told", "given", "asked", "meant", "taken", "gone", "settled", "heard"})
"""Participles and pronouns that stand for a noun. The list is chosen from the most frequent ones of 2026."""

Definition = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Finding:
    """One place with a habit. `words`: the start of the text, or the name."""

    path: Path
    line: int
    habit: Habit
    words: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.habit}: {self.words}"


def findings(source: str, path: Path) -> Iterator[Finding]:
    """The findings of one module, in no particular order. Raises `SyntaxError` for what is not Python."""
    tree = ast.parse(source)
    for text, line in _docstrings(tree):
        if HEADLESS.match(text):
            yield Finding(path, line, "headless", text.split("\n", 1)[0])
        if PERSONS.search(text):
            yield Finding(path, line, "persons", text.split("\n", 1)[0])
    for text, line in _comments(source):
        if PERSONS.search(text):
            yield Finding(path, line, "persons", text)
    for name, line in _local_names(tree):
        if name in VAGUE:
            yield Finding(path, line, "names", name)


def _docstrings(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Every string that stands as a statement: docstrings of definitions and those below a field or a constant."""
    for node in ast.walk(tree):
        if isinstance(node, Definition):
            for statement in node.body:
                match statement:
                    case ast.Expr(ast.Constant(str(text))):
                        yield text.strip(), statement.lineno


def _comments(source: str) -> Iterator[tuple[str, int]]:
    if not any("#" in line and PERSONS.search(line) for line in source.splitlines()):
        return  # tokens take most of the time of this tool
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string.lstrip("#: "), token.start[0]


def _local_names(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Each parameter and each name that something is assigned to."""
    for node in ast.walk(tree):
        match node:
            case ast.arg(arg=name, lineno=line) | ast.Name(id=name, ctx=ast.Store(), lineno=line):
                yield name, line


def package_of(path: Path) -> str:
    """The name under which a file is counted: its folder, up to two levels below the root."""
    return "/".join(path.parent.parts[:2])


def all_findings(root: Path) -> list[Finding]:
    """The findings of all trees, ordered by path and line."""
    files = sorted(file for tree in TREES for file in (root / tree).rglob("*.py"))
    by_file = (findings(file.read_text(encoding="utf-8"), file.relative_to(root)) for file in files)
    return sorted((finding for each in by_file for finding in each), key=lambda finding: (finding.path, finding.line))


def counted(listed: list[Finding]) -> dict[str, dict[str, int]]:
    """The number of findings for each package and habit. A package without findings is left out."""
    counts: dict[str, Counter[str]] = {}
    for finding in listed:
        counts.setdefault(package_of(finding.path), Counter())[finding.habit] += 1
    return {package: dict(sorted(counter.items())) for package, counter in sorted(counts.items())}


def above(counts: dict[str, dict[str, int]], limits: dict[str, dict[str, int]]) -> list[str]:
    """One line for each count that is above its limit. A package that the limits do not name has the limit 0."""
    return [
        f"prose: {package} has {count} {habit}, and at most {limit} are accepted; see `tools/prose.py --list {package}`"
        for package, habits in counts.items()
        for habit, count in habits.items()
        if count > (limit := limits.get(package, {}).get(habit, 0))
    ]


def lowered(counts: dict[str, dict[str, int]], limits: dict[str, dict[str, int]]) -> dict[str, dict[str, int]]:
    """The limits, each lowered to its count. Limits of 0 are left out."""
    smaller = {
        package: {habit: min(limit, counts.get(package, {}).get(habit, 0)) for habit, limit in habits.items()}
        for package, habits in limits.items()
    }
    kept = {package: {habit: limit for habit, limit in habits.items() if limit} for package, habits in smaller.items()}
    return {package: habits for package, habits in kept.items() if habits}


def main(arguments: list[str]) -> int:
    """Compare the counts with the limits, or list or lower them; the exit code."""
    parser = argparse.ArgumentParser(prog="tools/prose.py", description="count three habits that make prose hard")
    parser.add_argument("--list", metavar="PATH", help="print each place in this folder or file")
    parser.add_argument("--update", action="store_true", help="lower the limits to what is counted")
    options = parser.parse_args(arguments)
    chosen = None if options.list is None else (ROOT / options.list).resolve()
    if chosen is not None and not chosen.exists():
        parser.error(f"there is no {options.list}")
    listed = all_findings(ROOT)
    if chosen is not None:
        print(*(finding for finding in listed if (ROOT / finding.path).is_relative_to(chosen)), sep="\n")
        return 0
    counts, limits = counted(listed), json.loads(LIMITS.read_text(encoding="utf-8"))
    if options.update:
        LIMITS.write_text(json.dumps(lowered(counts, limits), indent=2) + "\n", encoding="utf-8")
    faults = above(counts, limits)
    print(*faults, sep="\n", end="\n" if faults else "", file=sys.stderr)
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
