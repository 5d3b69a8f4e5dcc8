"""The moments that explain an episode, and the distribution of a film's seconds over its boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lingjing.analysis.families import attribute
from lingjing.trace.reader import Trace
from lingjing.viewer.steps import ViewStep, shorten

MOST = 8
"""Most moments of a film. Chosen."""

HOLD_S = 1.2
"""Time for which the film stops at a moment, seconds. Chosen. It is shortened so that all stops together take at most
half of the film."""

_WEIGHTS = {"bad": 3.0, "good": 2.0}
"""Weight of a moment by kind, for the choice among too many. A step that raises the score has one more. Chosen."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The caption of one step."""

    place: int
    """Number of the step, from 0."""
    kind: str
    """`good` or `bad`."""
    text: str


def moments(steps: Sequence[ViewStep], trace: Trace, *, truth: bool, most: int = MOST) -> tuple[Moment, ...]:
    """Return at most `most` moments in order of time.

    Moments are steps with incidents, substituted decisions or adjudicated events. With `truth`, the evidence of a lost
    episode's failure family is included (`lingjing.analysis.families`).
    """
    weighted: list[tuple[float, Moment]] = []
    for place, step in enumerate(steps):
        events = [event for event in step.events if event.kind != "plain"]
        if events:
            kind = "bad" if any(event.kind == "bad" for event in events) else "good"
            rest = f" · and {len(events) - 2} more" if events[2:] else ""
            text = " · ".join(event.text for event in events[:2]) + rest
            gained = place > 0 and step.score > steps[place - 1].score
            weighted.append((_WEIGHTS[kind] + gained, Moment(place, kind, text)))
    places = {step.tick: place for place, step in enumerate(steps)}
    blame = attribute(trace) if truth else None
    for link in blame.chain if blame is not None else ():
        if link.tick in places:
            word = blame.family.replace("_", " ") if blame is not None else ""
            weighted.append((4.0, Moment(places[link.tick], "bad", f"{word}: {shorten(link.text, 160)}")))
    chosen = sorted(weighted, key=lambda pair: (-pair[0], pair[1].place))[:most]
    return tuple(sorted((moment for _, moment in chosen), key=lambda moment: moment.place))


def schedule(steps: int, stops: Sequence[Moment], seconds: float, rate: int) -> list[float]:
    """Return the (fractional) number of the step at each frame: uniform motion with stops at the moments.

    `seconds` is the length of this part of the film, `rate` its frames per second.
    """
    places = sorted({moment.place for moment in stops})
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
    numbers: list[float] = np.interp(np.linspace(0.0, seconds, frames), times, at).tolist()
    return numbers
