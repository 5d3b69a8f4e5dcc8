"""Make the models of people: `lingjing/engines/camera/models/people.npz`, which `models.skeleton` reads.

A figure is a skin of tubes about a skeleton at rest: trunk, head with face and hair, arms, hands, legs and shoes, and
what it wears. Each tube is a list of rings; a vertex belongs to one or two joints by its place along the tube. Figures
differ in age, build and clothes; their colours come from the looks of `models.people`. Each has three levels of detail.

`python tools/people_models.py` writes the file anew, the same bytes each time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from model_lofts import Array, Soup, flat, halved, smooth

from lingjing.engines.camera.models.skeleton import JOINTS, WEIGHT_UNIT
from lingjing.engines.camera.models.stored import FOLDER, LEVELS, MATERIALS, UNIT_M

Weights = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Array]
"""First joint, second joint, and weight of the first, of points."""
Binding = Callable[[Array], Weights]
Ring = tuple[float, float, float, float, str]
"""Height, place ahead, half width, half depth (m) and the material up to the next ring."""

REST: dict[str, tuple[float, float, float]] = {
    "pelvis": (0.0, 0.0, 0.95), "spine": (0.0, -0.01, 1.08), "head": (0.0, 0.0, 1.50),
    "arm_right": (0.185, -0.01, 1.415), "elbow_right": (0.236, -0.02, 1.125),
    "leg_right": (0.088, 0.0, 0.90), "knee_right": (0.092, 0.0, 0.48), "foot_right": (0.095, -0.02, 0.085),
    "arm_left": (-0.185, -0.01, 1.415), "elbow_left": (-0.236, -0.02, 1.125),
    "leg_left": (-0.088, 0.0, 0.90), "knee_left": (-0.092, 0.0, 0.48), "foot_left": (-0.095, -0.02, 0.085),
}  # fmt: skip
"""Joints of a person of 1.75 m at rest."""
SIDES = {"trunk": (18, 12, 6), "limb": (11, 7, 4), "head": (16, 10, 6), "hand": (8, 5, 4)}
"""Sides of the tubes at each level."""


@dataclass(frozen=True)
class Figure:
    """A person's age, build and clothes."""

    height_m: float = 1.75
    wide: float = 1.0
    """Factor of the trunk's and limbs' girth."""
    belly: float = 0.0
    """Extra depth at the waist, metres."""
    head: float = 1.0
    """Factor of the head's size against the body's."""
    shoulders: float = 1.0
    hips: float = 1.0
    stoop_m: float = 0.0
    """Shift of shoulders and head ahead, metres."""
    sleeves: str = "coat"
    """Material of the forearms."""
    shins: str = "trousers"
    """Material of the lower legs."""
    thighs: str = "trousers"
    skirt: tuple[float, float, str] | None = None
    """Height of a skirt's hem (m), its half width there, and its material."""
    hair: str = "short"
    """`short`, `long`, `tail`, `bald`, `cap`, `hood`, `helmet` or `hat`."""
    front: str = ""
    """`suit`, `open`, `bands`, `vest` or nothing."""
    bag: bool = False


FIGURES = {
    "jacket": Figure(),
    "tshirt": Figure(1.79, sleeves="skin"),
    "suit": Figure(1.80, front="suit"),
    "coat": Figure(1.67, wide=0.92, shoulders=0.90, hips=1.02, skirt=(0.52, 0.23, "coat"), shins="trousers",
                   hair="long",
                   front="open"),
    "dress": Figure(1.66, wide=0.88, shoulders=0.88, hips=1.06, skirt=(0.50, 0.24, "coat"), sleeves="skin",
                    shins="skin", thighs="skin", hair="long"),
    "blouse": Figure(1.68, wide=0.90, shoulders=0.90, hips=1.06, hair="tail", bag=True),
    "hoodie": Figure(1.73, wide=0.96, hair="hood", bag=True),
    "worker": Figure(1.77, wide=1.04, hair="helmet", front="bands"),
    "child": Figure(1.42, wide=0.98, head=1.17, shoulders=0.92, sleeves="skin", shins="skin", hair="short", bag=True),
    "elder": Figure(1.69, wide=1.02, belly=0.02, stoop_m=0.06, hair="hat", front="open"),
    "heavy": Figure(1.78, wide=1.15, belly=0.06, shoulders=1.04, hair="bald", sleeves="coat"),
    "skirt": Figure(1.65, wide=0.90, shoulders=0.90, hips=1.06, skirt=(0.58, 0.20, "trousers"), shins="skin",
                    thighs="skin", hair="tail"),
    "swimmer": Figure(1.76, sleeves="coat", hair="short"),
    "lifevest": Figure(1.76, sleeves="shirt", hair="short", front="vest"),
    "rider": Figure(1.75, wide=1.03, hair="visor"),
    "cyclist": Figure(1.76, wide=0.96, hair="helmet", sleeves="skin", shins="skin"),
}  # fmt: skip
"""All figures by name."""


