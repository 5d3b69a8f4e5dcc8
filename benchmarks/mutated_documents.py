"""Mutate `resetScenario` documents and read them: every one gives a mission or a message, never a traceback.

`python -m benchmarks.mutated_documents [--count 100000] [--seed 1]` takes the shipped documents, changes one to four
things in each (a value of another kind, a key renamed, removed, doubled, nulled or spelt twice, a list cut or repeated,
a number made huge), reads them and counts how they ended. The documents of other systems that the tests have
(`tests/mission/wild` and `made_up`) are among those that are changed. What may not be is counted, printed, and makes it
fail: an exception that is no `LingjingError` that names the file, and a silent guess (`benchmarks/silent_guesses.py`).
"""

from __future__ import annotations

import argparse
import collections
import copy
import json
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.silent_guesses import silent_guesses
from lingjing.dsl.loading.load import templates_beside
from lingjing.errors import LingjingError
from lingjing.mission.jsontext import without_comments
from lingjing.mission.model import Mission
from lingjing.mission.reset.reading import instantiate_document

ROOT = Path(__file__).resolve().parents[1]
ODD: tuple[Any, ...] = (
    None,
    True,
    "",
    "12",
    "北",
    -1,
    0,
    1e9,
    1e300,
    float("nan"),
    float("inf"),
    10**400,
    -243_000,
    3.5,
    [],
    {},
    [[]],
    {"X": 1},
    "x" * 999,
)


def spots(value: Any) -> list[tuple[Any, Any]]:
    """Return (container, key) of every value in a document."""
    places: list[tuple[Any, Any]] = []
    stack = [value]
    while stack:
        container = stack.pop()
        inner = container.items() if isinstance(container, dict) else enumerate(container)
        for key, item in inner:
            places.append((container, key))
            if isinstance(item, dict | list):
                stack.append(item)
    return places


def mutate(places: Sequence[tuple[Any, Any]], chance: random.Random) -> None:
    """Change one value of a document, given all its places."""
    holder, key = chance.choice(places)
    change = chance.randrange(8)
    if change == 0 or isinstance(holder, list):
        holder[key] = copy.deepcopy(chance.choice(ODD))
    elif change == 1:
        del holder[key]
    elif change == 2:
        holder[chance.choice((key.lower(), key.upper(), f"{key}s", "data", "position", "tle", "名"))] = holder.pop(key)
    elif change == 3:
        holder[key] = [copy.deepcopy(holder[key])] * chance.choice((1, 2, 40))
    elif change == 4 and isinstance(holder[key], list):
        holder[key] = holder[key][: chance.randrange(3)]
    elif change == 5:
        holder[key] = {"data": holder[key]}
    elif change == 6:
        holder[f"{key}2"] = holder[key]
    else:
        holder[key.swapcase()] = copy.deepcopy(chance.choice(ODD))


def mutated(texts: Sequence[str], chance: random.Random) -> str:
    """Return one of the documents with one to four changes."""
    whole = json.loads(chance.choice(texts))
    if chance.random() < 0.5 and isinstance(whole.get("scenario"), dict):
        whole["scenario"].pop("lingjing", None)
    for _ in range(chance.randint(1, 4)):
        if places := spots(whole):
            mutate(places, chance)
    return json.dumps(whole, ensure_ascii=False)


def ended(text: str, templates: Callable[[str], Mission]) -> tuple[str, str]:
    """Return how the reading of a document ended, and the forbidden part of its result, or ""."""
    try:
        mission, notes = instantiate_document(text, "m.json", templates)
        guesses = "; ".join(silent_guesses(text, mission, notes, templates))
    except LingjingError as error:
        named = str(error).startswith("m.json")
        return type(error).__name__, "" if named else f"the message names no file: {error}"
    except Exception as error:  # noqa: BLE001 - whatever it is, it is counted
        return "traceback", f"{type(error).__name__}: {error}"
    return "guessed" if guesses else "read", guesses


def read_mutated(count: int, seed: int, tell: Callable[[int, Mapping[str, int]], object]) -> Mapping[str, int]:
    """Read mutated documents and return the number of each kind of result; forbidden results are printed."""
    chance = random.Random(seed)
    tests = ROOT / "tests" / "mission"
    folders = (ROOT / "scenarios" / "reset", tests / "wild", tests / "made_up")
    texts = [
        without_comments(file.read_text(encoding="utf-8"))
        for folder in folders
        for file in sorted(folder.glob("*.json"))
    ]
    templates: Callable[[str], Mission] = cache(templates_beside(ROOT / "nowhere"))
    ends: collections.Counter[str] = collections.Counter()
    for number in range(1, count + 1):
        text = mutated(texts, chance)
        end, wrong = ended(text, templates)
        ends[end] += 1
        if wrong:
            ends["wrong"] += 1
            print(f"\ndocument {number}: {wrong}, on {text}", flush=True)
        if number % 1000 == 0:
            tell(number, ends)
    return ends


def main() -> int:
    """Read the requested number of documents."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()

    def tell(number: int, ends: Mapping[str, int]) -> None:
        print(f"\r{number} documents: {dict(ends)}", end="", file=sys.stderr, flush=True)

    ends = read_mutated(args.count, args.seed, tell)
    print(f"\n{args.count} documents: {dict(ends)}")
    return 1 if ends.get("wrong") else 0


if __name__ == "__main__":
    sys.exit(main())
