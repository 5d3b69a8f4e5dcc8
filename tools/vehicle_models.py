"""Make the models of road vehicles: `lingjing/engines/camera/models/vehicles.npz`, which `models.stored` reads.

A vehicle is a *skin* and *patches*. The skin is a loft along y: its centre line is a side profile, its half width is a
plan times a flank (a factor by height), its lower edge rises over the wheels. Patches (windows, lamps, grille, bumper,
plates, door lines) are outlines that are projected onto the skin from ahead, astern or the side, and lifted off it. So
they follow its curves and have its smooth normals. Each model has three levels of detail.

`python tools/vehicle_models.py` writes the file anew, the same bytes each time.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.models.stored import FILE, MATERIALS, UNIT_M

Array = npt.NDArray[np.float64]
Curve = tuple[tuple[float, float], ...]
Side = Literal["front", "back", "right"]

LEVELS = 3


@dataclass(frozen=True)
class Soup:
    """Triangles: corners and normals (n, 3, 3), a material each."""

    corners: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    normals: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    materials: npt.NDArray[np.uint8] = field(default_factory=lambda: np.zeros(0, np.uint8))

    def __add__(self, other: Soup) -> Soup:
        return Soup(
            np.concatenate([self.corners, other.corners]),
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.materials, other.materials]),
        )

    def moved(self, x: float, y: float, z: float) -> Soup:
        """Return the triangles shifted by metres."""
        return Soup(self.corners + np.array((x, y, z)), self.normals, self.materials)

    def mirrored(self) -> Soup:
        """Return the triangles with their mirror image across x = 0."""
        flip = np.array([-1.0, 1.0, 1.0])
        return self + Soup((self.corners * flip)[:, ::-1], (self.normals * flip)[:, ::-1], self.materials)


@dataclass(frozen=True)
class Skin:
    """The measures of a loft; metres."""

    profile: Curve
    """Height of the centre line by y."""
    plan: Curve
    """Half width by y."""
    flank: Curve
    """Factor of the half width by height."""
    low: float
    """Height of the lower edge."""
    axles: tuple[float, ...] = ()
    """Places of the wheels along y."""
    arch: float = 0.0
    """Radius of the wheel arches about the axles."""
    hub: float = 0.0
    """Height of the axles."""
    corner: float = 0.12
    """Radius of the edge between side and top."""
    crown: float = 0.03
    """Rise of the top towards its middle."""


def at(curve: Curve, where: Array) -> Array:
    """Return a curve's values between its points."""
    xs, ys = zip(*curve, strict=True)
    return np.interp(where, xs, ys)


def stations(skin: Skin, level: int) -> Array:
    """Return the places of cross-sections: at the points of the curves, and around the arches."""
    ys = {y for y, _ in (*skin.profile, *skin.plan)}
    for axle in skin.axles:
        for angle in np.linspace(0.0, np.pi, (9, 7, 4)[level]):
            ys.add(round(axle + skin.arch * float(np.cos(angle)), 4))
    low, high = skin.profile[0][0], skin.profile[-1][0]
    placed = sorted(y for y in ys if low <= y <= high)
    gap = (0.02, 0.05, 0.12)[level]
    kept = placed[:1]
    for y in placed[1:-1]:
        if y - kept[-1] > gap and high - y > gap:
            kept.append(y)
    return np.array([*kept, placed[-1]])


def ring(skin: Skin, y: float, level: int) -> Array:
    """Return one cross-section's right half, from the lower edge to the middle of the top: (n, 2) of x and z."""
    top, low = float(at(skin.profile, np.array(y))), skin.low
    for axle in skin.axles:
        inside = skin.arch**2 - (y - axle) ** 2
        if inside >= -1e-9:
            low = max(low, skin.hub + float(np.sqrt(max(inside, 0.0))))
    low = min(low, top - 0.05)
    round_m = min(skin.corner, 0.45 * (top - low))
    sides = np.linspace(low, top - round_m, (7, 5, 3)[level])
    half = float(at(skin.plan, np.array(y)))
    x = half * at(skin.flank, sides)
    edge = np.linspace(0.0, np.pi / 2.0, (4, 3, 2)[level])[1:]
    last = x[-1]
    round_x = min(1.4 * round_m, 0.5 * last)
    bend = np.stack([last - round_x * (1.0 - np.cos(edge)), top - round_m + round_m * np.sin(edge)], 1)
    across = np.linspace(1.0, 0.0, (4, 3, 2)[level])[1:, None]
    roof = np.hstack([bend[-1, 0] * across, top + skin.crown * (1.0 - across**2)])
    return np.concatenate([np.stack([x, sides], 1), bend, roof])


