"""Measurement of attribution methods on planted faults: `_AttributionSuite`, `AttributionRun` and tables.

An *attribution method* receives the trace of an episode and names the faults that made it fail: a sequence of
`NamedFault`, the most likely first, empty if it finds none. `families` uses the rules of `lingjing.analysis.families`,
`blame` uses branches of the episode (`lingjing.causal.blame`). Other methods are functions in files
(`FILE.py:FUNCTION`), which may return plain (agent, faculty, boundary).

The header of the trace holds the options of the faulty policy, which name the faults. A method receives a copy without
them, in a folder apart from answers and episodes. A method with the attribute `redrives`, which runs policies again,
needs the options and receives the trace itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, cast

import msgspec
from pydantic import Field, ValidationError

from lingjing.analysis.families import RecordLink, attribute
from lingjing.analysis.played_city import surroundings_of
from lingjing.analysis.shares import wilson
from lingjing.bench.executors import Executor
from lingjing.bench.planted import FACULTIES, PlantedEpisode, PlantedKind, read_planted
from lingjing.bench.suite import ATTRIBUTION, NameOrFile, ShortText, SuitePart, read_document
from lingjing.bench.table_cells import UNDEFINED, ResultCell, ResultLine, ResultTable
from lingjing.decoding import from_json
from lingjing.errors import LingjingError, UsageError
from lingjing.play.parallel import EpisodeTask
from lingjing.play.python_files import function_of
from lingjing.play.report import EpisodeReport
from lingjing.suggest import nearest_or
from lingjing.trace.copying import copy_trace
from lingjing.trace.digest import last_digest
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import CUT_SHORT, DIGEST_VERSION, DigestVersion

BRANCHES = 60
"""Branches per episode of the method `blame`. Chosen; shares and placebos name no fault and are switched off."""


class NamedFault(msgspec.Struct, frozen=True, kw_only=True):
    """A fault that a method names."""

    agent: str
    faculty: str
    boundary: int | None = None
    """The first boundary of the fault; None if unknown."""


NamesFaults = Callable[[Trace], Sequence[NamedFault]]
"""The function of a method."""


@dataclass(frozen=True, slots=True)
class AttributionMethod:
    """An attribution method."""

    ask: NamesFaults
    """Returns the faults that a trace shows."""
    redrives: bool = False
    """True if the method runs policies again and needs their options."""


class _AttributionSuite(SuitePart):
    """A suite that measures attribution methods on a file of planted faults."""

    suite: Literal[1] = Field(description="the version of this form")
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$", description="the name of its folder")
    title: str = Field("", max_length=200, description="the heading of its tables")
    about: str = Field("", max_length=4000, description="the question of the study")
    planted: NameOrFile = Field(description="the file of episodes with planted faults, beside the suite")
    methods: tuple[ShortText, ...] = Field(
        ("families",), min_length=1, strict=False, description="the methods to measure"
    )


class AttributionRow(msgspec.Struct, frozen=True, kw_only=True):
    """A method's answer for an episode."""

    method: str
    episode: PlantedEpisode
    named: tuple[NamedFault, ...] = ()
    """The named faults, the most likely first."""
    standing: Literal["answered", "differs", "failed", "cut short"] = "answered"
    """`differs`: the episode is not that of the file (not counted). `cut short`: the episode did not end by itself
    (not counted). `failed`: the method raised, which counts as an empty answer.
    """
    detail: str = ""

    @property
    def names_first(self) -> bool:
        """True if agent and faculty of the first named fault are those of the planted one."""
        return bool(self.named) and _pair(self.named[0]) == _planted(self.episode)[0]

    @property
    def names_all(self) -> bool:
        """True if all planted faults are among the named ones."""
        return set(_planted(self.episode)) <= {_pair(fault) for fault in self.named}

    @property
    def boundary_off(self) -> int | None:
        """Distance of the first named boundary from the planted one; None if agent or faculty are wrong or no boundary
        is named.
        """
        if not self.names_first or self.named[0].boundary is None:
            return None
        return abs(self.named[0].boundary - self.episode.faults[0].boundary)


def _pair(fault: NamedFault) -> tuple[str, str]:
    return fault.agent, fault.faculty


def _planted(episode: PlantedEpisode) -> list[tuple[str, str]]:
    return [(fault.agent, fault.faculty) for fault in episode.faults]


def is_attribution_suite(path: Path) -> bool:
    """Return whether a suite file measures attribution methods. Raises `UsageError` for an unreadable file."""
    return ATTRIBUTION in read_document(path)


def read_attribution_suite(path: Path) -> tuple[_AttributionSuite, tuple[PlantedEpisode, ...]]:
    """Return the suite and its episodes. Raises `UsageError`."""
    try:
        suite = _AttributionSuite.model_validate(read_document(path))
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}" for problem in error.errors())
        raise UsageError(f"{path}: {faults}", hint="docs/studies.md describes the form of such a suite") from error
    return suite, read_planted(path.parent / suite.planted)


