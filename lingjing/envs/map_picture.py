"""A map of an episode's present state from above, as a picture for `render`, and a window that shows it."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lingjing.errors import UsageError
from lingjing.mission.instance import Instance
from lingjing.trace.records import BodyState

SIZE_PX = 480
"""Width and height of the map, pixels (chosen)."""

_COLOURS = {"asset": (30, 90, 200), "target": (200, 60, 40)}
_OTHER = (110, 110, 110)
_DOT_PX = 5


def map_picture(instance: Instance, states: Mapping[str, BodyState], reach_m: float) -> npt.NDArray[np.uint8]:
    """Return the map, `SIZE_PX` × `SIZE_PX` × 3: public regions as outlines, entities as dots in the colour of their
    role. The map shows the square of `reach_m` around the origin; entities outside are at its edge.
    """
    from PIL import Image, ImageDraw

    picture = Image.new("RGB", (SIZE_PX, SIZE_PX), (245, 245, 240))
    draw = ImageDraw.Draw(picture)

    def place(east: float, north: float) -> tuple[float, float]:
        x, y = (0.5 + part / (2.2 * reach_m) for part in (east, -north))
        return min(max(x, 0.0), 1.0) * (SIZE_PX - 1), min(max(y, 0.0), 1.0) * (SIZE_PX - 1)

    for region in instance.regions:
        if not region.hidden and len(region.polygon) > 2:
            draw.polygon([place(point[0], point[1]) for point in region.polygon], outline=(150, 160, 150))
    for entity in instance.entities:
        if entity.id in states:
            x, y = place(*states[entity.id].position[:2])
            colour = _COLOURS.get(entity.role, _OTHER)
            draw.ellipse((x - _DOT_PX, y - _DOT_PX, x + _DOT_PX, y + _DOT_PX), fill=colour)
    return np.asarray(picture, np.uint8)


class MapWindow:
    """A window with the latest map, through pygame, which Gymnasium's own environments use too."""

    def __init__(self) -> None:
        self._pygame = self.check()
        try:
            self._pygame.display.init()
            self._screen = self._pygame.display.set_mode((SIZE_PX, SIZE_PX))
        except self._pygame.error as error:
            raise UsageError(f"no window can be opened: {error}", hint='use render_mode="rgb_array"') from error
        self._pygame.display.set_caption("Lingjing")

    @staticmethod
    def check() -> Any:
        """Return the module pygame. Raises `UsageError` if it is not installed."""
        try:
            return importlib.import_module("pygame")
        except ImportError as error:
            hint = 'run `pip install pygame`, or use render_mode="rgb_array"'
            raise UsageError('render_mode="human" needs the package pygame', hint=hint) from error

    def show(self, picture: npt.NDArray[np.uint8]) -> None:
        """Show a map, height × width × 3."""
        surface = self._pygame.surfarray.make_surface(np.swapaxes(picture, 0, 1))
        self._screen.blit(surface, (0, 0))
        self._pygame.event.pump()  # otherwise the window system takes the window for hung
        self._pygame.display.flip()

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()
