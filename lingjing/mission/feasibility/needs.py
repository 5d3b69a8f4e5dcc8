"""What must have happened for a condition to be true: the tree of `Need`s that `condition_needs` makes of it."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from lingjing.mission.feasibility.outline import Body
from lingjing.mission.feasibility.spread import PossiblePlaces


class VisitNeed(msgspec.Struct, frozen=True):
    """One of `movers` must come within `radius_m` of the goal, in the plane."""

    movers: tuple[Body, ...]
    goal: Body | PossiblePlaces
    radius_m: float
    at: str


class ReportNeed(msgspec.Struct, frozen=True):
    """A message of a kind must be sent; a `matching` one is about exactly one entity."""

    kind: str
    at: str
    about: str = ""
    matching: bool = False


class PictureNeed(msgspec.Struct, frozen=True):
    """A picture must be taken in which the entity covers pixels."""

    target: Body
    at: str


class Handover(msgspec.Struct, frozen=True):
    """A destination for the asset that means the target must be given, by command or by message."""

    asset: Body
    target: Body
    at: str


class Supply(msgspec.Struct, frozen=True):
    """A stock that the target lacks must be brought: `amount` of its property `name` is missing at least, `most` may be
    left."""

    target: Body
    name: str
    amount: float
    at: str
    most: float = 0.0


class Performed(msgspec.Struct, frozen=True):
    """An interaction must be performed, on the target if it is known which."""

    interaction: str
    target: Body | None
    at: str


class Impossible(msgspec.Struct, frozen=True):
    """What cannot happen."""

    message: str
    at: str


class AtLeast(msgspec.Struct, frozen=True):
    """At least `least` of the parts: all of them, one of them, some number in between; 0 asks for nothing."""

    least: int
    parts: tuple[Need, ...]


NeedLeaf = VisitNeed | ReportNeed | PictureNeed | Handover | Supply | Performed | Impossible
Need = NeedLeaf | AtLeast

NOTHING = AtLeast(0, ())
"""No requirement, or none that is understood."""


def mandatory(need: Need) -> list[NeedLeaf]:
    """The leaves that every way of meeting the need goes through."""
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