def find_method(name: str) -> AttributionMethod:
    """Return the method with that name, or the function `FILE.py:FUNCTION`. Raises `UsageError`."""
    if name in METHODS:
        return METHODS[name]
    if not Path(name.partition(":")[0]).is_file():
        hint = nearest_or(name, METHODS, f"methods are {', '.join(METHODS)} and FILE.py:FUNCTION")
        raise UsageError(f"there is no attribution method `{name}`", hint=hint)
    method = function_of(name, "method")
    return AttributionMethod(
        lambda trace: tuple(map(_named, method(trace))), redrives=bool(getattr(method, "redrives", False))
    )


def _named(answer: object) -> NamedFault:
    if isinstance(answer, NamedFault):
        return answer
    agent, faculty, boundary = cast("tuple[str, str, int | None]", answer)
    return NamedFault(agent=str(agent), faculty=str(faculty), boundary=boundary)


def _by_families(trace: Trace) -> tuple[NamedFault, ...]:
    """Name the fault of an episode's failure family: its faculty, the agent of its chain, and the tick of the
    breakdown.
    """
    failure = attribute(trace)
    faculty = _FACULTY_OF.get(failure.family) if failure is not None else None
    if failure is None or faculty is None:
        return ()
    agent = next(filter(None, (_agent_of(trace, link) for link in failure.chain)), "")
    return (NamedFault(agent=agent, faculty=faculty, boundary=failure.tick),)


_FACULTY_OF = {
    "perception_miss": "perception",
    "object_confusion": "perception",
    "localisation_error": "localisation",
    "handoff_break": "handoff",
    "coordination_deadlock": "execution",
    "context_drift": "waypoint",
}


def _agent_of(trace: Trace, link: RecordLink) -> str:
    """Return the agent of a record: the record is the agent, the agent sent the message, or the text begins with its
    name.
    """
    agents = [item.id for item in trace.header.instance.agents]
    envelopes = (item for record in trace.boundaries for item in record.messages if link.kind == "message")
    sender = next((item.sender for item in envelopes if item.id == link.record), "")
    words = (sender, link.record, link.record.partition(" ")[0], link.text.partition(" ")[0])
    return next((word for word in words if word in agents), "")


def _by_blame(trace: Trace) -> tuple[NamedFault, ...]:
    """Name the causes that `lingjing blame` finds: those of all smallest repairs, the best repair first."""
    from lingjing.causal.blame import BlameOptions, blame

    result = blame(trace, BlameOptions(branches=BRANCHES, placebos=0, shares=False, jobs=1))
    causes = (cause for repair in result.repairs for cause in repair.causes)
    return tuple(NamedFault(agent=cause.agent, faculty=cause.faculty, boundary=cause.boundary) for cause in causes)


METHODS: dict[str, AttributionMethod] = {
    "families": AttributionMethod(_by_families),
    "blame": AttributionMethod(_by_blame, redrives=True),
}
"""The methods by name."""


@dataclass
class AttributionRun:
    """A run of methods over episodes. Answers are stored in `folder`, and an interrupted run continues from them."""

    folder: Path
    methods: dict[str, AttributionMethod]
    executor: Executor
    tell: Callable[[str], None] = print
    """Receives a line for each answer."""

    def run(self, episodes: Sequence[PlantedEpisode]) -> list[AttributionRow]:
        """Return every method's answer for every episode, in the order of the episodes."""
        self.folder.mkdir(parents=True, exist_ok=True)
        known = {(row.method, row.episode): row for row in self._kept()}
        places = {
            self.folder / f"episode-{number}": episode
            for number, episode in enumerate(episodes)
            if any((name, episode) not in known for name in self.methods)
        }
        for place in places:  # remains of a killed command
            _clear(place)
        tasks = (EpisodeTask(episode.options(), place) for place, episode in places.items())
        for task, report in self.executor.play(tasks):
            episode = places[task.folder]
            for name, method in self.methods.items():
                if (name, episode) not in known:
                    known[name, episode] = self._answer(name, method, episode, report)
            _clear(task.folder)
        return [known[name, episode] for episode in episodes for name in self.methods]

    def _answer(
        self, name: str, method: AttributionMethod, episode: PlantedEpisode, report: EpisodeReport
    ) -> AttributionRow:
        """Return the row of a played episode. It is stored unless the episode was cut short, which is played again
        later.
        """
        if report.reason in CUT_SHORT:
            row = AttributionRow(method=name, episode=episode, standing="cut short", detail=report.reason)
        elif _played_digest(report, episode.digest_version) != episode.digest:
            row = AttributionRow(method=name, episode=episode, standing="differs", detail="its digest differs here")
        else:
            row = self._ask(name, method, episode, Path(report.trace))
        if row.standing != "cut short":
            self._keep(row)
        listed = ", ".join(f"{fault.agent} {fault.faculty} at {fault.boundary}" for fault in row.named) or "nothing"
        self.tell(f"{episode.name}; {name}: {listed if row.standing == 'answered' else row.standing}")
        return row

    def _ask(self, name: str, method: AttributionMethod, episode: PlantedEpisode, path: Path) -> AttributionRow:
        try:
            trace = read_trace(path)
            with TemporaryDirectory(prefix="lingjing-attribution-") as apart:
                input_trace = trace if method.redrives else _without_labels(trace, Path(apart) / "trace.mcap")
                answer = tuple(method.ask(input_trace))
        except Exception as error:  # noqa: BLE001 - a foreign method: an exception of any kind is its answer
            detail = f"{type(error).__name__}: {error}"
            return AttributionRow(method=name, episode=episode, standing="failed", detail=detail)
        return AttributionRow(method=name, episode=episode, named=answer)

    def _keep(self, row: AttributionRow) -> None:
        with self._file.open("ab") as answers:
            answers.write(msgspec.json.encode(row) + b"\n")

    def _kept(self) -> Iterable[AttributionRow]:
        for line in self._file.read_bytes().splitlines() if self._file.is_file() else ():
            try:
                yield from_json(line, AttributionRow)
            except msgspec.DecodeError:  # an incomplete last line of a killed command
                continue

    @property
    def _file(self) -> Path:
        return self.folder / "answers.jsonl"