def skinned(skin: Skin, level: int, material: str = "paint") -> Soup:
    """Return the loft with smooth normals, its ends closed and its floor dark."""
    ys = stations(skin, level)
    rings = np.stack([np.insert(ring(skin, float(y), level), 1, y, axis=1) for y in ys])
    sheet = surface(rings, material, crease_deg=50.0)
    ends = fan(rings[-1][::-1], material) + fan(rings[0], material)
    edge = rings[:, 0]
    middle = edge * (0.0, 1.0, 1.0)
    floor = surface(np.stack([middle, edge], 1), "under", crease_deg=180.0)
    return (sheet + ends + floor).mirrored()


def fan(edge: Array, material: str) -> Soup:
    """Return the flat end between an edge and the plane x = 0."""
    middle = edge * (0.0, 1.0, 1.0)
    triangles = []
    for k in range(len(edge) - 1):
        triangles += [(middle[k], edge[k], edge[k + 1]), (middle[k], edge[k + 1], middle[k + 1])]
    return flat(np.array(triangles), material)


def halved(grid: Array) -> Array:
    """Return the cells of a grid (rows, columns, 3) as two triangles each: (n, 3, 3)."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])


def surface(grid: Array, material: str, crease_deg: float) -> Soup:
    """Return a grid of points (rows, columns, 3) as triangles. Normals are smooth, except across sharp edges."""
    return smooth(halved(grid), material, crease_deg)


def smooth(corners: Array, material: str, crease_deg: float) -> Soup:
    """Return triangles with normals averaged over those neighbours at each corner that bend less than an angle."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    corners, across = corners[area > 1e-7], across[area > 1e-7]
    face = across / np.linalg.norm(across, axis=1, keepdims=True)
    _, which = np.unique(np.round(corners.reshape(-1, 3) / 1e-4), axis=0, return_inverse=True)
    which = which.reshape(-1, 3)
    normals = np.zeros_like(corners)
    least = np.cos(np.radians(crease_deg))
    order = np.argsort(which.ravel(), kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(which.ravel()[order])) + 1):
        mine = group // 3
        alike = face[mine] @ face[mine].T >= least
        total = alike @ across[mine]
        normals.reshape(-1, 3)[group] = total / np.linalg.norm(total, axis=1, keepdims=True).clip(1e-12)
    return Soup(corners, normals, np.full(len(corners), MATERIALS.index(material), np.uint8))


def flat(corners: Array, material: str) -> Soup:
    """Return triangles with the normals of their faces."""
    return smooth(np.asarray(corners, float).reshape(-1, 3, 3), material, 1.0)


def box(centre: Sequence[float], size: Sequence[float], material: str, bevel: float = 0.0) -> Soup:
    """Return a box; with a bevel, its long edges along y are cut."""
    w, half, h = (0.5 * measure for measure in size)
    b = bevel
    outline = [(-w, -h + b), (-w + b, -h), (w - b, -h), (w, -h + b), (w, h - b), (w - b, h), (-w + b, h), (-w, h - b)]
    return prism(outline, half, material).moved(*centre)


def prism(outline: Sequence[tuple[float, float]], half: float, material: str) -> Soup:
    """Return an anticlockwise outline (x, z; seen from astern) drawn out along y."""
    points = np.array(outline)
    near, far = np.insert(points, 1, -half, axis=1), np.insert(points, 1, half, axis=1)
    following = np.roll(np.arange(len(points)), -1)
    sides = np.concatenate([
        np.stack([near, near[following], far[following]], 1), np.stack([near, far[following], far], 1)
    ])  # fmt: skip
    ends = [(near[0], near[k + 1], near[k]) for k in range(1, len(points) - 1)]
    ends += [(far[0], far[k], far[k + 1]) for k in range(1, len(points) - 1)]
    return flat(np.concatenate([sides, np.array(ends)])[:, ::-1], material)


