"""`Milestones`: the moments of interactions, rules and assignments, and so of all facts; the world of `Readings`.

Facts: `performed`, `reached` and `unlock` (interaction, target), `achieved` (rule, ids of its arguments), `handover`
(asset).
"""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.conditions.episode import EVENT
from lingjing.mission.conditions.outline import Body
from lingjing.mission.feasibility.condition_values import AXIS_NAMES, SENT, Gauge, Message
from lingjing.mission.feasibility.message_size import least_bytes
from lingjing.mission.feasibility.moments import id_of, is_of_message, shown
from lingjing.mission.feasibility.reports import Reports
from lingjing.mission.feasibility.steps import NEVER, first
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    NO,
    YES,
    Moment,
    Quantity,
    Reason,
    Truth,
    conjunction,
    constant,
    disjunction,
    earliest,
    lasting,
    latest,
    since,
    unknown,
)
from lingjing.mission.instance import InteractionSpec
from lingjing.mission.model import Unlock
from lingjing.mission.values import Value
from lingjing.mission.vocabulary import STOP

_MIRROR_S = 2.0
"""Seconds of motion by which an engine may know the place of another engine's body too late, besides a macro-step."""

_LEVELS = ("heat", "flow")
"""States that an interaction works off from their present value, so that it may take less than its declared time."""

_UNDER_WAY = {"vessel": ("moving",), "quadruped": ("walking", "turning")}
"""Engine → its status words that only a command gives, if the body has no `stop`."""


