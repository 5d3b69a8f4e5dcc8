"""The tasks that a mission requires, for policies that may see its rules: public names of `lingjing.mission.tasks`."""

from lingjing.mission.tasks import Task, declared, entry_regions, possible, reported
from lingjing.mission.tasks import matching_members as meant
from lingjing.mission.tasks import required_tasks as asked
from lingjing.mission.units import field_named

__all__ = ["Task", "asked", "declared", "entry_regions", "field_named", "meant", "possible", "reported"]