def wheel(radius: float, width: float, level: int, rim: float = 0.64) -> Soup:
    """Return a right wheel about its hub, its outer side at x = 0: a rounded tyre and a rim with five spokes."""
    sides = (18, 12, 8)[level]
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    circle = np.stack([np.zeros(sides + 1), np.cos(angle), -np.sin(angle)], 1)

    def lathe(outline: Sequence[tuple[float, float]], material: str) -> Soup:
        rows = [circle * r + (x, 0.0, 0.0) for x, r in outline]
        return surface(np.stack(rows), material, 40.0)

    bulge = 0.03 if level < 2 else 0.0
    made = lathe([(-width, radius * 0.7), (-width, radius - bulge), (-width + bulge, radius), (-bulge, radius),
                  (0.0, radius - bulge), (0.0, radius * rim)], "tyre")  # fmt: skip
    if level == 2:
        return made + lathe([(0.0, radius * rim), (0.0, 0.0)], "rim")
    made += lathe([(0.0, radius * rim), (-0.015, radius * (rim - 0.07)), (-0.05, radius * (rim - 0.08))], "rim")
    made += lathe([(-0.05, radius * (rim - 0.08)), (-0.05, 0.0)], "under")
    spokes = []
    for turn in 2.0 * np.pi * np.arange(5) / 5.0:
        ends = np.array([(0.0, -0.084), (rim - 0.06, -0.126), (rim - 0.06, 0.126), (0.0, 0.084)]) * radius
        along, across = ends[:, :1], ends[:, 1:]
        ahead, up = along * np.cos(turn) - across * np.sin(turn), along * np.sin(turn) + across * np.cos(turn)
        a, b, c, d = np.hstack([np.full((4, 1), -0.02), ahead, up])
        spokes += [(a, b, c), (a, c, d)]
    return made + flat(np.array(spokes), "rim")


class Projector:
    """Projects outlines onto a skin."""

    def __init__(self, skin: Soup) -> None:
        self.skin = skin

    def patch(self, side: Side, outline: Sequence[tuple[float, float]], material: str, lift: float = 0.006,
              cuts: tuple[int, int] = (4, 3)) -> Soup:  # fmt: skip
        """Return a four-cornered outline on the skin, with `cuts` cells along its first and second edge.

        Corners run around the patch: (x, z) seen from ahead or astern, (y, z) seen from the right.
        """
        p = np.array(outline)
        u, v = np.meshgrid(np.linspace(0, 1, cuts[0] + 1), np.linspace(0, 1, cuts[1] + 1), indexing="ij")
        u, v = u[..., None], v[..., None]
        grid = (1 - u) * (1 - v) * p[0] + u * (1 - v) * p[1] + u * v * p[2] + (1 - u) * v * p[3]
        points, normals = self._hits(side, grid.reshape(-1, 2))
        points = (points + lift * normals).reshape(*grid.shape[:2], 3)
        shading = normals.reshape(points.shape)
        tri, lit = halved(points), halved(shading)
        facing = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
        turned = np.einsum("nj,nj->n", facing, lit.mean(axis=1)) < 0.0
        tri[turned], lit[turned] = tri[turned][:, ::-1], lit[turned][:, ::-1]
        kept = np.linalg.norm(facing, axis=1) > 1e-8
        return Soup(tri[kept], lit[kept], np.full(int(kept.sum()), MATERIALS.index(material), np.uint8))

    def _hits(self, side: Side, where: Array) -> tuple[Array, Array]:
        """Return the outermost points of the skin behind plane points, with normals; missing ones take the nearest."""
        axis, sign, plane = {"front": (1, 1.0, (0, 2)), "back": (1, -1.0, (0, 2)), "right": (0, 1.0, (1, 2))}[side]
        paint = self.skin
        tri = paint.corners[:, :, plane]
        a, b, c = tri[:, 0], tri[:, 1], tri[:, 2]
        det = (b[:, 1] - c[:, 1]) * (a[:, 0] - c[:, 0]) + (c[:, 0] - b[:, 0]) * (a[:, 1] - c[:, 1])
        safe = np.where(np.abs(det) < 1e-12, np.inf, det)
        out, lit = np.zeros((len(where), 3)), np.zeros((len(where), 3))
        for k, point in enumerate(where):
            s = ((b[:, 1] - c[:, 1]) * (point[0] - c[:, 0]) + (c[:, 0] - b[:, 0]) * (point[1] - c[:, 1])) / safe
            t = ((c[:, 1] - a[:, 1]) * (point[0] - c[:, 0]) + (a[:, 0] - c[:, 0]) * (point[1] - c[:, 1])) / safe
            weights = np.stack([s, t, 1.0 - s - t], 1)
            inside = (weights >= -1e-6).all(axis=1) & np.isfinite(safe)
            if not inside.any():
                near = paint.corners.reshape(-1, 3)
                ranked = np.linalg.norm(near[:, plane] - point, axis=1) - 0.05 * sign * near[:, axis]
                best = int(ranked.argmin())
                out[k], lit[k] = near[best], paint.normals.reshape(-1, 3)[best]
                continue
            depth = np.einsum("nk,nk->n", weights, paint.corners[:, :, axis]) * sign
            best = int(np.where(inside, depth, -np.inf).argmax())
            out[k] = weights[best] @ paint.corners[best]
            normal = weights[best] @ paint.normals[best]
            lit[k] = normal / max(float(np.linalg.norm(normal)), 1e-9)
        return out, lit


