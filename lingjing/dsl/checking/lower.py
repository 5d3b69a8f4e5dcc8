"""`lower`: checked declarations become the `Mission`. Only what had no errors is ever lowered."""

from __future__ import annotations

import hashlib

from lingjing.dsl.checking.checker import Checked
from lingjing.dsl.source.text import Source
from lingjing.mission.model import Mission, Origin


def lower(checked: Checked, source: Source) -> Mission:
    """The mission graph. `checked` must be complete (no errors were reported); a gap is a fault of the checker."""
    scene, clock, budget, modes, success = checked.scene, checked.clock, checked.budget, checked.modes, checked.success
    if scene is None or clock is None or budget is None or modes is None or success is None:
        raise AssertionError("the checker let an incomplete mission pass")
    return Mission(
        name=checked.name,
        title=checked.title,
        goal=checked.goal,
        scene=scene,
        clock=clock,
        budget=budget,
        weather=checked.weather,
        parameters=checked.parameters,
        modes=modes,
        regions=checked.regions,
        grids=checked.grids,
        groups=checked.groups,
        agents=checked.agents,
        authorities=checked.authorities,
        messages=checked.messages,
        comms=checked.comms,
        rules=checked.rules,
        unlocks=checked.unlocks,
        stages=checked.stages,
        relations=checked.relations,
        reveals=checked.reveals,
        success=success,
        failure=checked.failure,
        origin=_origin(source),
        base=checked.base,
        limits=checked.limits,
        permits=checked.permits,
        constraints=checked.constraints,
        inspections=checked.inspections,
        events=checked.events,
        sweeps=checked.sweeps,
    )


def _origin(source: Source) -> Origin:
    name = source.path.replace("\\", "/").rsplit("/", 1)[-1]
    return Origin(file=name, sha256=hashlib.sha256(source.text.encode("utf-8", "surrogatepass")).hexdigest())