def by(x: float, y: float, z: float) -> Array:
    """Return a shift."""
    return np.array((x, y, z))


class Body:
    """The triangles of a figure, with the joints of their corners."""

    def __init__(self, figure: Figure, level: int) -> None:
        self.figure, self.level = figure, level
        self.soups: list[Soup] = []
        self.joints: list[Array] = []

    def add(self, soup: Soup, bind: Binding) -> None:
        """Add triangles that are bound to joints."""
        first, second, weight = bind(soup.corners.reshape(-1, 3))
        self.soups.append(soup)
        self.joints.append(np.stack([first, second, weight], 1))

    def sides(self, kind: str) -> int:
        """Return the sides of tubes of a kind."""
        return SIDES[kind][self.level]

    def tube(self, rings: Sequence[Ring], sides: int, bind: Binding, power: float = 2.0, x: float = 0.0,
             closed: bool = True) -> None:  # fmt: skip
        """Add a tube along z through superelliptic rings about (x, ahead); `closed` closes its ends."""
        kept = [r for k, r in enumerate(rings) if self.level < 2 or k % 2 == 0 or k == len(rings) - 1]
        self.loft([(np.array((x, y, z)), np.array((rx, 0.0, 0.0)), np.array((0.0, ry, 0.0)), name)
                   for z, y, rx, ry, name in kept], sides, bind, power, closed)  # fmt: skip

    def loft(self, rings, sides: int, bind: Binding, power: float = 2.0, closed: bool = True) -> None:
        """Add a tube through rings (centre, half axis, half axis, material up to the next ring)."""
        angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
        c, s = np.cos(angle), np.sin(angle)
        across = np.sign(c) * np.abs(c) ** (2.0 / power)
        along = np.sign(s) * np.abs(s) ** (2.0 / power)
        grid = np.stack([o + across[:, None] * u + along[:, None] * v for o, u, v, _ in rings])
        names = [name for *_, name in rings[:-1]]
        if closed:
            grid = np.concatenate([np.broadcast_to(rings[0][0], (1, *grid.shape[1:])), grid,
                                   np.broadcast_to(rings[-1][0], (1, *grid.shape[1:]))])  # fmt: skip
            names = [names[0], *names, names[-1]]
        corners = np.concatenate([halved(grid[k : k + 2]) for k in range(len(names))])
        cells = np.repeat(np.array([MATERIALS.index(name) for name in names]), 2 * sides)
        u, v = rings[0][1], rings[0][2]
        if np.cross(u, v) @ (rings[-1][0] - rings[0][0]) > 0.0:
            corners = corners[:, ::-1]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-7
        made = smooth(corners, "skin", 75.0)
        self.add(Soup(made.corners, made.normals, cells[area].astype(np.uint8)), bind)

    def patch(self, corners: Sequence[Sequence[float]], material: str, joint: str) -> None:
        """Add a flat polygon that belongs to one joint."""
        p = [np.array(corner, float) for corner in corners]
        self.add(flat(np.array([(p[0], p[k], p[k + 1]) for k in range(1, len(p) - 1)]), material), only(joint))


def only(joint: str) -> Binding:
    """Return the binding of all points to one joint."""
    number = JOINTS.index(joint)
    return lambda points: (np.full(len(points), number), np.full(len(points), number), np.ones(len(points)))


def along(stops: Sequence[tuple[float, str]]) -> Binding:
    """Return a binding by height: at each stop (m, falling or rising) the joint has all the weight."""
    heights = np.array([z for z, _ in stops])
    order = np.argsort(heights)
    numbers = np.array([JOINTS.index(joint) for _, joint in stops])[order]
    heights = heights[order]

    def bind(points: Array) -> Weights:
        place = np.interp(points[:, 2], heights, np.arange(len(heights), dtype=float))
        low = np.clip(place.astype(int), 0, len(heights) - 2)
        return numbers[low], numbers[low + 1], 1.0 - (place - low)

    return bind