@dataclass(frozen=True)
class Car:
    """A motorcar by its side profile."""

    skin: Skin
    wheel: float
    """Radius of the wheels."""
    track: float
    """Distance of the wheels' outer sides from the middle."""
    windows: tuple[tuple[tuple[float, float], ...], ...]
    """Side windows: corners (y, z)."""
    screen: tuple[tuple[float, float], ...]
    """Windscreen seen from ahead: corners (x, z)."""
    rear: tuple[tuple[float, float], ...]
    """Rear window seen from astern: corners (x, z)."""
    doors: tuple[float, ...]
    """Places of the door lines along y."""
    belt: float
    """Height of the belt line at the doors."""
    nose: float
    """Height of the lamps in front."""
    tail: float
    """Height of the lamps astern."""
    tall_tail: bool = False
    """True for upright rear lamps."""


def rect(left: float, right: float, low: float, high: float) -> list[tuple[float, float]]:
    """Return the corners of a rectangle, around it."""
    return [(left, low), (right, low), (right, high), (left, high)]


def motorcar(car: Car, level: int) -> Soup:
    """Return a car at a level of detail."""
    body = skinned(car.skin, level)
    on, fine = Projector(skinned(car.skin, 0)), level == 0
    cut = ((4, 3), (2, 2), (1, 1))[level]
    made = body
    for window in car.windows:
        made += on.patch("right", window, "glass", 0.008, cut).mirrored()
    made += on.patch("front", car.screen, "glass", 0.008, ((6, 4), (4, 2), (2, 1))[level])
    made += on.patch("back", car.rear, "glass", 0.008, ((6, 3), (4, 2), (2, 1))[level])
    half = float(at(car.skin.plan, np.array(car.skin.profile[-1][0])))
    made += on.patch("front", lamp(half, car.nose, 0.145), "lamp", 0.012, cut).mirrored()
    tails = rect(half * 0.70, half * 1.02, car.tail - 0.14, car.tail + 0.16) if car.tall_tail else \
        rect(half * 0.55, half * 1.04, car.tail - 0.075, car.tail + 0.075)  # fmt: skip
    made += on.patch("back", tails, "tail", 0.012, cut).mirrored()
    made += on.patch("front", rect(-0.52 * half, 0.52 * half, car.nose - 0.10, car.nose + 0.035), "black", 0.012, cut)
    made += on.patch(
        "front", rect(-0.62 * half, 0.62 * half, car.skin.low + 0.07, car.skin.low + 0.20), "black", 0.01, cut
    )
    made += on.patch(
        "back", rect(-0.85 * half, 0.85 * half, car.skin.low + 0.03, car.skin.low + 0.17), "black", 0.01, cut
    )
    made += on.patch("back", rect(-0.26, 0.26, car.tail - 0.20, car.tail - 0.09), "plate", 0.02, (1, 1))
    if level < 2:
        made += on.patch("front", rect(-0.26, 0.26, car.nose - 0.25, car.nose - 0.14), "plate", 0.02, (1, 1))
        made += mirror(car)
        sill = [(car.skin.axles[0] + car.skin.arch + 0.03, car.skin.low),
                (car.skin.axles[1] - car.skin.arch - 0.03, car.skin.low),
                (car.skin.axles[1] - car.skin.arch - 0.03, car.skin.low + 0.07),
                (car.skin.axles[0] + car.skin.arch + 0.03, car.skin.low + 0.07)]  # fmt: skip
        made += on.patch("right", sill, "black", 0.006, (2, 1)).mirrored()
    if fine:
        for y in car.doors:
            made += on.patch(
                "right", rect(y - 0.010, y + 0.010, car.skin.low + 0.08, car.belt), "seam", 0.004, (1, 5)
            ).mirrored()
        for y in car.doors[1:]:
            made += on.patch(
                "right", rect(y + 0.06, y + 0.24, car.belt - 0.13, car.belt - 0.095), "chrome", 0.02, (1, 1)
            ).mirrored()
        made += on.patch(
            "front", rect(-0.40 * half, 0.40 * half, car.nose - 0.045, car.nose - 0.02), "chrome", 0.016, (3, 1)
        )
    for y in car.skin.axles:
        made += wheel(car.wheel, 0.21, level).moved(car.track, y, car.wheel).mirrored()
    return made


