"""Selection of the template mission for a `resetScenario` document.

`lingjing.mission` names it, else `taskType` or `task_type`, else it is recognised by its entities and hidden fields. A
document that fits several templates equally well is an error that lists them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import msgspec

from lingjing.data import data_path
from lingjing.decoding import from_json
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import HiddenEntries
from lingjing.mission.reset.row_goals import GOALS, has_row_goals, only_goals, rows_with_goals
from lingjing.mission.reset.shapes import LISTS, fold_key

_FILLERS = ("task", "mission", "scenario", "任务", "场景")
"""Folded words at the beginning or end of a task type that do not change its meaning."""


FREE: tuple[tuple[str, frozenset[str]], ...] = (
    ("free", frozenset({"multirotor", "quadruped", "road", "plane", "satellite"})),
    ("free_sea", frozenset({"multirotor", "vessel", "plane", "satellite"})),
)
"""The missions of documents without hidden places, with the engines of their bodies."""

_SPECIAL = {
    "bridge_fracture": ("bridge", "fracture", "crack", "span", "桥", "断裂", "裂缝"),
    "pipeline_leak": ("pipe", "leak", "管道", "泄漏"),
}
"""Target types that the general field `goalPosition` means only if the document has one of these words."""

_BY_AIR = "air_delivery"
"""The mission of UAVs that share the deliveries."""


class TemplateSignature(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The features by which a mission is recognised."""

    mission: str
    engines: frozenset[str]
    """Engines of its assets."""
    types: frozenset[str]
    """Types of its targets."""
    spellings: frozenset[str] = frozenset()
    """Names of its task."""
    also: frozenset[str] = frozenset()
    """Further names, which count only if the document has hidden places of its types. Such a name describes the
    entities and not the task."""
    without: frozenset[str] = frozenset()
    """Engines that its documents do not have, because their entities could do more than the mission requires. A mission
    with such engines is not recognised by a `general` field."""
    optional: frozenset[str] = frozenset()
    """Engines of entities that it accepts but does not need."""
    fleet: str = ""
    """The mission for documents with several entities of a kind of which this one has one; "" for none."""
    of: str = ""
    """The mission that has the same names; "" for none."""

    def named(self, word: str, hidden_entries: Iterable[HiddenEntries]) -> bool:
        """True if a task type, folded, names the mission in a document with these hidden fields."""
        words = {word, *(word.removeprefix(filler).removesuffix(filler) for filler in _FILLERS)}
        return bool(words & self.spellings) or (
            bool(words & self.also) and any(self.holds(field) for field in hidden_entries)
        )

    def equipped(self, engines: frozenset[str]) -> bool:
        """True if a document with entities of these engines may be for the mission."""
        return self.engines <= engines and not self.without & engines

    def holds(self, hidden: HiddenEntries) -> bool:
        """True if the mission has targets of a type that the field may hold."""
        vague = hidden.field.general and self.without
        return not vague and any(type_ in self.types for type_ in hidden.field.types)


@cache
def signatures() -> tuple[TemplateSignature, ...]:
    """The signatures of the shipped missions, from `scenarios/reset-templates.json`. A test compares them with the
    compiled missions."""
    entries = from_json(data_path("scenarios", "reset-templates.json").read_bytes(), list[TemplateSignature])
    by_mission = {signature.mission: signature for signature in entries}
    return tuple(
        msgspec.structs.replace(
            signature,
            spellings=frozenset(
                map(fold_key, (signature.mission, *by_mission[signature.of or signature.mission].spellings))
            ),
            also=frozenset(map(fold_key, by_mission[signature.of or signature.mission].also)),
        )
        for signature in entries
    )


