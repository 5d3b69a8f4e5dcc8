"""The redaction of pictures: class ids and instances without hidden entities, boxes without entities too faint to see.

Both need the picture without some entities. The part of the picture where these entities, or their changes to the town,
may show is drawn again without them. Everywhere else the second drawing equals the first, pixel by pixel. A picture
that shows none of them is not drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.boxes import all_boxes
from lingjing.engines.camera.classes import CLASSES, instance_numbers, instance_picture, semantic_picture
from lingjing.engines.camera.contrast import bounding_rect, pixels_of, projected_rect, split_by_contrast
from lingjing.engines.camera.draw import Renderer, Scenery
from lingjing.engines.camera.effects import TownChanges, changed_boxes
from lingjing.engines.camera.effects.town_changes import WorldBox
from lingjing.engines.camera.render_targets import Buffers, PixelRect
from lingjing.mission.instance import Entity
from lingjing.scene.city import Pieces
from lingjing.trace.records import Box, CameraPose

ALL, WITHOUT_HIDDEN, WITHOUT_TARGETS = range(3)
"""Variants of the town (`Renderer.set_variants`): everything, without hidden entities, without targets."""

Numbers = dict[str, int]
"""Index of an entity in the instance, by id."""


Staged = Callable[[Collection[str], int], Scenery]
"""Function that returns the scenery without some entities, in one of the variants."""

CLIPPED = 0.85
"""Ratio of another near plane to a near plane from which nothing lies before the latter (the margin of
`culling.near_plane`)."""


@dataclass(frozen=True, slots=True)
class Shot:
    """A requested picture."""

    pose: CameraPose
    """Pose of the camera."""
    depth: bool
    """True with a depth picture."""
    semantic: bool
    """True with class ids."""
    staged: Staged
    """The scenery."""
    instance: bool = False
    """True with numbers of entities."""
    visible_m: float = math.inf
    """Distance along the axis beyond which nothing has a depth, a class id or a box, metres."""

    @property
    def labels(self) -> bool:
        """True with a channel in which hidden entities are withheld."""
        return self.semantic or self.instance

    @property
    def measures(self) -> bool:
        """True if the drawing needs distances."""
        return self.depth or not math.isinf(self.visible_m)


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """The parts of a picture that agents may receive, and its boxes."""

    rgb: npt.NDArray[np.uint8]
    """Colours."""
    depth: npt.NDArray[np.float32] | None
    """Distances, metres; None if not requested."""
    semantic: npt.NDArray[np.uint8] | None
    """Class ids; None if not requested."""
    boxes: tuple[Box, ...]
    """Boxes of visible entities."""
    faint: tuple[Box, ...]
    """Boxes of targets that are too faint to see."""
    others: tuple[Box, ...]
    """Boxes of things without an entity."""
    instance: npt.NDArray[np.uint16] | None = None
    """Numbers of entities; None if not requested."""
    instance_ids: dict[str, int] = field(default_factory=dict)
    """The numbers of the entities in `instance`."""


@dataclass(frozen=True, slots=True)
class _RedrawnPart:
    place: PixelRect
    drawn: Buffers


class PictureRedaction:
    """The redaction of the pictures of one instance.

    An entity with a hidden value is hidden completely: its outline would reveal its place, or the number of people in a
    queue.
    """

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
        """Take over the changes of the entities to a town, in the order `ALL`, `WITHOUT_HIDDEN`, `WITHOUT_TARGETS`.

        `load` and `ground` are as in `effects.changed_boxes`.
        """
        whole, public, bare = variants
        self._volumes = changed_boxes(whole, public, load, ground)
        self._alike &= (public.tiles, public.entity_buildings) == (bare.tiles, bare.entity_buildings)

    def take(self, renderer: Renderer, shot: Shot) -> ShownPicture:
        """Draw a picture, and parts of it again if necessary."""
        whole, public_m = shot.staged((), ALL), None
        if shot.labels and self.hidden:
            public_m = renderer.near_plane(shot.pose, shot.staged(self.hidden, WITHOUT_HIDDEN))
        near_m = self._near(renderer, shot.pose, whole, public_m)
        drawn = _veiled(renderer.render(shot.pose, whole, shot.measures, near_m), shot)
        boxes, others = all_boxes(drawn.ids, self._entities)
        public = None if public_m is None else self._public(renderer, shot, drawn, boxes, public_m)
        seen, faint = self._visible_and_faint(renderer, shot, drawn, boxes, public)
        depth = drawn.depth if shot.depth else None
        ids = drawn.ids if public is None else _replaced(drawn.ids, public)
        semantic = semantic_picture(ids, self._entities) if shot.semantic else None
        instance = instance_picture(ids, self._entities) if shot.instance else None
        return ShownPicture(drawn.rgb, depth, semantic, seen, faint, others, instance, self._shown_numbers(instance))

    def _shown_numbers(self, instance: npt.NDArray[np.uint16] | None) -> dict[str, int]:
        """Return the numbers that occur in a picture, by entity."""
        if instance is None:
            return {}
        shown = set(np.unique(instance).tolist())
        return {name: number for name, number in instance_numbers(self._entities).items() if number in shown}

    def _near(self, renderer: Renderer, pose: CameraPose, whole: Scenery, public_m: float | None) -> float | None:
        """Return the near plane of a picture with class ids; None for the picture's own.

        It is that of the picture without hidden entities, unless this one cuts something off. The near plane decides
        which of two touching surfaces shows.
        """
        if public_m is None:
            return None
        own_m = renderer.near_plane(pose, whole)
        return public_m if own_m >= CLIPPED * public_m else own_m

    def _public(
        self, renderer: Renderer, shot: Shot, drawn: Buffers, boxes: Sequence[Box], near_m: float
    ) -> _RedrawnPart | None:
        """Return the part of the picture without hidden entities; None if it would not differ."""
        size = shot.pose.width, shot.pose.height
        places = [pixels_of((box,), *size) for box in boxes if box.entity in self.hidden]
        places += [place for volume in self._volumes if (place := projected_rect(volume, shot.pose)) is not None]
        place = bounding_rect(places) if near_m == drawn.near_m else (0, 0, *size)
        return None if place is None else self._redraw(renderer, shot, self.hidden, WITHOUT_HIDDEN, place, near_m)

    def _visible_and_faint(
        self, renderer: Renderer, shot: Shot, drawn: Buffers, boxes: tuple[Box, ...], public: _RedrawnPart | None
    ) -> tuple[tuple[Box, ...], tuple[Box, ...]]:
        """Return the boxes of visible entities and of those that are too faint."""
        size = shot.pose.width, shot.pose.height
        place = bounding_rect(pixels_of((box,), *size) for box in boxes if box.entity in self.targets)
        if place is None:
            return boxes, ()
        bare = public if self._alike else None  # it already covers every target's pixels
        if bare is None:
            bare = self._redraw(renderer, shot, self.targets, WITHOUT_TARGETS, place, drawn.near_m)
        return split_by_contrast(boxes, self.targets, drawn.rgb, drawn.ids, bare.place, bare.drawn.rgb)

    def _redraw(
        self, renderer: Renderer, shot: Shot, without: Numbers, variant: int, place: PixelRect, near_m: float
    ) -> _RedrawnPart:
        scenery = shot.staged(without, variant)
        drawn = renderer.redraw(shot.pose, scenery, shot.measures, place, near_m)
        return _RedrawnPart(place, _veiled(drawn, shot))


def _veiled(drawn: Buffers, shot: Shot) -> Buffers:
    """Return a drawing without what lies beyond the visibility: it is sky, without a depth."""
    if drawn.depth is None or math.isinf(shot.visible_m):
        return drawn
    beyond = drawn.depth > shot.visible_m
    sky = np.uint16(CLASSES["sky"])
    depth, ids = np.where(beyond, np.float32(np.inf), drawn.depth), np.where(beyond, sky, drawn.ids)
    return replace(drawn, depth=depth, ids=ids)


def _replaced(ids: npt.NDArray[np.uint16], part: _RedrawnPart) -> npt.NDArray[np.uint16]:
    """Return drawn ids with those of the redrawn part in its place."""
    whole = ids.copy()
    whole[_rows(part.place)] = part.drawn.ids
    return whole


def _rows(place: PixelRect) -> tuple[slice, slice]:
    left, top, width, height = place
    return slice(top, top + height), slice(left, left + width)


__all__ = ["ALL", "WITHOUT_HIDDEN", "WITHOUT_TARGETS", "PictureRedaction", "Shot", "ShownPicture"]