def lamp(half: float, z: float, tall: float) -> list[tuple[float, float]]:
    """Return the outline of a right headlamp that rises towards the side."""
    return [
        (half * 0.60, z - 0.4 * tall),
        (half * 1.06, z - 0.25 * tall),
        (half * 1.10, z + 0.65 * tall),
        (half * 0.60, z + 0.35 * tall),
    ]


def mirror(car: Car) -> Soup:
    """Return both outside mirrors."""
    window = car.windows[-1]
    y = max(corner[0] for corner in window) - 0.22
    wide = float(at(car.skin.plan, np.array(y))) * float(at(car.skin.flank, np.array(car.belt)))
    return box((wide + 0.09, y, car.belt + 0.07), (0.20, 0.11, 0.14), "paint", 0.03).mirrored()


FLANK: Curve = ((0.15, 0.93), (0.34, 0.985), (0.55, 1.0), (0.78, 0.985), (0.90, 0.945), (0.96, 0.915), (1.46, 0.70))
"""The flank of a low car."""

SEDAN = Car(
    skin=Skin(
        profile=((-2.25, 0.62), (-2.22, 0.80), (-2.14, 0.95), (-2.0, 1.00), (-1.66, 1.03), (-1.50, 1.08),
                 (-1.0, 1.33), (-0.75, 1.405),
                 (-0.40, 1.44), (0.0, 1.445), (0.25, 1.41), (0.42, 1.355), (1.10, 0.985), (1.22, 0.94),
                 (1.75, 0.865), (2.05, 0.77),
                 (2.18, 0.68), (2.25, 0.55)),
        plan=((-2.25, 0.72), (-2.19, 0.80), (-2.0, 0.855), (-1.4, 0.895), (0.0, 0.90), (1.3, 0.895), (1.85, 0.85),
              (2.10, 0.77), (2.25, 0.62)),
        flank=FLANK, low=0.21, axles=(-1.33, 1.38), arch=0.39, hub=0.32, corner=0.11,
    ),
    wheel=0.32, track=0.88,
    windows=(((-1.32, 0.985), (-0.93, 0.975), (-0.90, 1.33), (-1.02, 1.28)), ((-0.86, 0.975), (-0.14, 0.965),
                                                                              (-0.14, 1.365), (-0.82, 1.345)),
             ((-0.05, 0.965), (0.88, 0.955), (0.40, 1.285), (-0.05, 1.365))),
    screen=((-0.70, 1.0), (0.70, 1.0), (0.55, 1.385), (-0.55, 1.385)),
    rear=((-0.66, 1.10), (0.66, 1.10), (0.52, 1.37), (-0.52, 1.37)),
    doors=(-0.92, -0.10, 0.98), belt=0.93, nose=0.635, tail=0.80,
)  # fmt: skip
HATCH = Car(
    skin=Skin(
        profile=((-2.05, 0.60), (-2.03, 0.85), (-1.98, 1.02), (-1.88, 1.22), (-1.74, 1.41), (-1.60, 1.465),
                 (-1.0, 1.50), (-0.2, 1.51),
                 (0.15, 1.475), (0.34, 1.42), (1.05, 1.02), (1.18, 0.97), (1.60, 0.88), (1.88, 0.79), (2.0, 0.70),
                 (2.06, 0.56)),
        plan=((-2.05, 0.74), (-2.0, 0.80), (-1.8, 0.85), (-1.2, 0.88), (0.0, 0.885), (1.2, 0.88), (1.65, 0.84),
              (1.92, 0.76), (2.06, 0.62)),
        flank=((0.15, 0.93), (0.34, 0.985), (0.55, 1.0), (0.80, 0.985), (0.93, 0.945), (0.99, 0.92), (1.52, 0.73)),
        low=0.21, axles=(-1.25, 1.26), arch=0.39, hub=0.32, corner=0.11,
    ),
    wheel=0.32, track=0.865,
    windows=(((-1.72, 1.06), (-1.10, 1.0), (-1.06, 1.40), (-1.56, 1.38)), ((-1.0, 1.0), (-0.24, 0.99),
                                                                           (-0.24, 1.425), (-0.96, 1.41)),
             ((-0.14, 0.99), (0.83, 0.985), (0.32, 1.34), (-0.14, 1.425))),
    screen=((-0.70, 1.035), (0.70, 1.035), (0.56, 1.45), (-0.56, 1.45)),
    rear=((-0.63, 1.09), (0.63, 1.09), (0.54, 1.40), (-0.54, 1.40)),
    doors=(-1.06, -0.19, 0.93), belt=0.95, nose=0.67, tail=0.90, tall_tail=True,
)  # fmt: skip
SUV = Car(
    skin=Skin(
        profile=((-2.3, 0.66), (-2.28, 0.98), (-2.22, 1.15), (-2.12, 1.42), (-2.0, 1.60), (-1.86, 1.66),
                 (-1.2, 1.69), (-0.2, 1.695),
                 (0.12, 1.66), (0.30, 1.60), (0.94, 1.18), (1.08, 1.13), (1.6, 1.07), (2.0, 1.0), (2.18, 0.90),
                 (2.3, 0.66)),
        plan=((-2.3, 0.78), (-2.24, 0.84), (-2.0, 0.88), (-1.2, 0.905), (0.0, 0.91), (1.2, 0.905), (1.8, 0.875),
              (2.12, 0.81), (2.3, 0.68)),
        flank=((0.25, 0.95), (0.46, 0.99), (0.70, 1.0), (0.95, 0.985), (1.06, 0.95), (1.13, 0.925), (1.70, 0.765)),
        low=0.30, axles=(-1.36, 1.36), arch=0.45, hub=0.37, corner=0.11,
    ),
    wheel=0.37, track=0.90,
    windows=(((-2.0, 1.18), (-1.18, 1.14), (-1.15, 1.58), (-1.86, 1.55)), ((-1.08, 1.14), (-0.24, 1.13),
                                                                           (-0.24, 1.60), (-1.05, 1.59)),
             ((-0.14, 1.13), (0.76, 1.125), (0.28, 1.50), (-0.14, 1.60))),
    screen=((-0.73, 1.20), (0.73, 1.20), (0.60, 1.62), (-0.60, 1.62)),
    rear=((-0.66, 1.22), (0.66, 1.22), (0.58, 1.57), (-0.58, 1.57)),
    doors=(-1.13, -0.19, 0.90), belt=1.09, nose=0.86, tail=1.02, tall_tail=True,
)  # fmt: skip
VAN = Car(
    skin=Skin(
        profile=((-2.95, 0.60), (-2.94, 2.30), (-2.90, 2.50), (-2.75, 2.565), (-1.5, 2.58), (1.0, 2.57),
                 (1.25, 2.50), (1.42, 2.38), (2.18, 1.40),
                 (2.30, 1.29), (2.70, 1.14), (2.86, 1.0), (2.95, 0.62)),
        plan=((-2.95, 0.96), (-2.88, 1.0), (-2.0, 1.02), (1.6, 1.02), (2.2, 0.97), (2.6, 0.90), (2.82, 0.80),
              (2.95, 0.66)),
        flank=((0.2, 0.96), (0.5, 1.0), (1.1, 1.0), (1.25, 0.985), (2.0, 0.93), (2.6, 0.87)),
        low=0.30, axles=(-1.80, 1.82), arch=0.44, hub=0.35, corner=0.14, crown=0.02,
    ),
    wheel=0.35, track=1.0,
    windows=(((0.95, 1.34), (1.98, 1.32), (1.42, 2.02), (0.95, 2.06)),),
    screen=((-0.84, 1.42), (0.84, 1.42), (0.74, 2.32), (-0.74, 2.32)),
    rear=((-0.72, 1.45), (0.72, 1.45), (0.66, 2.15), (-0.66, 2.15)),
    doors=(-0.55, 0.78, 2.02), belt=1.25, nose=0.92, tail=1.10, tall_tail=True,
)  # fmt: skip

