"""A brief and observations made by hand, for checks that need no mission: one body, one camera, one kind of report."""

from __future__ import annotations

from lingjing.plugins.policy import (
    ArgumentSpec,
    Brief,
    Cell,
    EntityView,
    Field,
    MessageSpec,
    Observation,
    Peer,
    Resource,
    VerbSpec,
    Weather,
)

BODY = "body"
TICK_S = 10.0


def sample_brief() -> Brief:
    """Return the brief of an agent `pilot` with one body, which goes to places and reports a `beacon`."""
    place = (ArgumentSpec(name="x", unit="m"), ArgumentSpec(name="y", unit="m"))
    verbs = (VerbSpec(name="moveTo", arguments=place, doc="goes to the place"), VerbSpec(name="stop"))
    report = MessageSpec(
        kind="sighting",
        type="sighting",
        category="report",
        fields=(Field(name="class", type="name"), Field(name="position", type="position")),
        senders=("pilot",),
        recipients=("all",),
    )
    square = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
    return Brief(
        agent="pilot",
        role="pilot",
        index=0,
        goal="Visit the beacon.",
        prompt="",
        mode="broadcast",
        hub=None,
        tick_s=TICK_S,
        ticks=10,
        seed=1,
        resources=(Resource(id=BODY, type="craft", embodied=True, verbs=verbs),),
        peers=(Peer(id="other", role="pilot", resources=("second",)),),
        messages=(report,),
        regions=(),
        cells=(Cell(name="cells-1-1", grid="cells", row=1, column=1, polygon=square, centre=(50.0, 50.0)),),
        classes=("beacon",),
        weather=Weather(),
        water_level_m=0.0,
    )


def sample_observations(brief: Brief, count: int = 3) -> tuple[Observation, ...]:
    """Return observations in which the agent's bodies stand at the origin."""
    views = tuple(
        EntityView(id=body.id, type=body.type, position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), heading_deg=0.0,
                   status="idle", busy=False)
        for body in brief.resources
    )  # fmt: skip
    return tuple(
        Observation(agent=brief.agent, tick=tick, time_s=tick * brief.tick_s, entities=views, weather=brief.weather)
        for tick in range(count)
    )


__all__ = ["BODY", "TICK_S", "sample_brief", "sample_observations"]
