"""`Presence`: the moments of the mission's events, and the macro-steps at which a target is there.

Fact: `event` (name).
"""

from __future__ import annotations

from lingjing.mission.conditions.outline import Body
from lingjing.mission.feasibility.condition_values import Occurrences
from lingjing.mission.feasibility.moments import Moments, shown
from lingjing.mission.feasibility.proof import spelled
from lingjing.mission.feasibility.steps import NEVER, Steps
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    Moment,
    Quantity,
    Reason,
    earliest,
)
from lingjing.mission.kinds import engine_kind
from lingjing.mission.vocabulary import ENGINE_EVENTS


class Presence(Moments):
    """Events, and targets that appear and vanish."""

    def _event(self, name: str) -> Moment:
        """An event of the mission can have occurred."""
        event = next(each for each in self.outline.instance.events if each.name == name)
        if event.condition is not None:
            moment = self._at_boundary(self.truth(event.condition, {}), f"event/{name}")
        else:
            tick = self.outline.first_ticks.get(name, event.tick or 0)
            step = tick * self.clock.per_tick
            words = f"it occurs at {spelled(self.clock.time_s(step))} s"
            moment = Moment(step, Reason(lambda: words, "LJ0613", f"event/{name}") if step else None)
        return Moment(moment.step, moment.reason and moment.reason.behind(shown(("event", name))))

    def occurrences(self, name: str, body: Body | None) -> Occurrences | None:
        """The times of an event of the mission, or of an interaction of the engine `city`."""
        key: Quantity = ("count", name, body.id if body is not None else "*")
        event = next((each for each in self.outline.instance.events if each.name == name), None)
        if event is not None:
            moment = AT_ONCE if self._frozen else self.moment(("event", name))
            per_tick = self.clock.per_tick
            pause = (
                None
                if event.pause_s is None
                else max(per_tick, self.clock.boundary(self.clock.after(0, event.pause_s)))
            )
            timed = event.tick is not None and name not in self.outline.first_ticks
            certain = (event.tick or 0) * per_tick + per_tick if timed else NEVER
            return Occurrences(key, (moment,), pause, certain=certain)
        owners = self._owners(name, body)
        if owners is None:
            return None
        fact = ("emitted", *key[1:])
        moments = sorted(
            (AT_ONCE if self._frozen else self.moment(("performed", name, owner.id)) for owner in owners),
            key=lambda moment: moment.step,
        )
        once = all(self._is_done_once(name, owner) for owner in owners)
        return Occurrences(key, tuple(moments), None if once else 0, fact)

    def _owners(self, name: str, body: Body | None) -> list[Body] | None:
        """The targets that have an interaction; None if another engine may report an event of this name."""
        if name in ENGINE_EVENTS or (body is not None and body.entity.role != "target"):
            return None
        targets = [body] if body is not None else list(self.outline.bodies.values())
        owners = [each for each in targets if any(spec.name == name for spec in each.entity.interactions)]
        return None if not owners or any(owner.entity.engine != "city" for owner in owners) else owners

    def _is_done_once(self, name: str, owner: Body) -> bool:
        """True if an interaction is finished for good as soon as it was performed: it moves no goods, and works nothing
        off that an event may raise again."""
        specs = [spec for spec in owner.entity.interactions if spec.name == name]
        plain = not any(spec.carried or spec.own or spec.takes or spec.gives for spec in specs)
        return plain and len(specs) == 1

    def is_always_there(self, body: Body) -> bool:
        """True if the body is present during the whole episode."""
        return body.entity.role == "asset" and not engine_kind(body.entity.engine).orbits

    def present(self, target: str) -> Steps:
        """The macro-steps at which a target can be there."""
        body, events = self.outline.bodies[target], self.outline.instance.events
        concerned = [event for event in events if target in event.appear or target in event.vanish]
        if not self._is_timetabled(target):
            return self.clock.since(self._appearance(target).step) if body.entity.dormant else self.clock.always
        there, since_step, steps = not body.entity.dormant, 0, []
        for event in sorted(concerned, key=lambda each: each.tick or 0):
            now = (there or target in event.appear) and target not in event.vanish
            step = (event.tick or 0) * self.clock.per_tick
            if there and not now and step > since_step:
                steps.append((since_step, step - 1))
            if now and not there:
                since_step = step
            there = now
        if there:
            steps.append((since_step, max(since_step, self.clock.last)))
        return tuple(steps)

    def _is_timetabled(self, target: str) -> bool:
        """True if the times at which a target appears and vanishes are known."""
        return all(
            event.is_fixed and event.name not in self.outline.first_ticks
            for event in self.outline.instance.events
            if target in event.appear or target in event.vanish
        )

    def _appearance(self, target: str) -> Moment:
        """The moment at which an absent target can appear."""
        events = [event for event in self.outline.instance.events if target in event.appear]
        return AT_ONCE if self._frozen else earliest(self.moment(("event", event.name)) for event in events)

    def _absent(self, target: str, step: int) -> Moment:
        """The moment of a fact that its target's absence delays to `step`."""
        steps = self.present(target)
        appearance = AT_ONCE if self._is_timetabled(target) else self._appearance(target)
        if appearance.reason is not None and self.outline.bodies[target].entity.dormant:
            return Moment(step, appearance.reason.behind(f"the appearance of `{target}`"))
        appears = next((low for low, _ in steps if low > 0), None)
        if steps and appears is None:
            end = spelled(self.clock.time_s(steps[-1][1] + 1))
            words = f"`{target}` vanishes at {end} s"
        else:
            words = (
                f"`{target}` appears at {spelled(self.clock.time_s(appears or 0))} s"
                if steps
                else (f"`{target}` never appears")
            )
        return Moment(step, Reason(lambda: words, "LJ0613", self.outline.bodies[target].path))