CAB = Car(
    skin=Skin(
        profile=((2.40, 2.50), (2.46, 2.68), (2.60, 2.74), (3.70, 2.72), (3.98, 2.64), (4.12, 2.50), (4.40, 1.62),
                 (4.45, 1.45), (4.48, 0.75)),
        plan=((2.40, 1.13), (3.9, 1.15), (4.3, 1.12), (4.42, 1.05), (4.48, 0.98)),
        flank=((0.4, 0.97), (0.7, 1.0), (1.5, 1.0), (1.7, 0.985), (2.74, 0.88)),
        low=0.52, axles=(3.2,), arch=0.60, hub=0.48, corner=0.12, crown=0.02,
    ),
    wheel=0.48, track=1.13,
    windows=(((2.85, 1.55), (4.16, 1.52), (3.92, 2.32), (2.85, 2.36)),),
    screen=((-0.96, 1.62), (0.96, 1.62), (0.88, 2.52), (-0.88, 2.52)),
    rear=((-0.5, 1.8), (0.5, 1.8), (0.5, 2.3), (-0.5, 2.3)),
    doors=(2.70, 4.22), belt=1.46, nose=0.92, tail=1.2,
)  # fmt: skip
"""The cab of a truck, a car without a back."""


def delivery_van(level: int) -> Soup:
    """Return a van with a sliding door, rear doors and rubbing strips."""
    made = motorcar(VAN, level)
    on = Projector(skinned(VAN.skin, 0))
    if level < 2:
        made += on.patch("right", rect(-1.33, 1.35, 0.62, 0.74), "black", 0.012, (6, 1)).mirrored()
        made += on.patch("back", rect(-0.012, 0.012, 0.65, 2.35), "seam", 0.012, (1, 3))
    if level == 0:
        made += on.patch("right", rect(-2.6, 0.7, 1.60, 1.63), "seam", 0.006, (4, 1)).mirrored()
        made += on.patch("right", rect(-2.75, -2.73, 0.6, 2.3), "seam", 0.006, (1, 4)).mirrored()
        made += on.patch("front", rect(-0.55, 0.55, 1.0, 1.05), "black", 0.012, (4, 1))
    return made


