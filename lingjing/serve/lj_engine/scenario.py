"""The `resetScenario` object that sessions receive."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping

from lingjing.engines.remote.messages import Document
from lingjing.engines.remote.poses import list_of
from lingjing.mission import jsontext
from lingjing.mission.instance import Instance
from lingjing.mission.model import Mission
from lingjing.mission.reset.emit import scenario_of

_KEPT = ("taskType", "task_type", "extras", "sceneRegion")
"""Fields of an original document that are sent as they are."""


def scenario_maker(mission: Mission, settings: Mapping[str, float], task_id: str) -> Callable[[Instance], Document]:
    """Return the function that makes the scenario of a placed instance, in Unreal's centimetres."""

    def make(instance: Instance) -> Document:
        scenario: dict[str, object] = dict(scenario_of(mission, instance, settings, list_of))
        scenario |= _kept(mission)
        task_type = scenario.get("taskType") or scenario.get("task_type") or mission.name
        scenario.setdefault("extras", {})
        return {**scenario, "taskId": task_id, "scenarioId": f"{mission.name}-{instance.seed}", "taskType": task_type}

    return make


def _kept(mission: Mission) -> Document:
    """Return the fields of a mission's own document that its places do not depend on."""
    if not mission.origin.document:
        return {}
    document = json.loads(jsontext.without_extras(mission.origin.document))
    for key in ("data", "scenario"):
        inner = document.get(key) if isinstance(document, dict) else None
        document = inner if isinstance(inner, dict) else document
    return {name: document[name] for name in _KEPT if isinstance(document, dict) and name in document}
