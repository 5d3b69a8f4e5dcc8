"""The file of episodes with planted faults: options, faults and results of each episode.

One JSON object per line; the first line holds the format. `planting` makes the file, `attribution` tests methods on
it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import UsageError
from lingjing.play.options import PlayOptions
from lingjing.trace.records import DigestVersion

FORMAT = "lingjing-planted/1"
"""The format's name and version."""

FACULTIES = ("perception", "localisation", "waypoint", "routing", "handoff", "execution")
"""The faculties of an agent, in the order from perception to action."""

PlantedKind = Literal["one", "two", "harmless", "none"]
"""`one`: one fault that loses the episode. `two`: two faults, each of which loses it alone. `harmless`: a fault of a
won episode. `none`: no fault. The last three are decoys.
"""


class FaultLabel(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A planted fault, as in the options of `faulty-oracle`."""

    agent: str
    faculty: str
    boundary: int
    """The first boundary at which the fault acts."""
    boundaries: int = 0
    """The number of boundaries at which it acts; 0: until the end."""
    way: str = ""
    """The kind of failure of the faculty; empty: its only kind."""
    east_m: float = 0.0
    """Displacement to the east in metres, if the way is `displaced`."""
    north_m: float = 0.0
    """Displacement to the north in metres, if the way is `displaced`."""


class PlantedEpisode(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An episode with its planted faults and its result."""

    kind: PlantedKind
    mission: str
    mode: str
    seed: int
    base: str
    """The policy that the faults are planted in."""
    faults: tuple[FaultLabel, ...]
    without: str
    """The digest of the won episode without the faults."""
    digest: str
    """The digest of the episode with the faults."""
    reason: str
    """The reason of the outcome with the faults."""
    ticks: int
    """The duration with the faults, ticks."""
    settings: tuple[tuple[str, float], ...] = ()
    """Parameter values (SI units) in place of the mission's."""
    digest_version: DigestVersion = 1
    """The version of both digests."""

    @property
    def name(self) -> str:
        """The name in messages: `ssr-star-3 oracle: skipper execution at 12`, `idf-broadcast-dogs=1-2 oracle: no
        fault`.
        """
        faults = " + ".join(f"{fault.agent} {fault.faculty} at {fault.boundary}" for fault in self.faults) or "no fault"
        column = "-".join([self.mission, self.mode, *(f"{key}={value:g}" for key, value in self.settings)])
        return f"{column}-{self.seed} {self.base}: {faults}"

    def options(self) -> PlayOptions:
        """Return the options that play the episode."""
        return faulty_options(self.mission, self.mode, self.seed, self.base, self.faults, dict(self.settings))


class _Head(msgspec.Struct, frozen=True):
    """The first line of the file."""

    format: str


def faulty_options(
    mission: str, mode: str, seed: int, base: str, faults: Sequence[FaultLabel], settings: Mapping[str, float]
) -> PlayOptions:
    """Return the options that play an episode of the base policy with these faults."""
    return PlayOptions(
        mission=mission,
        mode=mode,
        settings=dict(settings),
        seed=seed,
        policy=f"faulty-{base}",
        policy_args={"faults": [msgspec.to_builtins(fault) for fault in faults]},
        overview=False,
    )


def read_planted(path: Path) -> tuple[PlantedEpisode, ...]:
    """Return the episodes of a file. Raises `UsageError` for an unreadable file or another format."""
    try:
        head, *lines = path.read_bytes().splitlines()
        first_line = from_json(head, _Head)
        if first_line.format != FORMAT:
            raise UsageError(f"`{path}` has the format {first_line.format}", hint=f"this version reads {FORMAT}")
        return tuple(from_json(line, PlantedEpisode) for line in lines)
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from error
    except (ValueError, msgspec.DecodeError) as error:
        raise UsageError(f"`{path}` is not a file of planted faults: {error}") from error


def encode_planted(episodes: Iterable[PlantedEpisode]) -> bytes:
    """Return the file of these episodes, sorted: equal sets give equal bytes."""
    ordered = sorted(
        episodes,
        key=lambda episode: (episode.mission, episode.mode, episode.base, episode.seed, episode.kind, episode.name),
    )
    return b"\n".join([msgspec.json.encode(_Head(FORMAT)), *map(msgspec.json.encode, ordered)]) + b"\n"
