"""Frames of traces with their labels: the boxes of visible entities, and the false reports about them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import msgspec

from lingjing.analysis.detection import detect, shots
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import Box, CameraPose

MARK = 8
"""Hexadecimal digits of an episode's digest in frame names. Chosen."""


class LabelledFrame(msgspec.Struct, frozen=True, kw_only=True):
    """One stored frame of a trace."""

    name: str
    """The frame's file name in a set; the same episode always gives the same names."""
    mission: str
    mode: str
    seed: int
    policy: str
    """The policies of the episode, joined by `+`."""
    frame: str
    """The frame's id in the trace."""
    tick: int
    camera: str
    pose: CameraPose
    """Pose and optics of the camera."""
    level_m: float
    """Elevation of ground or water in the agents' briefing, metres; with it the height of a nadir camera is known."""
    sha256: str
    """SHA-256 of the picture."""
    boxes: tuple[Box, ...] = ()
    """Boxes of all visible entities, by the engine's measure of visibility (ADR 0012)."""
    faint: tuple[str, ...] = ()
    """Classes of targets that were drawn and are invisible."""
    reported: tuple[str, ...] = ()
    """Classes of false detection reports on this frame."""
    targets: tuple[str, ...] = ()
    """Classes of all targets of the mission."""

    def shows(self, cls: str) -> tuple[Box, ...]:
        """Return the boxes of one class."""
        return tuple(box for box in self.boxes if box.cls == cls)


def labelled_frames(trace: Trace) -> Iterator[LabelledFrame]:
    """Yield every frame of an episode in the order of capture, without reference pictures.

    Raises `UsageError` for an episode that was cut short, because the reports on its last frames are missing.
    """
    if trace.outcome is None or not trace.complete:
        raise UsageError(f"{trace.path} was cut short", hint="play it again: `lingjing run` with the same seed")
    instance = trace.header.instance
    wrong: dict[str, set[str]] = {}
    for report in detect(trace).reports:
        if report.false:
            wrong.setdefault(report.frame, set()).add(report.cls)
    targets = tuple(sorted({entity.type for entity in instance.entities if entity.role == "target"}))
    policy = "+".join(dict.fromkeys(binding.policy for binding in trace.header.bindings))
    episode = f"{_plain(instance.mission)}-{_plain(instance.mode)}-{instance.seed}-{trace.outcome.digest[:MARK]}"
    for frame in shots(trace):
        yield LabelledFrame(
            name=f"{episode}-{_plain(frame.id)}.jpg",
            mission=instance.mission,
            mode=instance.mode,
            seed=instance.seed,
            policy=policy,
            frame=frame.id,
            tick=frame.tick,
            camera=frame.camera,
            pose=frame.pose,
            level_m=instance.scene.datum_m,
            sha256=frame.sha256,
            boxes=frame.boxes,
            faint=tuple(sorted({box.cls for box in frame.faint})),
            reported=tuple(sorted(wrong.get(frame.id, ()))),
            targets=targets,
        )


def seen_targets(frames: Iterable[LabelledFrame]) -> tuple[str, ...]:
    """Return the classes of targets that at least one frame shows, sorted."""
    return tuple(sorted({box.cls for frame in frames for box in frame.boxes if box.cls in frame.targets}))


def _plain(text: str) -> str:
    """Return a name as a part of a file name: `f3-uav[1]-nadir` becomes `f3-uav1-nadir`."""
    return re.sub(r"[^A-Za-z0-9_-]", "", text)


__all__ = ["LabelledFrame", "labelled_frames", "seen_targets"]