class Milestones(Reports):
    """The moments of all facts of one outline."""

    def entering(self, gauge: Gauge, low: float, high: float) -> Moment:
        """The moment at which a number can lie between two bounds."""
        kind, name = str(gauge.key[0]), str(gauge.key[1])
        body = self.outline.bodies.get(name)
        if self._frozen or body is None:
            return AT_ONCE
        if kind in AXIS_NAMES[:2]:
            return self._crossing(body, AXIS_NAMES.index(kind), low, high)
        if kind == AXIS_NAMES[2]:
            return self._rising(body, low)
        if kind == "speed":
            return self._speeding(body, low)
        return self._changing(body, str(gauge.key[2]), low, high) if kind == "value" else AT_ONCE

    def status(self, body: Body, word: str) -> Truth:
        """The truth of `body.status == word`."""
        words, key = self.knowledge.status_words(body), ("status", body.id)
        if words is None:
            return Truth(self.clock.always, (), {key: frozenset((word,))})
        if word not in words:
            what = f"nothing gives `{body.id}` the status `{word}`"
            return constant(False, self.clock, Reason(lambda: what, "LJ0612"))
        moment = AT_ONCE
        if words[word]:
            moment = earliest(
                self.moment(
                    ("event", name.removeprefix(EVENT)) if name.startswith(EVENT) else ("performed", name, body.id)
                )
                for name in words[word]
            )
        if word in _UNDER_WAY.get(body.entity.engine, ()) and not any(verb.name == STOP for verb in body.entity.verbs):
            moment = self.moment(("climb", body.id))
        wanted, others = frozenset((word,)), frozenset(words) - {word}
        return Truth(self.clock.since(moment.step), (), {key: wanted}, {key: others}, moment.reason)

    def emitted(self, name: str, body: Body | None) -> Truth:
        """The truth of a performed interaction."""
        key: Quantity = ("emitted", name, body.id if body is not None else "*")
        owners = self._owners(name, body)
        if owners is None:
            return Truth(self.clock.always, (), {key: YES}, {key: NO})
        truth = since(earliest(self.moment(("performed", name, owner.id)) for owner in owners), self.clock, key)
        return msgspec.structs.replace(truth, if_true={key: YES, ("emitted", name, "*"): YES})

    def _performed(self, name: str, target: str) -> Moment:
        specs = [spec for spec in self.outline.bodies[target].entity.interactions if spec.name == name]
        return earliest(self._finished(spec, target) for spec in specs)

    def _finished(self, spec: InteractionSpec, target: str) -> Moment:
        reached = self.moment(("reached", spec.name, target))
        words = self._steady.get(("status", target))
        if isinstance(words, frozenset) and spec.done_word not in words and not (spec.own or spec.carried):
            return Moment(NEVER, self._barred(("status", target)))
        levelled = spec.works_off or any(state.name in _LEVELS for state in self.outline.bodies[target].entity.state)
        lasting = 0.0 if levelled or spec.lasting_s is None else spec.lasting_s
        step = self.clock.after(reached.step, lasting)
        if step <= self.clock.last and not any(step <= high for _, high in self.present(target)):
            return self._absent(target, NEVER)
        return Moment(step, reached.reason)

    def _reached(self, name: str, target: str) -> Moment:
        """An actor can be within reach of a target with an unlocked interaction."""
        body = self.outline.bodies[target]
        unlocked = self.moment(("unlock", name, target))
        opened = Moment(unlocked.step + 1 if unlocked.step < NEVER else NEVER, unlocked.reason)
        specs = [spec for spec in body.entity.interactions if spec.name == name]
        arrived = earliest(self._visit(spec, body) for spec in specs)
        late = latest((opened, arrived))
        present = self.present(target)
        step = next((max(low, late.step) for low, high in present if late.step <= high), NEVER)
        on_time = step == late.step or late.step > self.clock.last
        moment = Moment(step, late.reason) if on_time else self._absent(target, step)
        return Moment(moment.step, moment.reason and moment.reason.behind(shown(("reached", name, target))))

    def _visit(self, spec: InteractionSpec, target: Body) -> Moment:
        actors = self.outline.actors(spec)
        if not actors:
            words = f"no asset has the engine or role `{spec.by}`"
            return self._never(words, "LJ0612", target.path)
        return earliest(self.near(actor, target, spec.within_m, self._mirror_m(actor)) for actor in actors)

    def _mirror_m(self, actor: Body) -> float:
        """The largest error of an actor's place in the engine of its target, metres."""
        return actor.speed_mps * (_MIRROR_S + self.clock.sync_s)

    def _unlock(self, name: str, target: str) -> Moment:
        group = self.outline.bodies[target].entity.group
        unlocks = [each for each in self.outline.instance.unlocks if each.interaction == name]
        concerned = [each for each in unlocks if each.parameters and each.parameters[0].domain == group]
        if not concerned:
            return AT_ONCE
        return earliest(self._unlocked(unlock, target) for unlock in concerned)

    def _unlocked(self, unlock: Unlock, target: str) -> Moment:
        names: dict[str, Value] = {unlock.parameters[0].name: self.outline.bodies[target]}
        choices = [names]
        for place, parameter in enumerate(unlock.parameters[1:]):
            members: Iterable[Value] = self.outline.groups.get(parameter.domain, ())
            if parameter.domain in self.outline.kinds:
                members = (Message(parameter.domain, f"*{place}"),)
            choices = [{**each, parameter.name: member} for each in choices for member in members]
        truths = [self.truth(unlock.condition, each, early=True) for each in choices]
        return self._at_boundary(disjunction(truths, self.clock), f"unlock/{unlock.interaction}")

    def _changing(self, body: Body, field: str, low: float, high: float) -> Moment:
        """The moment at which a state can lie between two bounds."""
        state, start = body.entity.state_of(field), body.bounds(field)
        if state is None or (start.high >= low and start.low <= high):
            return AT_ONCE
        raised = low > start.high
        if raised and state.name in _LEVELS:
            return AT_ONCE
        ways = [
            self.moment(("reached", spec.name, body.id))
            for spec in body.entity.interactions
            if not raised and spec.own == state.name
        ]
        for owner in self.outline.bodies.values():
            for spec in owner.entity.interactions:
                changes = spec.gives == state.name if raised else spec.takes and spec.source == state.name
                if changes and any(actor.id == body.id for actor in self.outline.actors(spec)):
                    ways.append(self.moment(("reached", spec.name, owner.id)))
        if not raised and state.name in _LEVELS:
            ways += [
                self.moment(("reached", spec.name, body.id)) for spec in body.entity.interactions if not spec.carried
            ]
        if (body.id, field) in self.outline.set_fields:
            ways += [
                self.moment(("event", event.name))
                for event in self.outline.instance.events
                if any((change.entity, change.field) == (body.id, field) for change in event.changes)
            ]
        return earliest(ways) if ways else AT_ONCE

    def rule(self, call: ex.Call, values: list[Value]) -> Truth:
        """The truth of a rule's event."""
        rule = self._rules.get(call.function)
        ids = [id_of(value) for value in values]
        if rule is None or len(rule.parameters) != len(values) or None in ids:
            return unknown(self.clock)
        key: Quantity = ("achieved", rule.name, *ids)
        if self._frozen:
            return Truth(self.clock.always, (), {key: YES}, {key: NO})
        general = ("achieved", rule.name, *("" if isinstance(value, Message) else str(value.id) for value in values))
        moment = self.moment(general)
        truth = since(moment, self.clock, key)
        certain = self._certain.get(general, NEVER)
        implied = {_with_marks(of, values): extent for of, extent in self._implied.get(general, {}).items()}
        return msgspec.structs.replace(truth, must=self.clock.since(certain), if_true={**implied, key: YES})

    def _achieved(self, name: str, *ids: str) -> Moment:
        rule = self._rules[name]
        names: dict[str, Value] = {}
        sent: list[Moment] = []
        for place, (parameter, entity) in enumerate(zip(rule.parameters, ids, strict=True)):
            if entity:
                names[parameter.name] = self.outline.bodies[entity]
            else:
                names[parameter.name] = Message(parameter.domain, f"*{place}")
                sent.append(self.message(parameter.domain))
        truth = self.truth(rule.condition, names)
        truth = conjunction((truth, *(since(each, self.clock) for each in sent)), self.clock)
        lasts = lasting(truth.if_true)  # the fields of a message never change
        self._implied["achieved", name, *ids] = {
            key: extent
            for key, extent in truth.if_true.items()
            if (key[0] in ("field", SENT) if is_of_message(key) else key in lasts)
        }
        too_long = self._too_long(truth)
        if too_long is not None:
            return too_long
        if all(ids) and not rule.matching:
            self._certain[("achieved", name, *ids)] = self.clock.first_boundary(truth.must)
        reason = truth.reason or truth.ends
        if reason is not None and not reason.at:
            reason = msgspec.structs.replace(reason, at=f"rule/{name}")
        return Moment(first(truth.may), reason and reason.behind(shown(("achieved", name, *ids))))

    def _too_long(self, truth: Truth) -> Moment | None:
        """Never, if a message with the texts that a rule requires exceeds the payload."""
        lengths: dict[tuple[object, str], dict[str, int]] = {}
        for key, words in truth.if_true.items():
            if key[0] == "field" and isinstance(words, frozenset):
                lengths.setdefault((key[1], str(key[2])), {})[str(key[3])] = min(len(word.encode()) for word in words)
        instance = self.outline.instance
        for (_, kind), texts in lengths.items():
            spec = next((each for each in instance.messages if each.kind == kind), None)
            least = 0 if spec is None else least_bytes(spec, instance, texts)
            if least > instance.comms.payload_bytes:
                words_of = f"such a `{kind}` has at least {least} bytes"
                payload = f"the payload of a message is {instance.comms.payload_bytes} bytes"
                return self._never(f"{words_of}, and {payload}", "LJ0605", f"message/{kind}")
        return None

    def assigned(self, asset: Body, target: Body) -> Truth:
        """The truth of an assignment."""
        return since(self.moment(("handover", asset.id)), self.clock, ("assigned", asset.id, target.id))

    def _handover(self, asset: str) -> Moment:
        """A destination of the asset can have been commanded or sent."""
        body = self.outline.bodies[asset]
        ways = [
            self.moment(("command", asset, verb.name))
            for verb in body.entity.verbs
            if {"x", "y"} <= {argument.name for argument in verb.arguments}
        ]
        ordered = earliest(ways)
        sent = [self.message(spec.kind) for spec in self.outline.instance.messages if spec.category == "assignment"]
        commanded = Moment(ordered.step + self.clock.per_tick if ordered.step < NEVER else NEVER, ordered.reason)
        moment = earliest((commanded, *sent))
        return Moment(moment.step, moment.reason and moment.reason.behind(shown(("handover", asset))))


def _with_marks(key: Quantity, values: list[Value]) -> Quantity:
    """A field of the message of a rule's parameter (`*1`) as that of the message that a call names."""
    if not is_of_message(key):
        return key
    of, mark, kind, name = key
    message = values[int(str(mark)[1:])]
    return of, message.mark if isinstance(message, Message) else mark, kind, name
