"""Rows of a suite's results, and the rules for rows in one table."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Literal

import msgspec

import lingjing
from lingjing.data import data_path
from lingjing.errors import UsageError
from lingjing.mission.languages import ORIGINAL
from lingjing.play.options import PlayOptions, without_places
from lingjing.play.report import EpisodeReport

RowStanding = Literal["counted", "aborted", "lost"]
"""`counted`: a valid result. `aborted`: played again with the same seed. `lost`: aborted in the last try."""

RowKey = tuple[str, str, str, str, int, int]
"""Entrant, mission, mode, condition, seed and try."""


class SuiteRow(msgspec.Struct, frozen=True, kw_only=True):
    """One played episode of a suite."""

    suite: str
    entrant: str
    group: str = ""
    """The entrant's heading in tables; may be empty."""
    mission: str
    mode: str
    condition: str = ""
    """The condition's name; empty without conditions."""
    baseline: bool = False
    """True if other conditions of the mission are compared with this one."""
    entrant_place: int = 0
    """The entrant's position in the suite file, from 0."""
    condition_place: int = 0
    """The condition's position in the suite file, from 0."""
    seed: int
    tries: int = 1
    """The number of the try with this seed, from 1."""
    standing: RowStanding = "counted"
    policy: str
    """The policy's name."""
    model: str = ""
    """The model's name; empty for other policies."""
    served: str = ""
    """The models that the service named in its answers, with commas; empty if it named none."""
    privileged: bool = False
    """True if one of the entrant's policies observes the ground truth."""
    foreign: bool | None = None
    """True if one of the entrant's policies is not this project's; None in rows from before the field."""
    policy_seed: int = 0
    """The seed of the policies' own random streams."""
    salt_sha256: str = ""
    """The fingerprint of the salt: rows with equal fingerprints drew their policy seeds alike."""
    split_sha256: str = ""
    """The SHA-256 of the salt that drew the instances of a sealed split; "" for instances of public seeds."""
    seal: str = ""
    """The last seal of the trace, a hash over every byte of it; "" for an episode without a whole trace."""
    benchmark: str = ""
    """The version of the benchmark (`version.benchmark_version`); rows of two versions never stand in one table."""
    mission_sha256: str = ""
    """The version of the mission (`version.mission_version`); nor do rows of two versions of one mission."""
    code: str = ""
    """SHA-256 over all code and missions that decide an episode."""
    harness: str = ""
    """SHA-256 over all code that decides an episode, without the missions."""
    version: str = lingjing.__version__
    """The version of lingjing."""
    wall_s: float = 0.0
    """Duration, seconds of wall-clock time."""
    ended_unix_s: float = 0.0
    """End of the episode, UNIX time; 0 if unknown. Simultaneous aborts of several entrants show an outage."""
    attention_iou: float | None = None
    """IoU of the attention maps beside the trace when the row was read (`lingjing.analysis.attention`); None without
    maps.
    """
    options: PlayOptions
    """The options of the episode, without places of files."""
    report: EpisodeReport

    @property
    def key(self) -> RowKey:
        """The unique key of a row in a file."""
        return self.entrant, self.mission, self.mode, self.condition, self.seed, self.tries

    @property
    def cell(self) -> tuple[str, str, str, str]:
        """Entrant, mission, mode and condition."""
        return self.entrant, self.mission, self.mode, self.condition

    @property
    def column(self) -> str:
        """The column, such as `ssr-star`, `ssr-star, tier 1` above tier 0, or `ssr-star, zh` in another language."""
        return column_label(self.mission, self.mode, self.tier, self.language)

    @property
    def tier(self) -> int:
        """The tier of the mission."""
        return self.options.tier

    @property
    def language(self) -> str:
        """The language of the mission's texts and of the requests."""
        return self.options.language


def column_label(mission: str, mode: str, tier: int, language: str = ORIGINAL) -> str:
    """The heading of a column: `ssr-star`, `ssr-star, tier 1` above tier 0, or `ssr-star, zh` in another language."""
    return f"{mission}-{mode}{f', tier {tier}' if tier else ''}{f', {language}' if language != ORIGINAL else ''}"


