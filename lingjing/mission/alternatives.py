"""`with_alternatives`: a mission with its alternatives in place and its switches folded into its conditions.

Concepts. A *switch* is a param that is `true` or `false` (`param evidence = false`). An *alternative* is a line of a
block with `when`, which replaces the line without one (`position ~ sites(deck) when layout`). Both depend on settings
alone. So they are resolved before an instance is made, and its readers (kernel, proofs, oracle, metrics) meet plain
properties, and conditions without switches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache
from types import NoneType
from typing import Any, TypeVar

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.evaluate import Scope, flag_of
from lingjing.mission.tiers import settings_of_tier

T = TypeVar("T")
Guarded = TypeVar("Guarded", model.Rule, model.Stage, model.Reveal)
Line = TypeVar("Line", model.Alternative, model.OtherChannels)

_LEAVES = frozenset({str, float, int, bool, NoneType})
"""Types of values without expressions: four of five fields of a mission."""


def with_alternatives(mission: model.Mission, scope: Scope) -> model.Mission:
    """The mission for the mode and the parameters of `scope`: the same object if it has no alternative and no switch.

    Raises `MissionError` if a condition cannot be evaluated.
    """
    switches = tuple(
        (param.name, scope.parameters[param.name] != 0.0) for param in mission.parameters if param.is_switch
    )
    if not switches:
        return _chosen(mission, scope)
    return _chosen(_without_impossible_failure(_with_switches(Identity(mission), switches)), scope)


def at_tier(mission: model.Mission, tier: int = 0) -> model.Mission:
    """The mission with its switches as a tier sets them: for readers that show one form of it in all modes.

    Declarations and alternatives with a condition that is then false are left out, and alternatives with one that is
    then true are in place. Raises `UsageError` for a tier that the mission does not declare.
    """
    defaults = {param.name: param.default.value for param in mission.parameters if isinstance(param.default, ex.Flag)}
    chosen = settings_of_tier(mission, tier, mission.modes.default)
    if not defaults:
        return mission
    switches = tuple((name, chosen[name] != 0.0 if name in chosen else value) for name, value in defaults.items())
    folded = _without_absent(_with_switches(Identity(mission), switches))
    return _without_impossible_failure(_settled(folded))


def _settled(mission: model.Mission) -> model.Mission:
    """The mission with the alternatives of groups, cameras, scene and weather in place that hold in every mode."""
    scene = mission.scene
    return msgspec.structs.replace(
        mission,
        groups=tuple(_of_group(group, _certain, Scope(mode="")) for group in mission.groups),
        scene=msgspec.structs.replace(
            scene, options=_replaced(scene.options, _certain(scene.alternatives), Scope(mode="")), alternatives=()
        ),
        weather=_replaced(mission.weather, _certain(mission.weather_alternatives), Scope(mode="")),
        weather_alternatives=(),
    )


def _certain(alternatives: Iterable[Line]) -> tuple[Line, ...]:
    """The alternatives that hold in every mode."""
    return tuple(each for each in alternatives if each.when.condition == ex.Flag(True))


def _of_group(group: model.Group, among: Callable[[tuple[Any, ...]], tuple[Any, ...]], scope: Scope) -> model.Group:
    """The group with the alternatives of its block and of its cameras in place, as far as they are `among` these."""
    if not group.alternatives and not any(camera.alternatives for camera in group.cameras):
        return group
    return msgspec.structs.replace(
        group,
        properties=_replaced(group.properties, among(group.alternatives), scope),
        alternatives=(),
        cameras=tuple(_of_camera(camera, among(camera.alternatives), scope) for camera in group.cameras),
    )


def _of_camera(camera: model.Camera, others: Iterable[model.OtherChannels], scope: Scope) -> model.Camera:
    """The camera with the channels of the last alternative that holds."""
    chosen = [other.channels for other in others if flag_of(other.when.condition, scope)]
    return msgspec.structs.replace(camera, channels=chosen[-1] if chosen else camera.channels, alternatives=())


def _without_impossible_failure(mission: model.Mission) -> model.Mission:
    """The mission without a failure that its switches have made false: an instance of before has none."""
    return msgspec.structs.replace(mission, failure=None) if mission.failure == ex.Flag(False) else mission


def _without_absent(value: T) -> T:
    """The value without declarations of a false condition, and without true conditions."""
    if isinstance(value, tuple):
        kept = tuple(_without_absent(item) for item in value if _guard_of(item) != ex.Flag(False))
        return value if len(kept) == len(value) and all(a is b for a, b in zip(kept, value, strict=True)) else kept  # type: ignore[return-value]
    if not isinstance(value, msgspec.Struct) or isinstance(value, ex.Expr):
        return value
    changes = {
        name: new
        for name in value.__struct_fields__
        if (new := _without_absent(old := getattr(value, name))) is not old
    }
    if _guard_of(value) == ex.Flag(True) and not isinstance(value, model.Alternative | model.OtherChannels):
        changes["when"] = None
    return msgspec.structs.replace(value, **changes) if changes else value


def _guard_of(item: object) -> ex.Expr | None:
    """The condition of a declaration; None for one without."""
    guard = getattr(item, "when", None)
    return guard.condition if isinstance(guard, model.Guard) else None


def _chosen(mission: model.Mission, scope: Scope) -> model.Mission:
    groups = tuple(_of_group(group, tuple, scope) for group in mission.groups)
    agents = tuple(_observing(agent, scope) for agent in mission.agents)
    scene = mission.scene
    if scene.alternatives:
        options = _replaced(scene.options, scene.alternatives, scope)
        scene = msgspec.structs.replace(scene, options=options, alternatives=())
    whole = msgspec.structs.replace(
        mission,
        groups=groups,
        agents=agents,
        scene=scene,
        weather=_replaced(mission.weather, mission.weather_alternatives, scope),
        weather_alternatives=(),
        rules=_existing(mission.rules, scope),
        stages=_existing(mission.stages, scope),
        reveals=_existing(mission.reveals, scope),
    )
    return mission if whole == mission else whole


def _existing(declared: tuple[Guarded, ...], scope: Scope) -> tuple[Guarded, ...]:
    """The rules, stages or reveals that exist with these settings, without their conditions."""
    if all(each.when is None for each in declared):
        return declared
    return tuple(
        msgspec.structs.replace(each, when=None)
        for each in declared
        if each.when is None or flag_of(each.when.condition, scope)
    )


def _replaced(
    properties: tuple[model.Property, ...], alternatives: Iterable[model.Alternative], scope: Scope
) -> tuple[model.Property, ...]:
    """The properties with the alternatives of true conditions in place; a later one replaces an earlier one."""
    for alternative in alternatives:
        if flag_of(alternative.when.condition, scope):
            new = {prop.name: prop for prop in alternative.properties}
            known = {prop.name for prop in properties}
            kept = tuple(new.get(prop.name, prop) for prop in properties)
            properties = (*kept, *(prop for name, prop in new.items() if name not in known))
    return properties


def _observing(agent: model.Agent, scope: Scope) -> model.Agent:
    """The agent with the channels that it observes with these settings.

    A condition that reads the agent's index stays: `instance_agents` evaluates it for each member.
    """
    if all(channel.when is None for channel in agent.observes):
        return agent
    observed = tuple(
        channel if _is_of_members(channel, agent) else msgspec.structs.replace(channel, when=None)
        for channel in agent.observes
        if channel.when is None or _is_of_members(channel, agent) or flag_of(channel.when.condition, scope)
    )
    return msgspec.structs.replace(agent, observes=observed)


def _is_of_members(channel: model.Channel, agent: model.Agent) -> bool:
    """True if the condition of a channel reads the index of the agent's declaration."""
    if channel.when is None or not agent.index:
        return False
    return any(isinstance(part, ex.Ref) and part.name == agent.index for part in ex.parts(channel.when.condition))


