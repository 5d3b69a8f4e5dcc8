"""What is looked for, by the classes that a report may name: its detector and how its finds are to be treated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from lingjing.plugins.policy import Brief, CameraPose
from lingjing_agents.heuristic.sightings import Sightings
from lingjing_agents.perception.bridge_gaps import find_gaps
from lingjing_agents.perception.fires_from_above import find_fires_from_above
from lingjing_agents.perception.images import ByteImage
from lingjing_agents.perception.people_at_sea import FoundBox, find_people

Detector = Callable[[ByteImage, CameraPose, float], tuple[FoundBox, ...]]
"""Picture (height, width, 3), its pose and the elevation of the ground or water → finds, the surest first."""


TrainedDetectors = Mapping[str, Detector]
"""Detectors that take the place of the colour rules, by the class of what they find."""


@dataclass(frozen=True, slots=True)
class TargetType:
    """One sort of target: words of which a class's name has one, and rules of thumb.

    `done` begins the name of the event that settles one and `task` is what an assignment calls it; `counts` are names
    of settings that may say how many there are. Finds nearer than `merge_m` metres are one. `aside` is how far from
    the picture's middle, as a share of its size, one may lie for its place to be believed: what stands high seems
    farther out than it is. `confirm` is the height of a second look as a share of the search height, `settle_m` the
    distance (m) from which somebody settles one, `raised_m` how high over the ground one usually is: among buildings,
    where a vehicle climbs before it flies anywhere. Searches are flown at `aloft` times the mission's altitude, from
    where walls hide less, with `overlap` (0..1) between pictures and never below `lowest` of that height. What
    `drifts` goes with the water.
    """

    words: tuple[str, ...]
    find: Detector
    done: str = ""
    task: str = ""
    counts: tuple[str, ...] = ()
    merge_m: float = 35.0
    aside: float = 1.0
    confirm: float = 0.5
    settle_m: float = 50.0
    raised_m: float = 0.0
    aloft: float = 1.0
    overlap: float = 0.03
    lowest: float = 0.0
    drifts: bool = False

    def sightings(self, brief: Brief) -> Sightings:
        """An empty memory of such targets; what floats moves with the water's current."""
        return Sightings(brief.weather, merge_m=self.merge_m, drifts=self.drifts)


PEOPLE = TargetType(("person", "victim"), find_people, drifts=True, done="rescue", task="rescue", counts=("victims",))
FIRES = TargetType(
    ("fire",),
    find_fires_from_above,
    done="extinguish",
    task="extinguish",
    counts=("fires",),
    merge_m=60.0,
    aside=0.12,
    confirm=1.0,
    settle_m=30.0,
    raised_m=25.0,
    aloft=1.4,
    overlap=0.2,
    lowest=0.85,
)
GAPS = TargetType(("fracture", "gap", "collapse"), find_gaps, merge_m=60.0)
QUEUES = ("congestion", "jam")
"""Words of which a class of queues has one; those are looked for along a route, see `perception.road_queues`."""

TARGET_TYPES = (PEOPLE, FIRES, GAPS)
"""In this order the first that has a class in the brief is what a searcher looks for."""


VEHICLES = frozenset(("truck", "van", "car", "bus", "boat", "engine"))


def target_type_of(brief: Brief, among: tuple[TargetType, ...] = TARGET_TYPES) -> tuple[TargetType, str] | None:
    """What this mission's reports are about, and the class to report it as; None if no detector knows any class.

    A fire truck is no fire: names of vehicles are left out."""
    for kind in among:
        for name in brief.classes:
            if any(word in name for word in kind.words) and not VEHICLES.intersection(name.split("_")):
                return kind, name
    return None
