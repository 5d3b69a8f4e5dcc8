"""One street picture with 20 bodies at 1920x1080, colour, depth and ids, at eye height: milliseconds wall and CPU.

The street is that of `eyes.py`. The same view without bodies comes beside it, and the triangles of the bodies' finest
levels. Medians of alternating rounds come first, then the least CPU time, which depends least on what else runs.
"""

from __future__ import annotations

import statistics
from functools import partial

from eyes import beside
from eyes_street import SIZE, Body, Place, Street
from two_cameras import timed

ROUNDS = 15
KINDS = ("car", "car", "delivery_van", "car", "truck", "taxi", "bus", "car", "motorcycle", "bicycle")
VEHICLES, PEOPLE = 12, 8


def bodies(place: Place) -> list[Body]:
    """Return two lanes of vehicles and people on both sides of a place."""
    out = []
    for k in range(VEHICLES):
        side = -3.3 * (k % 2)
        out.append(Body(KINDS[k % len(KINDS)], k, beside(place, side, 4.0 + 7.0 * (k // 2), 180.0 * (k % 2))))
    return out + [
        Body("person", k, beside(place, 3.0 if k % 2 else -6.5, 1.0 + 4.0 * k, 45.0 * k)) for k in range(PEOPLE)
    ]


def main() -> None:
    """Print the table."""
    street = Street([*dict.fromkeys(KINDS), "person"], VEHICLES)
    print(f"{SIZE[0]}x{SIZE[1]}, RGB + depth + ids, median of {ROUNDS}, milliseconds wall / CPU (least CPU)\n")
    print("| place | empty street | with 20 bodies | pixels of bodies |")
    print("| --- | --- | --- | --- |")
    for number, place in enumerate(street.places(3, 5)):
        view, cast = street.view_of(place, 180.0, 8.0), bodies(place)
        spent = {len(shown): [] for shown in ((), cast)}
        for _ in range(ROUNDS + 1):
            for shown in ((), cast):
                spent[len(shown)].append(timed(partial(street.shoot, *view, shown)))
        pixels = sum(box.pixels for box in street.shoot(*view, cast).boxes if box is not None)
        cells = [" / ".join(f"{statistics.median(values):.0f}" for values in zip(*rows[1:], strict=True))
                 + f" ({min(cpu for _, cpu in rows[1:]):.0f})" for rows in spent.values()]  # fmt: skip
        print(f"| {number} | {' | '.join(cells)} | {pixels} |", flush=True)
    street.engine.close()


if __name__ == "__main__":
    main()
