"""Exposures of hidden values by public values and motions of a compiled mission.

The compiler of a text finds hidden values in expressions, with the path from their declaration (LJ0401). This module
finds them in the compiled mission, so that a `mission.json` is held to the same rules. `public_values` lists every
value that is no condition and that agents may learn. A reference to a member of a group (`uav[k]`) is public if its
index is. Motions, receipts and the radio show hidden values, too:

- a target with a public place that flees from, follows or wanders by a hidden place;
- an observed target with a hidden drift, which its places show, or hidden arrivals, which its number of people shows;
- an asset with a hidden speed or band, which the receipts of its commands show;
- an asset with a hidden place that agents command, or that shows in its pictures or by the range of its radio.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.conditions.declarations import Declarations, Group, group_names, of_mission
from lingjing.mission.conditions.public_values import CONSTANT, References, public_values
from lingjing.mission.conditions.reads import Reader
from lingjing.mission.conditions.taint import PLACE, propagate
from lingjing.mission.natures import PEOPLE
from lingjing.mission.vocabulary import MOTION

HINT = "hidden values may reach only `adjudicate`, `truth(…)` and sensors"
"""The way out of an exposure."""

_RATES: tuple[tuple[str, tuple[str, ...], frozenset[str]], ...] = (
    (PLACE, MOTION, frozenset({"*", PLACE, "velocity", "heading_deg"})),
    (PEOPLE, ("arrivals", "departures"), frozenset({"*", "resources", PEOPLE})),
)
"""A value that changes by itself, the properties that are its rates, and the fields of a channel that show it."""


class Exposure(NamedTuple):
    """A public value or motion that shows a hidden value."""

    name: str
    """The declaration that has it."""
    sink: str
    """The public thing, as the object of "reaches"."""
    way: str
    """The hidden value."""

    @property
    def message(self) -> str:
        """The error in one sentence."""
        return f"a hidden value reaches {self.sink}: {self.way}"


def exposures(mission: model.Mission) -> tuple[Exposure, ...]:
    """Every exposure of a mission, in the order of declaration."""
    of = propagate(of_mission(mission))
    return (
        *_values(mission, of),
        *_motions(of),
        *_shown_rates(mission),
        *_receipts(mission),
        *_places_of_agents(mission),
    )


# -- private


def _values(mission: model.Mission, of: Declarations) -> Iterator[Exposure]:
    """Public declarations that are computed from hidden values."""
    reader = Reader(of)
    for name, sink, value in public_values(mission):
        if value is None or isinstance(value, CONSTANT):
            continue
        read = (each for part in _read_parts(value) for each in reader.value(part, {}).quantities)
        hidden = next((each for each in read if each.hidden), None)
        if hidden is not None:
            yield Exposure(name, sink, f"`{hidden.name if hidden.kind == 'setting' else hidden.key}`")


def _read_parts(value: ex.Expr | References) -> tuple[ex.Expr, ...]:
    """The expressions that a public value shows: of references, the indices alone."""
    if not isinstance(value, References):
        return (value,)
    return tuple(part.index for each in value.to for part in ex.parts(each) if isinstance(part, ex.Index))


def _motions(of: Declarations) -> Iterator[Exposure]:
    for group in of.groups.values():
        if group.behaviour is None or PLACE in group.hidden:
            continue
        if group.behaviour.region in of.hidden_regions:
            way = f"the hidden region `{group.behaviour.region}`"
        else:
            others = (of.group(name) for name in group.behaviour.of)
            hidden = (each for each in others if each is not None and _is_placeless(each, of))
            way = next((f"`{each.name}.{PLACE}`" for each in hidden), "")
        if way:
            yield Exposure(group.name, f"the motion of `{group.name}`, which has a public place", way)


def _is_placeless(group: Group, of: Declarations) -> bool:
    return PLACE in group.hidden or (group.name, PLACE) in of.taint.fields


def _shown_rates(mission: model.Mission) -> Iterator[Exposure]:
    """Hidden rates of observed targets: a drift shows in public places, arrivals and departures in a public number of
    people. The speed of an asset shows in its receipts."""
    for group in mission.groups:
        hidden = {prop.plain for prop in group.properties if prop.hidden}
        for field, rates, fields in _RATES if group.role == "target" else ():
            for name in sorted(hidden.intersection(rates) if field not in hidden else ()):
                agent = next((agent for agent in mission.agents if _observes(agent, group.name, fields)), None)
                if agent is not None:
                    sink = f"the observation of `{group.name}` by `{agent.name}`"
                    yield Exposure(agent.name, sink, f"`{group.name}.{name}`")


def _observes(agent: model.Agent, group: str, fields: frozenset[str]) -> bool:
    return any(
        group in group_names((channel.source,)) and not fields.isdisjoint(channel.fields) for channel in agent.observes
    )


def _receipts(mission: model.Mission) -> Iterator[Exposure]:
    """Hidden bands and speeds of commanded assets: receipts show clipped commands, and when a command ends."""
    for group in mission.groups:
        if group.role == "asset" and group.verbs:
            hidden = {prop.plain for prop in group.properties if prop.hidden}
            for name in sorted(hidden.intersection(("band", *MOTION))):
                yield Exposure(group.name, "the receipts of commands", f"`{group.name}.{name}`")


def _is_commanded(mission: model.Mission, group: str) -> bool:
    controlled = (asset for agent in mission.agents for asset in agent.controls)
    return group in group_names((*controlled, *(each.resource for each in mission.authorities)))


def _places_of_agents(mission: model.Mission) -> Iterator[Exposure]:
    """Hidden places of assets with agents, once each: receipts show the share of the way that is done, and poses of
    pictures and the messages that arrive show the place."""
    radio = _radio_reaches_places(mission)
    for group in mission.groups:
        if group.role != "asset" or not any(prop.hidden and prop.plain == PLACE for prop in group.properties):
            continue
        way = f"`{group.name}.{PLACE}`"
        if group.verbs and _is_commanded(mission, group.name):
            yield Exposure(group.name, "the receipts of commands", way)
            continue
        cameras = frozenset(("*", *(camera.name for camera in group.cameras)))
        for agent in mission.agents:
            if group.cameras and _observes(agent, group.name, cameras):
                yield Exposure(agent.name, f"the pictures of `{group.name}` for `{agent.name}`", way)
            elif radio and group.name in group_names(agent.controls):
                yield Exposure(agent.name, f"the messages that reach `{agent.name}`", way)


def _radio_reaches_places(mission: model.Mission) -> bool:
    """True if the places of bodies decide which messages arrive."""
    changes = (change for event in mission.events for change in event.changes)
    return mission.comms.range is not None or any(
        change.kind == "jam" or change.range is not None for change in changes
    )
