"""A parsed `resetScenario` document: its scenario, its plain values, and notes on its spelling.

A document may be wrapped in the transport envelope (`{"type": "COMMAND", "data": …}`). A field that is null counts as
absent. Of equal keys the last one is used. Repeated keys, other spellings and unread fields give notes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from lingjing.errors import Fault, MissionError
from lingjing.mission import jsontext
from lingjing.mission.reset.faults import document_error, faults_of
from lingjing.mission.reset.repair import repair, substitute_place
from lingjing.mission.reset.shapes import CommandEnvelope, DocumentPart, Free, P, Scenario, TaskRow, fold_key
from lingjing.mission.reset.spelling import KeySpelling


@dataclass(frozen=True, slots=True)
class Parsed:
    """A parsed document. With faults its values are repaired (`repair`)."""

    scenario: Scenario
    path: str
    """JSON path of the scenario."""
    file: str
    """Name of the document, for messages."""
    raw: Mapping[str, Any]
    """The scenario's plain values without nulls, under the keys of `shapes`."""
    envelope: CommandEnvelope | None = None
    """The command that carried the scenario; None for a bare scenario."""
    notes: list[str] = field(default_factory=list)
    """Notes so far; further modules add to them."""
    spelling: KeySpelling = field(default_factory=lambda: KeySpelling({}))
    faults: list[Fault] = field(default_factory=list)
    """Errors so far; further modules add to them."""
    decided: bool = True
    """True if no repair changed the parts that select the template."""
    place: Mapping[str, float] = field(default_factory=dict)
    """Coordinates that replace invalid places."""
    placed: dict[str, str] = field(default_factory=dict)
    """Entity id → JSON path of the part that placed it."""
    understood: set[str] = field(default_factory=set)
    """Folded keys that are read in addition to those of the shapes."""

    @property
    def task(self) -> TaskRow:
        """The row of the task matrix that is used."""
        return self.scenario.task_matrix[0]

    @property
    def task_path(self) -> str:
        """JSON path of that row."""
        return f"{self.at('taskMatrix')}[0]"

    @property
    def state_path(self) -> str:
        """JSON path of the initial state."""
        return self.holders()[0][1]

    @property
    def lists_path(self) -> str:
        """JSON path of the lists of entities."""
        return self.at("equipmentList")

    def at(self, key: str) -> str:
        """JSON path of a key of the scenario, in the document's spelling."""
        return f"{self.path}.{self.spelling.key(self.raw, key)}"

    def in_state(self, key: str) -> str:
        """JSON path of a key of the initial state."""
        (state, path), *_ = self.holders()
        return f"{path}.{self.spelling.key(state, key)}"

    def list_path(self, name: str) -> str:
        """JSON path of one of the lists of entities."""
        lists = self.raw.get("equipmentList")
        return f"{self.lists_path}.{self.spelling.key(lists if isinstance(lists, dict) else {}, name)}"

    def holders(self) -> tuple[tuple[Mapping[str, Any], str], ...]:
        """The objects that may hold hidden places, with their JSON paths: initial state, task, scenario."""
        return *self._row_holders(0), (self.raw, self.path)

    def later_holders(self) -> Iterator[tuple[Mapping[str, Any], str]]:
        """Initial state and task of every row after the first, with their JSON paths."""
        for k in range(1, len(self.scenario.task_matrix)):
            yield from self._row_holders(k)

    def _row_holders(self, index: int) -> tuple[tuple[Mapping[str, Any], str], tuple[Mapping[str, Any], str]]:
        rows = self.raw.get("taskMatrix")
        task = rows[index] if isinstance(rows, list) and len(rows) > index and isinstance(rows[index], dict) else {}
        state = task.get("initial_state")
        inner: Mapping[str, Any] = state if isinstance(state, dict) else {}
        path = f"{self.at('taskMatrix')}[{index}]"
        return (inner, f"{path}.{self.spelling.key(task, 'initial_state')}"), (task, path)

    def typed_holders(self) -> Iterator[tuple[Mapping[str, Any], str]]:
        """The objects that may name a task type, with their JSON paths: the scenario and every row."""
        yield self.raw, self.path
        for k in range(len(self.scenario.task_matrix)):
            yield self._row_holders(k)[1]

    def fault(self, where: str, message: str, hint: str) -> MissionError:
        """An error at a JSON path of this document, together with all faults found before."""
        return document_error(self.file, [*self.faults, Fault(where, message, hint)])

    def report(self, where: str, message: str, hint: str) -> None:
        """Record a fault and continue."""
        self.faults.append(Fault(where, message, hint))

    def convert(self, value: object, shape: type[P], where: str) -> P:
        """A part of the document in its shape. An invalid part is reported and replaced by `place`."""
        try:
            return shape.model_validate(value)
        except ValidationError as error:
            self.faults.extend(faults_of(error, value, where, self.spelling))
            return shape.model_validate(dict(self.place))


