"""A `resetScenario` document that was read: its scenario, its plain values, and notes on how it is spelt.

_Either spelling may come in the wire's own envelope (`{"type": "COMMAND", "data": …}`). A field that is null counts as
absent, of equal keys the last one counts; the latter is noted, and so are other spellings and unread fields.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from lingjing.errors import Fault, MissionError
from lingjing.mission import jsontext
from lingjing.mission.reset.faults import document_error, faults_of
from lingjing.mission.reset.repair import mended, stand_in
from lingjing.mission.reset.shapes import CommandEnvelope, DocumentPart, Free, P, Scenario, TaskRow, folded
from lingjing.mission.reset.spelling import Spelt


@dataclass(frozen=True, slots=True)
class Parsed:
    """A document that was read: the scenario, the JSON path of the scenario, its plain values without nulls under the
    keys of this module; and the notes and faults found so far.

    `placed` are the JSON paths of what has been placed, by the ids of the entities; `understood` the keys, folded, that
    are read beyond those of the shapes. With faults the values are mended
    (`repair`), `place` standing in for places that are none; `decided` says whether what tells the template is as it
    was.
    """

    scenario: Scenario
    path: str
    file: str
    raw: Mapping[str, Any]
    envelope: CommandEnvelope | None = None
    notes: list[str] = field(default_factory=list)
    spelt: Spelt = field(default_factory=lambda: Spelt({}))
    faults: list[Fault] = field(default_factory=list)
    decided: bool = True
    place: Mapping[str, float] = field(default_factory=dict)
    placed: dict[str, str] = field(default_factory=dict)
    understood: set[str] = field(default_factory=set)

    @property
    def task(self) -> TaskRow:
        """The row of the task matrix that is played."""
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
        """JSON path of a key of the scenario, as the document spells it."""
        return f"{self.path}.{self.spelt.key(self.raw, key)}"

    def in_state(self, key: str) -> str:
        """JSON path of a key of the initial state."""
        (state, path), *_ = self.holders()
        return f"{path}.{self.spelt.key(state, key)}"

    def list_path(self, name: str) -> str:
        """JSON path of one of the lists of entities."""
        lists = self.raw.get("equipmentList")
        return f"{self.lists_path}.{self.spelt.key(lists if isinstance(lists, dict) else {}, name)}"

    def holders(self) -> tuple[tuple[Mapping[str, Any], str], ...]:
        """The objects that may hold hidden places, and their JSON paths: initial state, task, scenario."""
        return *self._row_holders(0), (self.raw, self.path)

    def later_holders(self) -> Iterator[tuple[Mapping[str, Any], str]]:
        """Initial state and task of every row after the first, and their JSON paths."""
        for k in range(1, len(self.scenario.task_matrix)):
            yield from self._row_holders(k)

    def _row_holders(self, index: int) -> tuple[tuple[Mapping[str, Any], str], tuple[Mapping[str, Any], str]]:
        rows = self.raw.get("taskMatrix")
        task = rows[index] if isinstance(rows, list) and len(rows) > index and isinstance(rows[index], dict) else {}
        state = task.get("initial_state")
        inner: Mapping[str, Any] = state if isinstance(state, dict) else {}
        path = f"{self.at('taskMatrix')}[{index}]"
        return (inner, f"{path}.{self.spelt.key(task, 'initial_state')}"), (task, path)

    def typed_holders(self) -> Iterator[tuple[Mapping[str, Any], str]]:
        """The objects that may name a task type, and their JSON paths: the scenario and every row."""
        yield self.raw, self.path
        for k in range(len(self.scenario.task_matrix)):
            yield self._row_holders(k)[1]

    def fault(self, where: str, message: str, hint: str) -> MissionError:
        """The error that ends the reading at a JSON path of this document, with all faults found before."""
        return document_error(self.file, [*self.faults, Fault(where, message, hint)])

    def report(self, where: str, message: str, hint: str) -> None:
        """Keep a fault and go on."""
        self.faults.append(Fault(where, message, hint))

    def converted(self, value: object, shape: type[P], where: str) -> P:
        """A part of the document in its shape; if it is none, that is reported and another place stands in."""
        try:
            return shape.model_validate(value)
        except ValidationError as error:
            self.faults.extend(faults_of(error, value, where, self.spelt))
            return shape.model_validate(dict(self.place))


def parse(text: str, path: str) -> Parsed:
    """Read a document; `UsageError` if it is not JSON, `MissionError` if it is no scenario and cannot be mended."""
    notes: list[str] = []
    faults: list[Fault] = []
    value, carriers = _unwrapped(_without_nulls(jsontext.load(text, path, notes, faults)))
    if carriers:
        notes.append(f"$: the wire's envelope is taken off; {_path(carriers)} is read")
    root = _path(carriers)
    spelt = Spelt({})
    if isinstance(value, dict):
        spelt.rename(value, _Either, root)
    if not isinstance(value, dict) or not ({"scenario", "equipmentList"} & value.keys()):
        packed = isinstance(value, str) and value.lstrip().startswith("{")
        raise MissionError(
            f"{path}: {root} is not a resetScenario: it holds neither 'scenario' nor 'equipmentList'",
            hint="the document is packed into a text: put the object itself there"
            if packed
            else "give a resetScenario document, a mission.json or an .ljs file",
        )
    shape: type[CommandEnvelope | Scenario] = CommandEnvelope if "scenario" in value else Scenario
    spelt.unify(value, shape, root)
    own = spelt.key(value, "scenario")
    inner, where = (value["scenario"], f"{root}.{own}") if shape is CommandEnvelope else (value, root)
    raw = inner if isinstance(inner, dict) else {}
    place = stand_in(raw)
    decided = True
    read: CommandEnvelope | Scenario | None
    try:
        read = shape.model_validate(value)
    except ValidationError as error:
        spelt.faults.extend(faults_of(error, value, root, spelt))
        read, decided = mended(value, shape, place)
    told = {fault.where for fault in faults}
    found = [*faults, *(fault for fault in spelt.faults if fault.where not in told)]
    if read is None:
        raise document_error(path, found)
    envelope = read if isinstance(read, CommandEnvelope) else None
    whole = read.scenario if isinstance(read, CommandEnvelope) else read
    return Parsed(whole, where, path, raw, envelope, [*notes, *spelt.notes], spelt, found, decided, place)


class _Either(DocumentPart):
    """What tells an envelope from a bare scenario."""

    scenario: Free = None
    equipment_list: Free = None


def scenario_keys(text: str) -> tuple[str, ...]:
    """The keys that lead to the scenario of a document that can be read; none if it is the document."""
    value, carriers = _unwrapped(_without_nulls(jsontext.load(text, "", [], [])))
    spelt = Spelt({})
    if isinstance(value, dict):
        spelt.rename(value, _Either, "$")
    return (*carriers, spelt.key(value, "scenario")) if isinstance(value, dict) and "scenario" in value else carriers


def _path(keys: tuple[str, ...]) -> str:
    return ".".join(("$", *keys))


def _unwrapped(value: object) -> tuple[object, tuple[str, ...]]:
    """What the wire's envelope carries, which may be one again, and the keys on the way there."""
    carriers: tuple[str, ...] = ()
    while isinstance(value, dict):
        keys = {folded(key): key for key in value}
        if "data" not in keys or not keys.keys().isdisjoint(("scenario", "equipmentlist")):
            break
        carriers = (*carriers, keys["data"])
        value = value[keys["data"]]
    return value, carriers


def _without_nulls(root: object) -> object:
    """The same values, with every field that is null taken out (in place; a loop, for documents nest deeply)."""
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
