"""The frames of a film: an oblique view of the city with moving bodies, a picture, captions and the score.

Frames are drawn with Pillow. The city is drawn once. Everything else is drawn over it at twice the size, and the result
is scaled down to smooth edges. Colours and sizes are chosen.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lingjing.analysis.fonts import font, missing_letters
from lingjing.errors import LingjingError
from lingjing.mission.geometry2d import Extent
from lingjing.scene.surroundings import OVERHEAD_M
from lingjing.trace.reader import Trace
from lingjing.viewer.ground import STEP_PER_M, GroundShape, PageGround
from lingjing.viewer.head import EndingCard, EpisodeHead
from lingjing.viewer.moments import Moment
from lingjing.viewer.steps import PictureNote, ViewStep

Ink = tuple[int, int, int]
"""A colour: red, green, blue in 0..255."""

WIDTH, HEIGHT = 1280, 720
"""Size of a frame, pixels."""
MAP: tuple[int, int, int, int] = (0, 64, 820, 612)
"""Left, top, right, bottom of the map, pixels."""

SHOT: tuple[int, int, int, int] = (844, 84, 1256, 316)
"""Left, top, right, bottom of the picture, pixels."""

STAGE_ROW = 34
"""Height of the row of a stage beside the map, pixels."""

TURN_DEG, TILT_DEG = -28.0, 52.0
"""Rotation of the view about the vertical, and its angle below the horizon (90: from above); chosen."""

FRESH_TICKS = 8
"""Length of the bright end of a trail, ticks (chosen)."""
SPECK = 6
"""Margin around a box, pixels, so that small objects remain visible."""

_FINE = 2
"""Factor of the size at which the map is drawn before it is scaled down."""
_PAPER, _PANEL, _RULE, _INK, _FAINT = (14, 18, 23), (22, 28, 36), (41, 50, 61), (230, 235, 241), (147, 161, 177)
_GOOD, _BAD, _REPORTED, _TRUE = (75, 208, 138), (255, 107, 122), (255, 63, 165), (24, 197, 107)
_ASSETS: tuple[Ink, ...] = (
    (86, 180, 255), (255, 158, 94), (190, 150, 255), (94, 226, 200), (240, 214, 96), (255, 130, 190), (160, 226, 96),
    (200, 208, 220),
)  # fmt: skip
_SIGHTS: dict[str, Ink] = {
    "known": (210, 215, 220), "found": (255, 180, 50), "completed": (60, 220, 120), "truth": (255, 111, 134)
}  # fmt: skip
_GREEN, _PAVED = (23, 40, 31), (30, 37, 45)
_LOOKS: dict[str, Ink] = {
    "water": (15, 37, 54), "land": (22, 29, 36), "slab": (26, 33, 41), "area": (26, 33, 40), "path": (29, 36, 44),
    "road": (43, 52, 63), "solid": (51, 60, 70), "bridge": (53, 64, 76), "building": (58, 70, 83), "tree": (36, 64, 47),
    "pipe": (106, 90, 67), **dict.fromkeys(("park", "grass", "forest", "pitch", "grass land"), _GREEN),
    **dict.fromkeys(("plaza", "sidewalk", "parking", "asphalt", "concrete", "concrete land"), _PAVED),
    "sand": (42, 42, 32),
}  # fmt: skip
_ROOF, _EDGE = (70, 83, 98), (98, 113, 130)


class _SlantedView:
    """Parallel projection of world coordinates to the map."""

    def __init__(self, frame: Extent) -> None:
        turn, tilt = math.radians(TURN_DEG), math.radians(TILT_DEG)
        self._cos, self._sin, self._flat, self._up = math.cos(turn), math.sin(turn), math.sin(tilt), math.cos(tilt)
        west, south, east, north = frame
        corners = [self._turned(x, y, 0.0) for x in (west, east) for y in (south, north)]
        xs, ys = [x for x, _ in corners], [y for _, y in corners]
        wide, high = MAP[2] - MAP[0], MAP[3] - MAP[1]
        self.scale = 0.88 * min(wide / (max(xs) - min(xs)), high / (max(ys) - min(ys)))
        self._x = wide / 2 - self.scale * (max(xs) + min(xs)) / 2
        self._y = high / 2 + self.scale * (max(ys) + min(ys)) / 2 + 12

    def point(self, x: float, y: float, z: float = 0.0) -> tuple[float, float]:
        """Return column and row, in pixels at `_FINE` times the map's size, of a point in metres."""
        across, up = self._turned(x, y, z)
        return (self._x + self.scale * across) * _FINE, (self._y - self.scale * up) * _FINE

    def _turned(self, x: float, y: float, z: float) -> tuple[float, float]:
        return x * self._cos - y * self._sin, (x * self._sin + y * self._cos) * self._flat + z * self._up

    def farness(self, shape: GroundShape) -> float:
        """Return the distance of a shape from the viewer, up to a constant. Farther shapes are drawn first."""
        ring = shape.rings[0]
        x, y = sum(ring[::2]) / len(ring[::2]), sum(ring[1::2]) / len(ring[1::2])
        return x * self._sin + y * self._cos


