"""Which parameters of missions a study sweeps, and what each of them is: how many there are, or something else."""

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
    """Episodes of a mission in a mode that differ in one parameter alone, by its values (SI units) in order.

    `counts` is whether the parameter is how many assets or targets there are; `unit` is that of its words.
    """

    mission: str
    mode: str
    parameter: str
    counts: bool
    unit: str
    points: Mapping[float, tuple[SuiteRow, ...]]

    def words(self, value: float) -> str:
        """A value as people write it: `60 m`, `20 %`."""
        known = unit_of(self.unit) if self.unit else None
        return f"{value / known.factor:.4g} {self.unit}" if known is not None else f"{value:.4g}"


def sweeps_of(study: ReportStudy) -> Iterator[ParameterSweep]:
    """Every parameter that has two values or more while the others stay as they are."""
    for (mission, mode), rows in study.by(lambda row: (row.mission, row.mode)).items():
        usual = parameters_of(mission, mode)
        settings = {row.key: {**usual, **row.options.settings} for row in rows}
        names = sorted({name for each in settings.values() for name in each})
        varied = [name for name in names if len({each.get(name) for each in settings.values()}) > 1]
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
    """The values that a shipped mission's parameters have by themselves; nothing for any other."""
    from lingjing.mission.instantiate import parameters

    found = _shipped(mission)
    try:
        return parameters(found, mode, {}) if found is not None else {}
    except LingjingError:
        return {}


def _basis(
    rows: Sequence[SuiteRow], settings: Mapping[RowKey, Mapping[str, float]], varied: Sequence[str]
) -> Mapping[str, float | None]:
    """The values around which the sweeps are: those of baselines, else the most frequent ones."""
    own = [row for row in rows if row.baseline] or rows
    found: dict[str, float | None] = {}
    for name in varied:
        values = [settings[row.key].get(name) for row in own]
        found[name] = max(dict.fromkeys(values), key=values.count)
    return found


def _meaning(mission: str, parameter: str) -> tuple[bool, str]:
    """Whether a parameter counts entities, and its unit as the mission has it."""
    found = _shipped(mission)
    if found is None:
        return False, ""
    counts = any(isinstance(group.count, Ref) and group.count.name == parameter for group in found.groups)
    default = next((one.default for one in found.parameters if one.name == parameter), None)
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
