"""The selection of the engines that an instance needs, with the place of each."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import partial

from lingjing.errors import ErrorCollector, UsageError
from lingjing.mission.instance import Instance
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.foreign_errors import one_line
from lingjing.plugins.host import PluginHost

CAMERA = "camera"
"""The name of the sensor engine that is preferred if several are installed."""


@dataclass(frozen=True, slots=True)
class EngineSelection:
    """Engine names by place, each sorted."""

    local: tuple[str, ...]
    """Motion engines of the world process."""
    remote: tuple[str, ...]
    """Motion engines in the caller: bridges to simulators elsewhere."""
    sensor: str | None
    """The sensor engine; None if the instance has neither cameras nor reference pictures, or without a plug-in that
    draws pictures."""

    @property
    def names(self) -> tuple[str, ...]:
        """All names, the sensor engine last."""
        return (*self.local, *self.remote, *((self.sensor,) if self.sensor else ()))


def select_engines(instance: Instance, host: PluginHost) -> EngineSelection:
    """Return the engines of `instance`. Raises `UsageError` with every engine that is not installed or cannot own
    entities.

    An engine takes part if it owns an entity or its plug-in requests it (`EnginePlugin.wanted`).
    """
    errors = ErrorCollector()
    owners = {entity.engine: entity.id for entity in reversed(instance.entities)}
    places = {name: errors.attempt(partial(_place, host, name, owner), "") for name, owner in owners.items()}
    errors.check()
    places |= {
        name: plugin.place
        for name, plugin in host.engines.items()
        if not plugin.sensor and _is_wanted(plugin, instance)
    }
    return EngineSelection(
        local=tuple(sorted(name for name, place in places.items() if place == "world")),
        remote=tuple(sorted(name for name, place in places.items() if place == "remote")),
        sensor=_sensor(host) if instance.reveals or any(entity.cameras for entity in instance.entities) else None,
    )


def takes_pictures_unasked(instance: Instance) -> bool:
    """Return whether pictures are certain to be taken, because some camera takes one each tick."""
    return any(camera.capture == "each_tick" for entity in instance.entities for camera in entity.cameras)


def _is_wanted(plugin: EnginePlugin, instance: Instance) -> bool:
    """Return whether an engine takes part without entities. An engine with a failing `wanted` does not."""
    try:
        return plugin.wanted is not None and bool(plugin.wanted(instance))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a plug-in's function; the warning names it
        problem = f"engine `{plugin.name}` is left out: its `wanted` failed: {one_line(error)}"
        warnings.warn(problem, RuntimeWarning, stacklevel=2)
        return False


def _place(host: PluginHost, engine: str, entity: str) -> str:
    place = host.engine(engine).place
    if place == "camera":
        raise UsageError(f"engine `{engine}` draws pictures and cannot move `{entity}`", hint="see `lingjing plugins`")
    return place


def _sensor(host: PluginHost) -> str | None:
    names = [name for name, plugin in host.engines.items() if plugin.sensor and plugin.place == "camera"]
    if len(names) < 2 or CAMERA in names:
        return CAMERA if CAMERA in names else next(iter(names), None)
    raise UsageError(f"several engines draw pictures: {', '.join(names)}", hint=f"call one of them `{CAMERA}`")
