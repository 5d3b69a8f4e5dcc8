"""The brief in words for the system text: the commands, the messages, and the facts that are known from the start.

All numbers come from the brief and are those that the kernel enforces. These facts follow every prompt.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import msgspec

from lingjing.plugins.decisions import altitude_band, argument_bounds, field_values, recipients, sendable
from lingjing.plugins.policy import (
    PHOTO,
    STOP,
    ArgumentSpec,
    Brief,
    CameraSpec,
    Cell,
    MessageSpec,
    Resource,
    VerbMotion,
    VerbSpec,
    Weather,
)

_VIEWS = {"nadir": "straight down", "front": "ahead", "oblique": "ahead and down"}
_UNITS = {"m": "m", "deg": "degrees", "s": "s", "kg": "kg", "mps": "m/s"}
_TOLD = ("length_m", "width_m", "height_m")
"""Measures of a body that are left out, because no decision needs them."""


def interface(brief: Brief) -> str:
    """Return the facts of a brief, in sections."""
    sections = (
        ("YOU MAY COMMAND", _commands(brief) or ["nothing: you only send messages; answer with command null."]),
        ("YOU MAY SEND", [*_messages(brief), *_extents(brief), *_speech(brief)]),
        ("YOU MAY RECEIVE", list(_others(brief))),
        ("KNOWN FROM THE START", [compact(known(brief))]),
    )
    return "\n\n".join(f"{head}\n" + "\n".join(lines) for head, lines in sections if lines)


def rules(brief: Brief) -> str:
    """Return the mission's rules, one a line."""
    return "\n".join(f"- {sentence}." for sentence in brief.rules) or "- none are told."


def goal_text(brief: Brief) -> str:
    """Return the goal with everything that ends the mission as a failure."""
    late = f"The mission is lost if it is not won within {brief.ticks} ticks"
    return " ".join((brief.goal, *(f"{sentence[0].upper()}{sentence[1:]}." for sentence in (*brief.failures, late))))


def known(brief: Brief) -> dict[str, object]:
    """Return the agents, the regions and cells, the weather and the parameters of the mission."""
    west, south, east, north = brief.bounds or (-math.inf, -math.inf, math.inf, math.inf)
    fields: dict[str, object] = {
        "ticks": brief.ticks,
        "tick_s": brief.tick_s,
        "agents": [{"id": peer.id, "role": peer.role, "resources": peer.resources} for peer in brief.peers],
        "regions_east_north_m": {region.name: [tenths(point) for point in region.polygon] for region in brief.regions},
        "cells": [_cell(cell) for cell in brief.cells],
        "classes": brief.classes,
        "water_level_m": brief.water_level_m,
        "settings": brief.settings,
        "weather": weather(brief.weather),
        "commanded_places_must_lie_within_m": {"east": [west, east], "north": [south, north]} if brief.bounds else None,
    }
    return {key: value for key, value in fields.items() if value not in (None, [], (), {})}


def weather(now: Weather) -> dict[str, float]:
    """Return the weather by names that contain the units. Ice is named where there is some."""
    values = {name: round(value, 3) for name, value in msgspec.structs.asdict(now).items() if name != "effects"}
    return values if now.ice else {name: value for name, value in values.items() if name != "ice"}


def compact(value: object) -> str:
    """Return JSON without white space."""
    return msgspec.json.encode(value).decode()


def _cell(cell: Cell) -> dict[str, object]:
    xs, ys = [x for x, _ in cell.polygon], [y for _, y in cell.polygon]
    return {
        "name": cell.name,
        "centre_m": tenths(cell.centre),
        "east_m": tenths((min(xs), max(xs))),
        "north_m": tenths((min(ys), max(ys))),
    }


def tenths(values: Iterable[float]) -> list[float]:
    """Return numbers rounded to a tenth, with 0.0 for -0.0."""
    return [round(value, 1) + 0.0 for value in values]


# -- commands


def _commands(brief: Brief) -> list[str]:
    return [line for resource in brief.resources for line in _resource(resource)]


def _resource(resource: Resource) -> Iterator[str]:
    own = "yours" if resource.embodied else "not yours, but you may command it; others may too, and the first wins"
    yield f"- `{resource.id}`: {resource.type}, {own}{_properties(resource)}"
    yield from (f"  camera `{camera.name}`: {_camera(camera)}" for camera in resource.cameras)
    band = altitude_band(resource.properties)
    for verb in resource.verbs:
        if verb.name != PHOTO or resource.cameras:
            arguments = ", ".join(_argument(resource, verb, spec) for spec in verb.arguments)
            yield f"  {verb.name}({arguments}): {_meaning(verb, band)}"


def _properties(resource: Resource) -> str:
    measures = [
        f"{name} {value:g}"
        for name, value in resource.properties.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and name not in _TOLD
    ]
    return f" ({', '.join(measures)})" if measures else ""


def _camera(camera: CameraSpec) -> str:
    each = ", a picture comes at every tick by itself" if camera.capture == "each_tick" else ""
    depth = ", with depth" if "depth" in camera.channels else ""
    size = f"{camera.width}x{camera.height} px, {camera.hfov_deg:g} degrees wide{depth}"
    return f"looks {_VIEWS[camera.view]}, {size}{each}"


