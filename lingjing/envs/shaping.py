"""Potential-based shaping of rewards: F = γ Φ(s') - Φ(s), which leaves the optimal policies unchanged.

Source: Ng, Harada and Russell, "Policy invariance under reward transformations", ICML 1999. The potential of a terminal
state is 0. Along an episode that ends in a terminal state the discounted sum of F is therefore -Φ(s₀), whatever the
agents do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from lingjing.analysis.completion import sought_targets
from lingjing.mission.instance import Instance
from lingjing.trace.records import BodyState, FrameInfo, StageChange


class TargetPotential:
    """The potential of a boundary: minus the mean over the targets of half the distance and half the unseen ones.

    Only targets that the mission is about count, so that nothing is gained at a rival, which only resembles them. A
    target that has completed the last stage counts 0. An open target counts (d + u) / 2. d is its horizontal distance
    from the nearest asset, in units of `reach_m`, at most 1. u is 0 if a picture of the boundary shows it, else 1. The
    potential lies in [-1, 0]. It is computed from the truth, as a reward may be: no observation holds the distance.

    The distance is horizontal, as `distance_xy` in the missions: with height included, an aircraft would gain by
    descending, and a low camera sees little.
    """

    def __init__(self, instance: Instance, reach_m: float) -> None:
        self._assets = [entity.id for entity in instance.entities if entity.role == "asset"]
        sought = sought_targets(instance)
        self._targets = [entity.id for entity in instance.entities if entity.id in sought]
        self._last = instance.stages[-1].name if instance.stages else ""
        self._reach_m = reach_m
        self._done: set[str] = set()

    def restart(self) -> None:
        """Begin another episode."""
        self._done.clear()

    def note(self, changes: Iterable[StageChange]) -> None:
        """Take over the stages of a boundary."""
        self._done |= {change.subject for change in changes if change.stage == self._last}

    def of(self, states: Mapping[str, BodyState], frames: Iterable[FrameInfo]) -> float:
        """Return the potential of a boundary with these states and pictures."""
        assets = [states[name].position[:2] for name in self._assets if name in states]
        if not assets or not self._targets:
            return 0.0
        seen = {box.entity for frame in frames for box in frame.boxes}
        total = 0.0
        for name in self._targets:
            if name in states and name not in self._done:
                far_m = min(math.dist(states[name].position[:2], asset) for asset in assets)
                total += min(1.0, far_m / self._reach_m) / 2.0 + (0.0 if name in seen else 0.5)
        return -total / len(self._targets)


def shaped(before: float, after: float, discount: float, *, ended: bool) -> float:
    """Return F for a step from a state with the potential `before` to one with `after`, which counts 0 if terminal."""
    return discount * (0.0 if ended else after) - before


__all__ = ["TargetPotential", "shaped"]
