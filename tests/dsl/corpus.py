"""A seeded corpus of faulty missions, and the share of the planted faults that the compiler finds.

    python tests/dsl/corpus.py --seed 7 --files 200 --faults 3 [--show] [--write FOLDER] [MISSION.ljs …]

Every file is a good mission with faults planted in different places. Their kinds are drawn so that every kind is
equally frequent wherever it can be planted. A fault counts as found when the primary span of an error lies within one
line of it. An error that lies within one line of no fault is spurious. Unbalanced braces have their own files (`--kinds
brace`) and are counted separately, since no parser can know the intended block.

Faults of the token kinds and misspellings may leave a legal mission (one member fewer, a title with other words). Such
a file has no fault, so another is planted in its place; the number of these cases is part of the outcome. The other
kinds are faults by construction and are counted whatever the compiler reports.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lingjing.dsl.syntax.tokens import INNER, STATEMENTS
from lingjing.mission.units import UNITS, unit_of
from lingjing.testing import compile_text
from lingjing.testing.missions import Diagnostic

ROOT = Path(__file__).parents[2]
KEYWORDS = STATEMENTS.keys() | INNER.keys()
APART = 2
"""Least distance in lines between two faults of one file."""

TOKEN = re.compile(
    r"""(?P<comment>\#[^\n]*)|(?P<string>""\"(?s:.*?)""\"|"(?:[^"\\\n]|\\.)*")|(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)
    |(?P<word>[^\W\d]\w*)|(?P<symbol><->|->|<=|>=|==|!=|\.\.|\.\*|[^\s\w])""",
    re.VERBOSE,
)
QUANTITY = re.compile(r"(?<![\w.])(?P<number>\d+(?:\.\d+)?) (?P<unit>[a-zA-Z%]+(?:/[a-z]+)?)(?![\w(])")
ENTITY = re.compile(r"^[ ]*(?:target|asset) (?P<name>\w+)(?P<index>\[[^\]\n]*\])?[^\n{]*\{", re.MULTILINE)
DECLARATION = re.compile(
    r"^[ ]*(?:param|region|target|asset|agent|message|adjudicate|stage) (?P<name>\w+)[^\n{]*(?:\{[^{}\n]*\})?[ ]*$",
    re.MULTILINE,
)


@dataclass(frozen=True)
class Token:
    """A word, number, symbol or text of the mission."""

    kind: str
    text: str
    start: int
    end: int


@dataclass(frozen=True)
class Fault:
    """One planted fault: the text from `start` to `end` became `text`; the error begins at `mark` in it."""

    kind: str
    start: int
    end: int
    text: str
    mark: int = 0


@dataclass(frozen=True)
class Planted:
    """A faulty file: its text, and the kind and line of each fault."""

    origin: str
    text: str
    faults: tuple[tuple[str, int], ...]


@dataclass
class Outcome:
    """The compiler's results over a corpus."""

    files: int = 0
    planted: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    spurious: int = 0
    spurious_codes: Counter[str] = field(default_factory=Counter)

    @property
    def recall(self) -> float:
        """Share of the planted faults that were found."""
        return self.found.total() / max(1, self.planted.total())

    @property
    def spurious_a_file(self) -> float:
        """Spurious errors per file."""
        return self.spurious / max(1, self.files)


class Mission:
    """A good mission, with the places where faults of each kind can be planted."""

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self.text = text
        tokens = [Token(str(m.lastgroup), m[0], m.start(), m.end()) for m in TOKEN.finditer(text)]
        self.comments = [token for token in tokens if token.kind == "comment"]
        self.tokens = [token for token in tokens if token.kind != "comment"]
        self.words = Counter(token.text for token in self.tokens if token.kind == "word")
        strings = [(token.start, token.end) for token in tokens if token.kind in ("comment", "string")]
        self.quantities = [
            match
            for match in QUANTITY.finditer(text)
            if unit_of(match["unit"]) is not None and not any(a <= match.start() < b for a, b in strings)
        ]
        self.legal: dict[Fault, bool] = {}

    def line(self, offset: int) -> int:
        """The line of an offset, from 1."""
        return self.text.count("\n", 0, offset) + 1

    def is_legal(self, fault: Fault) -> bool:
        """True if the mission is still legal with this fault alone."""
        if fault not in self.legal:
            self.legal[fault] = not errors(compile_text(apply(self.text, [fault])[0]).diagnostics)
        return self.legal[fault]


def apply(text: str, faults: Iterable[Fault]) -> tuple[str, list[int]]:
    """The text with the faults, and the line of each, in the order of their places."""
    parts, lines, at, line = [], [], 0, 1
    for fault in sorted(faults, key=lambda fault: fault.start):
        before = text[at : fault.start]
        line += before.count("\n")
        lines.append(line + fault.text.count("\n", 0, fault.mark))
        line += fault.text.count("\n")
        parts += [before, fault.text]
        at = fault.end
    return "".join([*parts, text[at:]]), lines


# -- the kinds: each yields or draws one fault, None if this mission has no place for it

Kind = Callable[[Mission, random.Random], Fault | None]


def _token(mission: Mission, chance: random.Random, *, braces: bool = False) -> int:
    while True:
        at = chance.randrange(len(mission.tokens) - 1)
        if (mission.tokens[at].text in "{}") == braces:
            return at


def deleted(mission: Mission, chance: random.Random) -> Fault | None:
    token = mission.tokens[_token(mission, chance)]
    return Fault("token deleted", token.start, token.end, "")


def doubled(mission: Mission, chance: random.Random) -> Fault | None:
    token = mission.tokens[_token(mission, chance)]
    return Fault("token doubled", token.end, token.end, f" {token.text}")


def swapped(mission: Mission, chance: random.Random) -> Fault | None:
    for _ in range(100):
        at = _token(mission, chance)
        first, second = mission.tokens[at], mission.tokens[at + 1]
        between = mission.text[first.end : second.start]
        if second.text not in "{}" and "\n" not in between and first.text != second.text:
            glue = between or (" " if first.kind == second.kind == "word" else "")
            return Fault("tokens swapped", first.start, second.end, f"{second.text}{glue}{first.text}")
    return None


def brace(mission: Mission, chance: random.Random) -> Fault | None:
    token = mission.tokens[_token(mission, chance, braces=True)]
    if chance.random() < 0.5:
        return Fault("brace", token.start, token.end, "")
    return Fault("brace", token.end, token.end, token.text)


def misspelling(word: str, chance: random.Random) -> str:
    """A typing error: two letters swapped, one lost, doubled or replaced."""
    while True:
        at = chance.randrange(len(word))
        slip = chance.randrange(4)
        if slip == 0 and at + 1 < len(word):
            typed = word[:at] + word[at + 1] + word[at] + word[at + 2 :]
        elif slip == 1 and len(word) > 1:
            typed = word[:at] + word[at + 1 :]
        elif slip == 2:
            typed = word[: at + 1] + word[at:]
        else:
            typed = word[:at] + chance.choice("abcdefghijklmnopqrstuvwxyz") + word[at + 1 :]
        if typed != word:
            return typed


def _misspelt(mission: Mission, chance: random.Random, kind: str, fits: Callable[[int], bool]) -> Fault | None:
    places = [at for at, token in enumerate(mission.tokens) if token.kind == "word" and fits(at)]
    if not places:
        return None
    token = mission.tokens[chance.choice(places)]
    return Fault(kind, token.start, token.end, misspelling(token.text, chance))


def misspelt_keyword(mission: Mission, chance: random.Random) -> Fault | None:
    return _misspelt(mission, chance, "keyword misspelt", lambda at: mission.tokens[at].text in KEYWORDS)


def misspelt_name(mission: Mission, chance: random.Random) -> Fault | None:
    return _misspelt(
        mission,
        chance,
        "name misspelt",
        lambda at: mission.tokens[at].text not in KEYWORDS and not _is_unit(mission, at),
    )


def misspelt_unit(mission: Mission, chance: random.Random) -> Fault | None:
    return _misspelt(mission, chance, "unit misspelt", lambda at: _is_unit(mission, at))


def _is_unit(mission: Mission, at: int) -> bool:
    return at > 0 and mission.tokens[at - 1].kind == "number" and mission.tokens[at].text not in KEYWORDS


def wrong_dimension(mission: Mission, chance: random.Random) -> Fault | None:
    match = chance.choice(mission.quantities)
    unit_found = unit_of(match["unit"])
    assert unit_found is not None
    others = sorted(word for word, unit in UNITS.items() if unit.dimension != unit_found.dimension and word.isascii())
    return Fault("wrong dimension", match.start("unit"), match.end("unit"), chance.choice(others))


def missing_unit(mission: Mission, chance: random.Random) -> Fault | None:
    fitting = [match for match in mission.quantities if match["unit"] not in ("%", "tick", "ticks")]
    match = chance.choice(fitting)
    return Fault("missing unit", match.end("number"), match.end("unit"), "")


def unclosed_string(mission: Mission, chance: random.Random) -> Fault | None:
    token = chance.choice([token for token in mission.tokens if token.kind == "string"])
    quotes = 3 if token.text.startswith('"""') else 1
    return Fault("unclosed string", token.end - quotes, token.end, "")


def undefined_reference(mission: Mission, chance: random.Random) -> Fault | None:
    """Replace a name in an expression by one that is declared nowhere and resembles none."""
    declared = {match["name"] for match in DECLARATION.finditer(mission.text)}
    declared |= {match["name"] for match in ENTITY.finditer(mission.text)}
    heads = {match.start("name") for pattern in (DECLARATION, ENTITY) for match in pattern.finditer(mission.text)}
    places = [
        token
        for before, token, after in zip(mission.tokens, mission.tokens[1:], mission.tokens[2:], strict=False)
        if token.kind == "word" and token.text in declared and token.start not in heads
        if before.text != "." and after.text not in ("=", "{", ":") and before.text not in STATEMENTS
    ]
    if not places:
        return None
    token = chance.choice(places)
    return Fault("undefined reference", token.start, token.end, chance.choice(("zeppelin", "qqq", "undefined_thing")))


def duplicate_name(mission: Mission, chance: random.Random) -> Fault | None:
    """Double a declaration, or give it the name of an earlier one."""
    places = list(DECLARATION.finditer(mission.text))
    if not places:
        return None
    match = chance.choice(places)
    word = match[0].split()[0]
    others = [other["name"] for other in places if other.start() < match.start() and other[0].split()[0] == word]
    if not others or chance.random() < 0.5:
        return Fault("duplicate name", match.end(), match.end(), f"\n{match[0]}", 1)
    return Fault("duplicate name", match.start("name"), match.end("name"), chance.choice(others))


def cycle(mission: Mission, chance: random.Random) -> Fault | None:
    """A rule that needs itself, a parameter that is its own value, or two stages that wait for each other."""
    faults: list[Fault] = []
    for match in re.finditer(r"adjudicate (\w+)\(([^)]*)\)\s*\{\s*when ", mission.text):
        names = ", ".join(part.split(":")[0].strip() for part in match[2].split(",") if part.strip())
        faults.append(Fault("cycle", match.end(), match.end(), f"{match[1]}({names}) and "))
    params = re.finditer(r"^ *param (\w+) *= *([\w. ]+?) +in ", mission.text, re.MULTILINE)
    faults += [Fault("cycle", match.start(2), match.end(2), match[1]) for match in params]
    return chance.choice(faults) if faults else None


def hidden_leak(mission: Mission, chance: random.Random) -> Fault | None:
    """An agent observes a value that a target hides, or the weather depends on it."""
    hidden = [
        f"{entity['name']}{'[1]' if entity['index'] else ''}.{match[1]}"
        for entity in ENTITY.finditer(mission.text)
        for match in re.finditer(r"hidden (\w+)", mission.text[entity.end() : mission.text.find("\n  }", entity.end())])
    ]
    places = [match.end() for match in re.finditer(r"\bobserves +", mission.text)]
    if not hidden or not places:
        return None
    at = chance.choice(places)
    return Fault("hidden leak", at, at, f"{chance.choice(hidden)}, ")


def capacity(mission: Mission, chance: random.Random) -> Fault | None:
    """A default that exceeds its highest value by one."""
    pattern = r"^ *param \w+ *= *(\d+)(?= *[a-z]* +in [^\n]*\.\. *(\d+))"
    places = list(re.finditer(pattern, mission.text, re.MULTILINE))
    match = chance.choice(places) if places else None
    return match and Fault("capacity exceeded", match.start(1), match.end(1), str(int(match[2]) + 1))


KINDS: dict[str, Kind] = {
    "deleted": deleted,
    "doubled": doubled,
    "swapped": swapped,
    "keyword": misspelt_keyword,
    "name": misspelt_name,
    "unit": misspelt_unit,
    "dimension": wrong_dimension,
    "missing_unit": missing_unit,
    "string": unclosed_string,
    "undefined": undefined_reference,
    "duplicate": duplicate_name,
    "cycle": cycle,
    "leak": hidden_leak,
    "capacity": capacity,
    "brace": brace,
}
PLAIN = tuple(name for name in KINDS if name != "brace")
MAY_BE_LEGAL = frozenset(("deleted", "doubled", "swapped", "keyword", "name", "unit"))


def good_missions(files: Iterable[Path] = ()) -> list[Mission]:
    """The missions in `files`, else all of `scenarios/`. Those with errors of their own are left out."""
    chosen = list(files) or sorted((ROOT / "scenarios").glob("*.ljs"))
    missions = []
    for file in chosen:
        text = file.read_text(encoding="utf-8")
        if compile_text(text, path=str(file)).mission is not None:
            missions.append(Mission(file.name, text))
        else:
            print(f"left out: {file} is no good mission", file=sys.stderr)
    return missions


def plant(mission: Mission, faults: int, chance: random.Random, kinds: tuple[str, ...]) -> tuple[Planted, int]:
    """One file with that many faults, and the number of legal changes that were discarded."""
    chosen: list[Fault] = []
    thrown = 0
    for _ in range(200 * faults):
        if len(chosen) == faults:
            break
        name = chance.choice(kinds)
        fault = KINDS[name](mission, chance)
        if fault is None or any(_too_near(mission, fault, other) for other in chosen):
            continue
        if name in MAY_BE_LEGAL and mission.is_legal(fault):
            thrown += 1
            continue
        chosen.append(fault)
    chosen.sort(key=lambda fault: fault.start)
    text, lines = apply(mission.text, chosen)
    kinds_planted = [fault.kind for fault in chosen]
    return Planted(mission.name, text, tuple(zip(kinds_planted, lines, strict=True))), thrown


def _too_near(mission: Mission, first: Fault, second: Fault) -> bool:
    return abs(mission.line(first.start) - mission.line(second.start)) < APART


def corpus(
    missions: list[Mission], seed: int, files: int, faults: int, kinds: tuple[str, ...] = PLAIN
) -> Iterator[tuple[Planted, int]]:
    """`files` faulty files; the missions alternate."""
    for number in range(files):
        chance = random.Random(f"{seed}/{faults}/{number}")
        yield plant(missions[number % len(missions)], faults, chance, kinds)


def errors(diagnostics: Iterable[Diagnostic]) -> list[Diagnostic]:
    """The diagnostics that are errors."""
    return [item for item in diagnostics if item.severity == "error"]


def near(item: Diagnostic, line: int) -> bool:
    """True if the primary span lies within one line of a line."""
    return item.span.line - 1 <= line <= max(item.span.line, item.span.end_line) + 1


def judge(planted: Planted, outcome: Outcome) -> tuple[list[tuple[str, int]], list[Diagnostic]]:
    """Compile and count into the outcome. Return the missed faults and the spurious errors."""
    diagnostics = errors(compile_text(planted.text, path=planted.origin).diagnostics)
    missed = []
    outcome.files += 1
    for kind, line in planted.faults:
        outcome.planted[kind] += 1
        if any(near(item, line) for item in diagnostics):
            outcome.found[kind] += 1
        else:
            missed.append((kind, line))
    spurious = [item for item in diagnostics if not any(near(item, line) for _, line in planted.faults)]
    outcome.spurious += len(spurious)
    outcome.spurious_codes.update(item.code for item in spurious)
    return missed, spurious


def table(outcome: Outcome, thrown: int) -> str:
    """The outcome as text."""
    first = f"{outcome.files} files, {outcome.planted.total()} faults: found {100 * outcome.recall:.1f} %, "
    lines = [f"{first}spurious {outcome.spurious_a_file:.3f} a file; {thrown} legal changes thrown away"]
    for kind in sorted(outcome.planted):
        share = 100 * outcome.found[kind] / outcome.planted[kind]
        lines.append(f"  {kind:20} {outcome.found[kind]:5} of {outcome.planted[kind]:5}  {share:5.1f} %")
    if outcome.spurious_codes:
        lines.append("  spurious: " + ", ".join(f"{code} {n}" for code, n in outcome.spurious_codes.most_common()))
    return "\n".join(lines)


def main() -> None:
    """Make a corpus and print the outcome."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("missions", nargs="*", type=Path, help="good missions; all of scenarios/ if none is named")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--files", type=int, default=100)
    parser.add_argument("--faults", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=sorted(KINDS), default=list(PLAIN))
    parser.add_argument("--show", action="store_true", help="print what was missed and what was spurious")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the files, and faults.json beside them")
    args = parser.parse_args()
    outcome, thrown_away, listed = Outcome(), 0, []
    for number, (planted, thrown) in enumerate(
        corpus(good_missions(args.missions), args.seed, args.files, args.faults, tuple(args.kinds))
    ):
        thrown_away += thrown
        missed, spurious = judge(planted, outcome)
        if args.show and (missed or spurious):
            show(number, planted, missed, spurious)
        if args.write:
            args.write.mkdir(parents=True, exist_ok=True)
            (args.write / f"{number:05}.ljs").write_text(planted.text, encoding="utf-8")
            listed.append({"file": f"{number:05}.ljs", "origin": planted.origin, "faults": planted.faults})
    if args.write:
        (args.write / "faults.json").write_text(json.dumps(listed, indent=1), encoding="utf-8")
    print(table(outcome, thrown_away))


def show(number: int, planted: Planted, missed: list[tuple[str, int]], spurious: list[Diagnostic]) -> None:
    """Print one file's missed faults and spurious errors, with the lines concerned."""
    lines = planted.text.split("\n")
    print(f"-- {number} {planted.origin}")
    for kind, line in planted.faults:
        print(f"   {'MISSED' if (kind, line) in missed else 'planted'} {kind} {line}: {lines[line - 1].strip()[:110]}")
    for item in spurious:
        print(f"   SPURIOUS {item.code} {item.span.line}: {item.message} | {lines[item.span.line - 1].strip()[:80]}")


if __name__ == "__main__":
    main()