def _argument(resource: Resource, verb: VerbSpec, spec: ArgumentSpec) -> str:
    if spec.unit == "name":
        mounts = "|".join(camera.name for camera in resource.cameras)
        return f"{spec.name}: {mounts if verb.name == PHOTO else 'name'}{_left_out(spec)}"
    low, high = argument_bounds(spec, resource.properties)
    bounds = f" {low:g} to {high:g}" if math.isfinite(low) and math.isfinite(high) else ""
    unit = _UNITS.get(spec.unit, spec.unit)
    return f"{spec.name}:{bounds}{f' {unit}' if unit else ''}{_left_out(spec)}"


def _left_out(spec: ArgumentSpec) -> str:
    if spec.default is not None:
        return f", {spec.default:g} if left out"
    return ", may be left out" if spec.optional else ""


def _meaning(verb: VerbSpec, band: tuple[float, float] | None) -> str:
    """Return the meaning of a verb in the words of its type or of its engine."""
    meaning = verb.doc or _RESERVED.get(verb.name) or _MOTIONS[verb.motion]
    if verb.motion in ("up", "down") and band is not None:
        meaning += f"; ends at the band, elevation {band[1] if verb.motion == 'up' else band[0]:g} m"
        if verb.motion == "down":
            meaning += ", or just above what lies below"
    if verb.name == _TAKEOFF and band is not None:
        meaning += f"; ends inside of the band, elevation {band[0]:g} to {band[1]:g} m"
    return meaning


_TAKEOFF = "takeoff"
"""The verb of a climb from the ground (the paper's Table R1). Its bounds count from there."""

_RESERVED: Mapping[str, str] = {
    STOP: "ends what it is doing; is taken while it is busy",
    PHOTO: "takes a picture, which comes with the next observation (the first camera if none is named)",
}
_MOTIONS: Mapping[VerbMotion, str] = {
    "": "see its arguments",
    "straight": "goes straight to the place",
    "route": "goes to the place by a way of its own",
    "step": "moves so far",
    "up": "rises",
    "down": "sinks",
    "turn": "turns",
}
"""The meanings of verbs without words of their type or engine, by motion."""


_EXTENTS: Mapping[str, str] = {
    "bridge_fracture": "the missing stretch, from edge to edge of the deck",
    "building_fire": "the flames, without smoke and scorched roof",
    "delivery_door": "the entrance: door, frame and what stands beside it",
    "fire_source": "the flames, without smoke",
    "person_in_water": "the body with its limbs, without foam",
    "pipeline_leak": "the spray from the pipe to its far end, without wet ground; its position is on the pipe",
    "reference_building": "the whole building",
}
"""The extent of the true boxes of the shipped missions' classes, as their pictures show it."""


# -- messages


def _messages(brief: Brief) -> Iterator[str]:
    for message in sendable(brief):
        fields = "; ".join(
            f"{field.name}{' (may be left out)' if field.optional else ''}: {field_values(brief, field)}"
            for field in message.fields
        )
        yield f"- {message.kind} ({message.category}): {{{fields}}}{_to(brief, message)}"


def _extents(brief: Brief) -> Iterator[str]:
    """Yield the extent of the boxes that reports may contain."""
    if any(field.type == "box" for message in sendable(brief) for field in message.fields):
        known = [f"{name}: {_EXTENTS[name]}" for name in brief.classes if name in _EXTENTS]
        if known:
            yield f"A true box encloses what is visible of the thing, cut at the picture's edge. {'; '.join(known)}."


def _others(brief: Brief) -> Iterator[str]:
    """Yield the kinds of message that this agent may receive, with the agents that may send them to it."""
    for message in brief.messages:
        senders = _senders(brief, message)
        if senders:
            fields = ", ".join(f"{field.name}{'?' * field.optional}" for field in message.fields)
            yield f"- {message.kind} ({message.category}) from {', '.join(senders)}: {fields}"


def _senders(brief: Brief, message: MessageSpec) -> list[str]:
    """Return the agents from which a kind of message can come to this agent: under a hub, the hub alone speaks to the
    others."""
    reaching = [peer for peer in brief.peers if brief.hub in (None, brief.agent, peer.id)]
    is_received = brief.hub == brief.agent or message.is_for(brief.role)
    return [peer.id for peer in reaching if is_received and message.is_sent_by(peer.role)]


def _to(brief: Brief, message: MessageSpec) -> str:
    if brief.hub != brief.agent:
        return ""
    names = recipients(brief, message)
    return f"; `to`: some of {', '.join(names)}" if names else "; only the adjudicator receives it"


def _speech(brief: Brief) -> Iterator[str]:
    if not sendable(brief):
        yield "nothing: answer with an empty list of messages."
        return
    late = f"{brief.delay_ticks} tick{'s' * (brief.delay_ticks != 1)} later"
    if not brief.peers:
        yield "No other agent is there: leave `to` empty; reports reach the adjudicator."
    elif brief.hub is None:
        yield f"Every message reaches all other agents {late}; leave `to` empty."
    elif brief.hub == brief.agent:
        yield (
            f"You are the hub: the messages of all others reach you alone, and others receive only yours, {late}. "
            "Nothing is passed on by itself. Name the recipients of each message in `to`."
        )
    else:
        yield f"Every message goes to `{brief.hub}` alone ({late}); it decides what to tell others. Leave `to` empty."
    far = f", and reaches only bodies within {brief.range_m:g} m" if brief.range_m is not None else ""
    lost = f", and is lost with probability {brief.loss:g}" if brief.loss else ""
    yield f"A message holds at most {brief.payload_bytes} bytes{far}{lost}."
