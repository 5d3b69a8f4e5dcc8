"""`sited`: a mission with its places in a real city, chosen among candidates and tried."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from lingjing.errors import MissionError, UsageError
from lingjing.mission import expression as ex
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission, Property, Scene
from lingjing.mission.tiers import tiers_of
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.scene.siting.areas import area_need, area_sites
from lingjing.scene.siting.city_view import CityView
from lingjing.scene.siting.grounds import ground_need, ground_sites
from lingjing.scene.siting.layout import Layout, read_layout
from lingjing.scene.siting.lines import line_need, line_sites
from lingjing.scene.siting.rewriting import Placement, rewritten
from lingjing.scene.siting.routes import route_need, route_sites

CITY = "city"
"""Option of a scene: the map or the built city in which its places are looked for."""

KEPT = ("pedestrians", "cyclists", "signals", "collisions")
"""Options of a scene that the map keeps."""
CARS_PER_KM = 12.0
"""Most background vehicles per kilometre of connected road (chosen: more would be a queue everywhere)."""
DISPLACEMENT_M = 120.0
"""Farthest move of a body from its found place, metres (chosen)."""
TRIED_SEEDS = range(4)
"""Seeds of the instances that a candidate must place (chosen)."""
MOST_CANDIDATES = 8
"""Most candidates that are tried (chosen)."""

_Sites = Callable[[Layout, CityView], Iterator[Placement]]
_Need = Callable[[Layout, CityView], str]


@dataclass(frozen=True, slots=True)
class _Rule:
    """The search of one role: its placements, and the words for its need."""

    sites: _Sites
    need: _Need


_RULES: Mapping[str, _Rule] = {
    "line": _Rule(line_sites, line_need),
    "route": _Rule(route_sites, route_need),
    "ground": _Rule(ground_sites, ground_need),
    "area": _Rule(area_sites, area_need),
}


def sited(mission: Mission, city: City, options: Mapping[str, ex.Expr]) -> Mission:
    """Return the mission with its places in the city.

    `options`: those of the scene `map` that name the city. Raises `MissionError` that says what the city lacks.
    """
    view = CityView(city)
    layout = read_layout(mission)
    rule = _RULES[_role(layout)]
    scene = _scene(mission, view, options)
    refused: MissionError | None = None
    for number, placement in enumerate(rule.sites(layout, view)):
        if number == MOST_CANDIDATES:
            break
        candidate = rewritten(mission, placement, scene)
        try:
            _try_out(candidate, city)
        except MissionError as error:
            refused = error
            continue
        return candidate
    because = f": {refused}" if refused is not None else ""
    raise MissionError(
        f"`{mission.name}` does not fit into `{city.id}`: it needs {rule.need(layout, view)}{because}",
        hint="choose another map, or a larger part of it",
    )


def city_option(mission: Mission) -> str | None:
    """The path of the scene's option `city`; None without it."""
    value = next((option.value for option in mission.scene.options if option.name == CITY), None)
    return value.value if isinstance(value, ex.Text) else None


def with_city_option(mission: Mission, path: str) -> Mission:
    """The mission with the scene's option `city`. Raises `UsageError` for a scene that is no made-up district."""
    from lingjing.mission.kinds import scene_kind

    kind = scene_kind(mission.scene.kind)
    if kind is None or CITY not in kind.options:
        raise UsageError(
            f"the scene `{mission.scene.kind}` of `{mission.name}` cannot be played in a city from a map",
            hint="remove --scene",
        )
    from msgspec.structs import replace

    rest = tuple(option for option in mission.scene.options if option.name != CITY)
    scene = replace(mission.scene, options=(*rest, Property(name=CITY, value=ex.Text(value=path))))
    return replace(mission, scene=scene)


# -- private


def _role(layout: Layout) -> str:
    if layout.line is not None:
        return "line"
    if layout.has_route:
        return "route"
    return "ground" if layout.ground else "area"


def _scene(mission: Mission, view: CityView, options: Mapping[str, ex.Expr]) -> Scene:
    """The scene `map` with the options that a made-up district and a map have in common."""
    declared = {option.name: option for option in mission.scene.options}
    kept = [declared[name] for name in KEPT if name in declared]
    made = [Property(name=name, value=value) for name, value in options.items()]
    made.append(Property(name="displacement_m", value=ex.Number(value=DISPLACEMENT_M, unit="m"), unit="m"))
    traffic = declared.get("traffic")
    if traffic is not None and isinstance(traffic.value, ex.Number):
        most = int(CARS_PER_KM * sum(segment.length_m for segment in view.segments) / 1000.0)
        made.append(Property(name="traffic", value=ex.Number(value=float(min(traffic.value.value, most)))))
    elif traffic is not None:
        made.append(traffic)
    return Scene(kind="map", options=(*made, *kept))


def _try_out(mission: Mission, city: City) -> None:
    """Raise `MissionError` if an instance of some seeds cannot be placed."""
    for tier in dict.fromkeys((0, *tiers_of(mission))):
        for seed in TRIED_SEEDS:
            anchor(instantiate(mission, seed=seed, tier=tier), city)
