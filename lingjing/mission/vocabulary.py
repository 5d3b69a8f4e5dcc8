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

UNLOCK = "unlock."
"""What the kernel's own command for an interaction begins with: `unlock.rescue`."""

MOTION = ("speed", "cruise", "acceleration", "braking", "drift")
"""Properties that show in how a body moves, so in where it is and in when its commands end."""
