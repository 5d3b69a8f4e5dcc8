"""The columns of a study: missions in their modes and, if wanted, at the values of the sweeps that they declare.

Nothing here knows a mission: what is played follows from `Mission.modes` and `Mission.sweeps`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from lingjing.data import data_path
from lingjing.mission.evaluate import Scope, flag_of, number
from lingjing.mission.instantiate import parameters
from lingjing.mission.model import Mission, Sweep


@dataclass(frozen=True, slots=True)
class Column:
    """A mission file in a mode, with settings (SI values by parameter name)."""

    path: Path
    mission: str
    mode: str
    settings: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """`ssr-star`, `ssr-star-uavs=2`."""
        return "-".join([self.mission, self.mode, *(f"{key}={value:g}" for key, value in self.settings.items())])


def shipped() -> tuple[Path, ...]:
    """The mission files that come with the package, by name."""
    return tuple(sorted(data_path("scenarios").glob("*.ljs")))


def columns(paths: Iterable[Path], modes: Iterable[str] | None = None, *, sweeps: bool = False) -> tuple[Column, ...]:
    """Every mission in every mode that it allows (and that is in `modes`), at its defaults or at its sweeps' values.

    Raises `MissionError` for a file that does not compile.
    """
    wanted = None if modes is None else frozenset(modes)
    found: dict[str, Column] = {}
    for path in paths:
        mission = _compiled(path)
        for mode in mission.modes.allowed:
            for settings in (*({} for _ in range(not sweeps)), *(_swept(mission, mode) if sweeps else ())):
                column = Column(path, mission.name, mode, settings)
                if wanted is None or mode in wanted:
                    found.setdefault(column.name, column)
    return tuple(found.values())


def _compiled(path: Path) -> Mission:
    from lingjing.dsl.loading.load import load_mission

    return load_mission(path)


def _swept(mission: Mission, mode: str) -> Iterator[dict[str, float]]:
    """The settings of every run of every sweep that is meant for the mode."""
    scope = Scope(parameters=parameters(mission, mode, {}), mode=mode)
    for sweep in mission.sweeps:
        if sweep.when is None or flag_of(sweep.when.condition, scope):
            yield from _runs(sweep, scope)


def _runs(sweep: Sweep, scope: Scope) -> Iterator[dict[str, float]]:
    values = [[number(value, scope) for value in column] for column in sweep.values]
    for run in product(*values):
        yield dict(zip(sweep.parameters, run, strict=True))
