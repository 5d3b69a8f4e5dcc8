"""Which template mission a `resetScenario` document is for.

Named by `lingjing.mission`, else by `taskType` or `task_type`, else recognised by its entities and hidden fields. A
document that fits several templates equally well is an error that lists them: nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import msgspec

from lingjing.data import data_path
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import Found
from lingjing.mission.reset.row_goals import GOALS, has_row_goals, only_goals, rows_with_goals
from lingjing.mission.reset.shapes import LISTS, folded

_FILLERS = ("task", "mission", "scenario", "任务", "场景")
"""What a task type may begin or end with, folded, and mean the same."""


FREE: tuple[tuple[str, frozenset[str]], ...] = (
    ("free", frozenset({"multirotor", "quadruped", "road", "plane", "satellite"})),
    ("free_sea", frozenset({"multirotor", "vessel", "plane", "satellite"})),
)
"""The missions of documents that hide nothing, and the engines whose bodies they take."""

SPECIAL = {
    "bridge_fracture": ("bridge", "fracture", "crack", "span", "桥", "断裂", "裂缝"),
    "pipeline_leak": ("pipe", "leak", "管道", "泄漏"),
}
"""Target types that `goalPosition`, which says nothing of them, means only where a word of the document does."""

BY_AIR = "air_delivery"
"""The mission of UAVs that share what is delivered."""


class TemplateSignature(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What tells a mission apart: the engines of its assets, the types of its targets, and spellings of its task.

    The words in `also` mean it only where the document has hidden places of its types: they say who is there.
    It is not for documents with entities of the engines in `without`, who could do more than it asks for; where these
    are told apart, a `general` field says too little. It takes entities of the engines in `optional` where there are
    some. `fleet` is the mission for documents that list several where this one has one; `of` names the mission whose
    words mean this one as well.
    """

    mission: str
    engines: frozenset[str]
    types: frozenset[str]
    spellings: frozenset[str] = frozenset()
    also: frozenset[str] = frozenset()
    without: frozenset[str] = frozenset()
    optional: frozenset[str] = frozenset()
    fleet: str = ""
    of: str = ""

    def named(self, word: str, found: Iterable[Found]) -> bool:
        """Whether a task type, folded, means the mission in a document with these hidden places."""
        words = {word, *(word.removeprefix(filler).removesuffix(filler) for filler in _FILLERS)}
        return bool(words & self.spellings) or (bool(words & self.also) and any(self.holds(one) for one in found))

    def equipped(self, engines: frozenset[str]) -> bool:
        """Whether a document that lists entities of these engines may be for the mission."""
        return self.engines <= engines and not self.without & engines

    def holds(self, found: Found) -> bool:
        """Whether the mission has targets of a type that the field may hold."""
        vague = found.field.general and self.without
        return not vague and any(type_ in self.types for type_ in found.field.types)


@cache
def signatures() -> tuple[TemplateSignature, ...]:
    """The missions that documents may be for, as the shipped `scenarios/reset-templates.json` lists them; a test
    compares it with the compiled missions."""
    entries = msgspec.json.decode(
        data_path("scenarios", "reset-templates.json").read_bytes(), type=list[TemplateSignature]
    )
    said = {one.mission: one for one in entries}
    return tuple(
        msgspec.structs.replace(
            one,
            spellings=frozenset(map(folded, (one.mission, *said[one.of or one.mission].spellings))),
            also=frozenset(map(folded, said[one.of or one.mission].also)),
        )
        for one in entries
    )