def box_truck(level: int) -> Soup:
    """Return a truck: a cab over the engine, a chassis with tank, guards and wheels, and a framed box with doors."""
    on, cut = Projector(skinned(CAB.skin, 0)), ((4, 3), (2, 2), (1, 1))[level]
    made = skinned(CAB.skin, level)
    for window in CAB.windows:
        made += on.patch("right", window, "glass", 0.01, cut).mirrored()
    made += on.patch("front", CAB.screen, "glass", 0.01, ((6, 3), (4, 2), (2, 1))[level])
    made += on.patch("front", rect(-0.62, 0.62, 1.10, 1.40), "black", 0.015, cut)
    made += on.patch("front", rect(0.58, 0.95, 0.86, 1.04), "lamp", 0.015, cut).mirrored()
    made += box((0.0, 4.46, 0.66), (2.24, 0.14, 0.30), "bumper", 0.03)
    made += box((0.0, -1.15, 2.20), (2.46, 6.60, 2.60), "cargo")
    made += box((0.0, -0.9, 0.72), (0.9, 7.0, 0.26), "under")
    made += box((1.08, -4.44, 0.96), (0.26, 0.06, 0.20), "tail").mirrored()
    made += box((0.0, -4.44, 0.62), (2.3, 0.10, 0.14), "under")
    if level < 2:
        made += truck_details(on, level)
    for y in (-2.7, 3.2):
        made += wheel(0.48, 0.30, level, 0.58).moved(1.13, y, 0.48).mirrored()
    return made


