"""`deep_check`: whether the instances of a mission have their places in the built city, for several seeds and modes.

The check of a text has no city. This check draws each instance, builds its city and places its entities, as an episode
does before its engines start. It needs the scene's plug-in and its maps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import msgspec

from lingjing.errors import LingjingError, MissionError
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.world.selection import select_engines
from lingjing.mission.draws import redrawn_in_words
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.siting import sited_mission
from lingjing.plugins.host import PluginHost
from lingjing.scene.displacement import in_words, moved_bodies

_LISTED = 5
"""Most single seeds that a text lists (chosen)."""


class DeepFinding(msgspec.Struct, frozen=True):
    """One finding that some instances share."""

    mode: str
    """The communication mode; "" if it holds in every mode that was checked."""
    seeds: tuple[int, ...]
    """The seeds of the instances, ascending."""
    message: str
    hint: str = ""
    refused: bool = True
    """True if such an episode cannot begin; False for a note on moved bodies or on a group that was drawn anew."""

    def where(self) -> str:
        """The instances in words: `star, seeds 0-4`."""
        first, last = self.seeds[0], self.seeds[-1]
        if len(self.seeds) == 1:
            seeds = f"seed {first}"
        elif last - first + 1 == len(self.seeds):
            seeds = f"seeds {first}-{last}"
        else:
            more = f" and {len(self.seeds) - _LISTED} more" if len(self.seeds) > _LISTED else ""
            seeds = "seeds " + ", ".join(map(str, self.seeds[:_LISTED])) + more
        return f"{self.mode}, {seeds}" if self.mode else seeds


def deep_check(
    mission: Mission, seeds: Sequence[int], progress: Callable[[int, int], None] | None = None
) -> tuple[DeepFinding, ...]:
    """All findings, in the order in which they first occur; equal ones of several instances are one finding.

    `progress` is called with the number of checked instances and of all. Errors of a scene or an engine that is not
    installed are findings too.
    """
    host = PluginHost()
    cities = CityBuilder(host)
    mission = sited_mission(mission, "", host)
    modes = mission.modes.allowed
    seeds_of: dict[tuple[str, str, bool], dict[str, list[int]]] = {}
    for number, (mode, seed) in enumerate((mode, seed) for mode in modes for seed in seeds):
        for key in _instance(mission, mode, seed, cities, host):
            seeds_of.setdefault(key, {}).setdefault(mode, []).append(seed)
        if progress is not None:
            progress(number + 1, len(modes) * len(seeds))
    return tuple(finding for key, by_mode in seeds_of.items() for finding in _findings(key, by_mode, modes))


def _instance(
    mission: Mission, mode: str, seed: int, cities: CityBuilder, host: PluginHost
) -> Iterator[tuple[str, str, bool]]:
    """The (message, hint, refused) of everything that is wrong with one instance."""
    try:
        instance = instantiate(mission, seed=seed, mode=mode)
        select_engines(instance, host)
        placed, _ = cities.place(instance, imported=bool(mission.origin.places))
    except LingjingError as error:
        faults = error.faults if isinstance(error, MissionError) else ()
        yield from ((fault.message, fault.hint, True) for fault in faults)
        if not faults:
            yield str(error), error.hint, True
        return
    for words in (*in_words(moved_bodies(instance, placed)), *redrawn_in_words(instance.redrawn)):
        yield words, "", False


def _findings(key: tuple[str, str, bool], by_mode: dict[str, list[int]], modes: Sequence[str]) -> Iterator[DeepFinding]:
    message, hint, refused = key
    seeds = [tuple(numbers) for numbers in by_mode.values()]
    if len(by_mode) == len(modes) and len(set(seeds)) == 1:
        yield DeepFinding("", seeds[0], message, hint, refused)
        return
    for mode, numbers in by_mode.items():
        yield DeepFinding(mode, tuple(numbers), message, hint, refused)


__all__ = ["DeepFinding", "deep_check"]
