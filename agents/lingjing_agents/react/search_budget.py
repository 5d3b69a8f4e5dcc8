"""`SearchBudget`: the bound on repeated searches (the paper's bounded re-search).

Where agents receive the share of each cell's ground that was seen, the bound is an area: `rounds` times the area of all
cells may be photographed again. Each picture costs the part of its footprint that was seen before. An agent has nothing
left to search once the area is used and the ground of all cells was seen.

Elsewhere the bound is the paper's count: every cell may be photographed once, and each further picture from over a
searched cell counts; `rounds` rounds over all cells are allowed. With 0 the search is a single pass.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.plugins.decisions import PHOTO
from lingjing.plugins.geometry import camera_pose, ground_footprint
from lingjing.plugins.policy import Action, Brief, CameraSpec, Cell, EntityView, Observation
from lingjing_agents.ground_plane import GroundPoint, inside
from lingjing_agents.react.facts import phrases_of

SEEN = 0.95
"""Share of a cell's ground from which on the cell counts as seen. Chosen: its rim would need pictures of its own."""

MOSTLY = 0.5
"""Share of a picture's ground from which on it repeats a search. Chosen."""

_SAMPLES = 7
"""Points on each side of a footprint at which its cells are looked up. Chosen."""


class SearchBudget:
    """The budget of one agent in one episode."""

    def __init__(self, brief: Brief, rounds: int) -> None:
        self._cells, self._level_m = brief.cells, brief.water_level_m
        self._say = phrases_of(brief)
        self._cameras = {
            resource.id: camera
            for resource in brief.resources
            if resource.embodied
            for camera in resource.cameras
            if camera.view == "nadir"
        }
        self.left = rounds * len(brief.cells)
        """Pictures of searched cells that are left, where agents receive no shares."""
        self.left_m2 = rounds * sum(_area_m2(cell.polygon) for cell in brief.cells)
        """Ground that may be seen again, square metres, where they do."""

    @property
    def applies(self) -> bool:
        """True if this agent photographs cells from above."""
        return bool(self._cells and self._cameras)

    def members(self, observation: Observation) -> Mapping[str, object]:
        """Return what is left of the bound as a member of the state: ground where the agent receives shares, else
        pictures."""
        if not self.applies:
            return {}
        if _shares(observation) is None:
            return {"pictures_of_searched_cells_left": self.left}
        return {"ground_that_may_be_seen_again_m2": round(self.left_m2)}

    def withheld(self, command: Action | None, observation: Observation) -> str:
        """Return the reason for which a command must not be sent: it would repeat a search too often. Counts the
        command and returns "" if it may be sent."""
        if command is None or command.verb != PHOTO or command.resource not in self._cameras:
            return ""
        shares = _shares(observation)
        if shares is not None:
            return self._withheld_area(command.resource, observation, shares)
        cell = self._searched_below(command.resource, observation)
        if cell is None:
            return ""
        if self.left == 0:
            return self._say(
                "takePhoto was not given: {cell} was searched, and no cell may be searched again", cell=cell.name
            )
        self.left -= 1
        return ""

    def over(self, observation: Observation) -> bool:
        """Return True if nothing is left to search."""
        if not self.applies:
            return False
        shares = _shares(observation)
        if shares is not None:
            return self.left_m2 <= 0.0 and all(share >= SEEN for share in shares.values())
        return self.left == 0 and all(cell.visited_tick is not None for cell in observation.cells)

    def _withheld_area(self, resource: str, observation: Observation, shares: dict[str, float]) -> str:
        view = next((view for view in observation.entities if view.id == resource), None)
        repeated, share = self._repeated(view, self._cameras[resource], shares)
        if share > MOSTLY and repeated > self.left_m2:
            return self._say(
                "takePhoto was not given: {share:.0%} of the ground below was seen, and no more may be seen again",
                share=share,
            )
        self.left_m2 = max(0.0, self.left_m2 - repeated)
        return ""

    def _repeated(self, view: EntityView | None, camera: CameraSpec, shares: dict[str, float]) -> tuple[float, float]:
        """Return the ground of a picture that was seen before, square metres, and its share of the picture."""
        if view is None or view.position is None:
            return 0.0, 0.0
        shown = ground_footprint(camera_pose(view.position, view.heading_deg or 0.0, camera), self._level_m)
        if shown is None:
            return 0.0, 0.0
        steps = [(n + 0.5) / _SAMPLES for n in range(_SAMPLES)]
        points = [_between(shown, across, down) for across in steps for down in steps]
        own = [
            max((shares.get(cell.name, 0.0) for cell in self._cells if inside(cell.polygon, point)), default=0.0)
            for point in points
        ]
        share = sum(own) / len(own)
        return share * _area_m2(shown), share

    def _searched_below(self, resource: str, observation: Observation) -> Cell | None:
        """Return the cell below an aircraft, if every cell there was searched."""
        place = next((view.position for view in observation.entities if view.id == resource), None)
        if place is None:
            return None
        searched = {cell.name for cell in observation.cells if cell.visited_tick is not None}
        below = [cell for cell in self._cells if inside(cell.polygon, place[:2])]
        return below[0] if below and all(cell.name in searched for cell in below) else None


def _shares(observation: Observation) -> dict[str, float] | None:
    """Return the share of each cell's ground that was seen, or None if the mission does not tell it."""
    shares = {cell.name: cell.seen for cell in observation.cells if cell.seen is not None}
    return shares or None


def _between(corners: tuple[GroundPoint, ...], across: float, down: float) -> GroundPoint:
    """Return the point at these shares of the sides of a four-cornered footprint."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners
    top, bottom = (ax + across * (bx - ax), ay + across * (by - ay)), (dx + across * (cx - dx), dy + across * (cy - dy))
    return top[0] + down * (bottom[0] - top[0]), top[1] + down * (bottom[1] - top[1])


def _area_m2(polygon: tuple[GroundPoint, ...]) -> float:
    """Return the area of a polygon of either orientation."""
    after = (*polygon[1:], *polygon[:1])
    return abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(polygon, after, strict=True))) / 2.0
