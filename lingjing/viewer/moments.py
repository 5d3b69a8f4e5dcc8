"""The moments that explain an episode, and how a film's seconds are shared among its boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lingjing.analysis.families import attribute
from lingjing.trace.reader import Trace
from lingjing.viewer.steps import ViewStep, clipped

MOST = 8
"""Moments of a film."""

HOLD_S = 1.2
"""A moment stands still for so long; less where there are so many that half of the film would stand."""

_WEIGHTS = {"bad": 3.0, "good": 2.0}
"""What is told first where there are too many; a step that raises the score counts one more."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What mattered at one step: its place among the steps, `good` or `bad`, and words."""

    place: int
    kind: str
    text: str


def moments(steps: Sequence[ViewStep], trace: Trace, *, truth: bool, most: int = MOST) -> tuple[Moment, ...]:
    """At most `most` moments in order of time: crashes and replaced answers, what the mission is about, and, with
    `truth`, the records that show a lost episode's failure family (`lingjing.analysis.families`)."""
    found: list[tuple[float, Moment]] = []
    for place, step in enumerate(steps):
        told = [event for event in step.events if event.kind != "plain"]
        if told:
            kind = "bad" if any(event.kind == "bad" for event in told) else "good"
            text = " · ".join(event.text for event in told[:2]) + (f" · and {len(told) - 2} more" if told[2:] else "")
            gained = place > 0 and step.score > steps[place - 1].score
            found.append((_WEIGHTS[kind] + gained, Moment(place, kind, text)))
    places = {step.tick: place for place, step in enumerate(steps)}
    blame = attribute(trace) if truth else None
    for link in blame.chain if blame is not None else ():
        if link.tick in places:
            word = blame.family.replace("_", " ") if blame is not None else ""
            found.append((4.0, Moment(places[link.tick], "bad", f"{word}: {clipped(link.text, 160)}")))
    kept = sorted(found, key=lambda one: (-one[0], one[1].place))[:most]
    return tuple(sorted((moment for _, moment in kept), key=lambda one: one.place))


def schedule(steps: int, told: Sequence[Moment], seconds: float, rate: int) -> list[float]:
    """The place among the steps at each frame of the played part: even motion, standing still at the moments."""
    places = sorted({moment.place for moment in told})
    hold = min(HOLD_S, seconds / 2 / max(1, len(places)))
    moving = max(seconds - hold * len(places), 0.0)
    times, at = [0.0], [0.0]
    for place in places:
        arrived = times[-1] + (place - at[-1]) / max(1, steps - 1) * moving
        times += [arrived, arrived + hold]
        at += [float(place), float(place)]
    times.append(max(seconds, times[-1]))
    at.append(float(max(0, steps - 1)))
    frames = max(2, round(seconds * rate))
    found: list[float] = np.interp(np.linspace(0.0, seconds, frames), times, at).tolist()
    return found