def template_name(parsed: Parsed, found: Sequence[Found]) -> tuple[str, str, str]:
    """Template, the JSON path that decided, and the reason in words; `MissionError` if nothing or too much fits."""
    given = parsed.scenario.lingjing
    if given is not None and given.mission is not None:
        return given.mission, f"{parsed.path}.lingjing.mission", "named by 'lingjing'"
    full = [one for one in found if one.targets]
    said, unknown = _named(parsed, full)
    if not said:
        own = _of_bodies_alone(parsed, full)
        return (own[0], parsed.lists_path, own[1] + unknown) if own else _recognised(parsed, full, unknown)
    common = [one for one in said[0][0] if all(one in fitting for fitting, _, _ in said)]
    if not common:
        each = "; ".join(f"{where.rpartition('.')[2]} names {_either(fitting)}" for fitting, where, _ in said)
        message = f"contradicts the other task type: {each}"
        raise parsed.fault(said[-1][1], message, _name_it(said[0][0][0].mission))
    agreed = common if len(common) == 1 else _narrowed(parsed, common, full)
    if not agreed:
        agreed = [one for one in common if one.of not in {other.mission for other in common}]
        if len(agreed) > 1:
            lacks = "; ".join(f"'{one.mission}' {_lacks(one, _engines(parsed))}" for one in agreed)
            message = f"may be any of {_either(agreed)}, and the lists of entities fit none: {lacks}"
            raise parsed.fault(said[0][1], message, "list what one of them needs, or name another task type")
    if len(agreed) > 1 and not full and (own := _of_bodies_alone(parsed, full)):
        return own[0], said[0][1], f"{said[0][2]}, which may be {_either(agreed)}: {own[1]}"
    if len(agreed) > 1:
        hint = _name_it(agreed[0].mission)
        raise parsed.fault(said[0][1], f"may be any of {_either(agreed)}; nothing in the document tells which", hint)
    if agreed[0].mission == BY_AIR and has_row_goals(parsed, found) and rows_with_goals(parsed) > 1:
        return GOALS, said[0][1], f"{said[0][2]}, with a goal in each row"
    return agreed[0].mission, said[0][1], " and ".join(dict.fromkeys(why for _, _, why in said)) + unknown


def _of_bodies_alone(parsed: Parsed, full: Sequence[Found]) -> tuple[str, str] | None:
    """The mission of a document whose UAVs have goals of their own, or that hides nothing, and why it is that one."""
    engines = _engines(parsed)
    if full:
        titled = any(_in_words(parsed, one) for one in _fitting(engines, full))
        return (GOALS, "recognised by UAVs and their goals") if has_row_goals(parsed, full) and not titled else None
    for name, taken in FREE:
        if engines and engines <= taken:
            return name, "no target is given, so bodies are placed and take pictures"
    return None


def _in_words(parsed: Parsed, signature: TemplateSignature) -> bool:
    """True if the scene's name or the goal has a word for what the mission looks for."""
    text = folded(f"{parsed.scenario.scene_name} {parsed.task.goal}")
    return any(word in text for type_ in signature.types for word in SPECIAL.get(type_, ()))


def fleet_of(mission: str) -> str:
    """The mission that takes several entities where this one has one, or ""."""
    return next((one.fleet for one in signatures() if one.mission == mission), "")


def _either(those: Iterable[TemplateSignature]) -> str:
    return ", ".join(one.mission for one in those)


def _name_it(mission: str) -> str:
    return f'name the template: "lingjing": {{"mission": "{mission}"}} in the scenario'


def _engines(parsed: Parsed) -> frozenset[str]:
    """The engines that drive what the document lists."""
    return frozenset(one.engine for one in LISTS if getattr(parsed.scenario.equipment_list, one.attribute))


def _lacks(signature: TemplateSignature, engines: frozenset[str]) -> str:
    """Why a document that lists entities of these engines is not for a mission."""
    wanting = [one.name for one in LISTS if one.engine in signature.engines - engines]
    barred = [one.name for one in LISTS if one.engine in signature.without & engines]
    return f"needs {_listing(wanting)}" if wanting else f"is for documents without {_listing(barred)}"


def _narrowed(parsed: Parsed, fitting: Sequence[TemplateSignature], found: Sequence[Found]) -> list[TemplateSignature]:
    """Of the missions that one word names, those that the hidden fields and the entities leave."""
    engines = _engines(parsed)
    left = _fitting(engines, found, fitting) or [one for one in fitting if one.equipped(engines)]
    most = max((len(one.engines) for one in left), default=0)
    return [one for one in left if len(one.engines) == most]


def _named(parsed: Parsed, found: Sequence[Found]) -> tuple[list[tuple[list[TemplateSignature], str, str]], str]:
    """The missions that every task type may mean, in order, and what is to be said of the first unknown one."""
    named: list[tuple[list[TemplateSignature], str, str]] = []
    unknown = ""
    for holder, path in parsed.typed_holders():
        for key, word in holder.items():
            if folded(key) == "tasktype" and isinstance(word, str) and word:
                spelt = parsed.spelt.key(holder, key)
                fitting = [one for one in signatures() if one.named(folded(word), found)]
                if fitting:
                    named.append((fitting, f"{path}.{spelt}", f"named by {spelt} '{word}'"))
                elif not unknown:
                    unknown = f" ({spelt} '{word}' is not known)"
    return named, unknown


