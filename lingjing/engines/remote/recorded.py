"""Remote engines of a recorded episode: the frames of the trace answer in place of the sessions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import get_args

from lingjing.engines.remote.engine import RemoteEngine, RemoteSettings, recorded_scenario
from lingjing.engines.remote.link import RecordedLink
from lingjing.engines.remote.messages import ProfileName
from lingjing.errors import UsageError
from lingjing.plugins.engine import Engine, EnginePlugin
from lingjing.trace.records import EngineFrame, RemoteBinding


def recorded_plugins(
    bindings: Sequence[RemoteBinding], frames: Sequence[EngineFrame], declared: Callable[[str], EnginePlugin]
) -> dict[str, EnginePlugin]:
    """Return the declarations of the engines that sessions played. `declared` returns that of a name.

    Raises `UsageError` for a profile of another version.
    """
    return {binding.engine: _plugin(binding, frames, declared(binding.engine)) for binding in bindings}


def _plugin(binding: RemoteBinding, frames: Sequence[EngineFrame], declared: EnginePlugin) -> EnginePlugin:
    profile = next((name for name in get_args(ProfileName) if name == binding.profile), None)
    if profile is None:
        raise UsageError(f"the trace names the profile `{binding.profile}`, which this version does not have")
    settings = RemoteSettings(
        engine=binding.engine, profile=profile, every_sync=binding.observes == "sync", asks=binding.asks
    )

    def make() -> Engine:
        return RemoteEngine(settings, RecordedLink(binding.engine, binding.task_id, frames), recorded_scenario)

    return replace(declared, factory=make, place="remote")
