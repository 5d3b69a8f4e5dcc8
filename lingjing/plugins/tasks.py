"""What a mission asks for, for policies that may see its rules: the public name of `lingjing.mission.tasks`."""

from lingjing.mission.tasks import Task, asked, declared, entry_regions, meant, possible, reported
from lingjing.mission.units import field_named

__all__ = ["Task", "asked", "declared", "entry_regions", "field_named", "meant", "possible", "reported"]
