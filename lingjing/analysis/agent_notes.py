"""`agent_notes`: the notes in the agents' thoughts, such as a condition that a policy has no way to work towards."""

from __future__ import annotations

from lingjing.terminal import visible
from lingjing.trace.reader import Trace
from lingjing.trace.records import NOTE

_MOST, _LETTERS = 8, 400
"""Greatest number of notes, and of letters of one. Chosen: a policy's text must not fill the terminal."""


def agent_notes(trace: Trace) -> list[str]:
    """Return each different note once, after the agents that have it, in the order of their first appearance."""
    agents: dict[str, dict[str, None]] = {}
    for record in trace.boundaries:
        for entry in record.decisions:
            for line in entry.decision.thought.splitlines():
                if line.startswith(NOTE):
                    text = visible(line.removeprefix(NOTE).strip())[:_LETTERS]
                    agents.setdefault(text, {})[entry.agent] = None
    lines = [f"{', '.join(f'`{name}`' for name in names)}: {text}" for text, names in agents.items()]
    more = len(lines) - _MOST
    return lines if more <= 0 else [*lines[:_MOST], f"and {more} more notes in the agents' thoughts"]
