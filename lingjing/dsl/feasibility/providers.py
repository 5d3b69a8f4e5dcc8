"""`check_providers`: warnings of scenes, engines and maps that a mission names and that are not installed.

They are warnings and not errors: the mission may be correct and played on another machine, which has the plug-in or the
map. Scenes and engines that a file of kinds describes (`lingjing.mission.kinds`) count as installed, and nothing is
imported to know them. For all others the caller passes the names that plug-ins offer, because plug-ins are a higher
layer than the language.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from typing import Literal

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.kinds import (
    SceneFault,
    builtin_engines,
    builtin_scenes,
    is_described,
    missing_path,
    missing_paths,
    named_paths,
)
from lingjing.mission.model import Mission
from lingjing.suggest import did_you_mean

Offered = Literal["scene", "engine"]

Offers = Callable[[Offered], tuple[str, ...]]
"""A function that returns the installed names, sorted. It is called only for names that no file of kinds describes."""


def check_providers(mission: Mission, tree: s.File, report: Reporter, offers: Offers) -> None:
    """Warn of every scene, engine and map that is not installed, once each, where the mission names it."""
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if node is None:
        return
    for kind, name, owner in missing_providers(mission, offers):
        place = _place(node, kind, owner)
        what = f"no {kind} called `{name}` is installed"
        report.at("LJ0505", place, what, did_you_mean(name, offers(kind)), severity="warning")
    for fault in _missing_maps(mission):
        report.at("LJ0505", _place(node, "scene", ""), fault.message, fault.hint, severity="warning")
    for owner, fault in _missing_looks(mission):
        report.at("LJ0505", _place(node, "engine", owner), fault.message, fault.hint, severity="warning")


def missing_files(mission: Mission) -> Iterator[SceneFault]:
    """Yield the files of the mission's scene and looks that do not exist."""
    yield from _missing_maps(mission)
    for _, fault in _missing_looks(mission):
        yield fault


def named_files(mission: Mission) -> Iterator[str]:
    """Yield the paths that the scene of a mission names, and those of its looks."""
    yield from (path for _, path in named_paths(mission.scene.kind, _scene_texts(mission)))
    yield from sorted({file for _, file in look_files(mission)})


def _missing_maps(mission: Mission) -> Iterator[SceneFault]:
    return missing_paths(mission.scene.kind, _scene_texts(mission))


def _scene_texts(mission: Mission) -> dict[str, str]:
    options = mission.scene.options
    return {option.name: option.value.value for option in options if isinstance(option.value, ex.Text)}


def look_files(mission: Mission) -> Iterator[tuple[str, str]]:
    """Yield each entity group with a look of its own, and the file."""
    for group in mission.groups:
        for prop in group.properties:
            if prop.name == "look" and isinstance(prop.value, ex.Text):
                yield group.name, prop.value.value


def _missing_looks(mission: Mission) -> Iterator[tuple[str, SceneFault]]:
    for group, file in look_files(mission):
        for fault in missing_path("look", file, f"look of `{group}`"):
            yield group, fault


def missing_providers(mission: Mission, offers: Offers) -> Iterator[tuple[Offered, str, str]]:
    """Yield kind, name and the entity group that needs it ("" for the scene) of each provider that is not installed."""
    for kind, name, owner in unknown_entities(mission):
        if not is_described(kind, name) and name not in offers(kind):
            yield kind, name, owner


def unknown_entities(mission: Mission) -> Iterator[tuple[Offered, str, str]]:
    """Yield the same for every scene and engine that is not built in, once each."""
    builtin: dict[Offered, Container[str]] = {"scene": builtin_scenes(), "engine": builtin_engines()}
    wanted: list[tuple[Offered, str, str]] = [("scene", mission.scene.kind, "")]
    wanted += [("engine", group.engine, group.name) for group in mission.groups]
    first = {(kind, name): owner for kind, name, owner in reversed(wanted)}
    for kind, name in dict.fromkeys((kind, name) for kind, name, _ in wanted):
        if name not in builtin[kind]:
            yield kind, name, first[kind, name]


def _place(node: s.MissionBlock, kind: Offered, owner: str) -> s.Name:
    """The place at which the mission names it; for one in a base mission, the base's name."""
    for item in node.block.items:
        inner = item.item if isinstance(item, s.Override) else item
        if kind == "scene" and isinstance(inner, s.SceneBlock):
            return inner.kind
        if kind == "engine" and isinstance(inner, s.EntityBlock) and inner.name.text == owner:
            return inner.type or inner.name
    return node.base or node.name
