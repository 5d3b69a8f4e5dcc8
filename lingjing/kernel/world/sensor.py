"""The sensor engine: brought to a boundary once, then asked for one picture after another.

It owns no entity and receives every entity's state with each capture. It therefore keeps no state between two captures,
and one camera serves a world and its forks.
"""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.kernel.world.boundary_checks import checked_boundary
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.frames import described, stored
from lingjing.kernel.world.guarded_calls import Enter, engine_error, engine_seed, guarded, no_note
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence, Schedule
from lingjing.plugins.engine import CaptureRequest, Engine, EngineSpec, KeyedPictures
from lingjing.scene.city import City
from lingjing.trace.records import BodyState


class Sensor:
    """One sensor engine, by name."""

    def __init__(self, name: str, engine: Engine, enter: Enter = no_note) -> None:
        self.name = name
        self._engine = engine
        self._enter = enter
        self._schedule: Schedule | None = None

    def reset(self, instance: Instance, city: City) -> None:
        """Build the drawn world of an episode."""
        self._schedule = Schedule(instance)
        spec = EngineSpec(engine=self.name, instance=instance, owns=(), events=self._schedule)
        seed = engine_seed(instance.seed, self.name)
        report, _ = guarded(self._enter, self.name, "reset", lambda: self._engine.reset(spec, city, seed))
        checked_boundary(self.name, "reset", report, 0.0, ())

    def move_to(self, time_s: float, states: Sequence[BodyState], occurrences: Sequence[Occurrence] = ()) -> None:
        """Move every entity to its state at the boundary at `time_s`. `occurrences` are those before it."""
        if self._schedule is not None:
            self._schedule.update(occurrences)
        mirrors = tuple(states)
        report, _ = guarded(self._enter, self.name, "advance", lambda: self._engine.advance(time_s, mirrors))
        checked_boundary(self.name, "advance", report, time_s, ())

    def key(self, request: CaptureRequest) -> bytes | None:
        """Return the key of all that the picture depends on, or None if the engine offers none (`KeyedPictures`)."""
        engine = self._engine
        if not isinstance(engine, KeyedPictures):
            return None
        return guarded(self._enter, self.name, "picture_key", lambda: engine.picture_key(request))[0]

    def picture(self, request: CaptureRequest, *, pixels: bool = True) -> StoredFrame | None:
        """Return the picture in its stored form, or None if the engine drew none. Without `pixels`, only its
        metadata.
        """
        frames, _ = guarded(self._enter, self.name, "capture", lambda: tuple(self._engine.capture((request,))))
        if len(frames) > 1:
            raise engine_error(self.name, "capture", f"it drew {len(frames)} pictures when asked for `{request.frame}`")
        if not frames:
            return None
        try:
            return (stored if pixels else described)(self.name, frames[0], request)
        except (TypeError, ValueError, AttributeError) as error:
            raise engine_error(self.name, "capture", f"its picture is malformed: {error}") from error
