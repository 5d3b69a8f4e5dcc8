"""The commands that are played with planted faults, and what may be planted in each."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
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

SHARES = {"trip": 70, "chat": 14, "process": 8, "suite": 5, "look": 3}
"""Of a hundred cases: one episode in one process, with a chat model, with a world process, a suite, with pictures."""


def arguments(case: Injection, port: int, token: str) -> list[str]:
    """The command line of a case."""
    policy, run = f"{HERE / 'trip.py'}:Sail", ["--no-overview", "--json", "-o", "out"]
    if case.target == "suite":
        return ["bench", str(HERE / "trip.toml"), "-o", "out"]
    if case.target == "chat":
        number, way = (case.number, case.error) if case.kind == "service" else (0, "good")
        url = f"http://127.0.0.1:{port}/{token}/{number}/{way}/v1"
        model = ["model=m", f"base_url={url}", "tries=2", "deadline=60"]
        given = [part for word in model for part in ("--policy-arg", word)]
        return ["run", str(HERE / "trip.ljs"), "--world", "inline", "--policy", "react", *given, *run]
    name, world = ("look", "process") if case.target == "look" else ("trip", "process")
    world = "inline" if case.target == "trip" else world
    return ["run", str(HERE / f"{name}.ljs"), "--world", world, "--policy", policy, *run]


def sample(counts: Mapping[str, Mapping[str, int]], number: int, seed: int) -> Iterator[Injection]:
    """`number` different cases: of each target its share, of its kinds each in turn, of a kind any call."""
    draw = random.Random(seed)
    for target, share in SHARES.items():
        kinds = [kind for kind, count in counts[target].items() if count and kind in ERRORS]
        seen: set[Injection] = set()
        for at in range(max(1, round(number * share / 100))):
            for _ in range(50):
                kind = kinds[at % len(kinds)]
                lasting = kind not in ("wall", "steady", "service") and draw.random() < 0.3
                call = draw.randint(1, counts[target][kind])
                case = Injection(target, kind, call, draw.choice(ERRORS[kind]), lasting)
                if case not in seen:
                    seen.add(case)
                    yield case
                    break
                at += 1
