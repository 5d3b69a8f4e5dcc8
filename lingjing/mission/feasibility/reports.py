"""`Reports`: the moments of pictures and of the messages that may name them.

Facts: `picture` (target), `photo` (asset, camera), `report` (message kind).
"""

from __future__ import annotations

import math

from lingjing.mission.conditions.outline import Body
from lingjing.mission.feasibility.arrivals import Arrivals, counts
from lingjing.mission.feasibility.message_size import least_bytes
from lingjing.mission.feasibility.moments import shown
from lingjing.mission.feasibility.presence import Presence
from lingjing.mission.feasibility.seeing import as_drawn, sight_m
from lingjing.mission.feasibility.steps import NEVER, Steps
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    NO,
    Moment,
    Truth,
    earliest,
    latest,
    since,
)
from lingjing.mission.instance import CameraSpec, MessageSpec
from lingjing.mission.intervals import Bounds
from lingjing.mission.vocabulary import PHOTO


class Reports(Arrivals, Presence):
    """Pictures and messages."""

    def reported_picture(self, body: Body) -> Moment:
        """The moment of the first message that names a picture of the body."""
        moment = self.moment(("picture", body.id))
        return Moment(moment.step + self.clock.per_tick if moment.step < NEVER else NEVER, moment.reason)

    def _picture(self, target: str) -> Moment:
        body = self.outline.bodies[target]
        present = self.present(target)
        mounts = [(carrier, camera) for carrier in self.outline.bodies.values() for camera in carrier.entity.cameras]
        moment = earliest(self._shot(carrier, camera, body, present) for carrier, camera in mounts)
        return Moment(moment.step, moment.reason and moment.reason.behind(shown(("picture", target))))

    def _shot(self, carrier: Body, camera: CameraSpec, target: Body, present: Steps) -> Moment:
        if self._before_end.get(("photographed", carrier.id)) == NO:
            return Moment(NEVER, self._barred(("photographed", carrier.id)))
        for limit in self.outline.instance.limits if camera.capture != "each_tick" else ():
            if self._is_uncounted(limit, self._before_end) and counts(limit, carrier.id, PHOTO):
                return Moment(NEVER, self._barred(("used", limit.name)))
        shot = self.moment(("photo", carrier.id, camera.name))
        radius = sight_m(carrier, camera, target, self.knowledge, self._ceiling_m(carrier))
        seen = AT_ONCE if math.isinf(radius) else self.near(carrier, as_drawn(target), radius)
        late = latest((shot, seen))
        step = self.clock.first_boundary(present, late.step) if late.step < NEVER else NEVER
        on_time = step == self.clock.boundary(late.step) or late.step > self.clock.last
        return Moment(step, late.reason) if on_time else self._absent(target.id, step)

    def _ceiling_m(self, body: Body) -> float:
        """The highest elevation that hard constraints allow a body, metres."""
        extent_of_body = self._steady.get(("elevation", body.id))
        return extent_of_body.high if isinstance(extent_of_body, Bounds) else math.inf

    def _photo(self, carrier: str, camera: str) -> Moment:
        """The camera can take a picture."""
        spec = next(each for each in self.outline.bodies[carrier].entity.cameras if each.name == camera)
        if spec.capture == "each_tick":
            return AT_ONCE
        if not any(verb.name == PHOTO for verb in self.outline.bodies[carrier].entity.verbs):
            return self._never(f"`{carrier}` has no `{PHOTO}`", "LJ0609", self.outline.bodies[carrier].path)
        ordered = self.moment(("command", carrier, PHOTO))
        return Moment(ordered.step + self.clock.per_tick if ordered.step < NEVER else NEVER, ordered.reason)

    def photographed(self, asset: Body) -> Truth:
        """The truth of a picture taken by a camera of the asset."""
        cameras = asset.entity.cameras
        moment = earliest(self.moment(("photo", asset.id, camera.name)) for camera in cameras)
        return since(moment, self.clock, ("photographed", asset.id))

    def message(self, kind: str) -> Moment:
        """The moment of the first message of a kind."""
        return self.moment(("report", kind))

    def _report(self, kind: str) -> Moment:
        instance = self.outline.instance
        spec = next((each for each in instance.messages if each.kind == kind), None)
        senders = [agent for agent in instance.agents if spec is not None and spec.is_sent_by(agent.role)]
        path = f"message/{kind}"
        if spec is None or not any(agent.id in self._able for agent in senders):
            return self._never(f"no agent can send a `{kind}`", "LJ0605", path)
        if instance.budget.messages == 0 or all(agent.budget and agent.budget.messages == 0 for agent in senders):
            return self._never(f"no agent with a budget of messages can send a `{kind}`", "LJ0610", path)
        least, most = least_bytes(spec, instance), instance.comms.payload_bytes
        if least > most:
            words = f"a `{kind}` has at least {least} bytes, and the payload of a message is {most} bytes"
            return self._never(words, "LJ0605", path)
        moment = latest((Moment(self.clock.per_tick), self._delivered(spec)))
        for limit in instance.limits:
            if limit.most <= 0 and any(item.kind == "message" and item.name == kind for item in limit.counts):
                if not limit.stage:
                    return self._never(f"`{limit.name}` allows no `{kind}`", "LJ0610", f"limit/{limit.name}")
                over = self._stage_over(limit.stage)
                moment = latest(
                    (moment, Moment(over.step, over.reason and over.reason.behind(shown(("report", kind)))))
                )
        return moment

    def _delivered(self, spec: MessageSpec) -> Moment:
        """The moment from which on the radio may deliver a message. Rules receive reports that are lost, too."""
        if spec.category == "report":
            return AT_ONCE
        changes = [
            (event, radio.loss) for event in self.outline.instance.events for radio in event.radio if not radio.region
        ]
        silent = any(
            event.tick == 0 and event.name not in self.outline.first_ticks and loss == 1.0
            for event, loss in changes
            if event.condition is None
        )
        if (self.outline.instance.comms.loss < 1.0 and not silent) or any(event.until for event, _ in changes):
            return AT_ONCE
        lowered = [event.name for event, loss in changes if loss is not None and loss < 1.0]
        if not lowered:
            return self._never(
                f"the radio loses every message, and a rule never receives a `{spec.kind}`",
                "LJ0605",
                f"message/{spec.kind}",
            )
        return earliest(self.moment(("event", name)) for name in lowered)
