"""The commands that are played with planted faults, and what may be planted in each."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from itertools import zip_longest
from pathlib import Path

from tests.faults.cases import Injection
from tests.faults.service import WAYS

HERE = Path(__file__).resolve().parent

ERRORS = {
    "open": ("ENOSPC", "EACCES", "EMFILE", "EIO", "EROFS", "ENOMEM"),
    "read": ("EIO", "ESTALE"),
    "write": ("ENOSPC", "EIO", "EDQUOT", "EFBIG"),
    "name": ("ENOSPC", "EACCES", "EROFS", "EIO"),
    "look": ("EACCES", "EIO", "ESTALE"),
    "memory": ("ENOMEM", "EMFILE", "ENFILE"),
    "start": ("EAGAIN", "ENOMEM", "EMFILE"),
    "wall": ("leap",),
    "steady": ("leap",),
    "record": ("EIO",),
    "service": WAYS,
}
"""The ways in which a call of each kind may fail."""

ONCE = ("wall", "steady", "service")
"""Kinds that fail once: a clock that has leapt stays so, and the service counts its answers itself."""

SHARES = {"trip": 62, "chat": 13, "process": 17, "suite": 6, "look": 2}
"""Of a hundred cases: one episode in one process, with a chat model, with a world process, a suite, with pictures."""

Counts = Mapping[tuple[str, str], int]
"""Calls of one target by kind and place."""


def arguments(case: Injection, port: int, token: str) -> list[str]:
    """The command line of a case."""
    policy, run = f"{HERE / 'trip.py'}:Sail", ["--no-overview", "--json", "-o", "out"]
    if case.target == "suite":
        # Without walls: here every fork server is a fork of the player, and walls need a clean one.
        return ["bench", str(HERE / "trip.toml"), "-o", "out", "--no-isolate"]
    if case.target == "chat":
        number, way = (case.number, case.error) if case.kind == "service" else (0, "good")
        url = f"http://127.0.0.1:{port}/{token}/{number}/{way}/v1"
        model = ["model=m", f"base_url={url}", "tries=2", "deadline=60"]
        options = [part for word in model for part in ("--policy-arg", word)]
        return ["run", str(HERE / "trip.ljs"), "--world", "inline", "--policy", "react", *options, *run]
    name, world = ("look", "process") if case.target == "look" else ("trip", "process")
    world = "inline" if case.target == "trip" else world
    return ["run", str(HERE / f"{name}.ljs"), "--world", world, "--policy", policy, *run]


def shares(number: int, targets: Iterable[str]) -> dict[str, int]:
    """Return the number of cases, of `number`, for each target."""
    chosen = [name for name in SHARES if name in set(targets)]
    whole = sum(SHARES[name] for name in chosen)
    parts = {name: max(1, number * SHARES[name] // whole) for name in chosen}
    parts[chosen[0]] += number - sum(parts.values())
    return parts


def sample(target: str, counts: Counts, number: int, seed: int) -> list[Injection]:
    """At most `number` different cases of a target: its kinds in turn, of a kind its places in turn.

    The order is that of a hash of each case. So a change of the product that adds a call or takes one away leaves the
    other cases of a sample as they are.
    """
    turns: list[tuple[int, str, Injection]] = []
    for kind in ERRORS:
        queues = [_ordered(target, key, counts[key], seed) for key in counts if key[0] == kind]
        queues.sort(key=lambda queue: _rank(queue[0], seed))
        of_kind = [case for turn in zip_longest(*queues) for case in turn if case is not None]
        turns += [(turn, kind, case) for turn, case in enumerate(of_kind)]
    turns.sort(key=lambda turn: turn[:2])
    return [case for _, _, case in turns[:number]]


def _ordered(target: str, key: tuple[str, str], count: int, seed: int) -> list[Injection]:
    """The cases of a place: its first calls, its last ones, some between them; each error, once or from then on."""
    kind, place = key
    numbers = {*range(1, min(count, 4) + 1), *range(max(1, count - 1), count + 1), *range(8, count, max(1, count // 8))}
    ways = (False,) if kind in ONCE else (False, True)
    cases = [Injection(target, kind, place, number, error, lasting)
             for number in numbers for error in ERRORS[kind] for lasting in ways]  # fmt: skip
    return sorted(cases, key=lambda case: _rank(case, seed))


def _rank(case: Injection, seed: int) -> bytes:
    return hashlib.sha256(f"{seed} {case.line}".encode()).digest()
