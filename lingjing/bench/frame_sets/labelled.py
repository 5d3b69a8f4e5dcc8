"""Frames of traces with what is true of them: the boxes of what can be seen, and who was wrong about them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import msgspec

from lingjing.analysis.detection import detect, shots
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import Box, CameraPose

MARK = 8
"""Hexadecimal digits of an episode's digest in the names of its frames."""


class LabelledFrame(msgspec.Struct, frozen=True, kw_only=True):
    """One stored frame. `name` is its file's name in a set; the same episode always gives the same names.

    `level_m` is the elevation that the agents were told the ground or the water has, so that a nadir camera's height is
    known. `boxes` are of everything that can be seen by the engine's measure (ADR 0012), `faint` the classes of targets
    that were drawn and cannot be seen. `reported` are the classes of detection reports on this frame that matched
    nothing: somebody saw there what is not.
    """

    name: str
    mission: str
    mode: str
    seed: int
    policy: str
    frame: str
    tick: int
    camera: str
    pose: CameraPose
    level_m: float
    sha256: str
    boxes: tuple[Box, ...] = ()
    faint: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()

    def shows(self, cls: str) -> tuple[Box, ...]:
        """The boxes of one class."""
        return tuple(box for box in self.boxes if box.cls == cls)


def labelled_frames(trace: Trace) -> Iterator[LabelledFrame]:
    """Every frame that a camera took in an episode, in the order of capture; reference pictures are none of them.

    Raises `UsageError` for an episode that was cut short: what was reported of its last frames is not known.
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
    """The classes of targets that at least one frame shows, in alphabetical order."""
    return tuple(sorted({box.cls for frame in frames for box in frame.boxes if box.cls in frame.targets}))


def _plain(text: str) -> str:
    """A name as a part of a file's name: `f3-uav[1]-nadir` → `f3-uav1-nadir`."""
    return re.sub(r"[^A-Za-z0-9_-]", "", text)


__all__ = ["LabelledFrame", "labelled_frames", "seen_targets"]
