"""Words that missions, commands and messages are made of and that several packages must spell alike."""

from __future__ import annotations

from typing import Literal

CommunicationMode = Literal["star", "broadcast", "single"]
"""A communication mode."""

MODES: tuple[CommunicationMode, ...] = ("star", "broadcast", "single")
"""What `mode` in a mission and `--mode` on the command line take; a mission says which of them it has."""

EVERYONE = "all"
"""In place of a role among a message's senders or recipients: whoever there is."""

PHOTO = "takePhoto"
"""The verb that asks a camera for a picture; the kernel routes it to the camera engine instead of its own engine."""

STOP = "stop"
"""The verb that ends what a body is doing; the only one that is admitted while the body is busy."""

VerbMotion = Literal["", "straight", "route", "step", "up", "down", "turn"]
"""How a verb moves its body, as the body's engine declares (`lingjing.mission.kinds_format.VerbKind`).

`straight` or by a `route` of the engine's it goes to the place that the arguments `x`, `y` (and `z`) name. By a `step`
along or across its heading, `up` or `down` it goes as far as the first argument says. By a `turn` it changes its
heading. "" is a verb that does none of these.
"""

UNLOCK = "unlock."
"""What the kernel's own command for an interaction begins with: `unlock.rescue`."""

ARRIVED, COLLIDED, BATTERY_EMPTY, FUEL_EMPTY = "arrived", "collided", "battery_empty", "fuel_empty"
FELL, DROWNED = "fell", "drowned"
ENGINE_EVENTS = (ARRIVED, COLLIDED, BATTERY_EMPTY, FUEL_EMPTY, FELL, DROWNED)
"""Events that engines tell by themselves, whatever the mission: no interaction is called so."""

AMOUNT, LEFT = "amount", "left"
"""What the event of an interaction that moves goods says, in the unit of the state that is moved (`amount_kg`; `amount`
for a bare number): how much changed hands, and how much of it the target still has, or still wants."""

MOTION = ("speed", "cruise", "acceleration", "braking", "drift")
"""Properties that show in how a body moves, so in where it is and in when its commands end."""