def hanging(points: Array) -> Weights:
    """Return the binding of a skirt: from the pelvis above to the leg of its side below."""
    share = np.clip((0.90 - points[:, 2]) / 0.30, 0.0, 0.85) * np.clip(np.abs(points[:, 0]) / 0.10, 0.0, 1.0)
    leg = np.where(points[:, 0] > 0.0, JOINTS.index("leg_right"), JOINTS.index("leg_left"))
    return np.full(len(points), JOINTS.index("pelvis")), leg, 1.0 - share


def trunk(body: Body) -> None:
    """Add trunk and neck."""
    f = body.figure
    w, b, stoop, hips, chest = f.wide, f.belly, f.stoop_m, f.hips, f.shoulders
    rings: list[Ring] = [
        (0.835, 0.0, 0.120 * w, 0.085 * w, "trousers"),
        (0.87, -0.005, 0.160 * w * hips, 0.108 * w, "trousers"),
        (0.93, -0.012, 0.172 * w * hips, 0.118 * w, "trousers"),
        (0.965, -0.010, 0.168 * w * hips, 0.114 * w, "trousers"),
        (0.968, -0.010, 0.176 * w * hips, 0.124 * w + b, "coat"),
        (1.02, 0.3 * b - 0.006, 0.168 * w * hips, 0.116 * w + b, "coat"),
        (1.10, 0.4 * b, 0.152 * w, 0.106 * w + b, "coat"),
        (1.20, 0.3 * b, 0.164 * w * chest, 0.114 * w + 0.7 * b, "coat"),
        (1.30, 0.2 * stoop, 0.180 * w * chest, 0.122 * w + 0.3 * b, "coat"),
        (1.38, 0.6 * stoop - 0.008, 0.184 * w * chest, 0.112 * w, "coat"),
        (1.425, 0.8 * stoop - 0.012, 0.158 * w * chest, 0.092 * w, "coat"),
        (1.455, 0.9 * stoop - 0.012, 0.110 * w * chest, 0.076, "coat"),
        (1.482, stoop - 0.010, 0.068, 0.064, "coat"),
        (1.492, stoop - 0.006, 0.058, 0.058, "skin"),
        (1.57, stoop + 0.008, 0.054, 0.058, "skin"),
    ]
    bind = along([(0.95, "pelvis"), (1.12, "spine"), (1.47, "spine"), (1.55, "head")])
    body.tube(rings, body.sides("trunk"), bind, 2.6)
    if f.skirt is not None:
        hem, half, name = f.skirt
        body.tube(
            [(1.03, 0.0, 0.160 * w * hips, 0.115 * w + b, name), (0.93, -0.008, 0.186 * w * hips, 0.135 * w + b, name),
             (0.80, -0.005, 0.195 * w * hips, 0.150 * w, name), (0.5 * (0.80 + hem), 0.0, 0.5 * (0.20 + half),
                                                                 0.16, name),
             (hem, 0.0, half, 0.17, name)],
            body.sides("trunk"), hanging, 2.3, closed=False,
        )  # fmt: skip
    if body.level < 2:
        front(body)


