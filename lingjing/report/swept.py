"""Sweeps: episodes of a study that differ in one parameter of the mission alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from lingjing.bench.rows import RowKey, SuiteRow
from lingjing.errors import LingjingError
from lingjing.mission.expression import Number, Ref
from lingjing.mission.model import Mission
from lingjing.mission.units import unit_of
from lingjing.report.evidence import ReportStudy


class ParameterSweep(NamedTuple):
    """Episodes of a mission in a mode that differ in one parameter alone."""

    mission: str
    """Name of the mission."""

    mode: str
    """The communication mode."""

    parameter: str
    """Name of the parameter."""

    counts: bool
    """True if the parameter is a number of assets or targets."""

    unit: str
    """Unit in which the mission writes the parameter; empty if it has none."""

    points: Mapping[float, tuple[SuiteRow, ...]]
    """Rows by the value of the parameter (SI units or degrees), rising."""

    def words(self, value: float) -> str:
        """Return a value in the mission's unit, such as `60 m` or `20 %`."""
        known = unit_of(self.unit) if self.unit else None
        return f"{value / known.factor:.4g} {self.unit}" if known is not None else f"{value:.4g}"


def sweeps_of(study: ReportStudy) -> Iterator[ParameterSweep]:
    """Yield the sweep of every parameter that has at least two values while the others keep theirs."""
    for (mission, mode), rows in study.by(lambda row: (row.mission, row.mode)).items():
        usual = parameters_of(mission, mode)
        settings = {row.key: {**usual, **row.options.settings} for row in rows}
        names = sorted({name for values in settings.values() for name in values})
        varied = [name for name in names if len({values.get(name) for values in settings.values()}) > 1]
        basis = _basis(rows, settings, varied)
        for name in varied:
            alike = [
                row for row in rows
                if all(settings[row.key].get(other) == basis.get(other) for other in varied if other != name)
                and name in settings[row.key]
            ]  # fmt: skip
            points: dict[float, list[SuiteRow]] = {}
            for row in alike:
                points.setdefault(settings[row.key][name], []).append(row)
            if len(points) > 1:
                counts, unit = _meaning(mission, name)
                ordered = {value: tuple(points[value]) for value in sorted(points)}
                yield ParameterSweep(mission, mode, name, counts, unit, ordered)


def parameters_of(mission: str, mode: str) -> Mapping[str, float]:
    """Return the default values of a shipped mission's parameters; nothing for any other mission."""
    from lingjing.mission.instantiate import parameters

    model = _shipped(mission)
    try:
        return parameters(model, mode, {}) if model is not None else {}
    except LingjingError:
        return {}


def _basis(
    rows: Sequence[SuiteRow], settings: Mapping[RowKey, Mapping[str, float]], varied: Sequence[str]
) -> Mapping[str, float | None]:
    """Return the values that the other parameters of a sweep keep: those of baselines, else the most frequent ones."""
    own = [row for row in rows if row.baseline] or rows
    basis: dict[str, float | None] = {}
    for name in varied:
        values = [settings[row.key].get(name) for row in own]
        basis[name] = max(dict.fromkeys(values), key=values.count)
    return basis


def _meaning(mission: str, parameter: str) -> tuple[bool, str]:
    """Return if a parameter counts entities, and its unit in the mission."""
    model = _shipped(mission)
    if model is None:
        return False, ""
    counts = any(isinstance(group.count, Ref) and group.count.name == parameter for group in model.groups)
    default = next((declared.default for declared in model.parameters if declared.name == parameter), None)
    return counts, default.unit if isinstance(default, Number) else ""


@lru_cache(maxsize=32)
def _shipped(mission: str) -> Mission | None:
    from lingjing.dsl.loading.load import load_mission
    from lingjing.dsl.loading.shipped import find_mission, shipped_missions

    if mission not in shipped_missions():
        return None
    try:
        return load_mission(find_mission(f"scenarios/{mission}.ljs"))
    except LingjingError:
        return None


__all__ = ["ParameterSweep", "parameters_of", "sweeps_of"]