def parse(text: str, path: str) -> Parsed:
    """Parse a document. Raises `UsageError` if it is not JSON, `MissionError` if it is no scenario and cannot be
    repaired."""
    notes: list[str] = []
    faults: list[Fault] = []
    value, carriers = _unwrap(_without_nulls(jsontext.load(text, path, notes, faults)))
    if carriers:
        notes.append(f"$: the transport envelope is removed; {_path(carriers)} is read")
    root = _path(carriers)
    spelling = KeySpelling({})
    if isinstance(value, dict):
        spelling.rename(value, _Either, root)
    if not isinstance(value, dict) or not ({"scenario", "equipmentList"} & value.keys()):
        packed = isinstance(value, str) and value.lstrip().startswith("{")
        raise MissionError(
            f"{path}: {root} is not a resetScenario: it holds neither 'scenario' nor 'equipmentList'",
            hint="the document is packed into a text: put the object itself there"
            if packed
            else "give a resetScenario document, a mission.json or an .ljs file",
        )
    shape: type[CommandEnvelope | Scenario] = CommandEnvelope if "scenario" in value else Scenario
    spelling.unify(value, shape, root)
    own = spelling.key(value, "scenario")
    inner, where = (value["scenario"], f"{root}.{own}") if shape is CommandEnvelope else (value, root)
    raw = inner if isinstance(inner, dict) else {}
    place = substitute_place(raw)
    decided = True
    read: CommandEnvelope | Scenario | None
    try:
        read = shape.model_validate(value)
    except ValidationError as error:
        spelling.faults.extend(faults_of(error, value, root, spelling))
        read, decided = repair(value, shape, place)
    reported = {fault.where for fault in faults}
    all_faults = [*faults, *(fault for fault in spelling.faults if fault.where not in reported)]
    if read is None:
        raise document_error(path, all_faults)
    envelope = read if isinstance(read, CommandEnvelope) else None
    whole = read.scenario if isinstance(read, CommandEnvelope) else read
    return Parsed(whole, where, path, raw, envelope, [*notes, *spelling.notes], spelling, all_faults, decided, place)


class _Either(DocumentPart):
    """The keys that distinguish an envelope from a bare scenario."""

    scenario: Free = None
    equipment_list: Free = None


def scenario_keys(text: str) -> tuple[str, ...]:
    """The keys that lead to the scenario of a valid document; () if the document is the scenario."""
    value, carriers = _unwrap(_without_nulls(jsontext.load(text, "", [], [])))
    spelling = KeySpelling({})
    if isinstance(value, dict):
        spelling.rename(value, _Either, "$")
    return (*carriers, spelling.key(value, "scenario")) if isinstance(value, dict) and "scenario" in value else carriers


def _path(keys: tuple[str, ...]) -> str:
    return ".".join(("$", *keys))


def _unwrap(value: object) -> tuple[object, tuple[str, ...]]:
    """The content of the transport envelope, which may be nested, and the keys that lead to it."""
    carriers: tuple[str, ...] = ()
    while isinstance(value, dict):
        keys = {fold_key(key): key for key in value}
        if "data" not in keys or not keys.keys().isdisjoint(("scenario", "equipmentlist")):
            break
        carriers = (*carriers, keys["data"])
        value = value[keys["data"]]
    return value, carriers


def _without_nulls(root: object) -> object:
    """Remove all fields that are null and return the document. Works in place and iteratively, because documents may
    nest deeply."""
    stack = [root]
    while stack:
        value = stack.pop()
        if isinstance(value, dict):
            for key in [key for key, item in value.items() if item is None]:
                del value[key]
            stack.extend(value.values())
        elif isinstance(value, list):
            stack.extend(value)
    return root
