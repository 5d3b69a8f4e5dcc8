"""Shapes of which the tools make models: lofts, lathes, tubes, boxes, and patches that are projected onto a loft.

`Soup` is a list of triangles with a material each. `packed` brings it into the form that `models.stored` reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.models.stored import MATERIALS, UNIT_M

Array = npt.NDArray[np.float64]
Curve = tuple[tuple[float, float], ...]
Side = Literal["front", "back", "right"]


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

    def opposite(self) -> Soup:
        """Return the mirror image across x = 0."""
        flip = np.array([-1.0, 1.0, 1.0])
        return Soup((self.corners * flip)[:, ::-1], (self.normals * flip)[:, ::-1], self.materials)

    def mirrored(self) -> Soup:
        """Return the triangles with their mirror image across x = 0."""
        return self + self.opposite()


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


def rod(
    start: Sequence[float], end: Sequence[float], radii: tuple[float, float], material: str, sides: int = 6
) -> Soup:
    """Return a round bar between two points, without its ends."""
    a, b = np.array(start, float), np.array(end, float)
    axis = (b - a) / np.linalg.norm(b - a)
    across = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)[:, None]
    spokes = np.cos(angle) * across + np.sin(angle) * np.cross(axis, across)
    return surface(np.stack([b + radii[1] * spokes, a + radii[0] * spokes]), material, 80.0)


def egg(centre: Sequence[float], radii: Sequence[float], material: str, rows: int = 6, sides: int = 10) -> Soup:
    """Return an ellipsoid."""
    polar, around = np.linspace(0.0, np.pi, rows + 1)[:, None], np.linspace(0.0, 2.0 * np.pi, sides + 1)
    grid = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around),
                     np.cos(polar) + np.zeros(sides + 1)], -1)  # fmt: skip
    return surface(grid * np.array(radii) + np.array(centre), material, 80.0)


def narrow_wheel(radius: float, tyre: float, level: int, spokes: int) -> Soup:
    """Return the wheel of a cycle about its hub, its axle along x: a round tyre, a rim and spokes."""
    sides, rows = (20, 14, 8)[level], (8, 6, 4)[level]
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    circle = np.stack([np.zeros(sides + 1), np.cos(angle), -np.sin(angle)], 1)
    bend = np.linspace(0.0, 2.0 * np.pi, rows + 1)
    made = surface(np.stack([circle * (radius - tyre + tyre * np.cos(b)) + (tyre * np.sin(b), 0.0, 0.0) for b in bend]),
                   "tyre", 80.0)  # fmt: skip
    bars = []
    for turn in 2.0 * np.pi * np.arange(spokes) / spokes:
        out = np.array((0.0, np.cos(turn), np.sin(turn)))
        side = np.array((0.0, -np.sin(turn), np.cos(turn))) * (0.10 * radius if spokes < 8 else 0.012)
        a, b = out * 0.08 * radius, out * (radius - 1.6 * tyre)
        for x in (-0.012, 0.012):
            shift = np.array((x, 0.0, 0.0))
            p, q, r, t = a - side + shift, b - side + shift, b + side + shift, a + side + shift
            bars += [(p, q, r), (p, r, t)]
    return made + flat(np.array(bars), "rim") + box((0.0, 0.0, 0.0), (0.11, 0.09, 0.09), "rim")


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


def rect(left: float, right: float, low: float, high: float) -> list[tuple[float, float]]:
    """Return the corners of a rectangle, around it."""
    return [(left, low), (right, low), (right, high), (left, high)]


def packed(soup: Soup) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]:
    """Return rows of position (units of the file), normal (127ths) and material, without duplicates, and indices."""
    points = np.round(soup.corners.reshape(-1, 3) / UNIT_M)
    normals = np.round(soup.normals.reshape(-1, 3) * 127.0)
    rows = np.hstack([points, normals, np.repeat(soup.materials, 3)[:, None]]).astype(np.int16)
    vertices, index = np.unique(rows, axis=0, return_inverse=True)
    return vertices, index.ravel().astype(np.uint16)
