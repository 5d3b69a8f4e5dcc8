"""Feasibility: proofs that a mission cannot be won, from lower bounds that hold whatever the policies do.

Three answers: *proved infeasible* (a `Proof` with the numbers), *feasible* and *unknown*; the last two are silent.
Bounds are sound: a straight line at top speed with allowances for wind, current and overshoot, the nearest point of a
region for a drawn place, all cameras at their best. So a mission that anybody can win is never called infeasible.

In the order of the work:

- `proof`: the result, and comparisons with slack. `spread`: places and numbers before the seed is known.
- `motion`: ceilings of speed and flight time. `outline`: a mission (every seed) or an instance (one) as checks see it.
- `condition_needs`: a condition → the tree of what must have happened (`needs`). `limits`: the time there is for it.
- `travel`, `tour`: time and energy of one visit and of several. `seeing`: pictures. `speech`: messages and
  assignments. `payload`: loads and trips. `counting`: counted budgets. `order`: circles. `placing`: room for draws.
  `standing`: where assets begin. `overlaps`: those that begin in one place.
- `wide`: pictures from orbit in which the scene is lost, no proof but a hint.
- `refutation`: the checks over one tree. `start`: whether success holds before anybody acts, no proof but a
  hint. Here: over success, in each mode.

Only what success needs counts: a stage that nobody can end matters where its own budget of ticks would end the episode
before success can hold. Missions are judged at their default settings, in each of their modes; a setting is judged by
its instance. Pictures from below an asset's altitude band do not count (on the way up one may be taken by chance).
"""

from __future__ import annotations

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission import model
from lingjing.mission.evaluate import number
from lingjing.mission.feasibility.condition_needs import needs, some_member
from lingjing.mission.feasibility.limits import TimeLimit, episode, of_stage
from lingjing.mission.feasibility.needs import Need
from lingjing.mission.feasibility.order import refute_order
from lingjing.mission.feasibility.outline import ENTITIES_MOST, Outline, of_instance, of_mission, too_large
from lingjing.mission.feasibility.overlaps import OVERLAP, refute_overlaps
from lingjing.mission.feasibility.placing import refute_places
from lingjing.mission.feasibility.proof import Proof, gathered
from lingjing.mission.feasibility.refutation import refute
from lingjing.mission.feasibility.standing import refute_standing
from lingjing.mission.instance import Instance

__all__ = ["Proof", "prove", "prove_instance", "prove_outline"]


def prove(mission: model.Mission) -> tuple[Proof, ...]:
    """Why the mission cannot be won at its default settings, for any seed, in one or more of its modes.

    A proof is `partly` one where the mission can be won in another mode for all that is known.
    Nothing if that is not proved: also for a mission that cannot be evaluated, or is too large to be looked at.
    """
    modes = mission.modes.allowed
    found: dict[Proof, list[str]] = {}
    lost: set[str] = set()
    for mode in modes:
        try:
            if too_large(mission, mode):
                return ()
            outline = of_mission(mission, mode)
        except LingjingError:
            continue
        for proof in prove_outline(outline):
            if proof.code == OVERLAP and mission.origin.places:
                continue  # bodies of an imported document are kept apart when the city is there
            found.setdefault(proof, []).append(mode)
            lost.add(mode)
    return tuple(_in_modes(proof, where, modes, len(lost)) for proof, where in found.items())


def prove_instance(instance: Instance) -> tuple[Proof, ...]:
    """Why this instance (seed, mode and settings) cannot be won; nothing if that is not proved."""
    return () if len(instance.entities) > ENTITIES_MOST else prove_outline(of_instance(instance))


def prove_outline(outline: Outline) -> tuple[Proof, ...]:
    """All checks over one outline; what is proved of several members of a group is said once."""
    places = [*refute_places(outline), *refute_standing(outline), *refute_overlaps(outline)]
    if places:
        return gathered(places)
    success = needs(outline.instance.success, outline, "success")
    whole = episode(outline)
    return gathered([*refute_order(outline), *refute(success, whole, outline, "success"), *_stages(outline, success)])


def _stages(outline: Outline, success: Need) -> list[Proof]:
    """Stages that nobody can end within their own budget, which ends the episode before success can hold; of those
    that begin at once."""
    found = []
    followers = {r.target for r in outline.instance.relations if r.kind == "dependency"}
    for stage in outline.instance.stages:
        if stage.ticks is None or stage.name in followers:
            continue
        at, own = f"stage/{stage.name}", _own(stage, outline)
        need = some_member(stage.condition, stage.variable, stage.domain, outline, at)
        late = refute(need, own, outline, at)
        if late and own.ticks < outline.ticks and refute(success, own, outline, "success"):
            found.extend(late)
    return found


def _own(stage: model.Stage, outline: Outline) -> TimeLimit:
    if stage.ticks is None:
        return episode(outline)
    try:
        return of_stage(outline, stage.name, number(stage.ticks, outline.scope))
    except LingjingError:
        return episode(outline)


def _in_modes(proof: Proof, where: list[str], modes: tuple[str, ...], lost: int) -> Proof:
    """The proof with the modes it holds in, if the mission has others; `lost` modes cannot be won at all."""
    if len(where) == len(modes):
        return proof
    message = f"in {' and '.join(where)} mode, {proof.message}"
    return msgspec.structs.replace(proof, message=message, partly=lost < len(modes))
