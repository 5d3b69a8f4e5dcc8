"""The columns of a study: missions in their modes and, on request, at the values of their sweeps.

The columns follow from `Mission.modes` and `Mission.sweeps`; no mission is treated specially.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from lingjing.data import data_path
from lingjing.mission.evaluate import Scope, flag_of
from lingjing.mission.instantiate import parameters
from lingjing.mission.languages import ORIGINAL
from lingjing.mission.model import Mission, Sweep
from lingjing.mission.tiers import setting_number


@dataclass(frozen=True, slots=True)
class Column:
    """One mission in one mode at given settings."""

    path: Path
    """The mission file."""
    mission: str
    """The mission's name."""
    mode: str
    """The communication mode."""
    settings: Mapping[str, float] = field(default_factory=dict)
    """Parameter values (SI units) by name; empty: the mission's defaults."""
    tier: int = 0
    """The tier of the mission (`lingjing.mission.tiers`)."""
    language: str = ORIGINAL
    """The language of its texts (`lingjing.mission.languages`)."""

    @property
    def name(self) -> str:
        """The column's name, such as `ssr-star`, `ssr-star-uavs=2`, above tier 0 `ssr-star-tier1`, or `ssr-star-zh`."""
        tier = [f"tier{self.tier}"] if self.tier else []
        tier += [self.language] if self.language != ORIGINAL else []
        return "-".join([self.mission, self.mode, *tier, *(f"{key}={value:g}" for key, value in self.settings.items())])


def shipped() -> tuple[Path, ...]:
    """Return the mission files of the package, by name."""
    return tuple(sorted(data_path("scenarios").glob("*.ljs")))


def columns(
    paths: Iterable[Path],
    modes: Iterable[str] | None = None,
    *,
    sweeps: bool = False,
    tiers: Mapping[str, int] | None = None,
    language: str = ORIGINAL,
) -> tuple[Column, ...]:
    """Return every mission in every allowed mode (of `modes`, if set), at its defaults or at the values of its sweeps.

    `tiers`: mission → its tier; 0 for a mission without an entry. `language`: that of all.

    Raises `MissionError` for a file that does not compile.
    """
    chosen_modes = None if modes is None else frozenset(modes)
    columns_by_name: dict[str, Column] = {}
    for path in paths:
        mission = _compiled(path)
        for mode in mission.modes.allowed:
            for settings in (*({} for _ in range(not sweeps)), *(_swept(mission, mode) if sweeps else ())):
                column = Column(path, mission.name, mode, settings, (tiers or {}).get(mission.name, 0), language)
                if chosen_modes is None or mode in chosen_modes:
                    columns_by_name.setdefault(column.name, column)
    return tuple(columns_by_name.values())


def _compiled(path: Path) -> Mission:
    from lingjing.dsl.loading.load import load_mission

    return load_mission(path)


def _swept(mission: Mission, mode: str) -> Iterator[dict[str, float]]:
    """Yield the settings of every run of the sweeps that apply to the mode."""
    scope = Scope(parameters=parameters(mission, mode, {}), mode=mode)
    for sweep in mission.sweeps:
        if sweep.when is None or flag_of(sweep.when.condition, scope):
            yield from _runs(sweep, scope)


def _runs(sweep: Sweep, scope: Scope) -> Iterator[dict[str, float]]:
    values = [[setting_number(value, scope) for value in column] for column in sweep.values]
    for run in product(*values):
        yield dict(zip(sweep.parameters, run, strict=True))
