"""The options of the faulty policies: the planted faults."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import field_validator, model_validator

from lingjing.plugins.options import Field, PluginOptions

FailingFaculty = Literal["perception", "localisation", "waypoint", "routing", "handoff", "execution"]
"""The faculties in which a fault can be planted."""
WayToFail = Literal["blind", "displaced", "mirrored", "dropped", "misaddressed", "withheld", "halted"]
"""The effects that a fault can have."""

WAYS: dict[FailingFaculty, tuple[WayToFail, ...]] = {
    "perception": ("blind",),
    "localisation": ("displaced",),
    "waypoint": ("displaced",),
    "routing": ("displaced", "mirrored"),
    "handoff": ("dropped", "misaddressed"),
    "execution": ("withheld", "halted"),
}
"""The possible effects of each faculty's faults, the default first."""


class PlantedFault(PluginOptions):
    """A fault of one agent's faculty from a boundary on."""

    agent: str = Field(description="the agent's id")
    faculty: FailingFaculty = Field(description="what fails")
    boundary: int = Field(ge=0, description="the first boundary at which it fails")
    boundaries: int = Field(0, ge=0, description="at how many boundaries it fails; 0: to the end")
    way: WayToFail | None = Field(None, description="how it fails; not given: the faculty's usual way")
    east_m: float = Field(300.0, ge=-10_000, le=10_000, description="how far off to the east, for `displaced`")
    north_m: float = Field(0.0, ge=-10_000, le=10_000, description="how far off to the north, for `displaced`")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.way is not None and self.way not in WAYS[self.faculty]:
            known = ", ".join(WAYS[self.faculty])
            raise ValueError(f"{self.faculty} cannot be `{self.way}`; it can be {known}")
        return self

    @property
    def chosen(self) -> WayToFail:
        """The effect of the fault."""
        return self.way or WAYS[self.faculty][0]

    def acts(self, agent: str, boundary: int) -> bool:
        """Return whether the fault affects this agent at this boundary."""
        end = self.boundary + self.boundaries if self.boundaries else boundary + 1
        return agent == self.agent and self.boundary <= boundary < end


class FaultyOptions(PluginOptions):
    """The options of a faulty policy."""

    faults: tuple[PlantedFault, ...] = Field((), description="the planted faults as a JSON list; none: no fault")

    @field_validator("faults")
    @classmethod
    def _one_each(cls, faults: tuple[PlantedFault, ...]) -> tuple[PlantedFault, ...]:
        if len({(fault.agent, fault.faculty) for fault in faults}) < len(faults):
            raise ValueError("two faults name the same agent and faculty, and a faculty can fail in one way only")
        return faults
