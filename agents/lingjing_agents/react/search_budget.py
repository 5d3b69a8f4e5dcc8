"""`SearchBudget`: the bound on repeated searches of searched cells (the paper's bounded re-search).

Every cell may be photographed once. Each further picture from over a searched cell counts; `rounds` rounds over all
cells are allowed. With 0 the search is a single pass.
"""

from __future__ import annotations

from lingjing.plugins.decisions import PHOTO
from lingjing.plugins.policy import Action, Brief, Cell, Observation
from lingjing_agents.ground_plane import inside


class SearchBudget:
    """The budget of one agent in one episode."""

    def __init__(self, brief: Brief, rounds: int) -> None:
        self._cells = brief.cells
        self._fliers = {
            resource.id
            for resource in brief.resources
            if resource.embodied and any(camera.view == "nadir" for camera in resource.cameras)
        }
        self.left = rounds * len(brief.cells)

    @property
    def applies(self) -> bool:
        """True if this agent photographs cells from above."""
        return bool(self._cells and self._fliers)

    def withheld(self, command: Action | None, observation: Observation) -> str:
        """Return the reason for which a command must not be sent: it would search a searched cell too often. Counts the
        command and returns "" if it may be sent."""
        if command is None or command.verb != PHOTO or command.resource not in self._fliers:
            return ""
        cell = self._searched_below(command.resource, observation)
        if cell is None:
            return ""
        if self.left == 0:
            return f"takePhoto was not given: {cell.name} was searched, and no cell may be searched again"
        self.left -= 1
        return ""

    def over(self, observation: Observation) -> bool:
        """Return True if nothing is left to search."""
        return self.applies and self.left == 0 and all(cell.visited_tick is not None for cell in observation.cells)

    def _searched_below(self, resource: str, observation: Observation) -> Cell | None:
        """Return the cell below an aircraft, if every cell there was searched."""
        place = next((view.position for view in observation.entities if view.id == resource), None)
        if place is None:
            return None
        searched = {cell.name for cell in observation.cells if cell.visited_tick is not None}
        below = [cell for cell in self._cells if inside(cell.polygon, place[:2])]
        return below[0] if below and all(cell.name in searched for cell in below) else None
