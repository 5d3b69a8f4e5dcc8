"""The brief in words for the system text: the commands, the messages, and the facts that are known from the start.

All numbers come from the brief and are those that the kernel enforces. These facts follow every prompt.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import msgspec

from lingjing.plugins.decisions import altitude_band, argument_bounds, field_values, recipients, sendable
from lingjing.plugins.languages import Phrases, phrases
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
_UNITS = {"deg": "degrees", "mps": "m/s"}
"""Units in words, where they differ from the sign."""
_TOLD = ("length_m", "width_m", "height_m")
"""Measures of a body that are left out, because no decision needs them."""


def interface(brief: Brief) -> str:
    """Return the facts of a brief, in sections."""
    say = phrases_of(brief)
    nothing = [say("nothing: you only send messages; answer with command null.")]
    sections = (
        ("YOU MAY COMMAND", _commands(brief, say) or nothing),
        ("YOU MAY SEND", [*_messages(brief, say), *_extents(brief, say), *_speech(brief, say)]),
        ("YOU MAY RECEIVE", list(_others(brief, say))),
        ("KNOWN FROM THE START", [compact(known(brief))]),
    )
    return "\n\n".join(f"{say(head)}\n" + "\n".join(lines) for head, lines in sections if lines)


def phrases_of(brief: Brief) -> Phrases:
    """Return the texts of `react` in the language of the brief."""
    return phrases(brief.language, __package__)


def rules(brief: Brief) -> str:
    """Return the mission's rules, one a line."""
    say = phrases_of(brief)
    lines = [say("- {sentence}.", sentence=sentence) for sentence in brief.local_rules or brief.rules]
    return "\n".join(lines) or say("- none are told.")


def goal_text(brief: Brief) -> str:
    """Return the goal with everything that ends the mission as a failure."""
    say = phrases_of(brief)
    late = say("The mission is lost if it is not won within {ticks} ticks", ticks=brief.ticks)
    sentences = (*(brief.local_failures or brief.failures), late)
    ended = (say("{sentence}.", sentence=f"{sentence[0].upper()}{sentence[1:]}") for sentence in sentences)
    return say.text(" ").join((brief.goal, *ended))


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


def _commands(brief: Brief, say: Phrases) -> list[str]:
    return [line for resource in brief.resources for line in _resource(resource, say)]


def _resource(resource: Resource, say: Phrases) -> Iterator[str]:
    own = say("yours" if resource.embodied else "not yours, but you may command it; others may too, and the first wins")
    yield f"- `{resource.id}`: {resource.type}, {own}{_properties(resource)}"
    for camera in resource.cameras:
        yield say("  camera `{name}`: {words}", name=camera.name, words=_camera(camera, say))
    band = altitude_band(resource.properties)
    for verb in resource.verbs:
        if verb.name != PHOTO or resource.cameras:
            arguments = ", ".join(_argument(resource, verb, spec, say) for spec in verb.arguments)
            yield f"  {verb.name}({arguments}): {_meaning(verb, band, say)}"


def _properties(resource: Resource) -> str:
    measures = [
        f"{name} {value:g}"
        for name, value in resource.properties.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and name not in _TOLD
    ]
    return f" ({', '.join(measures)})" if measures else ""


def _camera(camera: CameraSpec, say: Phrases) -> str:
    words = say(
        "looks {view}, {width}x{height} px, {wide:g} degrees wide",
        view=say(_VIEWS[camera.view]), width=camera.width, height=camera.height, wide=camera.hfov_deg,
    )  # fmt: skip
    depth = say(", with depth") if "depth" in camera.channels else ""
    each = say(", a picture comes at every tick by itself") if camera.capture == "each_tick" else ""
    return words + depth + each


def _argument(resource: Resource, verb: VerbSpec, spec: ArgumentSpec, say: Phrases) -> str:
    if spec.unit == "name":
        mounts = "|".join(camera.name for camera in resource.cameras)
        return f"{spec.name}: {mounts if verb.name == PHOTO else say('name')}{_left_out(spec, say)}"
    low, high = argument_bounds(spec, resource.properties)
    finite = math.isfinite(low) and math.isfinite(high)
    bounds = say(" {low:g} to {high:g}", low=low, high=high) if finite else ""
    unit = say(_UNITS.get(spec.unit, spec.unit))
    return f"{spec.name}:{bounds}{f' {unit}' if unit else ''}{_left_out(spec, say)}"


