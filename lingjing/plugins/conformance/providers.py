"""The checks of scenes and files of kinds: the offers match their contract, in every call."""

from __future__ import annotations

from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import described_by
from lingjing.plugins.building import build_city
from lingjing.plugins.conformance.case import ConformanceError, require
from lingjing.plugins.conformance.evaluators import check_evaluator
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import content_sha256
from lingjing.scene.city_checks import city_faults
from lingjing.suggest import nearest_or


def check_scene(spec: SceneSpec, host: PluginHost | None = None) -> None:
    """Check that the city of an installed scene is valid, and equal when it is built again. Raises
    `ConformanceError`."""
    host = host or PluginHost()
    city, again = build_city(spec, host), build_city(spec, host)
    faults = list(city_faults(city, spec))
    require(not faults, f"scene `{spec.kind}`: {'; '.join(faults[:10])}")
    same = content_sha256(city) == content_sha256(again)
    require(same, f"scene `{spec.kind}` builds another city in a second call")


def check_kinds(plugin: str, host: PluginHost | None = None) -> None:
    """Check that the `kinds.json` of an entry point is valid, and describes exactly the scenes that it offers.

    Raises `PluginError` that lists every fault of the file, `ConformanceError` for a missing or an unknown kind, and
    for a name that no installed entry point has.
    """
    sources = (host or PluginHost()).sources
    installed = {point.name for point in find_entries(PLUGINS).points}
    if plugin not in installed:
        close = nearest_or(plugin, installed, f"installed: {', '.join(sorted(installed))}")
        raise ConformanceError(f"no installed entry point of the group `{PLUGINS}` is called `{plugin}`", hint=close)
    file = described_by(plugin)
    for kind, described in (("scene", file.by_scene), ("engine", file.by_engine)):
        offered = [name for (hook, name), source in sources.items() if (hook, source) == (f"lingjing_{kind}s", plugin)]
        made_up = sorted(described.keys() - set(offered))
        require(not made_up, f"kinds.json describes {kind}s that `{plugin}` does not offer: {', '.join(made_up)}")
        left_out = sorted(set(offered) - described.keys()) if kind == "scene" else []
        require(not left_out, f"kinds.json does not describe the scenes {', '.join(left_out)} that `{plugin}` offers")


__all__ = ["check_evaluator", "check_kinds", "check_scene"]
