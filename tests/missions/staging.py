"""The twelve columns of the paper on their real instances, with stand-ins for all that moves and for the camera.

Rules, unlocks, the city engine and its targets are the real ones. Targets are put on multiples of 1/64 m, so that sums
of coordinates are exact.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

import lingjing
from lingjing import Mission
from lingjing.mission.instance import Entity, Instance, Weather
from lingjing.scene.city import City
from lingjing.testing import CENTRE_BOX, Episode, Stage, episode, mission_file, placed

COLUMNS = (
    ("vdn", "single"),
    ("bi", "single"),
    ("ld", "star"),
    ("idf", "broadcast"),
    ("upr", "star"),
    ("ufr", "star"),
    ("ufr", "broadcast"),
    ("cr", "star"),
    ("ssr", "star"),
    ("ssr", "broadcast"),
    ("cd", "star"),
    ("cd", "broadcast"),
)
"""The twelve task-mode columns of the paper's main table."""

FAR = 0.01
"""Just inside and just outside, metres."""


def shifted(share: float) -> tuple[float, float, float, float]:
    """`CENTRE_BOX` moved to the right so that the intersection over union is `share`."""
    left, top, right, bottom = CENTRE_BOX
    move = (right - left) * (1 - share) / (1 + share)
    return (left + move, top, right + move, bottom)


@functools.cache
def mission(name: str) -> Mission:
    return lingjing.compile(mission_file(name))


@functools.cache
def staged(
    name: str, mode: str | None = None, seed: int = 0, settings: tuple[tuple[str, float], ...] = ()
) -> tuple[Instance, City]:
    """The anchored instance and its city, as an episode gets them."""
    return placed(mission(name), seed=seed, mode=mode, settings=dict(settings))


def still(instance: Instance) -> Instance:
    """The instance in calm air and water, nothing adrift, its targets on 64ths of a metre."""

    def calm(entity: Entity) -> Entity:
        if entity.role != "target":
            return entity
        x, y, z = entity.position
        drift = {"drift_mps": 0.0} if "drift_mps" in entity.properties else {}
        place = (round(x * 64) / 64, round(y * 64) / 64, z)
        return msgspec.structs.replace(entity, position=place, properties={**entity.properties, **drift})

    weather = Weather(visibility_m=10_000.0)
    return msgspec.structs.replace(instance, weather=weather, entities=tuple(map(calm, instance.entities)))


@contextmanager
def playing(
    name: str,
    mode: str | None = None,
    *,
    seed: int = 0,
    real: tuple[str, ...] = ("city",),
    instance: Instance | None = None,
    stage: Stage | None = None,
    privileged: frozenset[str] = frozenset(),
    **settings: float,
) -> Iterator[Episode]:
    """An episode of a shipped mission at boundary 0, with stand-ins for every engine that is not in `real`."""
    made, city = staged(name, mode, seed, tuple(sorted(settings.items())))
    with episode((instance or still(made), city), stage=stage or Stage(), real=real, privileged=privileged) as play:
        yield play