def front(body: Body) -> None:
    """Add what closes or marks the coat in front."""
    f = body.figure
    y = 0.128 * f.wide + 0.6 * f.belly
    s = f.stoop_m
    if f.front == "suit":
        body.patch([(0.0, y + 0.004, 1.14), (0.055, y - 0.030 + s, 1.455), (-0.055, y - 0.030 + s, 1.455)], "shirt",
                   "spine")  # fmt: skip
        body.patch([(0.0, y + 0.007, 1.15), (0.020, y + 0.006, 1.20), (0.010, y - 0.020 + s, 1.44),
                    (-0.010, y - 0.020 + s, 1.44), (-0.020, y + 0.006, 1.20)], "bag", "spine")  # fmt: skip
    if f.front == "open":
        body.patch([(-0.045, y + 0.008, 0.98), (0.045, y + 0.008, 0.98), (0.050, y + 0.002, 1.22),
                    (0.055, y - 0.030 + s, 1.45), (-0.055, y - 0.030 + s, 1.45), (-0.050, y + 0.002, 1.22)],
                   "shirt", "spine")  # fmt: skip
    if f.front == "bands":
        for z in (1.06, 1.22):
            body.tube([(z - 0.025, 0.0, 0.176, 0.126, "white"), (z + 0.025, 0.0, 0.181, 0.130, "white")],
                      body.sides("trunk"), only("spine"), 2.6, closed=False)  # fmt: skip
        for x in (-0.09, 0.09):
            body.patch([(x - 0.022, 0.128, 1.24), (x + 0.022, 0.128, 1.24), (x + 0.022, 0.100, 1.43),
                        (x - 0.022, 0.100, 1.43)], "white", "spine")  # fmt: skip
    if f.front == "vest":
        body.tube([(1.03, 0.0, 0.175, 0.150, "coat"), (1.10, 0.005, 0.205, 0.185, "coat"),
                   (1.30, 0.01, 0.215, 0.195, "coat"), (1.42, 0.0, 0.175, 0.150, "coat"),
                   (1.48, -0.01, 0.125, 0.115, "coat")], body.sides("trunk"), only("spine"), 2.8)  # fmt: skip
        body.tube([(1.485, -0.02, 0.135, 0.120, "coat"), (1.53, -0.02, 0.145, 0.130, "coat"),
                   (1.56, -0.03, 0.105, 0.095, "coat")], body.sides("trunk"), only("spine"), 2.2)  # fmt: skip
        for z in (1.15, 1.32):
            body.tube([(z - 0.018, 0.008, 0.212, 0.193, "white"), (z + 0.018, 0.008, 0.217, 0.198, "white")],
                      body.sides("trunk"), only("spine"), 2.8, closed=False)  # fmt: skip


def limbs(body: Body, side: str) -> None:
    """Add arm, hand, leg and shoe of one side."""
    f = body.figure
    sign = 1.0 if side == "right" else -1.0
    w = f.wide
    rest = {name: np.array(place) for name, place in REST.items()}
    shoulder, elbow = (rest[f"{part}_{side}"] for part in ("arm", "elbow"))
    shoulder = shoulder * (f.shoulders * (0.5 + 0.5 * w), 1.0, 1.0) + by(0.0, 0.8 * f.stoop_m, 0.0)
    elbow = elbow * (f.shoulders * (0.5 + 0.5 * w), 1.0, 1.0) + by(0.0, 0.7 * f.stoop_m, 0.0)
    wrist = elbow + by(sign * 0.030, 0.030, -0.255)
    cloth = 1.0 if f.sleeves != "skin" else 0.86
    upper = "coat" if f.sleeves in ("coat", "skin") else f.sleeves

    def point(start: Array, end: Array, share: float) -> Array:
        return start + share * (end - start)

    def ring(place: Array, radius: float, name: str):
        return place, np.array((radius * w, 0.0, 0.0)), np.array((0.0, radius * w * 1.05, 0.0)), name

    half = 0.55 if f.sleeves == "skin" else 1.1
    arm = [ring(shoulder + by(-sign * 0.035, 0.0, 0.035), 0.030, upper), ring(shoulder + by(0.0, 0.0, 0.012),
                                                                              0.062, upper),
           ring(point(shoulder, elbow, 0.25), 0.061, upper),
           ring(point(shoulder, elbow, half if half < 1.0 else 0.6), 0.054 if half < 1.0 else 0.053, f.sleeves),
           ring(elbow, 0.047 * cloth, f.sleeves), ring(point(elbow, wrist, 0.3), 0.047 * cloth, f.sleeves),
           ring(point(elbow, wrist, 0.92), 0.038 * cloth, f.sleeves), ring(wrist, 0.027, "skin")]  # fmt: skip
    bind = along([(1.45, "spine"), (1.37, f"arm_{side}"), (1.19, f"arm_{side}"), (1.07, f"elbow_{side}")])
    body.loft(arm if body.level < 2 else arm[::2] + arm[-1:], body.sides("limb"), bind)
    palm = wrist + by(sign * 0.012, 0.012, -0.085)
    hand = [
        (wrist + by(0, 0, 0.02), np.array((0.024, 0, 0)), np.array((0, 0.028, 0)), "skin"),
        (point(wrist, palm, 0.5), np.array((0.024, 0, 0)), np.array((0, 0.042, 0)), "skin"),
        (palm, np.array((0.022, 0, 0)), np.array((0, 0.042, 0)), "skin"),
        (palm + by(sign * 0.004, 0.012, -0.075), np.array((0.014, 0, 0)), np.array((0, 0.028, 0)), "skin"),
    ]
    body.loft(hand, body.sides("hand"), only(f"elbow_{side}"), 2.4)
    if body.level == 0:
        thumb = palm + by(-sign * 0.01, 0.040, 0.02)
        body.loft([(thumb, np.array((0.012, 0, 0)), np.array((0, 0.012, 0)), "skin"),
                   (thumb + by(0.0, 0.022, -0.055), np.array((0.009, 0, 0)), np.array((0, 0.009, 0)), "skin")],
                  5, only(f"elbow_{side}"))  # fmt: skip
    leg(body, side, sign, w)