def template_name(parsed: Parsed, hidden_entries: Sequence[HiddenEntries]) -> tuple[str, str, str]:
    """(template, JSON path that decided, reason in words). Raises `MissionError` if no template fits, or several do."""
    extra = parsed.scenario.lingjing
    if extra is not None and extra.mission is not None:
        return extra.mission, f"{parsed.path}.lingjing.mission", "named by 'lingjing'"
    full = [field for field in hidden_entries if field.targets]
    named, unknown = _named_by_type(parsed, full)
    if not named:
        own = _of_bodies_alone(parsed, full)
        return (own[0], parsed.lists_path, own[1] + unknown) if own else _recognise(parsed, full, unknown)
    common = [signature for signature in named[0][0] if all(signature in fitting for fitting, _, _ in named)]
    if not common:
        each = "; ".join(f"{where.rpartition('.')[2]} names {_either(fitting)}" for fitting, where, _ in named)
        message = f"contradicts the other task type: {each}"
        raise parsed.fault(named[-1][1], message, _name_it(named[0][0][0].mission))
    agreed = common if len(common) == 1 else _narrow(parsed, common, full)
    if not agreed:
        agreed = [signature for signature in common if signature.of not in {other.mission for other in common}]
        if len(agreed) > 1:
            lacks = "; ".join(f"'{signature.mission}' {_lacks(signature, _engines(parsed))}" for signature in agreed)
            message = f"may be any of {_either(agreed)}, and the lists of entities fit none: {lacks}"
            raise parsed.fault(named[0][1], message, "list what one of them needs, or name another task type")
    if len(agreed) > 1 and not full and (own := _of_bodies_alone(parsed, full)):
        return own[0], named[0][1], f"{named[0][2]}, which may be {_either(agreed)}: {own[1]}"
    if len(agreed) > 1:
        hint = _name_it(agreed[0].mission)
        raise parsed.fault(named[0][1], f"may be any of {_either(agreed)}; nothing in the document decides it", hint)
    if agreed[0].mission == _BY_AIR and has_row_goals(parsed, hidden_entries) and rows_with_goals(parsed) > 1:
        return GOALS, named[0][1], f"{named[0][2]}, with a goal in each row"
    return agreed[0].mission, named[0][1], " and ".join(dict.fromkeys(why for _, _, why in named)) + unknown


def _of_bodies_alone(parsed: Parsed, full: Sequence[HiddenEntries]) -> tuple[str, str] | None:
    """The mission and the reason for a document with goals of single UAVs, or without hidden places; None for other
    documents."""
    engines = _engines(parsed)
    if full:
        titled = any(_in_words(parsed, signature) for signature in _fitting(engines, full))
        return (GOALS, "recognised by UAVs and their goals") if has_row_goals(parsed, full) and not titled else None
    for name, accepted in FREE:
        if engines and engines <= accepted:
            return name, "no target is given, so bodies are placed and take pictures"
    return None


def _in_words(parsed: Parsed, signature: TemplateSignature) -> bool:
    """True if the scene's name or the goal has a word for the mission's targets."""
    text = fold_key(f"{parsed.scenario.scene_name} {parsed.task.goal}")
    return any(word in text for type_ in signature.types for word in _SPECIAL.get(type_, ()))


def fleet_of(mission: str) -> str:
    """The mission that accepts several entities of a kind of which this one has one, or ""."""
    return next((signature.fleet for signature in signatures() if signature.mission == mission), "")


def _either(candidates: Iterable[TemplateSignature]) -> str:
    return ", ".join(signature.mission for signature in candidates)


def _name_it(mission: str) -> str:
    return f'name the template: "lingjing": {{"mission": "{mission}"}} in the scenario'


def _engines(parsed: Parsed) -> frozenset[str]:
    """The engines of the document's entities."""
    return frozenset(
        entity_list.engine for entity_list in LISTS if getattr(parsed.scenario.equipment_list, entity_list.attribute)
    )


def _lacks(signature: TemplateSignature, engines: frozenset[str]) -> str:
    """The reason why a document with entities of these engines is not for a mission."""
    wanting = [entity_list.name for entity_list in LISTS if entity_list.engine in signature.engines - engines]
    barred = [entity_list.name for entity_list in LISTS if entity_list.engine in signature.without & engines]
    return f"needs {_listing(wanting)}" if wanting else f"is for documents without {_listing(barred)}"


def _narrow(
    parsed: Parsed, fitting: Sequence[TemplateSignature], hidden_entries: Sequence[HiddenEntries]
) -> list[TemplateSignature]:
    """The candidates of one word that agree with the hidden fields and the entities."""
    engines = _engines(parsed)
    candidates = _fitting(engines, hidden_entries, fitting) or [
        signature for signature in fitting if signature.equipped(engines)
    ]
    most = max((len(signature.engines) for signature in candidates), default=0)
    return [signature for signature in candidates if len(signature.engines) == most]


def _named_by_type(
    parsed: Parsed, hidden_entries: Sequence[HiddenEntries]
) -> tuple[list[tuple[list[TemplateSignature], str, str]], str]:
    """The candidates of each task type, in order, and a remark on the first unknown one."""
    named: list[tuple[list[TemplateSignature], str, str]] = []
    unknown = ""
    for holder, path in parsed.typed_holders():
        for key, word in holder.items():
            if fold_key(key) == "tasktype" and isinstance(word, str) and word:
                spelling = parsed.spelling.key(holder, key)
                fitting = [signature for signature in signatures() if signature.named(fold_key(word), hidden_entries)]
                if fitting:
                    named.append((fitting, f"{path}.{spelling}", f"named by {spelling} '{word}'"))
                elif not unknown:
                    unknown = f" ({spelling} '{word}' is not known)"
    return named, unknown