def truck_details(on: Projector, level: int) -> Soup:
    """Return what only the finer levels of a truck show: mirrors, frame, doors, tank, guards."""
    made = box((1.32, 4.05, 2.05), (0.16, 0.12, 0.50), "black", 0.02).mirrored()
    made += on.patch("front", rect(-0.26, 0.26, 0.60, 0.72), "plate", 0.10, (1, 1))
    for z in (0.93, 3.47):
        made += box((1.225, -1.15, z), (0.05, 6.64, 0.09), "chrome").mirrored()
        made += box((0.0, -4.45, z), (2.46, 0.05, 0.09), "chrome")
        made += box((0.0, 2.15, z), (2.46, 0.05, 0.09), "chrome")
    for y in (-4.45, 2.15):
        made += box((1.225, y, 2.20), (0.06, 0.06, 2.60), "chrome").mirrored()
    made += box((0.0, -4.462, 2.20), (0.03, 0.03, 2.50), "black")
    made += box((0.35, -4.468, 2.10), (0.03, 0.03, 2.30), "chrome").mirrored()
    made += box((0.0, -4.50, 0.84), (0.52, 0.03, 0.12), "plate")
    made += box((0.95, 1.2, 0.66), (0.45, 1.1, 0.46), "bumper", 0.08).mirrored()
    made += box((1.12, -0.6, 0.62), (0.06, 2.0, 0.10), "bumper").mirrored()
    made += box((1.12, -0.6, 0.86), (0.06, 2.0, 0.08), "bumper").mirrored()
    made += box((0.98, -2.7, 1.02), (0.36, 1.15, 0.05), "black").mirrored()
    if level == 0:
        made += on.patch("right", rect(2.72, 2.74, 0.75, 1.48), "seam", 0.006, (1, 4)).mirrored()
        made += on.patch("right", rect(4.20, 4.22, 0.75, 1.48), "seam", 0.006, (1, 4)).mirrored()
        made += on.patch("right", rect(2.82, 3.05, 1.32, 1.37), "chrome", 0.02, (1, 1)).mirrored()
        for y in (-3.4, -2.3, -1.2, -0.1, 1.0):
            made += box((1.232, y, 2.20), (0.012, 0.05, 2.5), "cargo").mirrored()
    return made


MADE = {
    "sedan": lambda level: motorcar(SEDAN, level),
    "hatch": lambda level: motorcar(HATCH, level),
    "suv": lambda level: motorcar(SUV, level),
    "van": delivery_van,
    "truck": box_truck,
}
"""All models by name."""


def packed(soup: Soup) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]:
    """Return rows of position (units of the file), normal (127ths) and material, without duplicates, and indices."""
    points = np.round(soup.corners.reshape(-1, 3) / UNIT_M)
    normals = np.round(soup.normals.reshape(-1, 3) * 127.0)
    rows = np.hstack([points, normals, np.repeat(soup.materials, 3)[:, None]]).astype(np.int16)
    vertices, index = np.unique(rows, axis=0, return_inverse=True)
    return vertices, index.ravel().astype(np.uint16)


def main() -> None:
    """Write the file, and print the triangles of each level."""
    arrays = {}
    for name, make in MADE.items():
        counts = []
        for level in range(LEVELS):
            vertices, index = packed(make(level))
            arrays[f"{name}/{level}/vertices"], arrays[f"{name}/{level}/index"] = vertices, index
            counts.append(len(index) // 3)
        print(f"{name}: {', '.join(map(str, counts))} triangles")
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    np.savez_compressed(file, **arrays)


if __name__ == "__main__":
    main()