def leg(body: Body, side: str, sign: float, w: float) -> None:
    """Add leg and shoe of one side."""
    f = body.figure
    x, shin = sign * 0.090, f.shins
    loose = 1.0 if shin == "trousers" else 0.86
    thigh = 1.0 if f.thighs == "trousers" else 0.92
    hips = 0.5 + 0.5 * f.hips
    end = 0.09 if shin == "trousers" else 0.08
    rings: list[Ring] = [
        (0.93, -0.01, 0.080 * w * hips, 0.095 * w, f.thighs),
        (0.84, -0.008, 0.090 * w * thigh * hips, 0.100 * w * thigh, f.thighs),
        (0.72, 0.0, 0.081 * w * thigh, 0.090 * w * thigh, f.thighs),
        (0.58, 0.004, 0.068 * w * thigh, 0.074 * w * thigh, f.thighs),
        (0.50, 0.006, 0.060 * w * loose, 0.066 * w * loose, f.thighs if shin == "skin" else shin),
        (0.44, 0.0, 0.057 * w * loose, 0.062 * w * loose, shin),
        (0.34, -0.016, 0.056 * w * loose, 0.064 * w * loose, shin),
        (0.22, -0.018, 0.050 * w * loose, 0.055 * w * loose, shin),
        (0.13, -0.018, 0.047 * w * loose**2, 0.052 * w * loose**2, shin),
        (end, -0.014, 0.050 * w * loose**3, 0.058 * w * loose**3, shin),
    ]
    bind = along([(0.98, "pelvis"), (0.86, f"leg_{side}"), (0.54, f"leg_{side}"), (0.42, f"knee_{side}"),
                  (0.13, f"knee_{side}"), (0.07, f"foot_{side}")])  # fmt: skip
    body.tube(rings, body.sides("limb"), bind, 2.1, x)

    def sole(y: float, wide: float, tall: float):
        return np.array((x + sign * 0.01, y, tall)), np.array((wide, 0.0, 0.0)), np.array((0.0, 0.0, tall)), "shoes"

    shoe = [sole(-0.088, 0.026, 0.032), sole(-0.07, 0.038, 0.048), sole(0.0, 0.043, 0.055), sole(0.06, 0.046, 0.042),
            sole(0.13, 0.046, 0.032), sole(0.178, 0.030, 0.022)]  # fmt: skip
    body.loft(shoe if body.level < 2 else shoe[1::2], body.sides("hand"), only(f"foot_{side}"), 3.0)


HEAD: tuple[tuple[float, float, float, float], ...] = (
    (1.522, 0.050, 0.022, 0.026),
    (1.532, 0.044, 0.040, 0.044),
    (1.555, 0.032, 0.054, 0.066),
    (1.585, 0.020, 0.065, 0.084),
    (1.615, 0.012, 0.071, 0.094),
    (1.645, 0.006, 0.075, 0.099),
    (1.675, 0.002, 0.076, 0.100),
    (1.705, -0.002, 0.071, 0.093),
    (1.732, -0.004, 0.054, 0.073),
    (1.748, -0.006, 0.030, 0.042),
)
"""Rings of a head: height, place ahead, half width, half depth; metres."""


