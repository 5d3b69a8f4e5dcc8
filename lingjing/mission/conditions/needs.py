"""The tree of `Need`s of a condition: events that must have happened for it to be true. `condition_needs` builds it."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from lingjing.mission.conditions.outline import Body
from lingjing.mission.conditions.spread import PossiblePlaces


class VisitNeed(msgspec.Struct, frozen=True):
    """One of `movers` must come within `radius_m` of the goal, in the plane."""

    movers: tuple[Body, ...]
    goal: Body | PossiblePlaces
    radius_m: float
    at: str
    """Path of the declaration that has the need. The other needs have the same field."""


class ReportNeed(msgspec.Struct, frozen=True):
    """A message of a kind must be sent."""

    kind: str
    at: str
    about: str = ""
    """Id of the entity that a `matching` report is about; "" if unknown."""
    matching: bool = False
    """True if each report counts for exactly one entity."""


class PictureNeed(msgspec.Struct, frozen=True):
    """A picture in which the entity covers pixels must be taken."""

    target: Body
    at: str


class Handover(msgspec.Struct, frozen=True):
    """The asset must be assigned to the target, by a command or by a message."""

    asset: Body
    target: Body
    at: str


class Supply(msgspec.Struct, frozen=True):
    """Goods that the target lacks must be brought."""

    target: Body
    name: str
    """Name of the target's property that measures the lack."""
    amount: float
    """Least amount to bring, in the property's unit."""
    at: str
    most: float = 0.0
    """Amount of the lack that may remain."""


class Performed(msgspec.Struct, frozen=True):
    """An interaction must be performed."""

    interaction: str
    target: Body | None
    """Its target; None if unknown."""
    at: str


class Impossible(msgspec.Struct, frozen=True):
    """A need that cannot be met."""

    message: str
    at: str


class AtLeast(msgspec.Struct, frozen=True):
    """A requirement that at least `least` of its parts are met; 0 for no requirement."""

    least: int
    parts: tuple[Need, ...]


NeedLeaf = VisitNeed | ReportNeed | PictureNeed | Handover | Supply | Performed | Impossible
Need = NeedLeaf | AtLeast

NOTHING = AtLeast(0, ())
"""The empty requirement: also the value for a condition that this package does not model."""


def mandatory(need: Need) -> list[NeedLeaf]:
    """The leaves that every way to meet the need includes."""
    if not isinstance(need, AtLeast):
        return [need]
    if need.least < len(need.parts):
        return []
    return [leaf for part in need.parts for leaf in mandatory(part)]


def leaves(need: Need) -> Iterator[NeedLeaf]:
    """All leaves, needed or not."""
    if isinstance(need, AtLeast):
        for part in need.parts:
            yield from leaves(part)
    else:
        yield need
