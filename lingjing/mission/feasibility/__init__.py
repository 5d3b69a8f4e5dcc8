"""Feasibility: proofs that a mission cannot be won, from lower bounds that hold for every policy.

A check has three results: *proved infeasible* (a `Proof` with the numbers), *feasible* and *unknown*. Only the first is
reported. Bounds are sound: a straight line at top speed with allowances for wind, current and overshoot, the nearest
point of a region for a drawn place, all cameras at their best. A mission that can be won is never called infeasible.

Concepts. A check refutes a need of `lingjing.mission.conditions` by arithmetic over an `Outline`.

Modules in control-flow order:

- `proof`: the result, and comparisons with slack. `limits`: the available time.
- `travel`, `tour`: time and energy of one visit and of several. `seeing`: pictures. `payload`: loads and trips.
  `counting`: counted budgets. `message_size`: the smallest message of a kind. `start_places`: errors in start
  positions.
- `refutation`: all checks of one tree of needs, with those of messages and assignments.
- `steps`, `truths`: macro-steps at which a condition may hold or certainly holds. `condition_values`, `over_time`,
  `comparisons`, `readings`: values, functions over time, comparisons and whole conditions in this form.
- `moments`: the earliest moments of the facts that they wait for. `arrivals`: commands and motion. `presence`: events,
  and targets that appear and vanish. `reports`: pictures and messages. `milestones`: interactions, rules and
  assignments, and so all facts. `deadlines`: success after the episode's end.
- `start`: missions that are won or lost at the start. `wide`, `order`: hints, not proofs: satellite pictures much
  wider than the scene, stages that wait for each other.

Only needs of success count. A stage that cannot end matters if its own budget of ticks ends the episode before success
can hold. Missions are checked at their default settings and at their tiers, in each of their modes; other settings are
checked when their instance is made. A param that each seed draws takes each of its values; with too many values, or
with a draw from a continuous range, its bounds stand for them (`lingjing.mission.conditions.drawn_params`). Pictures
from below an asset's altitude band do not count, because a climb passes through these altitudes only by chance.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission import model
from lingjing.mission.conditions.condition_needs import needs, some_member
from lingjing.mission.conditions.drawn_params import cases, open_reason
from lingjing.mission.conditions.needs import Need
from lingjing.mission.conditions.outline import ENTITIES_MOST, Outline, Outlines, of_instance, too_large
from lingjing.mission.evaluate import number
from lingjing.mission.feasibility.deadlines import deadline
from lingjing.mission.feasibility.limits import TimeLimit, episode, of_stage
from lingjing.mission.feasibility.proof import Proof, gathered
from lingjing.mission.feasibility.refutation import refute
from lingjing.mission.feasibility.start import lost_at_boundary_0
from lingjing.mission.feasibility.start_places import OVERLAP, refute_overlaps, refute_places, refute_standing
from lingjing.mission.instance import Instance
from lingjing.mission.tiers import settings_of_tier, tiers_of

__all__ = ["Proof", "prove", "prove_instance", "prove_outline", "unproved"]


def prove(mission: model.Mission, outlines: Outlines | None = None) -> tuple[Proof, ...]:
    """Proofs that the mission cannot be won at its default settings, or at one of its tiers, for any seed, in at least
    one of its modes. The lowest tier that cannot be won is proved.

    A proof is `partly` one if it does not hold in the mission's own mode. The result is empty if nothing is proved, if
    the mission cannot be evaluated, or if it is too large. `outlines` of the mission are read and completed.
    """
    outlines = outlines or Outlines(mission)
    for tier in tiers_of(mission):
        proofs = _at_tier(outlines, tier)
        if proofs:
            return proofs
    return ()


def _at_tier(outlines: Outlines, tier: int) -> tuple[Proof, ...]:
    mission = outlines.mission
    modes = mission.modes.allowed
    modes_of_proof: dict[Proof, list[str]] = {}
    lost: set[str] = set()
    for mode in modes:
        try:
            if too_large(mission, mode):
                return ()
            proofs = _of_every_draw(outlines, mode, settings_of_tier(mission, tier, mode))
        except LingjingError:
            continue
        for proof in proofs:
            modes_of_proof.setdefault(proof, []).append(mode)
            lost.add(mode)
    partly = mission.modes.default not in lost
    proofs = tuple(_in_modes(proof, where, modes, partly=partly) for proof, where in modes_of_proof.items())
    if tier == 0:
        return proofs
    return tuple(msgspec.structs.replace(proof, message=f"at tier {tier}, {proof.message}") for proof in proofs)


def _of_every_draw(outlines: Outlines, mode: str, settings: Mapping[str, float]) -> tuple[Proof, ...]:
    """Proofs for each possible value of the drawn params: those of the first case if all have some, else none. The
    `settings` are fixed."""
    first: tuple[Proof, ...] = ()
    mission = outlines.mission
    for case in cases(mission, mode):
        wide = {name: bounds for name, bounds in (case.wide or {}).items() if name not in settings}
        proofs = prove_outline(outlines.of(mode, {**case.settings, **settings}, wide))
        # bodies of an imported document are kept apart when the city is there
        kept = tuple(proof for proof in proofs if not (proof.code == OVERLAP and mission.origin.places))
        if not kept:
            return ()
        first = first or kept
    return first


def unproved(mission: model.Mission) -> tuple[Proof, ...]:
    """A note for a mission with drawn params of which nothing is proved, with the reason."""
    if not any(param.is_drawn for param in mission.parameters):
        return ()
    reason = next((words for mode in mission.modes.allowed if (words := open_reason(mission, mode))), "")
    if not reason:
        return ()
    message = f"nothing is proved about winning this mission before a seed is drawn: {reason}"
    return (Proof("LJ0615", "success", message, "`lingjing run` checks each drawn instance"),)


def prove_instance(instance: Instance) -> tuple[Proof, ...]:
    """Proofs that this instance (seed, mode and settings) cannot be won; empty if nothing is proved."""
    return () if len(instance.entities) > ENTITIES_MOST else prove_outline(of_instance(instance))


def prove_outline(outline: Outline) -> tuple[Proof, ...]:
    """All checks of one outline. One proof stands for all members of a group."""
    places = [*refute_places(outline), *refute_standing(outline), *refute_overlaps(outline)]
    if places:
        return gathered(places)
    lost = lost_at_boundary_0(outline)
    if lost:
        return gathered(lost)
    timing, success = deadline(outline), needs(outline.instance.success, outline, "success")
    if timing.is_lost_at_start:
        return timing.proofs
    late = _stages(outline, success)
    limit = episode(outline) if late else timing.limit(outline)
    return gathered([*refute(success, limit, outline, "success"), *late] or timing.proofs)


def _stages(outline: Outline, success: Need) -> list[Proof]:
    """Proofs that a stage cannot end within its own budget, which ends the episode before success can hold. Only stages
    without a predecessor are checked."""
    proofs = []
    followers = {r.target for r in outline.instance.relations if r.kind == "dependency"}
    for stage in outline.instance.stages:
        if stage.ticks is None or stage.name in followers:
            continue
        at, own = f"stage/{stage.name}", _own(stage, outline)
        need = some_member(stage.condition, stage.variable, stage.domain, outline, at)
        late = refute(need, own, outline, at)
        if late and own.ticks < outline.ticks and refute(success, own, outline, "success"):
            proofs.extend(late)
    return proofs


def _own(stage: model.Stage, outline: Outline) -> TimeLimit:
    if stage.ticks is None:
        return episode(outline)
    try:
        return of_stage(outline, stage.name, number(stage.ticks, outline.scope))
    except LingjingError:
        return episode(outline)


def _in_modes(proof: Proof, where: list[str], modes: tuple[str, ...], *, partly: bool) -> Proof:
    """The proof with the modes in which it holds, if the mission has others."""
    if len(where) == len(modes):
        return proof
    message = f"in {' and '.join(where)} mode, {proof.message}"
    return msgspec.structs.replace(proof, message=message, partly=partly)