def head(body: Body) -> None:
    """Add head, face and hair."""
    f, bind = body.figure, only("head")
    size, stoop = f.head, f.stoop_m

    def grown(rows, material: str, factor: float = 1.0) -> list[Ring]:
        middle = 1.522
        return [(middle + (z - middle) * size, stoop + y * size, rx * size * factor, ry * size * factor, material)
                for z, y, rx, ry in rows]  # fmt: skip

    def at(x: float, y: float, z: float) -> tuple[float, float, float]:
        return x * size, stoop + y * size, 1.522 + (z - 1.522) * size

    body.tube(grown(HEAD, "skin"), body.sides("head"), bind, 2.1)
    if body.level < 2 and f.hair != "visor":
        for side in (-1.0, 1.0):
            body.patch([at(side * 0.018, 0.1055, 1.637), at(side * 0.047, 0.094, 1.638), at(side * 0.046,
                                                                                            0.0945, 1.650),
                        at(side * 0.018, 0.1055, 1.652)], "eye", "head")  # fmt: skip
            body.patch([at(side * 0.014, 0.107, 1.660), at(side * 0.051, 0.0925, 1.661), at(side * 0.049,
                                                                                            0.0925, 1.669),
                        at(side * 0.014, 0.1055, 1.670)], "hair", "head")  # fmt: skip
            ear = grown(
                [(1.60, -0.005, 0.012, 0.016), (1.63, -0.01, 0.016, 0.024), (1.655, -0.012, 0.012, 0.016)], "skin"
            )
            body.tube(ear, 5, bind, 2.0, side * 0.076 * size)
            nose = [at(0.0, 0.106, 1.655), at(side * 0.017, 0.103, 1.605), at(0.0, 0.128, 1.610)]
            body.patch(nose, "skin", "head")
        body.patch([at(-0.017, 0.103, 1.605), at(0.017, 0.103, 1.605), at(0.0, 0.128, 1.610)], "skin", "head")
        body.patch([at(-0.024, 0.100, 1.576), at(0.024, 0.100, 1.576), at(0.020, 0.102, 1.584), at(-0.020,
                                                                                                   0.102, 1.584)],
                   "lip", "head")  # fmt: skip
    worn(body, grown, at)