def _recognised(parsed: Parsed, found: Sequence[Found], unknown: str) -> tuple[str, str, str]:
    equipment = parsed.scenario.equipment_list
    # The lists that say most (ships rather than drones) are named first.
    lists = {one.engine: one.name for one in reversed(LISTS) if getattr(equipment, one.attribute)}
    fitting = _fitting(frozenset(lists), found, _told_in_words(parsed, found))
    seen = _listing([*dict.fromkeys(one.key for one in found), *lists.values()])
    own = _own_goals_left_out(parsed, found, fitting)
    if len(fitting) == 1 and not own:
        one = fitting[0]
        used = [f.key for f in found if one.holds(f)] + [
            name for engine, name in lists.items() if engine in one.engines
        ]
        return one.mission, parsed.lists_path, f"recognised by {_listing(dict.fromkeys(used))}{unknown}"
    if fitting:
        names = ", ".join([*(one.mission for one in fitting), *([GOALS] if own else [])])
        raise parsed.fault(
            parsed.path,
            f"several templates fit {seen}: {names}{unknown}",
            f'name one of {names}: "lingjing": {{"mission": "{fitting[0].mission}"}} in the scenario, or a taskType',
        )
    if found and not any(one.holds(field) for one in signatures() for field in found):
        unheard = _listing(dict.fromkeys(f"'{one.key}'" for one in found))
        hint = f"take it out, or name a template of your own that has a target of type {found[0].field.types[0]}"
        raise parsed.fault(found[0].path, f"no template has anything for {unheard}", hint)
    known = [one for one in signatures() if not one.of]
    possible = [one for one in known if one.equipped(frozenset(lists))] or known
    names = ", ".join(one.mission for one in possible)
    what = f"of {seen}" if seen else "of empty lists"
    lacking = "" if found else " without any hidden place"
    plain = [field for field in found if not field.field.general] or found
    near = next((one for one in signatures() if any(one.holds(f) for f in plain)), possible[0])
    wanting = [one.name for one in LISTS if one.engine in near.engines - lists.keys()]
    needs = f"; '{near.mission}' would, with {_listing(wanting)}" if wanting else ""
    raise parsed.fault(
        parsed.path,
        f"no template fits a scenario {what}{lacking}{unknown}; by its entities it may be {names}{needs}",
        f"add {_listing(wanting)}, or {_name_it(near.mission)}" if wanting else _name_it(near.mission),
    )


def _own_goals_left_out(parsed: Parsed, found: Sequence[Found], fitting: Sequence[TemplateSignature]) -> bool:
    """True if rows with a goal each may be those of UAVs that every fitting mission leaves out."""
    drones = len(parsed.scenario.equipment_list.drone_entity_list)
    fleetless = bool(fitting) and not any("multirotor" in one.engines | one.optional for one in fitting)
    return fleetless and drones > 0 and only_goals(parsed, found) and rows_with_goals(parsed) > 1


def _told_in_words(parsed: Parsed, found: Sequence[Found]) -> list[TemplateSignature]:
    """The missions without those of special targets that neither a field nor a word of the document names."""
    vague = all(one.field.general for one in found)
    return [one for one in signatures() if not vague or not one.types & SPECIAL.keys() or _in_words(parsed, one)]


def _fitting(
    engines: frozenset[str], found: Sequence[Found], among: Sequence[TemplateSignature] | None = None
) -> list[TemplateSignature]:
    """The templates that fit best: their engines and every field; at least their engines; at least one field."""
    known = signatures() if among is None else among
    enough = [one for one in known if one.equipped(engines) and any(one.holds(f) for f in found)]
    whole = [one for one in enough if all(one.holds(f) for f in found)]
    exact = [one for one in whole if one.engines == engines]
    best = exact or whole or enough
    return [one for one in best if not any(one.engines < other.engines and one.types == other.types for other in best)]


def _listing(words: Iterable[str]) -> str:
    *first, last = [*words] or [""]
    return f"{', '.join(first)} and {last}" if first else last