def _draw_city(ground: PageGround, view: _SlantedView) -> Image.Image:
    """Draw the city at `_FINE` times the map's size."""
    size = ((MAP[2] - MAP[0]) * _FINE, (MAP[3] - MAP[1]) * _FINE)
    image = Image.new("RGB", size, _LOOKS["water"] if ground.sea else _LOOKS["land"])
    pen = ImageDraw.Draw(image)
    tall = []
    for shape in ground.shapes:
        colour = _LOOKS.get(shape.surface, _LOOKS.get(shape.layer))
        if colour is None:
            continue
        if shape.layer in ("building", "solid"):
            tall.append(shape)
        elif shape.width:
            _line(pen, shape, colour, view)
        else:
            _fill(pen, shape, colour, view, shape.top / STEP_PER_M)
    for shape in sorted(tall, key=view.farness, reverse=True):
        _walls(pen, shape, view)
        _fill(pen, shape, _ROOF if shape.layer == "building" else _LOOKS["solid"], view, shape.top / STEP_PER_M)
        for ring in shape.rings:
            outline = [view.point(x, y, shape.top / STEP_PER_M) for x, y in _corners(ring)]
            pen.line([*outline, outline[0]], fill=_EDGE, width=1)
    return image


def _corners(ring: Sequence[int]) -> list[tuple[float, float]]:
    return [(ring[at] / STEP_PER_M, ring[at + 1] / STEP_PER_M) for at in range(0, len(ring), 2)]


def _fill(pen: ImageDraw.ImageDraw, shape: GroundShape, colour: Ink, view: _SlantedView, height: float) -> None:
    corners = [view.point(x, y, height) for ring in shape.rings for x, y in _corners(ring)]
    if len(shape.rings) == 1:
        pen.polygon(corners, fill=colour)
        return
    for at in range(0, len(shape.triangles), 3):
        pen.polygon([corners[index] for index in shape.triangles[at : at + 3]], fill=colour)


def _line(pen: ImageDraw.ImageDraw, shape: GroundShape, colour: Ink, view: _SlantedView) -> None:
    heights = [height / STEP_PER_M for height in shape.heights] or [0.0]
    corners = _corners(shape.rings[0])
    points = [view.point(x, y, heights[min(at, len(heights) - 1)]) for at, (x, y) in enumerate(corners)]
    width = max(1, round(shape.width / STEP_PER_M * view.scale * _FINE * 0.85))
    if len(points) == 1:
        (x, y), half = points[0], width / 2
        pen.ellipse((x - half, y - half, x + half, y + half), fill=colour)
    else:
        pen.line(points, fill=colour, width=width, joint="curve")