def worn(body: Body, grown, at) -> None:
    """Add hair or what covers it."""
    f, bind, sides = body.figure, only("head"), body.sides("head")
    if f.hair == "visor":
        body.tube(grown([(1.50, 0.02, 0.085, 0.10), (1.54, 0.015, 0.112, 0.130), (1.62, 0.008, 0.124, 0.145),
                         (1.70, 0.0, 0.118, 0.138), (1.76, -0.01, 0.085, 0.10), (1.785, -0.01, 0.035, 0.045)],
                        "helmet"), sides, bind)  # fmt: skip
        if body.level < 2:
            body.tube(grown([(1.60, 0.018, 0.118, 0.140), (1.63, 0.016, 0.121, 0.1445), (1.68, 0.010, 0.117, 0.1405)],
                            "black"), sides, bind, closed=False)  # fmt: skip
        return
    cap = [(1.585, -0.028, 0.058, 0.064), (1.615, -0.026, 0.073, 0.078), (1.645, -0.022, 0.081, 0.088),
           (1.672, -0.014, 0.084, 0.096), (1.690, -0.004, 0.082, 0.105), (1.722, -0.004, 0.070, 0.092),
           (1.748, -0.006, 0.046, 0.062), (1.762, -0.008, 0.022, 0.030)]  # fmt: skip
    if f.hair == "bald":
        body.tube(grown(cap[:4], "hair", 0.97), sides, bind)
    elif f.hair == "long":
        body.tube(grown([(1.43, -0.085, 0.085, 0.034), (1.50, -0.075, 0.098, 0.052), (1.56, -0.050, 0.096, 0.070),
                         (1.62, -0.034, 0.092, 0.082), *cap[3:]], "hair", 1.03), sides, bind)  # fmt: skip
    else:
        body.tube(grown(cap, "hair"), sides, bind)
    if f.hair == "tail":
        body.tube(grown([(1.44, -0.15, 0.012, 0.014), (1.54, -0.155, 0.030, 0.032), (1.64, -0.13, 0.030, 0.034),
                         (1.69, -0.10, 0.02, 0.02)], "hair"), max(sides // 2, 4), bind)  # fmt: skip
    if f.hair == "helmet":
        body.tube(grown([(1.662, -0.008, 0.100, 0.125), (1.672, -0.008, 0.096, 0.118), (1.71, -0.006, 0.090, 0.108),
                         (1.755, -0.006, 0.062, 0.076), (1.782, -0.006, 0.022, 0.028)], "helmet"), sides,
                         bind)  # fmt: skip
        body.tube(grown([(1.664, 0.09, 0.070, 0.062), (1.674, 0.085, 0.068, 0.060)], "helmet"), sides, bind)
    if f.hair == "hat":
        body.tube(grown([(1.690, 0.0, 0.092, 0.118), (1.715, -0.004, 0.096, 0.120), (1.745, -0.006, 0.080, 0.100),
                         (1.762, -0.006, 0.03, 0.04)], "bag"), sides, bind)  # fmt: skip
        body.tube(grown([(1.692, 0.095, 0.066, 0.050), (1.702, 0.090, 0.062, 0.046)], "bag"), sides, bind)
    if f.hair == "hood":
        stoop = f.stoop_m
        body.tube([(1.42, stoop - 0.11, 0.060, 0.030, "coat"), (1.47, stoop - 0.085, 0.105, 0.062, "coat"),
                   (1.53, stoop - 0.060, 0.098, 0.062, "coat"), (1.545, stoop - 0.045, 0.06, 0.04, "coat")],
                  sides, only("spine"))  # fmt: skip


def bag(body: Body) -> None:
    """Add a rucksack with straps."""
    w = body.figure.wide
    y = -0.118 * w
    body.tube([(1.06, y - 0.07, 0.115, 0.055, "bag"), (1.10, y - 0.085, 0.145, 0.082, "bag"),
               (1.32, y - 0.080, 0.140, 0.078, "bag"), (1.42, y - 0.050, 0.100, 0.050, "bag")],
              body.sides("limb"), only("spine"), 3.4)  # fmt: skip
    if body.level == 0:
        for side in (-1.0, 1.0):
            x = side * 0.105 * w * body.figure.shoulders
            body.patch([(x - 0.022, 0.122 * w, 1.16), (x + 0.022, 0.120 * w, 1.16), (x + 0.022, 0.112 * w, 1.36),
                        (x + 0.020, 0.078 * w, 1.46), (x - 0.022, 0.084 * w, 1.462), (x - 0.022, 0.120 * w, 1.36)],
                       "bag", "spine")  # fmt: skip


def figure_body(figure: Figure, level: int) -> Body:
    """Return all parts of a figure at a level of detail, for a person of 1.75 m."""
    body = Body(figure, level)
    trunk(body)
    for side in ("right", "left"):
        limbs(body, side)
    head(body)
    if figure.bag:
        bag(body)
    return body


def packed_figure(figure: Figure, level: int) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]:
    """Return rows of position, normal, material, two joints and the first one's weight, and indices."""
    body = figure_body(figure, level)
    scale = figure.height_m / 1.75
    points = np.concatenate([soup.corners for soup in body.soups]).reshape(-1, 3) * scale
    normals = np.concatenate([soup.normals for soup in body.soups]).reshape(-1, 3)
    materials = np.repeat(np.concatenate([soup.materials for soup in body.soups]), 3)
    joints = np.concatenate(body.joints)
    rows = np.hstack([np.round(points / UNIT_M), np.round(normals * 127.0), materials[:, None], joints[:, :2],
                      np.round(joints[:, 2:] * WEIGHT_UNIT)]).astype(np.int16)  # fmt: skip
    vertices, index = np.unique(rows, axis=0, return_inverse=True)
    return vertices, index.ravel().astype(np.uint16)


def packed_joints(figure: Figure) -> npt.NDArray[np.int16]:
    """Return the joints of a figure at rest."""
    rest = np.array([REST[name] for name in JOINTS])
    wide = np.array([figure.shoulders * (0.5 + 0.5 * figure.wide) if "arm" in name or "elbow" in name else 1.0
                     for name in JOINTS])  # fmt: skip
    ahead = np.array([0.8 * figure.stoop_m if "arm" in name or "elbow" in name else 0.0 for name in JOINTS])
    rest = rest * np.stack([wide, np.ones(len(JOINTS)), np.ones(len(JOINTS))], 1)
    rest[:, 1] += ahead
    return np.round(rest * figure.height_m / 1.75 / UNIT_M).astype(np.int16)


def main() -> None:
    """Write the file, and print the triangles of each level."""
    arrays = {}
    for name, figure in FIGURES.items():
        arrays[f"{name}/joints"] = packed_joints(figure)
        counts = []
        for level in range(LEVELS):
            vertices, index = packed_figure(figure, level)
            arrays[f"{name}/{level}/vertices"], arrays[f"{name}/{level}/index"] = vertices, index
            counts.append(len(index) // 3)
        print(f"{name}: {', '.join(map(str, counts))} triangles")
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER / "people.npz"
    np.savez_compressed(file, **arrays)


if __name__ == "__main__":
    main()