def _recognise(parsed: Parsed, hidden_entries: Sequence[HiddenEntries], unknown: str) -> tuple[str, str, str]:
    equipment = parsed.scenario.equipment_list
    # The most specific lists (ships rather than drones) are named first.
    lists = {each.engine: each.name for each in reversed(LISTS) if getattr(equipment, each.attribute)}
    fitting = _fitting(frozenset(lists), hidden_entries, _with_words(parsed, hidden_entries))
    seen = _listing([*dict.fromkeys(field.key for field in hidden_entries), *lists.values()])
    own = _own_goals_left_out(parsed, hidden_entries, fitting)
    if len(fitting) == 1 and not own:
        signature = fitting[0]
        used = [f.key for f in hidden_entries if signature.holds(f)] + [
            name for engine, name in lists.items() if engine in signature.engines
        ]
        return signature.mission, parsed.lists_path, f"recognised by {_listing(dict.fromkeys(used))}{unknown}"
    if fitting:
        names = ", ".join([*(signature.mission for signature in fitting), *([GOALS] if own else [])])
        raise parsed.fault(
            parsed.path,
            f"several templates fit {seen}: {names}{unknown}",
            f'name one of {names}: "lingjing": {{"mission": "{fitting[0].mission}"}} in the scenario, or a taskType',
        )
    if hidden_entries and not any(signature.holds(field) for signature in signatures() for field in hidden_entries):
        keys = _listing(dict.fromkeys(f"'{field.key}'" for field in hidden_entries))
        hint = f"remove it, or name a template of your own that has a target of type {hidden_entries[0].field.types[0]}"
        raise parsed.fault(hidden_entries[0].path, f"no template has a target for {keys}", hint)
    known = [signature for signature in signatures() if not signature.of]
    possible = [signature for signature in known if signature.equipped(frozenset(lists))] or known
    names = ", ".join(signature.mission for signature in possible)
    what = f"of {seen}" if seen else "of empty lists"
    lacking = "" if hidden_entries else " without any hidden place"
    plain = [field for field in hidden_entries if not field.field.general] or hidden_entries
    near = next((signature for signature in signatures() if any(signature.holds(f) for f in plain)), possible[0])
    wanting = [each.name for each in LISTS if each.engine in near.engines - lists.keys()]
    needs = f"; '{near.mission}' would, with {_listing(wanting)}" if wanting else ""
    raise parsed.fault(
        parsed.path,
        f"no template fits a scenario {what}{lacking}{unknown}; by its entities it may be {names}{needs}",
        f"add {_listing(wanting)}, or {_name_it(near.mission)}" if wanting else _name_it(near.mission),
    )


def _own_goals_left_out(
    parsed: Parsed, hidden_entries: Sequence[HiddenEntries], fitting: Sequence[TemplateSignature]
) -> bool:
    """True if the document has rows with goals of UAVs that no candidate includes."""
    drones = len(parsed.scenario.equipment_list.drone_entity_list)
    fleetless = bool(fitting) and not any(
        "multirotor" in signature.engines | signature.optional for signature in fitting
    )
    return fleetless and drones > 0 and only_goals(parsed, hidden_entries) and rows_with_goals(parsed) > 1


def _with_words(parsed: Parsed, hidden_entries: Sequence[HiddenEntries]) -> list[TemplateSignature]:
    """The missions without those of special targets for which the document has neither a field nor a word."""
    vague = all(hidden.field.general for hidden in hidden_entries)
    return [
        signature
        for signature in signatures()
        if not vague or not signature.types & _SPECIAL.keys() or _in_words(parsed, signature)
    ]


def _fitting(
    engines: frozenset[str], hidden_entries: Sequence[HiddenEntries], among: Sequence[TemplateSignature] | None = None
) -> list[TemplateSignature]:
    """The best candidates: with exactly these engines and every field; else with every field; else with at least one
    field."""
    known = signatures() if among is None else among
    enough = [
        signature
        for signature in known
        if signature.equipped(engines) and any(signature.holds(f) for f in hidden_entries)
    ]
    whole = [signature for signature in enough if all(signature.holds(f) for f in hidden_entries)]
    exact = [signature for signature in whole if signature.engines == engines]
    best = exact or whole or enough
    return [
        signature
        for signature in best
        if not any(signature.engines < other.engines and signature.types == other.types for other in best)
    ]


def _listing(words: Iterable[str]) -> str:
    *first, last = [*words] or [""]
    return f"{', '.join(first)} and {last}" if first else last
