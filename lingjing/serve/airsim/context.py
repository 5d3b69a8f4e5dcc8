"""The running episode as the methods see it."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable
from dataclasses import dataclass, field

from lingjing.mission.instance import Instance
from lingjing.plugins.policy import Picture
from lingjing.scene.camera_geometry import CameraPlacement
from lingjing.serve.airsim.arguments import Arguments
from lingjing.serve.airsim.distortion import Distortion
from lingjing.serve.airsim.pictures import ImageWish
from lingjing.serve.airsim.server import Call, Client
from lingjing.serve.airsim.skies import Skies
from lingjing.serve.airsim.vehicles import Fleet, Surroundings, Vehicle
from lingjing.trace.records import BodyState


@dataclass
class DetectionFilter:
    """The objects that one camera detects."""

    names: list[str] = field(default_factory=list)
    """Names with `*` and `?`, in lower case; none detects nothing, as in AirSim."""
    radius_m: float = 200.0
    """The largest distance, metres (AirSim's default: 20,000 cm)."""

    def admits(self, name: str, distance_m: float) -> bool:
        """Return whether an object is detected."""
        return distance_m <= self.radius_m and any(fnmatch.fnmatchcase(name.lower(), each) for each in self.names)


@dataclass(eq=False)
class PictureWait:
    """A call that waits for pictures."""

    call: Call
    vehicle: Vehicle
    wishes: tuple[ImageWish, ...]
    answer: Callable[[dict[str, Picture]], object]
    """Makes the result from the pictures by camera."""
    pictures: dict[str, Picture] = field(default_factory=dict)
    """The pictures so far, by camera."""

    @property
    def missing(self) -> tuple[str, ...]:
        """The cameras without a picture, in the order of the request."""
        wanted = dict.fromkeys(wish.camera.name for wish in self.wishes)
        return tuple(name for name in wanted if name not in self.pictures)


@dataclass(eq=False)
class Context:
    """The episode at a boundary, and the state of its clients' control."""

    instance: Instance
    fleet: Fleet
    surroundings: Surroundings
    objects: tuple[str, ...]
    """Ids of the bodies of the mission that are not hidden."""
    time_s: float = 0.0
    states: dict[str, BodyState] = field(default_factory=dict)
    """The states of all bodies."""
    paused: bool = False
    """True while `simPause` holds: only pictures and `simContinueForTime` let time pass."""
    run_until_s: float = 0.0
    """Mission time at which `simContinueForTime` pauses."""
    run_call: Call | None = None
    """The call of `simContinueForTime` that waits."""
    segmentation: dict[str, int] = field(default_factory=dict)
    """The ids that clients have given to objects, by entity; others have that of their class."""
    filters: dict[tuple[str, str, int], DetectionFilter] = field(default_factory=dict)
    """The filters of detections, by vehicle, camera and image type."""
    placements: dict[tuple[str, str], CameraPlacement] = field(default_factory=dict)
    """The places and lenses that clients have given to cameras, by vehicle and camera; others have their mount's."""
    distortions: dict[tuple[str, str], Distortion] = field(default_factory=dict)
    """The distortions that clients have given to cameras, by vehicle and camera."""
    skies: Skies = field(default_factory=Skies)
    """The weather and the time of day of pictures."""
    waits: list[PictureWait] = field(default_factory=list)
    """The calls that wait for pictures."""
    flying: dict[str, Call] = field(default_factory=dict)
    """Vehicle → the call that waits for the end of its task."""
    resets: bool = False
    """True after `reset`."""

    @property
    def tick_s(self) -> float:
        """Length of a tick, seconds."""
        return self.instance.clock.tick_s

    @property
    def waiting(self) -> bool:
        """True if an answer depends on time that passes."""
        return bool(self.waits or self.flying or self.run_call or self.steering)

    @property
    def steering(self) -> bool:
        """True while a call of `setCarControls` waits for its command to be accepted."""
        return any(vehicle.driver.waits for vehicle in self.fleet.vehicles)

    def drop(self, client: Client) -> None:
        """Forget a client that has gone: its tasks end, and their vehicles hold their places."""
        self.waits = [wait for wait in self.waits if wait.call.client is not client]
        for name, call in tuple(self.flying.items()):
            if call.client is client:
                self.fleet.find(name).pilot.cancel()
        if self.run_call is not None and self.run_call.client is client:
            self.run_call = None


class Later:
    """The result of a method that answers its call later."""


LATER = Later()
"""The only `Later`."""

Method = Callable[[Context, Call, Arguments], object]
"""A served method. Returns a result of plain values or `LATER`. Raises `CallError`."""
