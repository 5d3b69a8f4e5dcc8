"""`absent`: scenes, engines and maps that a mission names and that are not here.

A warning and no error: the mission may be right and be played elsewhere, where the plug-in is installed or the map
lies. What a file of kinds describes (`lingjing.mission.kinds`), built in or a plug-in's, is there, and nothing is
imported to know it. Who offers what no file describes is the caller's to say, because plug-ins lie behind the language.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from typing import Literal

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.kinds import SceneFault, builtin_engines, builtin_scenes, is_described, missing_paths
from lingjing.mission.model import Mission
from lingjing.suggest import did_you_mean

Offered = Literal["scene", "engine"]

Offers = Callable[[Offered], tuple[str, ...]]
"""The names that are installed, sorted; called only for a name that no file of kinds describes."""


def absent(mission: Mission, tree: s.File, report: Reporter, offers: Offers) -> None:
    """Warn of every scene, engine and map that is not here, once each, where the mission names it."""
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if node is None:
        return
    for kind, name, owner in missing(mission, offers):
        place = _place(node, kind, owner)
        what = f"no {kind} called `{name}` is installed"
        report.at("LJ0505", place, what, did_you_mean(name, offers(kind)), severity="warning")
    for fault in missing_files(mission):
        report.at("LJ0505", _place(node, "scene", ""), fault.message, fault.hint, severity="warning")


def missing_files(mission: Mission) -> Iterator[SceneFault]:
    """What the mission's scene is to be made of and is not there."""
    options = mission.scene.options
    return missing_paths(
        mission.scene.kind, {one.name: one.value.value for one in options if isinstance(one.value, ex.Text)}
    )


def missing(mission: Mission, offers: Offers) -> Iterator[tuple[Offered, str, str]]:
    """Kind, name and the entity group that asks for it ("" for the scene)."""
    for kind, name, owner in strange(mission):
        if not is_described(kind, name) and name not in offers(kind):
            yield kind, name, owner


def strange(mission: Mission) -> Iterator[tuple[Offered, str, str]]:
    """The same of every scene and engine that is not built in, once each."""
    builtin: dict[Offered, Container[str]] = {"scene": builtin_scenes(), "engine": builtin_engines()}
    wanted: list[tuple[Offered, str, str]] = [("scene", mission.scene.kind, "")]
    wanted += [("engine", group.engine, group.name) for group in mission.groups]
    first = {(kind, name): owner for kind, name, owner in reversed(wanted)}
    for kind, name in dict.fromkeys((kind, name) for kind, name, _ in wanted):
        if name not in builtin[kind]:
            yield kind, name, first[kind, name]


def _place(node: s.MissionBlock, kind: Offered, owner: str) -> s.Name:
    """Where the mission says it; what stands in a base mission is shown where that is named."""
    for item in node.block.items:
        inner = item.item if isinstance(item, s.Override) else item
        if kind == "scene" and isinstance(inner, s.SceneBlock):
            return inner.kind
        if kind == "engine" and isinstance(inner, s.EntityBlock) and inner.name.text == owner:
            return inner.type or inner.name
    return node.base or node.name
