"""The file of episodes with planted faults: what is played, which fault is in it, and what was seen when it was made.

One JSON object a line; the first says the format. `planting` makes the file, `attribution` measures methods on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.errors import UsageError
from lingjing.play.options import PlayOptions
from lingjing.trace.records import DigestVersion

FORMAT = "lingjing-planted/1"

FACULTIES = ("perception", "localisation", "waypoint", "routing", "handoff", "execution")
"""What of an agent can fail, in the order from what it sees to what it does."""

PlantedKind = Literal["one", "two", "harmless", "none"]
"""One fault that loses the episode; two of which each alone loses it; a fault with which it is won all the same; none.
The last three are decoys."""


class FaultLabel(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A planted fault as the options of `faulty-oracle` have it: `boundary` is the first at which it acts, `boundaries`
    at how many it does (0: to the end), `way` how the faculty fails, and by how many metres where it is `displaced`."""

    agent: str
    faculty: str
    boundary: int
    boundaries: int = 0
    way: str = ""
    east_m: float = 0.0
    north_m: float = 0.0


class PlantedEpisode(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An episode with its faults. `base` is the policy that they are planted in, `without` the digest of the won
    episode without them, `digest`, `reason` and `ticks` are those with them. `settings` are values of the mission's
    parameters (SI) in place of its own. `digest_version` is that of both digests."""

    kind: PlantedKind
    mission: str
    mode: str
    seed: int
    base: str
    faults: tuple[FaultLabel, ...]
    without: str
    digest: str
    reason: str
    ticks: int
    settings: tuple[tuple[str, float], ...] = ()
    digest_version: DigestVersion = 1

    @property
    def name(self) -> str:
        """`ssr-star-3 oracle: skipper execution at 12`, `idf-broadcast-dogs=1-2 oracle: no fault`."""
        faults = " + ".join(f"{one.agent} {one.faculty} at {one.boundary}" for one in self.faults) or "no fault"
        column = "-".join([self.mission, self.mode, *(f"{key}={value:g}" for key, value in self.settings)])
        return f"{column}-{self.seed} {self.base}: {faults}"

    def options(self) -> PlayOptions:
        """How the episode is played."""
        return faulty_options(self.mission, self.mode, self.seed, self.base, self.faults, dict(self.settings))


class _Head(msgspec.Struct, frozen=True):
    format: str


def faulty_options(
    mission: str, mode: str, seed: int, base: str, faults: Sequence[FaultLabel], settings: Mapping[str, float]
) -> PlayOptions:
    """How an episode of the base policy with these faults is played."""
    return PlayOptions(
        mission=mission,
        mode=mode,
        settings=dict(settings),
        seed=seed,
        policy=f"faulty-{base}",
        policy_args={"faults": [msgspec.to_builtins(one) for one in faults]},
        overview=False,
    )


def read_planted(path: Path) -> tuple[PlantedEpisode, ...]:
    """The episodes of a file. Raises `UsageError` for one that cannot be read or is of another format."""
    try:
        head, *lines = path.read_bytes().splitlines()
        found = msgspec.json.decode(head, type=_Head)
        if found.format != FORMAT:
            raise UsageError(f"`{path}` is of the format {found.format}", hint=f"this version reads {FORMAT}")
        return tuple(msgspec.json.decode(line, type=PlantedEpisode) for line in lines)
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from error
    except (ValueError, msgspec.DecodeError) as error:
        raise UsageError(f"`{path}` is no file of planted faults: {error}") from error


def encode_planted(episodes: Iterable[PlantedEpisode]) -> bytes:
    """The file of these episodes, in one order whatever the order given."""
    ordered = sorted(episodes, key=lambda one: (one.mission, one.mode, one.base, one.seed, one.kind, one.name))
    return b"\n".join([msgspec.json.encode(_Head(FORMAT)), *map(msgspec.json.encode, ordered)]) + b"\n"
