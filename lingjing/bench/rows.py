"""The rows of a suite's results, and what decides whether two of them may stand in one table."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import msgspec

import lingjing
from lingjing.data import data_path
from lingjing.play.options import PlayOptions
from lingjing.play.report import EpisodeReport

RowStanding = Literal["counted", "aborted", "lost"]
"""Whether an episode counts: `aborted` ones are played again with their seed, `lost` is the last of them."""

RowKey = tuple[str, str, str, str, int, int]
"""Entrant, mission, mode, condition, seed and try."""


class SuiteRow(msgspec.Struct, frozen=True, kw_only=True):
    """One played episode of a suite.

    `entrant`, `mission`, `mode`, `condition` and `seed` say which, `tries` is 1 for the first try with this seed.
    `entrant_place` and `condition_place` are where the suite lists them, from 0; the others of a mission are compared
    with the `baseline`. `privileged` is true if one of its policies sees the truth. `options` are those that it was
    played with, without the places of files. `salt_sha256` tells whose policy seeds are drawn alike without telling the
    salt. `code` is the SHA-256 over everything that decides an episode, `version` lingjing's. `wall_s` is how long it
    took, seconds; `ended_unix_s` is when it ended (UNIX time, 0 in rows that do not say): aborts of several entrants at
    once are told by it. `attention_iou` is that of the maps that lay beside the trace when the row was read from the
    suite's folder (`lingjing.analysis.attention`), None where there were none.
    """

    suite: str
    entrant: str
    group: str = ""
    mission: str
    mode: str
    condition: str = ""
    baseline: bool = False
    entrant_place: int = 0
    condition_place: int = 0
    seed: int
    tries: int = 1
    standing: RowStanding = "counted"
    policy: str
    model: str = ""
    privileged: bool = False
    policy_seed: int = 0
    salt_sha256: str = ""
    code: str = ""
    version: str = lingjing.__version__
    wall_s: float = 0.0
    ended_unix_s: float = 0.0
    attention_iou: float | None = None
    options: PlayOptions
    report: EpisodeReport

    @property
    def key(self) -> RowKey:
        """What no two rows of one file share."""
        return self.entrant, self.mission, self.mode, self.condition, self.seed, self.tries

    @property
    def cell(self) -> tuple[str, str, str, str]:
        """Entrant, mission, mode and condition."""
        return self.entrant, self.mission, self.mode, self.condition

    @property
    def column(self) -> str:
        """`ssr-star`."""
        return f"{self.mission}-{self.mode}"


def comparable(options: PlayOptions) -> PlayOptions:
    """The options without what differs from machine to machine or from seed to seed, limits and records of calls too;
    policies' files by their names."""
    return msgspec.structs.replace(
        options,
        mission="",
        seed=0,
        policy_seed=0,
        sign=None,
        calls="record",
        calls_from="",
        max_cost=None,
        max_tokens=None,
        ledger="",
        policy=_without_folder(options.policy),
        policies_for={role: _without_folder(policy) for role, policy in options.policies_for.items()},
    )


def _without_folder(policy: str) -> str:
    return policy.rpartition("/")[2] if policy.partition(":")[0].endswith(".py") else policy


def code_sha256(missions: Iterable[Path]) -> str:
    """SHA-256 over everything that decides an episode: the missions, the language's library, every file of the core and
    of the agents."""
    from importlib.util import find_spec

    agents = find_spec("lingjing_agents")
    roots = [Path(lingjing.__file__).parent, *map(Path, (agents.submodule_search_locations or []) if agents else [])]
    library = sorted((*data_path("std").glob("*.ljs"), *data_path("scenarios").glob("*.ljs")))  # some extend others
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in (*sorted(missions), *library)))
    for root in roots:
        for path in sorted(root.rglob("*")):
            place = path.relative_to(root)
            if path.is_file() and not {"__pycache__", "_data"} & set(place.parts):
                digest.update(f"{place}\n".encode() + path.read_bytes())
    return digest.hexdigest()


__all__ = ["RowKey", "RowStanding", "SuiteRow", "code_sha256", "comparable"]
