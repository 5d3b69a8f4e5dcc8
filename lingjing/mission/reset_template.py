"""Which template mission a `resetScenario` document is for.

Named by `lingjing.mission`, else by `taskType` or `task_type`, else recognised by its entities and hidden fields. A
document that fits several templates equally well is an error that lists them: nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import msgspec

from lingjing.data import data_path
from lingjing.mission.reset_document import LISTS, Parsed
from lingjing.mission.reset_fields import Found, folded


class Signature(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What tells a mission apart: the engines of its assets, the types of its targets, and spellings of its task."""

    mission: str
    engines: frozenset[str]
    types: frozenset[str]
    spellings: frozenset[str]

    def holds(self, found: Found) -> bool:
        """Whether the mission has targets of a type that the field may hold."""
        return any(type_ in self.types for type_ in found.field.types)


@cache
def signatures() -> tuple[Signature, ...]:
    """The missions that documents may be for, as the shipped `scenarios/reset-templates.json` lists them; a test
    compares it with the compiled missions."""
    entries = msgspec.json.decode(data_path("scenarios", "reset-templates.json").read_bytes(), type=list[Signature])
    return tuple(
        msgspec.structs.replace(one, spellings=frozenset(map(folded, (one.mission, *one.spellings)))) for one in entries
    )


def template_name(parsed: Parsed, found: Sequence[Found]) -> tuple[str, str, str]:
    """Template, the JSON path that decided, and the reason in words; `MissionError` if nothing or too much fits."""
    if parsed.scenario.lingjing is not None:
        return parsed.scenario.lingjing.mission, f"{parsed.path}.lingjing.mission", "named by 'lingjing'"
    named, unknown = _named(parsed)
    if named:
        mission, where, why = named[0]
        others = [f"{path} names '{other}'" for other, path, _ in named[1:] if other != mission]
        return mission, where, why + (f" (although {' and '.join(others)})" if others else "")
    return _recognised(parsed, [one for one in found if one.targets], unknown)


def _named(parsed: Parsed) -> tuple[list[tuple[str, str, str]], str]:
    """What every task type names, in order, and what is to be said of the first unknown one."""
    named: list[tuple[str, str, str]] = []
    unknown = ""
    for holder, path in ((parsed.scenario, parsed.path), (parsed.task, parsed.task_path)):
        for field, word in (("taskType", holder.task_type), ("task_type", holder.task_type_snake)):
            signature = next((one for one in signatures() if folded(word) in one.spellings), None)
            if signature:
                named.append((signature.mission, f"{path}.{field}", f"named by {field} '{word}'"))
            elif word and not unknown:
                unknown = f" ({field} '{word}' is not known)"
    return named, unknown


def _recognised(parsed: Parsed, found: Sequence[Found], unknown: str) -> tuple[str, str, str]:
    equipment = parsed.scenario.equipment_list
    # The lists that say most (ships rather than drones) are named first.
    lists = {one.engine: one.name for one in reversed(LISTS) if getattr(equipment, one.attribute)}
    fitting = _fitting(frozenset(lists), found)
    seen = _listing([*dict.fromkeys(one.key for one in found), *lists.values()])
    if len(fitting) == 1:
        one = fitting[0]
        used = [f.key for f in found if one.holds(f)] + [
            name for engine, name in lists.items() if engine in one.engines
        ]
        return one.mission, f"{parsed.path}.equipmentList", f"recognised by {_listing(dict.fromkeys(used))}{unknown}"
    if fitting:
        names = ", ".join(one.mission for one in fitting)
        raise parsed.fault(
            parsed.path,
            f"several templates fit {seen}: {names}{unknown}",
            f'name one of {names}: "lingjing": {{"mission": "{fitting[0].mission}"}} in the scenario, or a taskType',
        )
    possible = [one for one in signatures() if one.engines <= lists.keys()] or list(signatures())
    names = ", ".join(one.mission for one in possible)
    what = f"of {seen}" if seen else "of empty lists"
    lacking = "" if found else " without any hidden place"
    near = next((one.mission for one in signatures() if any(one.holds(f) for f in found)), possible[0].mission)
    raise parsed.fault(
        parsed.path,
        f"no template fits a scenario {what}{lacking}{unknown}; by its entities it may be {names}",
        f'name the template: "lingjing": {{"mission": "{near}"}} in the scenario',
    )


def _fitting(engines: frozenset[str], found: Sequence[Found]) -> list[Signature]:
    """The templates that fit best: their engines and every field; at least their engines; at least one field."""
    enough = [one for one in signatures() if one.engines <= engines and any(one.holds(f) for f in found)]
    whole = [one for one in enough if all(one.holds(f) for f in found)]
    exact = [one for one in whole if one.engines == engines]
    return exact or whole or enough


def _listing(words: Iterable[str]) -> str:
    *first, last = [*words] or [""]
    return f"{', '.join(first)} and {last}" if first else last
