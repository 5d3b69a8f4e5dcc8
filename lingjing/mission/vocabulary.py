"""Words of missions, commands and messages that several packages must spell alike."""

from __future__ import annotations

from typing import Literal

CommunicationMode = Literal["star", "broadcast", "single"]
"""A communication mode."""

MODES: tuple[CommunicationMode, ...] = ("star", "broadcast", "single")
"""Values of `mode` in a mission and of `--mode` on the command line; a mission has some of them."""

EVERYONE = "all"
"""The word for every role among a message's senders or recipients."""

PORTRAIT = "portrait"
"""The property with the distance from which an entity's reference picture is taken."""

PHOTO = "takePhoto"
"""The verb that requests a picture from a camera; the kernel routes it to the camera engine."""

STOP = "stop"
"""The verb that ends a body's present action; the only one that is admitted while the body is busy."""

VerbMotion = Literal["", "straight", "route", "step", "up", "down", "turn"]
"""Motions of a verb's body, as the body's engine declares them (`lingjing.mission.kinds_format.VerbKind`).

`straight`, or along a `route` that the engine plans: to the place in the arguments `x`, `y` (and `z`). A `step` along
or across its heading, `up` or `down`: by the first argument. A `turn` changes its heading. "": none of these.
"""

DORMANT = "dormant"
"""The status of an entity that has not appeared yet or has vanished. It is not drawn, hit or observed."""

CLEARED = "cleared"
"""The status of a road blockage that has been removed."""

UNLOCK = "unlock."
"""Prefix of the kernel's own command for an interaction: `unlock.rescue`."""

ARRIVED, COLLIDED, BATTERY_EMPTY, FUEL_EMPTY = "arrived", "collided", "battery_empty", "fuel_empty"
FELL, DROWNED = "fell", "drowned"
ENGINE_EVENTS = (ARRIVED, COLLIDED, BATTERY_EMPTY, FUEL_EMPTY, FELL, DROWNED)
"""Events that engines report in every mission; an interaction cannot have one of these names."""

AMOUNT = "amount"
"""Field of an interaction's event with the transferred amount, with the unit of the state (`amount_kg`; `amount` for a
bare number)."""
LEFT = "left"
"""Field of that event with the amount that the target still has, or still lacks, with the same unit."""

BEHAVIOURS = {
    "flee": ("from", "speed", "within"),
    "wander": ("in", "speed"),
    "follow": ("of", "speed", "distance"),
}
"""Behaviours of targets → the properties that each has."""
MOTION = ("speed", "cruise", "acceleration", "braking", "drift")
"""Properties that an observer can derive from a body's motion: they affect its position and the end of its commands."""
