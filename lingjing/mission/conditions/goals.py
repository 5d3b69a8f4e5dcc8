"""Goals: the things that agents must bring about for a condition to hold, as a tree with its alternatives.

`goal_reading` builds the tree from an instance. A leaf has the part of the condition that it comes from, and the path
of that condition. A part that no kind of goal covers is an `OpenGoal` with the reason.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission.conditions.quantities import Record


class GoalLeaf(Record, frozen=True, kw_only=True):
    """Base of the leaves."""

    at: str
    """Path of the condition: `success`, `rule/served`, `unlock/rescue`."""
    text: str
    """The part of the condition as it is written."""


class PerformGoal(GoalLeaf, frozen=True, kw_only=True):
    """An interaction with a target must be performed."""

    interaction: str
    target: str
    actors: tuple[str, ...]
    """Ids of the assets that may perform it."""
    within_m: float
    """Largest distance between actor and target, metres."""
    lasting_s: float | None = None
    """Seconds that the actor must stay; None for an instantaneous interaction or one that the target's nature
    times."""


class LevelGoal(GoalLeaf, frozen=True, kw_only=True):
    """The amount of a state must be within bounds, summed over entities."""

    entities: tuple[str, ...]
    """The entities with that state."""
    state: str
    """Name of the state, without its unit."""
    most: float | None = None
    """Upper bound of the sum in the state's unit; None if there is none."""
    least: float | None = None
    """Lower bound of the sum; None if there is none."""
    strict: bool = False
    """True if the sum must differ from the bound."""
    ways: tuple[PerformGoal, ...] = ()
    """The interactions that change the state in this direction."""

    def holds(self, amount: float) -> bool:
        """True if the sum is within the bounds."""
        slack = -_DUST if self.strict else _DUST
        below = self.most is None or amount <= self.most + slack
        return below and (self.least is None or amount >= self.least - slack)


_DUST = 1e-6
"""Tolerance of amounts. Chosen: sums of transfers have rounding errors."""


class ReachGoal(GoalLeaf, frozen=True, kw_only=True):
    """One of the movers must be near an entity or a point, or inside a region."""

    movers: tuple[str, ...]
    """Ids of the bodies."""
    entity: str = ""
    """Id of the entity to come near; "" for a point or a region."""
    point: tuple[float, float] | None = None
    """The point: metres east and north."""
    region: tuple[tuple[float, float], ...] = ()
    """Outline of the region, metres."""
    radius_m: float = 0.0
    """Largest distance from the entity or point, metres."""


class StatusGoal(GoalLeaf, frozen=True, kw_only=True):
    """A target's status must be one of some words, which interactions give."""

    entity: str
    words: tuple[str, ...]
    ways: tuple[PerformGoal, ...] = ()
    """The interactions that give one of the words."""


class ReportGoal(GoalLeaf, frozen=True, kw_only=True):
    """A message of a kind must be sent."""

    kind: str
    about: str = ""
    """Id of the target that it is about; "" if any will do."""
    matching: bool = False
    """True if a rule matches such reports with targets in pictures."""


class PictureGoal(GoalLeaf, frozen=True, kw_only=True):
    """A camera of an asset must take a picture."""

    asset: str


class InspectGoal(GoalLeaf, frozen=True, kw_only=True):
    """The waypoints of an inspection's route must be inspected, or the route must be clear."""

    inspection: str


class AssignGoal(GoalLeaf, frozen=True, kw_only=True):
    """An asset must be sent to a target, by a command or a message."""

    asset: str
    target: str


class OpenGoal(GoalLeaf, frozen=True, kw_only=True):
    """A part of a condition that no kind of goal covers."""

    reason: str
    never: bool = False
    """True if nothing can meet it: the declared values rule it out."""


class Alternatives(Record, frozen=True, kw_only=True):
    """A goal of which at least `least` of the parts must be met: all of them for `and`, one for `or`."""

    least: int
    parts: tuple[Goal, ...] = ()


class Ordered(Record, frozen=True, kw_only=True):
    """The first goal unlocks the second one."""

    first: Goal
    then: Goal


class Judged(Record, frozen=True, kw_only=True):
    """The goal of a rule. A rule that held once counts as met for the rest of the episode."""

    rule: str
    entities: tuple[str, ...]
    """Ids of the entities among its arguments."""
    part: Goal


LeafGoal = (
    PerformGoal | LevelGoal | ReachGoal | StatusGoal | ReportGoal | PictureGoal | InspectGoal | AssignGoal | OpenGoal
)
Goal = LeafGoal | Alternatives | Ordered | Judged

MET = Alternatives(least=0)
"""A goal that is met without action: time passes, a declared value fits, something must not be done."""


def every(goals: tuple[Goal, ...]) -> Goal:
    """The goal to meet all of these."""
    barred = next((goal for goal in goals if is_never(goal)), None)
    if barred is not None:
        return barred
    left = tuple(goal for goal in goals if goal != MET)
    return left[0] if len(left) == 1 else Alternatives(least=len(left), parts=left)


def some(goals: tuple[Goal, ...], least: int = 1) -> Goal:
    """The goal to meet at least `least` of these. Those that are met without action count first."""
    left = tuple(goal for goal in goals if goal != MET)
    lacking = least - (len(goals) - len(left))
    if lacking <= 0:
        return MET
    possible = tuple(goal for goal in left if not is_never(goal))
    left = possible if len(possible) >= lacking else left
    return every(left) if lacking == len(left) else Alternatives(least=lacking, parts=left)


def is_never(goal: Goal) -> bool:
    """True for a part that nothing can meet."""
    return isinstance(goal, OpenGoal) and goal.never


def leaves_of(goal: Goal) -> Iterator[LeafGoal]:
    """All leaves of a goal, in the order of its condition."""
    match goal:
        case Alternatives(parts=parts):
            for part in parts:
                yield from leaves_of(part)
        case Ordered(first=first, then=then):
            yield from leaves_of(first)
            yield from leaves_of(then)
        case Judged(part=part):
            yield from leaves_of(part)
        case _:
            yield goal
