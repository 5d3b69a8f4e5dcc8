"""The conversion of observations to requests with descriptors, and back."""

from __future__ import annotations

from lingjing.mission.instance import Instance
from lingjing.play.policy_processes.messages import ActPolicy, TruthNow
from lingjing.play.policy_processes.pictures import PicturePart
from lingjing.plugins.policy import Inbox, Observation, Picture, Privileged
from lingjing.scene.city import City


def request_of(observation: Observation, inbox: Inbox, pictures: tuple[PicturePart, ...]) -> ActPolicy:
    """Return the request for a decision. `pictures` describe those of the observation."""
    truth = observation.privileged
    return ActPolicy(
        agent=observation.agent,
        tick=observation.tick,
        time_s=observation.time_s,
        entities=observation.entities,
        cells=observation.cells,
        events=observation.events,
        pictures=pictures,
        absent=observation.absent,
        weather=observation.weather,
        truth=None if truth is None else _changing(truth),
        inbox=inbox,
    )


def observation_of(
    request: ActPolicy, pictures: tuple[Picture, ...], constants: tuple[Instance, City] | None
) -> Observation:
    """Return the observation of a request. `constants` are the instance and the city of the truth; None without it."""
    truth = request.truth
    privileged = None
    if truth is not None and constants is not None:
        instance, city = constants
        privileged = Privileged(
            instance=instance,
            city=city,
            states=truth.states,
            frames=truth.frames,
            achieved=truth.achieved,
            emitted=truth.emitted,
            routes=truth.routes,
            inspected=truth.inspected,
            used=truth.used,
            forbidden=truth.forbidden,
        )
    return Observation(
        agent=request.agent,
        tick=request.tick,
        time_s=request.time_s,
        entities=request.entities,
        cells=request.cells,
        events=request.events,
        pictures=pictures,
        absent=request.absent,
        privileged=privileged,
        weather=request.weather,
    )


def _changing(truth: Privileged) -> TruthNow:
    return TruthNow(
        states=truth.states,
        frames=truth.frames,
        achieved=truth.achieved,
        emitted=truth.emitted,
        routes=truth.routes,
        inspected=truth.inspected,
        used=truth.used,
        forbidden=truth.forbidden,
    )