NEVER_BY_NUMBER = "tier 0 is comparable with the paper by protocol and never by number"
"""The sentence beside every result of tier 0."""


def tiers_in_words(missions: Iterable[tuple[int, str]]) -> str:
    """The missions of each tier: `tier 0: queue; tier 1: bi, ssr`. `missions`: pairs of a tier and a mission's name."""
    tiers: dict[int, dict[str, None]] = {}
    for tier, mission in missions:
        tiers.setdefault(tier, {})[mission] = None
    return "; ".join(f"tier {tier}: {', '.join(tiers[tier])}" for tier in sorted(tiers))


def check_tiers(rows: Iterable[SuiteRow]) -> None:
    """Raise `UsageError` if rows of one mission have different tiers or languages, because no table compares these."""
    tiers: dict[str, set[int]] = {}
    languages: dict[str, set[str]] = {}
    for row in rows:
        tiers.setdefault(row.mission, set()).add(row.tier)
        languages.setdefault(row.mission, set()).add(row.language)
    for mission, spoken in languages.items():
        if len(spoken) > 1:
            listed = " and ".join(sorted(spoken))
            raise UsageError(
                f"the rows of `{mission}` have the languages {listed}, which no table compares",
                hint="name results of one language",
            )
    for mission, several in tiers.items():
        if len(several) > 1:
            listed = " and ".join(map(str, sorted(several)))
            raise UsageError(
                f"the rows of `{mission}` have the tiers {listed}, which no table compares",
                hint="name results of one tier",
            )


def comparable(options: PlayOptions) -> PlayOptions:
    """Return the options that must be equal in one table: without places, seeds, limits and call records."""
    return msgspec.structs.replace(
        without_places(options),
        mission="",
        seed=0,
        policy_seed=0,
        sign=None,
        calls="record",
        max_cost=None,
        max_tokens=None,
    )


def code_sha256(missions: Iterable[Path]) -> str:
    """Return the SHA-256 over everything that decides an episode: the missions, the language's library, and all files
    of the core and of the agents.
    """
    library = sorted((*data_path("std").glob("*.ljs"), *data_path("scenarios").glob("*.ljs")))  # missions extend others
    named = sorted((path.name, path.read_bytes()) for path in missions)  # not by folder: it differs between machines
    digest = hashlib.sha256(b"".join((*(content for _, content in named), *(path.read_bytes() for path in library))))
    digest.update(_hash_of_code(tuple(_code_files())))
    return digest.hexdigest()


_CodeFile = tuple[str, str, int, int]
"""The place of a file in its package, its path, its size in bytes and the time of its last change in nanoseconds."""


def _code_files() -> Iterator[_CodeFile]:
    """Yield the files of the core and of the agents, those of each folder in order."""
    from importlib.util import find_spec

    agents = find_spec("lingjing_agents")
    for root in (lingjing.__path__[0], *((agents.submodule_search_locations or []) if agents else [])):
        yield from _files_below(root, "")


def _files_below(folder: str, place: str) -> Iterator[_CodeFile]:
    try:
        with os.scandir(folder) as entries:
            ordered = sorted(entries, key=lambda entry: entry.name)
    except OSError:  # a package in an archive, or a folder that may not be read, has no files that can be hashed
        return
    for entry in ordered:
        inside = f"{place}{entry.name}"
        if entry.is_dir(follow_symlinks=False):
            if entry.name not in ("__pycache__", "_data"):
                yield from _files_below(entry.path, f"{inside}/")
        elif entry.is_file():
            status = entry.stat()
            yield inside, entry.path, status.st_size, status.st_mtime_ns


@lru_cache(maxsize=1)
def _hash_of_code(files: tuple[_CodeFile, ...]) -> bytes:
    """Return the SHA-256 over files. It is kept, because a command asks for it up to ten times and reads 1,300 files
    for it; a file that was changed since has another size or time.
    """
    digest = hashlib.sha256()
    for place, path, _, _ in files:
        content = Path(path).read_bytes()
        digest.update(f"{place} {len(content)}\n".encode() + content)
    return digest.digest()


__all__ = ["RowKey", "RowStanding", "SuiteRow", "code_sha256", "comparable"]
