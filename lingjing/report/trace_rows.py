"""Rows of single traces, with entrants and conditions as the traces record them.

The conditions are the differences among the traces of one mission and mode: parameters of the mission, and options of
the policies. The mission's own values without options are the baseline.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import msgspec

from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.mission.instance import GivenOption
from lingjing.play.options import PlayOptions
from lingjing.play.report import report_of
from lingjing.report.swept import parameters_of
from lingjing.trace.reader import Trace


def row_of(trace: Trace) -> SuiteRow:
    """Return the row of one trace, without its condition, which depends on the other traces."""
    header = trace.header
    instance, arguments = header.instance, dict[str, GivenOption]()
    for binding in header.bindings:
        arguments |= binding.arguments
    policy = "+".join(dict.fromkeys(binding.policy for binding in header.bindings))
    model = arguments.pop("model", "")
    report = report_of(trace, policy)
    return SuiteRow(
        suite="",
        entrant=str(model) if isinstance(model, str) and model else policy,
        mission=instance.mission,
        mode=instance.mode,
        seed=instance.seed,
        policy=policy,
        model=str(model),
        privileged=any(binding.privileged for binding in header.bindings),
        policy_seed=header.policy_seed,
        version=header.fingerprint.get("lingjing", ""),
        options=PlayOptions(
            mission=instance.mission, policy=policy, policy_args=arguments, mode=instance.mode, seed=instance.seed,
            settings=dict(instance.settings),
        ),
        report=msgspec.structs.replace(report, happened=(), incidents=()),  # long, and in no figure
    )  # fmt: skip


def with_conditions(rows: Iterable[SuiteRow]) -> list[SuiteRow]:
    """Return the rows with their conditions, and with the places of entrants and conditions in tables."""
    named: list[SuiteRow] = []
    for (mission, mode), own in grouped(rows, lambda row: (row.mission, row.mode)).items():
        settings = _differing([row.options.settings for row in own])
        usual = parameters_of(mission, mode)
        for of_entrant in grouped(own, lambda row: row.entrant).values():
            options = _differing([row.options.policy_args for row in of_entrant])
            for row in of_entrant:
                arguments = row.options.policy_args
                changed = {name: arguments[name] for name in options if name in arguments}
                values = {name: row.options.settings.get(name) for name in settings}
                words = [f"{name} = {value:g}" for name, value in values.items() if value is not None]
                words += [f"{name} = {value}" for name, value in changed.items()]
                plain = not changed and all(value == usual.get(name) for name, value in values.items())
                named.append(
                    msgspec.structs.replace(
                        row, condition=", ".join(words), baseline=bool(settings or options) and plain
                    )
                )
    return _placed(named)


def _placed(rows: Sequence[SuiteRow]) -> list[SuiteRow]:
    entrants = sorted({(row.privileged, row.entrant) for row in rows})
    places = {name: at for at, (_, name) in enumerate(entrants)}
    conditions = sorted({(not row.baseline, _values(row), row.condition) for row in rows})
    order = {name: at for at, (_, _, name) in reversed(list(enumerate(conditions)))}
    return [
        msgspec.structs.replace(row, entrant_place=places[row.entrant], condition_place=order[row.condition])
        for row in rows
    ]


def _values(row: SuiteRow) -> tuple[float, ...]:
    """Return the numbers in a row's condition, by which `uavs = 10` sorts after `uavs = 9`."""
    words = (part.rpartition(" = ")[2] for part in row.condition.split(", "))
    return tuple(float(word) if word.replace(".", "", 1).isdecimal() else 0.0 for word in words)


def _differing(settings: Sequence[Mapping[str, GivenOption]] | Sequence[Mapping[str, float]]) -> list[str]:
    """Return the names that do not have the same value in all of them."""
    names = sorted({name for values in settings for name in values})
    return [name for name in names if len({repr(values.get(name)) for values in settings}) > 1]


__all__ = ["row_of", "with_conditions"]
