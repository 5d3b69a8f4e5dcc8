"""What a picture keeps back: classes without what is hidden, boxes without what is too faint to be seen.

Both ask what would be drawn without some entities, so a part of the picture is drawn again without them: where they, or
what they change about the town, show. The second drawing is the first one's, pixel for pixel, wherever they do not
matter. A picture that shows none of them is not drawn again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.boxes import entity_boxes
from lingjing.engines.camera.classes import semantic_picture
from lingjing.engines.camera.contrast import around, judged, pixels_of, spanned
from lingjing.engines.camera.draw import Renderer, Scenery
from lingjing.engines.camera.effects import TownChanges, altered
from lingjing.engines.camera.effects.town_changes import WorldBox
from lingjing.engines.camera.targets import Buffers, PixelRect
from lingjing.mission.instance import Entity
from lingjing.scene.city import Pieces
from lingjing.trace.records import Box, CameraPose

ALL, WITHOUT_HIDDEN, WITHOUT_TARGETS = range(3)
"""The variants of the town (`Renderer.vary`): everything, without what is hidden, without any target."""

Numbers = dict[str, int]
"""Entity id → its number in the instance."""


Staged = Callable[[Collection[str], int], Scenery]
"""The scenery without some entities, in one of the variants."""

CLIPPED = 0.85
"""From this share of a near plane on another one shows that nothing lies before it (`culling.near_plane`'s reserve)."""


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture to take: from where, with depth and class ids or without, and of what."""

    pose: CameraPose
    depth: bool
    semantic: bool
    staged: Staged


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """What is handed out of a picture: colours and depth, class ids if they are declared, the boxes of what can be
    seen, and of the targets that nobody can."""

    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32] | None
    semantic: npt.NDArray[np.uint8] | None
    boxes: tuple[Box, ...]
    faint: tuple[Box, ...]


@dataclass(frozen=True, slots=True)
class _Again:
    place: PixelRect
    rgb: npt.NDArray[np.uint8]
    ids: npt.NDArray[np.uint16]


class Withheld:
    """What the pictures of one instance keep back. An entity with a hidden value is hidden as a whole: its outline
    would tell its place, and how many stand in a queue."""

    def __init__(self, entities: Sequence[Entity]) -> None:
        numbered = list(enumerate(entities))
        self._entities = entities
        self.hidden: Numbers = {entity.id: number for number, entity in numbered if entity.hidden}
        self.targets: Numbers = {entity.id: number for number, entity in numbered if entity.role == "target"}
        self._volumes: tuple[WorldBox, ...] = ()
        self._alike = self.hidden == self.targets

    def note_changes(
        self,
        variants: tuple[TownChanges, TownChanges, TownChanges],
        load: Callable[[tuple[int, int]], Pieces],
        ground: Callable[[float, float], float],
    ) -> None:
        """Take note of what the entities change about a town, in the order of `ALL`, `WITHOUT_HIDDEN`,
        `WITHOUT_TARGETS`; `load` and `ground` as in `effects.altered`."""
        whole, public, bare = variants
        self._volumes = altered(whole, public, load, ground)
        self._alike &= (public.tiles, public.faced) == (bare.tiles, bare.faced)

    def take(self, renderer: Renderer, shot: Shot) -> ShownPicture:
        """Draw a picture, and again what that takes."""
        whole, public_m = shot.staged((), ALL), None
        if shot.semantic and self.hidden:
            public_m = renderer.near_plane(shot.pose, shot.staged(self.hidden, WITHOUT_HIDDEN))
        drawn = renderer.render(shot.pose, whole, shot.depth, self._near(renderer, shot.pose, whole, public_m))
        boxes = entity_boxes(drawn.ids, self._entities)
        public = None if public_m is None else self._public(renderer, shot, drawn, boxes, public_m)
        semantic = semantic_picture(drawn.ids, self._entities) if shot.semantic else None
        if public is not None and semantic is not None:
            semantic[_rows(public.place)] = semantic_picture(public.ids, self._entities)
        seen, faint = self._judged(renderer, shot, drawn, boxes, public)
        return ShownPicture(drawn.rgb, drawn.depth, semantic, seen, faint)

    def _near(self, renderer: Renderer, pose: CameraPose, whole: Scenery, public_m: float | None) -> float | None:
        """The near plane of a picture that names classes: that without what is hidden, unless this cuts something off;
        None for the picture's own. Where two surfaces meet the near plane decides which one shows."""
        if public_m is None:
            return None
        own_m = renderer.near_plane(pose, whole)
        return public_m if own_m >= CLIPPED * public_m else own_m

    def _public(
        self, renderer: Renderer, shot: Shot, drawn: Buffers, boxes: Sequence[Box], near_m: float
    ) -> _Again | None:
        """The picture without what is hidden, where that matters; None where it does not."""
        size = shot.pose.width, shot.pose.height
        places = [pixels_of((box,), *size) for box in boxes if box.entity in self.hidden]
        places += [place for volume in self._volumes if (place := spanned(volume, shot.pose)) is not None]
        place = around(places) if near_m == drawn.near_m else (0, 0, *size)
        return None if place is None else self._again(renderer, shot, self.hidden, WITHOUT_HIDDEN, place, near_m)

    def _judged(
        self, renderer: Renderer, shot: Shot, drawn: Buffers, boxes: tuple[Box, ...], public: _Again | None
    ) -> tuple[tuple[Box, ...], tuple[Box, ...]]:
        """The boxes of what can be seen, and of what is too faint."""
        size = shot.pose.width, shot.pose.height
        place = around(pixels_of((box,), *size) for box in boxes if box.entity in self.targets)
        if place is None:
            return boxes, ()
        bare = public if self._alike else None  # it covers every target's pixels
        if bare is None:
            bare = self._again(renderer, shot, self.targets, WITHOUT_TARGETS, place, drawn.near_m)
        return judged(boxes, self.targets, drawn.rgb, drawn.ids, bare.place, bare.rgb)

    def _again(
        self, renderer: Renderer, shot: Shot, without: Numbers, variant: int, place: PixelRect, near_m: float
    ) -> _Again:
        scenery = shot.staged(without, variant)
        return _Again(place, *renderer.redraw(shot.pose, scenery, shot.depth, place, near_m))


def _rows(place: PixelRect) -> tuple[slice, slice]:
    left, top, width, height = place
    return slice(top, top + height), slice(left, left + width)


__all__ = ["ALL", "WITHOUT_HIDDEN", "WITHOUT_TARGETS", "Shot", "ShownPicture", "Withheld"]