def _left_out(spec: ArgumentSpec, say: Phrases) -> str:
    if spec.default is not None:
        return say(", {default:g} if left out", default=spec.default)
    return say(", may be left out") if spec.optional else ""


def _meaning(verb: VerbSpec, band: tuple[float, float] | None, say: Phrases) -> str:
    """Return the meaning of a verb in the words of its type or of its engine."""
    meaning = say.text(verb.doc or _RESERVED.get(verb.name) or _MOTIONS[verb.motion])
    if verb.motion in ("up", "down") and band is not None:
        meaning += say("; ends at the band, elevation {elevation:g} m", elevation=band[verb.motion == "up"])
        if verb.motion == "down":
            meaning += say(", or just above what lies below")
    if verb.name == _TAKEOFF and band is not None:
        meaning += say("; ends inside of the band, elevation {low:g} to {high:g} m", low=band[0], high=band[1])
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


def _messages(brief: Brief, say: Phrases) -> Iterator[str]:
    optional = say(" (may be left out)")
    for message in sendable(brief):
        fields = "; ".join(
            f"{field.name}{optional if field.optional else ''}: {field_values(brief, field)}"
            for field in message.fields
        )
        yield f"- {message.kind} ({message.category}): {{{fields}}}{_to(brief, message, say)}"


def _extents(brief: Brief, say: Phrases) -> Iterator[str]:
    """Yield the extent of the boxes that reports may contain."""
    if any(field.type == "box" for message in sendable(brief) for field in message.fields):
        known = [f"{name}: {say(_EXTENTS[name])}" for name in brief.classes if name in _EXTENTS]
        if known:
            extents = say.text("; ").join(known)
            yield say(
                "A true box encloses what is visible of the thing, cut at the picture's edge. {extents}.",
                extents=extents,
            )


def _others(brief: Brief, say: Phrases) -> Iterator[str]:
    """Yield the kinds of message that this agent may receive, with the agents that may send them to it."""
    for message in brief.messages:
        senders = _senders(brief, message)
        if senders:
            fields = ", ".join(f"{field.name}{'?' * field.optional}" for field in message.fields)
            yield say(
                "- {kind} ({category}) from {senders}: {fields}",
                kind=message.kind, category=message.category, senders=", ".join(senders), fields=fields,
            )  # fmt: skip


def _senders(brief: Brief, message: MessageSpec) -> list[str]:
    """Return the agents from which a kind of message can come to this agent: under a hub, the hub alone speaks to the
    others."""
    reaching = [peer for peer in brief.peers if brief.hub in (None, brief.agent, peer.id)]
    is_received = brief.hub == brief.agent or message.is_for(brief.role)
    return [peer.id for peer in reaching if is_received and message.is_sent_by(peer.role)]


def _to(brief: Brief, message: MessageSpec, say: Phrases) -> str:
    if brief.hub != brief.agent:
        return ""
    names = recipients(brief, message)
    return (
        say("; `to`: some of {names}", names=", ".join(names)) if names else say("; only the adjudicator receives it")
    )


def _speech(brief: Brief, say: Phrases) -> Iterator[str]:
    if not sendable(brief):
        yield say("nothing: answer with an empty list of messages.")
        return
    late = say("1 tick later") if brief.delay_ticks == 1 else say("{ticks} ticks later", ticks=brief.delay_ticks)
    if not brief.peers:
        yield say("No other agent is there: leave `to` empty; reports reach the adjudicator.")
    elif brief.hub is None:
        yield say("Every message reaches all other agents {late}; leave `to` empty.", late=late)
    elif brief.hub == brief.agent:
        yield say(
            "You are the hub: the messages of all others reach you alone, and others receive only yours, {late}. "
            "Nothing is passed on by itself. Name the recipients of each message in `to`; an empty list is all of "
            "them.",
            late=late,
        )
    else:
        yield say(
            "Every message goes to `{hub}` alone ({late}); it decides what to tell others. Leave `to` empty.",
            hub=brief.hub, late=late,
        )  # fmt: skip
    far = say(", and reaches only bodies within {range:g} m", range=brief.range_m) if brief.range_m is not None else ""
    lost = say(", and is lost with probability {loss:g}", loss=brief.loss) if brief.loss else ""
    yield say("A message holds at most {bytes} bytes{far}{lost}.", bytes=brief.payload_bytes, far=far, lost=lost)