# -- folding of switches


class Identity:
    """A key of a cache: equal keys hold the same object. The hash of a mission would walk it as the folding does."""

    def __init__(self, mission: model.Mission) -> None:
        self.mission = mission

    def __hash__(self) -> int:
        return id(self.mission)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identity) and other.mission is self.mission


@lru_cache(8)  # a check makes about twelve instances of a mission, with two or three combinations of switches
def _with_switches(key: Identity, switches: tuple[tuple[str, bool], ...]) -> model.Mission:
    """The mission with these switches folded into its conditions."""
    values = dict(switches)
    return _rebuilt(key.mission, lambda expr: _folded(expr, values))


def _folded(expr: ex.Expr, switches: dict[str, bool]) -> ex.Expr:
    """The expression with the values of switches, and without the parts that they decide."""
    match expr:
        case ex.Ref(kind="switch", name=name):
            return ex.Flag(switches[name])
        case ex.Unary(operator="not", operand=ex.Flag(value=value)):
            return ex.Flag(not value)
        case ex.Binary(operator="and", left=left, right=right):
            return _decided(expr, left, right, by=False)
        case ex.Binary(operator="or", left=left, right=right):
            return _decided(expr, left, right, by=True)
    return expr


def _decided(expr: ex.Expr, left: ex.Expr, right: ex.Expr, *, by: bool) -> ex.Expr:
    """`a and b`, which is decided by one `false`, or `a or b`, which is decided by one `true`."""
    for side, other in ((left, right), (right, left)):
        if isinstance(side, ex.Flag):
            return side if side.value is by else other
    return expr


def _rebuilt(value: T, fold: Callable[[ex.Expr], ex.Expr]) -> T:
    """The value with every expression in it folded, from the innermost part outwards. Unchanged parts stay the same
    objects."""
    if isinstance(value, tuple):
        items = tuple(_rebuilt(item, fold) for item in value)
        same = all(new is old for new, old in zip(items, value, strict=True))
        return value if same else items  # type: ignore[return-value]
    if not isinstance(value, msgspec.Struct):
        return value
    changes = {
        name: new
        for name in value.__struct_fields__
        if type(old := getattr(value, name)) not in _LEAVES and (new := _rebuilt(old, fold)) is not old
    }
    whole = msgspec.structs.replace(value, **changes) if changes else value
    return fold(whole) if isinstance(whole, ex.Expr) else whole  # type: ignore[return-value]