def _walls(pen: ImageDraw.ImageDraw, shape: GroundShape, view: _SlantedView) -> None:
    """Draw the walls that face the viewer, with a brightness that depends on their direction."""
    base, top = shape.base / STEP_PER_M, shape.top / STEP_PER_M
    colour = _LOOKS[shape.layer]
    for ring in shape.rings:
        corners = _corners(ring)
        for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
            (left, _), (right, _) = view.point(ax, ay), view.point(bx, by)
            if right <= left:  # the wall faces away, since outlines run anticlockwise and holes clockwise
                continue
            light = 0.62 + 0.3 * (bx - ax) / (math.hypot(bx - ax, by - ay) or 1.0)
            lit = (round(colour[0] * light), round(colour[1] * light), round(colour[2] * light))
            pen.polygon(
                [view.point(ax, ay, base), view.point(bx, by, base), view.point(bx, by, top), view.point(ax, ay, top)],
                fill=lit,
            )


class _EntityTrack:
    """The track of an entity: simulated seconds and (east, north, elevation), with linear interpolation."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self._rows: list[tuple[float, float, float]] = []
        self.headings: list[float] = []

    def add(self, samples: Sequence[tuple[float, float, float, float, float]], tick_s: float) -> None:
        """Add samples of time, position and heading. During a gap between samples, the entity stands still."""
        for time_s, x, y, z, heading in samples:
            if self.times and time_s - self.times[-1] > tick_s / 4 + 0.11:
                self.times.append(max(self.times[-1], time_s - tick_s / 5))
                self._rows.append(self._rows[-1])
                self.headings.append(self.headings[-1])
            self.times.append(time_s)
            self._rows.append((x, y, z))
            self.headings.append(heading)

    def at(self, time_s: float) -> tuple[float, float, float] | None:
        """Return the position at a time, or None before the first sample."""
        if not self.times or time_s < self.times[0] - 0.05:
            return None
        x, y, z = (float(np.interp(time_s, self.times, [row[part] for row in self._rows])) for part in range(3))
        return x, y, z

    def heading(self, time_s: float) -> float:
        """Return the heading of the last sample at or before a time, degrees."""
        return self.headings[max(0, int(np.searchsorted(self.times, time_s + 0.05)) - 1)]

    def between(self, begin_s: float, end_s: float, most: int = 200) -> list[tuple[float, float, float]]:
        """Return about `most` positions of a period, evenly chosen, and the position at its end."""
        first, last = np.searchsorted(self.times, (begin_s, end_s))
        rows = self._rows[int(first) : int(last)]
        end = self.at(end_s)
        return [*rows[:: max(1, len(rows) // most)], *([end] if end is not None else [])]


class FilmFrames:
    """Renderer of the frames of one episode."""

    def __init__(self, trace: Trace, head: EpisodeHead, steps: Sequence[ViewStep], ground: PageGround) -> None:
        self._trace, self._head, self._steps = trace, head, steps
        self._view = _SlantedView(head.frame)
        self._city = _draw_city(ground, self._view)
        self._cards = {card.id: card for step in steps for card in step.cards}
        self._tracks = {name: _EntityTrack() for name in self._cards}
        self._sights: dict[str, list[tuple[int, str]]] = {}
        self._dormant: dict[str, list[tuple[int, bool]]] = {}
        self._pictures: list[tuple[int, PictureNote]] = []
        for place, step in enumerate(steps):
            for name, samples in step.moves.items():
                self._tracks[name].add(samples, head.tick_s)
            for name, sight in step.sights.items():
                self._sights.setdefault(name, []).append((place, sight))
            for name, (status, _) in step.status.items():
                self._dormant.setdefault(name, []).append((place, status == "dormant"))
            self._pictures += [(place, picture) for picture in step.pictures]
        self._reports: dict[str, list[tuple[int, tuple[float, float, float, float], str]]] = {}
        for place, step in enumerate(steps):
            for report in step.reports:
                self._reports.setdefault(report.frame, []).append((place, report.box, report.cls))
        self._decoded: tuple[str, Image.Image | None] = ("", None)

    def title(self) -> Image.Image:
        """Draw the first frame: mission, policies and goal."""
        image = self._sheet(0.0, None)
        self._card(image, [(self._head.title or self._head.mission, 34, _INK), (self._facts(), 18, _FAINT),
                           (self._head.goal, 20, _INK)])  # fmt: skip
        return image

    def played(self, place: float, moment: Moment | None) -> Image.Image:
        """Draw the episode at a (fractional) number of its steps, with the caption of a moment."""
        return self._sheet(place, moment)

    def ended(self, ending: EndingCard) -> Image.Image:
        """Draw the last frame: the ending, with its explanation if the card has one."""
        image = self._sheet(float(max(0, len(self._steps) - 1)), None)
        colour = {"won": _GOOD, "lost": _BAD}.get(ending.state, _INK)
        lines = [(ending.line, 26, colour), (f"score {self._steps[-1].score:.2f} after {self._steps[-1].tick} ticks"
                                             if self._steps else "", 18, _INK)]  # fmt: skip
        lines += [(line.strip(), 15, _FAINT) for line in ending.why.splitlines()[2:9]]
        self._card(image, lines)
        return image

    # -- parts

    def _facts(self) -> str:
        head = self._head
        return " · ".join([head.mission, f"seed {head.seed}", head.mode, *head.policies])

    def _sheet(self, place: float, moment: Moment | None) -> Image.Image:
        image = Image.new("RGB", (WIDTH, HEIGHT), _PAPER)
        shown = self._map(place)
        image.paste(shown, MAP[:2])
        pen = ImageDraw.Draw(image)
        pen.rectangle((0, 0, WIDTH, MAP[1] - 1), fill=_PANEL)
        pen.rectangle((MAP[2], MAP[1], WIDTH, MAP[3]), fill=_PANEL)
        _write(pen, (24, 12), _short(self._head.title or self._head.mission, 60), 22, _INK)
        _write(pen, (24, 40), _short(self._facts(), 110), 13, _FAINT)
        if self._head.credit:
            wide = font_of(self._head.credit, 11).getlength(self._head.credit)
            _write(pen, (MAP[2] - wide - 8, MAP[3] - 18), self._head.credit, 11, _FAINT)
        if self._steps:
            if self._pictures:
                self._latest(image, pen, int(place + 1e-6))
            self._stages(pen, int(place + 1e-6))
            self._timeline(pen, place)
            self._caption(pen, moment)
        return image

    def _map(self, place: float) -> Image.Image:
        image = self._city.copy()
        pen = ImageDraw.Draw(image, "RGBA")
        for polygon in self._head.regions:
            points = [self._view.point(x, y) for x, y in polygon]
            pen.polygon(points, fill=(70, 180, 204, 16))
            pen.line([*points, points[0]], fill=(70, 180, 204, 150), width=2)
        if self._steps:
            self._things(pen, place)
        size = (MAP[2] - MAP[0], MAP[3] - MAP[1])
        return image.resize(size, Image.Resampling.BOX)

    def _things(self, pen: ImageDraw.ImageDraw, place: float) -> None:
        step, now = int(place + 1e-6), self._time(place)
        assets = [card for card in self._cards.values() if card.role == "asset" and not self._is_away(card.id, step)]
        fresh = now - FRESH_TICKS * self._head.tick_s
        for card in assets:
            ink, track = _ASSETS[card.colour % len(_ASSETS)], self._tracks[card.id]
            for begin, end, width, alpha in ((0.0, fresh, 3, 90), (fresh, now, 5, 235)):
                points = [self._view.point(x, y, z) for x, y, z in track.between(begin, end) if z < OVERHEAD_M]
                if len(points) > 1:
                    pen.line(points, fill=(*ink, alpha), width=width, joint="curve")
        labels = []
        for name, sights in self._sights.items():
            known = [sight for at, sight in sights if at <= step]
            where = self._tracks[name].at(now)
            if known and where is not None and not self._is_away(name, step):
                x, y = self._view.point(*where)
                _sign(pen, x, y, known[-1])
                labels.append((x, y, self._cards[name].label or name, _SIGHTS[known[-1]]))
        for card in assets:
            where = self._tracks[card.id].at(now)
            if where is not None and where[2] < OVERHEAD_M:
                self._arrow(pen, where, self._tracks[card.id].heading(now), _ASSETS[card.colour % len(_ASSETS)])
                x, y = self._view.point(*where)
                labels.append((x, y, card.label or card.id, _ASSETS[card.colour % len(_ASSETS)]))
        occupied: list[tuple[float, float, float]] = []
        for x, y, text, ink in labels if len(labels) <= 40 else ():
            name = _short(text, 20)
            wide = font_of(name, 24).getlength(name)
            if not any(abs(y - row) < 26 and x < right and x + wide + 26 > left for left, right, row in occupied):
                occupied.append((x, x + wide + 26, y))
                letters = font_of(name, 24)
                pen.text((x + 22, y - 14), name, font=letters, fill=ink, stroke_width=4, stroke_fill=_PAPER)

    def _arrow(self, pen: ImageDraw.ImageDraw, where: tuple[float, float, float], heading: float, ink: Ink) -> None:
        x, y, z = where
        turn, size = math.radians(heading), 11.0 / self._view.scale
        ahead = math.sin(turn), math.cos(turn)
        if z > 2.0:
            foot = self._view.point(x, y)
            pen.line([self._view.point(x, y, z), foot], fill=(*ink, 120), width=2)
            pen.ellipse((foot[0] - 7, foot[1] - 4, foot[0] + 7, foot[1] + 4), fill=(*ink, 130))
        corners = [
            self._view.point(x + size * (u * ahead[0] + v * ahead[1]), y + size * (u * ahead[1] - v * ahead[0]), z)
            for u, v in ((1.5, 0.0), (-1.0, 0.95), (-0.45, 0.0), (-1.0, -0.95))
        ]
        pen.polygon(corners, fill=ink)
        pen.line([*corners, corners[0]], fill=_PAPER, width=3)

    def _time(self, place: float) -> float:
        return float(np.interp(place, range(len(self._steps)), [step.time for step in self._steps]))

    def _is_away(self, name: str, step: int) -> bool:
        dormant = [is_dormant for at, is_dormant in self._dormant.get(name, ()) if at <= step]
        return bool(dormant) and dormant[-1]

    def _latest(self, image: Image.Image, pen: ImageDraw.ImageDraw, step: int) -> None:
        """Draw the latest picture. Of the last six ticks, a picture with a report is preferred."""
        recent = [(at, picture) for at, picture in self._pictures if step - 6 < at <= step]
        reported = [(at, picture) for at, picture in recent if self._boxes(picture, step)]
        latest = (reported or recent or [(at, picture) for at, picture in self._pictures if at <= step])[-1:]
        box = SHOT
        pen.rectangle(box, fill=_PAPER)
        for at, picture in latest:
            shown = self._shot(picture.id)
            if shown is None:
                _write(pen, (box[0] + 12, box[1] + 12), "this picture is broken", 14, _FAINT)
                continue
            ratio = min((box[2] - box[0]) / shown.width, (box[3] - box[1]) / shown.height)
            size = (max(1, round(shown.width * ratio)), max(1, round(shown.height * ratio)))
            left, top = (box[0] + box[2] - size[0]) // 2, (box[1] + box[3] - size[1]) // 2
            image.paste(shown.resize(size, Image.Resampling.BILINEAR), (left, top))
            for corners, ink in [(truth[2], _TRUE) for truth in picture.truth] + [
                (reported_box, _REPORTED) for reported_box in self._boxes(picture, step)
            ]:
                pen.rectangle(_placed(corners, left, top, size), outline=ink, width=2)
            words = f"{picture.entity} · {picture.camera} · tick {self._steps[at].tick}"
            _write(pen, (box[0], box[3] + 6), _short(words, 58), 13, _FAINT)

    def _stages(self, pen: ImageDraw.ImageDraw, step: int) -> None:
        """Draw the progress of stages under the picture, or in its place if the episode has no pictures."""
        box, top = SHOT, SHOT[3] + 40 if self._pictures else SHOT[1]
        counts = next((counted.stages for counted in reversed(self._steps[: step + 1]) if counted.stages), [])
        for row, (name, done, members) in enumerate(counts[: (MAP[3] - top) // STAGE_ROW]):
            y = top + STAGE_ROW * row
            _write(pen, (box[0], y), _short(name, 16), 15, _INK)
            _write(pen, (box[2] - 52, y), f"{done} of {members}", 14, _FAINT)
            left, right = box[0] + 140, box[2] - 66
            pen.rounded_rectangle((left, y + 6, right, y + 13), 3, fill=_RULE)
            if members and done:
                pen.rounded_rectangle(
                    (left, y + 6, left + (right - left) * min(1.0, done / members), y + 13), 3, fill=_GOOD
                )

    def _boxes(self, picture: PictureNote, step: int) -> list[tuple[float, float, float, float]]:
        return [box for at, box, _ in self._reports.get(picture.id, ()) if at <= step]

    def _shot(self, name: str) -> Image.Image | None:
        if self._decoded[0] != name:
            try:
                shown = Image.open(io.BytesIO(self._trace.jpeg(name)), formats=("JPEG",))
                shown.draft("RGB", (SHOT[2] - SHOT[0], SHOT[3] - SHOT[1]))
                self._decoded = name, shown.convert("RGB")
            except (LingjingError, OSError, ValueError, SyntaxError):
                self._decoded = name, None
        return self._decoded[1]

    def _timeline(self, pen: ImageDraw.ImageDraw, place: float) -> None:
        left, right, top, bottom = 24, WIDTH - 24, 672, 704
        pen.rectangle((0, MAP[3], WIDTH, HEIGHT), fill=_PANEL)
        last, step = max(1, len(self._steps) - 1), self._steps[int(place + 1e-6)]
        column = [left + (right - left) * at / last for at in range(len(self._steps))]
        most = max(1.0, *(other.score for other in self._steps), 0.0)
        points = [
            (column[at], bottom - max(0.0, other.score) / most * (bottom - top)) for at, other in enumerate(self._steps)
        ]
        if len(points) > 1:
            pen.polygon([(left, bottom), *points, (right, bottom)], fill=(30, 62, 50))
            pen.line(points, fill=_GOOD, width=2)
        for at, other in enumerate(self._steps):
            for kind, ink in (("good", _GOOD), ("bad", _BAD)):
                if any(event.kind == kind for event in other.events):
                    pen.ellipse((column[at] - 4, top - 12, column[at] + 4, top - 4), fill=ink)
        x = left + (right - left) * place / last
        pen.line([(x, top - 14), (x, bottom + 4)], fill=_INK, width=2)
        words = f"tick {step.tick} of {self._head.ticks}   score {step.score:.2f}"
        _write(pen, (WIDTH - 24 - font(18).getlength(words), 22), words, 18, _INK)

    def _caption(self, pen: ImageDraw.ImageDraw, moment: Moment | None) -> None:
        if moment is not None:
            ink = _BAD if moment.kind == "bad" else _GOOD
            _write(pen, (24, MAP[3] + 12), _fitting(moment.text, 20, WIDTH - 48), 20, ink)

    @staticmethod
    def _card(image: Image.Image, lines: Sequence[tuple[str, int, Ink]]) -> None:
        """Draw lines of text on a translucent panel over the map."""
        pen = ImageDraw.Draw(image, "RGBA")
        wide = MAP[2] - 140
        rows = [(row, size, ink) for text, size, ink in lines if text for row in _wrapped(text, size, wide)[:4]][:14]
        high = sum(round(size * 1.45) for _, size, _ in rows) + 48
        top = max(MAP[1] + 8, (MAP[1] + MAP[3] - high) // 2)
        pen.rounded_rectangle((48, top, MAP[2] - 48, top + high), 14, fill=(*_PAPER, 222))
        y = top + 22
        for text, size, ink in rows:
            _write(pen, (70, y), text, size, ink)
            y += round(size * 1.45)


def _sign(pen: ImageDraw.ImageDraw, x: float, y: float, sight: str) -> None:
    ink, half = _SIGHTS[sight], 11
    if sight in ("known", "completed"):
        pen.ellipse(
            (x - half, y - half, x + half, y + half), fill=ink if sight == "completed" else None, outline=ink, width=4
        )
    else:
        corners = [(x, y - half - 2), (x + half, y), (x, y + half + 2), (x - half, y)]
        pen.polygon(corners, fill=ink if sight == "found" else None)
        pen.line([*corners, corners[0], corners[1]], fill=ink, width=4)


def _placed(
    box: tuple[float, float, float, float], left: int, top: int, size: tuple[int, int]
) -> tuple[float, float, float, float]:
    """Return a normalised box in pixels of the frame, clipped to the picture. A reported box may have any values."""
    x0, y0, x1, y1 = (min(1.0, max(0.0, part)) if math.isfinite(part) else 0.0 for part in box)
    right, bottom = left + size[0] - 1, top + size[1] - 1
    return (
        max(left, left + min(x0, x1) * size[0] - SPECK),
        max(top, top + min(y0, y1) * size[1] - SPECK),
        min(right, left + max(x0, x1) * size[0] + SPECK),
        min(bottom, top + max(y0, y1) * size[1] + SPECK),
    )


def _write(pen: ImageDraw.ImageDraw, at: tuple[float, float], text: str, size: int, ink: Ink) -> None:
    pen.text(at, text, font=font_of(text, size), fill=ink)


def _short(text: str, most: int) -> str:
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def _fitting(text: str, size: int, wide: float) -> str:
    """Return the text as one line, shortened to `wide` pixels."""
    line = _short(text, 400)
    while line and font_of(line, size).getlength(line) > wide:
        line = f"{line[: max(0, int(len(line) * 0.9) - 1)]}…"
    return line


def _wrapped(text: str, size: int, wide: float) -> list[str]:
    """Return the text in lines of at most `wide` pixels.

    A line may end between two ideographs. A word that is wider than a line is shortened.
    """
    rows: list[str] = []
    for piece in _PIECE.findall(_short(text, 600)):
        longer = f"{rows[-1]}{piece}" if rows else piece
        if rows and font_of(longer, size).getlength(longer.rstrip()) <= wide:
            rows[-1] = longer
        else:
            rows.append(_fitting(piece, size, wide) + piece[len(piece.rstrip()) :])
    return [row.rstrip() for row in rows]


_IDEOGRAPHS = "\u2e80-\u9fff\uac00-\ud7a3\uf900-\ufaff\uff00-\uffef"
"""Unicode blocks of CJK ideographs and Hangul, and their full-width forms."""
_PIECE = re.compile(f"[{_IDEOGRAPHS}] ?|[^ {_IDEOGRAPHS}]+ ?| ")
"""A word with the space behind it, or one ideograph."""


def font_of(text: str, size: int) -> ImageFont.FreeTypeFont:
    """Return a font that has the letters of a text, if there is one."""
    return font(size, missing_letters(text))


def frames_of(drawn: FilmFrames, places: Sequence[float], captions: Sequence[Moment]) -> Iterator[Image.Image]:
    """Yield the frames at `places` among the steps, with captions. Equal neighbours are drawn once."""
    before: tuple[float, Image.Image] | None = None
    for place in places:
        if before is None or before[0] != place:
            latest = [moment for moment in captions if moment.place <= place + 1e-6 and place - moment.place < 4.0]
            before = place, drawn.played(place, latest[-1] if latest else None)
        yield before[1]
