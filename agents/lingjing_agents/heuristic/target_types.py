"""Types of targets by the classes of reports, with the detector and the search rules of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from lingjing.plugins.policy import Brief, CameraPose, Picture
from lingjing_agents.capability import sends
from lingjing_agents.heuristic.sightings import Sightings
from lingjing_agents.perception.bridge_gaps import find_gaps
from lingjing_agents.perception.fires_from_above import find_fires_from_above
from lingjing_agents.perception.images import ByteImage
from lingjing_agents.perception.people_at_sea import FoundBox, find_people

ColourRule = Callable[[ByteImage, CameraPose, float], tuple[FoundBox, ...]]
"""A function of the pixels of a picture (height, width, 3), its pose and the elevation of the ground or water that
returns detections, highest confidence first.
"""

Detector = Callable[[Picture, float], tuple[FoundBox, ...]]
"""A function of a picture and the elevation of the ground or water that returns detections, highest confidence
first."""

Detectors = Mapping[str, Detector]
"""Detectors that replace the colour rules, by class."""


@dataclass(frozen=True, slots=True)
class TargetType:
    """A type of target with its search rules."""

    words: tuple[str, ...]
    """Words of which the class's name contains one."""
    find: ColourRule
    """The function that detects targets of this type by their colour."""
    done: str = ""
    """Beginning of the name of the event that reports a target as served."""
    task: str = ""
    """Task name in assignments."""
    counts: tuple[str, ...] = ()
    """Names of settings that may hold the number of targets."""
    merge_m: float = 35.0
    """Distance in metres within which detections are one target."""
    aside: float = 1.0
    """Largest distance from the picture's centre, as a share of its size, for a reliable position: high objects appear
    farther out than they are.
    """
    confirm: float = 0.5
    """Height of a second picture as a share of the search height."""
    settle_m: float = 50.0
    """Distance in metres from which a target is served."""
    raised_m: float = 0.0
    """Usual height of a target above the ground in metres. Above 0 it lies among buildings, where aircraft climb
    first.
    """
    aloft: float = 1.0
    """Search height as a multiple of the mission's altitude: from higher up, walls hide less."""
    overlap: float = 0.03
    """Overlap of pictures, 0 to 1."""
    lowest: float = 0.0
    """Least search height of later passes as a share of the first."""
    drifts: bool = False
    """True if targets drift with the water."""

    def detector(self, name: str, detectors: Detectors) -> Detector:
        """Return the detector of the class `name`: the given one, or the colour rule of this type."""
        return detectors.get(name, on_pixels(self.find))

    def sightings(self, brief: Brief) -> Sightings:
        """Return an empty store of sightings of this type."""
        return Sightings(brief.weather, merge_m=self.merge_m, drifts=self.drifts)


def on_pixels(rule: ColourRule) -> Detector:
    """Return the detector that applies a rule to the pixels of a picture."""
    return lambda picture, level_m: rule(picture.rgb, picture.pose, level_m)


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
"""Words of which the class of a queue contains one; queues are detected along a route (`perception.road_queues`)."""

TARGET_TYPES = (PEOPLE, FIRES, GAPS)
"""The target types in order of precedence: the first with a class in the brief is searched for."""


ANY_VEHICLE = "any vehicle"
"""The key of a detector of vehicles of every class, except parked ones. No class has a space in its name."""

VEHICLES = frozenset(("truck", "van", "car", "bus", "boat", "engine"))
"""Words that mark a class as a vehicle."""


def lack_of_detectors(brief: Brief, detectors: Detectors) -> str:
    """Return a note for an agent that may send reports while no detector knows any of their classes; "" for others."""
    words = (*(word for kind in TARGET_TYPES for word in kind.words), *QUEUES, *_OTHERS)
    known = any(any(word in name for word in words) or name in detectors for name in brief.classes)
    if known or not any(sends(brief, record) for record in ("report", "count")):
        return ""
    return f"no detector of this policy knows one of the classes {', '.join(brief.classes) or '(none)'}: no reports"


_OTHERS = ("queue", "leak")
"""Words of the classes that other rules detect: lines of people and leaks."""


BUILDINGS = ("reference", "door")
"""Words of which the class of the building in a reference picture contains one."""


def building_class(brief: Brief) -> str | None:
    """Return the class of the building that a walker looks for: the one that a rule names in a report, else the first
    with a word of `BUILDINGS`; None without one. Rivals that look alike have classes of their own.
    """
    named = [name for name in brief.classes if any(f"class` is `{name}`" in rule for rule in brief.rules)]
    alike = [name for name in brief.classes if any(word in name for word in BUILDINGS)]
    return next((name for name in alike if name in named), next(iter(alike), None))


def target_type_of(brief: Brief, among: tuple[TargetType, ...] = TARGET_TYPES) -> tuple[TargetType, str] | None:
    """Return the target type and class of the mission's reports; None if no detector knows a class.

    Classes of vehicles are left out: a fire truck is no fire.
    """
    for kind in among:
        for name in brief.classes:
            if any(word in name for word in kind.words) and not VEHICLES.intersection(name.split("_")):
                return kind, name
    return None