def _played_digest(report: EpisodeReport, version: DigestVersion) -> str:
    """Return the digest of the played episode in the version of the planted one; "" if its trace cannot be read."""
    if version == DIGEST_VERSION:
        return report.digest
    try:
        return last_digest(read_trace(report.trace), version)
    except LingjingError:
        return ""


def _without_labels(trace: Trace, path: Path) -> Trace:
    """Copy the trace to `path` without the options of its policies, which name the planted faults."""
    bindings = tuple(msgspec.structs.replace(binding, arguments={}) for binding in trace.header.bindings)
    header = msgspec.structs.replace(trace.header, bindings=bindings)
    return copy_trace(trace, header, path, surroundings_of(trace))


def _clear(folder: Path) -> None:
    from shutil import rmtree

    rmtree(folder, ignore_errors=True)


# -- tables

_NOT_COUNTED = {
    "differs": "differ from those of the file",
    "cut short": "were cut short (the same command plays them again)",
}


def attribution_tables(rows: Sequence[AttributionRow], title: str) -> tuple[ResultTable, ...]:
    """Return the table of all methods on all episodes, then tables of single faults by faculty and by mission."""
    counted = [row for row in rows if row.standing not in _NOT_COUNTED]
    notes = []
    for standing, why in _NOT_COUNTED.items():
        left_out = len({row.episode for row in rows if row.standing == standing})
        if left_out:
            notes.append(f"{left_out} episodes {why} and are not counted")
    raised = sum(row.standing == "failed" for row in counted)
    if raised:
        notes.append(f"in {raised} cases a method raised, which counts as an empty answer")
    heads = ("Agent and faculty", "Among all named", "Boundary within 1", "Both of two", "Harmless", "No fault")
    methods = list(dict.fromkeys(row.method for row in rows))
    whole = tuple(ResultLine("", (name,), _cells([row for row in counted if row.method == name])) for name in methods)
    short = heads[:3]
    by_faculty = tuple(
        ResultLine(name, (faculty,), _cells(some)[:3])
        for name in methods
        for faculty in FACULTIES
        if (some := [row for row in counted if row.method == name and _faculty(row) == faculty])
    )
    by_mission = tuple(
        ResultLine(name, (mission, base), _cells(some)[:3])
        for name in methods
        for mission, base in dict.fromkeys((row.episode.mission, row.episode.base) for row in counted)
        if (some := [row for row in counted if (row.method, row.episode.mission, row.episode.base)
                     == (name, mission, base) and row.episode.kind == "one"])
    )  # fmt: skip
    return (
        ResultTable("attribution", title, ("Method",), heads, whole, tuple(notes)),
        ResultTable("attribution", f"{title}, by faculty", ("Faculty",), short, by_faculty),
        ResultTable("attribution", f"{title}, by mission", ("Mission", "Policy"), short, by_mission),
    )


def _faculty(row: AttributionRow) -> str:
    return row.episode.faults[0].faculty if row.episode.kind == "one" else ""


def _cells(rows: Sequence[AttributionRow]) -> tuple[ResultCell, ...]:
    def of(kind: PlantedKind) -> list[AttributionRow]:
        return [row for row in rows if row.episode.kind == kind]

    ones, twos = of("one"), of("two")
    near = [row.boundary_off is not None and row.boundary_off <= 1 for row in ones]
    return (
        _share([row.names_first for row in ones]),
        _share([row.names_all for row in ones]),
        _share(near),
        _share([row.names_all for row in twos]),
        *(_share([not row.named for row in of(kind)]) for kind in ("harmless", "none")),
    )  # fmt: skip


def _share(right: Sequence[bool]) -> ResultCell:
    """Return a share in per cent with Wilson's interval: `14/16 (87.5, 64.0 to 96.5)`."""
    if not right:
        return ResultCell(UNDEFINED)
    low, high = wilson(sum(right), len(right))
    share = 100 * sum(right) / len(right)
    return ResultCell(f"{sum(right)}/{len(right)} ({share:.1f}, {100 * low:.1f} to {100 * high:.1f})", share)
