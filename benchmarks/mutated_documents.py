"""Mutate `resetScenario` documents and read them: every one gives a mission or a message, never a traceback.

`python benchmarks/mutated_documents.py [--count 100000] [--seed 1]` takes the shipped documents, changes one to four
things in each (a value of another kind, a key renamed, removed, doubled or nulled, a list cut or repeated, a number
made huge), reads them and counts how they ended. It fails at the first that raises anything but a `LingjingError`, and
at the first that is read although an entity's coordinate is no finite number or its heading is beyond a turn. The
documents of other systems that the tests have (`tests/mission/wild`) are among those that are changed.
"""

from __future__ import annotations

import argparse
import collections
import copy
import json
import math
import random
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from lingjing.dsl.loading.load import templates_beside
from lingjing.errors import LingjingError
from lingjing.mission.jsontext import without_comments
from lingjing.mission.model import Mission
from lingjing.mission.reset.reading import instantiate_document
from lingjing.mission.reset.shapes import LISTS

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
COORDINATES = ("X", "Y", "Z", "lon", "lat", "alt")
HEADINGS = ("heading", "raw", "yaw")


def spots(value: Any) -> list[tuple[Any, Any]]:
    """(container, key) of everything in a document."""
    found, stack = [], [value]
    while stack:
        one = stack.pop()
        keys = list(one) if isinstance(one, dict) else range(len(one)) if isinstance(one, list) else ()
        for key in keys:
            found.append((one, key))
            stack.append(one[key])
    return found


def mutate(whole: Any, chance: random.Random) -> Any:
    """The document with something changed in it."""
    holder, key = chance.choice(spots(whole))
    change = chance.randrange(7)
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
    else:
        holder[f"{key}2"] = holder[key]
    return whole


def silent(text: str) -> bool:
    """Whether a coordinate of an entity is no finite number, or a heading beyond a turn."""
    scenario = json.loads(text).get("scenario")
    lists = scenario.get("equipmentList", {}) if isinstance(scenario, dict) else {}
    known = [lists[one.name] for one in LISTS if isinstance(lists.get(one.name), list)]
    rows = [row for rows in known for row in rows if isinstance(row, dict)]
    places = [row["data"] for row in rows if isinstance(row.get("data"), dict)]
    headings = [row.get(name) for row in rows for name in HEADINGS]
    turns = [one for one in headings if isinstance(one, int | float) and not abs(one) <= 360.0]
    given = [place.get(name) for place in places for name in COORDINATES]
    return bool(turns) or any(
        isinstance(one, str | list | dict | bool) or (isinstance(one, float) and not math.isfinite(one))
        for one in given
    )


def read_mutated(count: int, seed: int, tell: Callable[[int, Mapping[str, int]], object]) -> Mapping[str, int]:
    """How so many documents ended, by kind of error; `AssertionError` for one that ended as none may."""
    chance = random.Random(seed)
    folders = (ROOT / "scenarios" / "reset", ROOT / "tests" / "mission" / "wild")
    texts = [
        without_comments(file.read_text(encoding="utf-8"))
        for folder in folders
        for file in sorted(folder.glob("*.json"))
    ]
    templates: Callable[[str], Mission] = cache(templates_beside(ROOT / "nowhere"))
    ends: collections.Counter[str] = collections.Counter()
    for number in range(count):
        whole = json.loads(chance.choice(texts))
        if chance.random() < 0.5 and isinstance(whole.get("scenario"), dict):
            whole["scenario"].pop("lingjing", None)
        for _ in range(chance.randint(1, 4)):
            if isinstance(whole, dict) and spots(whole):
                whole = mutate(whole, chance)
        text = json.dumps(whole, ensure_ascii=False)
        try:
            instantiate_document(text, "m.json", templates)
            ends["read"] += 1
            assert not silent(text), f"read in spite of a coordinate that is no number: {text}"
        except LingjingError as error:
            ends[type(error).__name__] += 1
            assert str(error).startswith("m.json"), f"the message names no file: {error}"
        except Exception as error:
            raise AssertionError(f"{type(error).__name__}: {error}, on {text}") from error
        if number % 1000 == 999:
            tell(number + 1, ends)
    return ends


def main() -> int:
    """Read as many documents as asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()

    def tell(number: int, ends: Mapping[str, int]) -> None:
        print(f"\r{number} documents: {dict(ends)}", end="", file=sys.stderr, flush=True)

    ends = read_mutated(args.count, args.seed, tell)
    print(f"\n{args.count} documents: {dict(ends)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
