"""The goals and tasks that a mission requires, for policies that may see its rules.

`goals` is the tree of everything that success requires, with its alternatives. `asked` are the interactions in it, and
`reported` the kinds of reports that rules match. All are public names of `lingjing.mission`.
"""

from lingjing.mission.conditions.goal_reading import goals
from lingjing.mission.conditions.goals import (
    Alternatives,
    AssignGoal,
    Goal,
    InspectGoal,
    Judged,
    LeafGoal,
    LevelGoal,
    OpenGoal,
    Ordered,
    PerformGoal,
    PictureGoal,
    ReachGoal,
    ReportGoal,
    StatusGoal,
    leaves_of,
)
from lingjing.mission.tasks import Task, declared, entry_regions, possible, reported
from lingjing.mission.tasks import matching_members as meant
from lingjing.mission.tasks import required_tasks as asked
from lingjing.mission.units import field_named

__all__ = [
    "Alternatives", "AssignGoal", "Goal", "InspectGoal", "Judged", "LeafGoal", "LevelGoal", "OpenGoal", "Ordered",
    "PerformGoal", "PictureGoal", "ReachGoal", "ReportGoal", "StatusGoal", "Task", "asked", "declared",
    "entry_regions", "field_named", "goals", "leaves_of", "meant", "possible", "reported",
]  # fmt: skip
