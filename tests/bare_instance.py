"""An instance in which nothing is declared but who is there, for tests of engines, cameras and worlds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from lingjing.mission.expression import Flag
from lingjing.mission.instance import Budget, Clock, CommsSpec, Entity, Instance, SceneSpec, Weather


def bare_instance(entities: Iterable[Entity], **changes: Any) -> Instance:
    """These entities in a bay, in ticks of 10 s of which every 0.5 s is a macro-step, and `changes` to the fields."""
    fields: dict[str, Any] = {
        "mission": "test",
        "title": "",
        "goal": "",
        "seed": 1,
        "settings": {},
        "scene": SceneSpec(kind="bay"),
        "clock": Clock(tick_s=10.0, sync_s=0.5),
        "budget": Budget(ticks=60, policy_s=1.0, engine_s=1.0, capture_s=1.0),
        "weather": Weather(),
        "regions": (),
        "cells": (),
        "agents": (),
        "messages": (),
        "comms": CommsSpec(mode="broadcast", hub=None),
        "rules": (),
        "unlocks": (),
        "stages": (),
        "relations": (),
        "success": Flag(value=True),
    }
    return Instance(entities=tuple(entities), **{**fields, **changes})
