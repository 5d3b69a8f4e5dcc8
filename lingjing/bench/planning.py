"""From a suite file to the episodes that it means: names looked up, values checked, every fault told at once.

A `SuiteCell` is one entrant in one column under one condition. It has an episode for each of the suite's seeds, so that
all cells of a mission are matched: a seed is the same instance in each of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lingjing.bench.columns import Column, columns
from lingjing.bench.suite import (
    Entrant,
    Plain,
    Suite,
    SuiteCondition,
    faults_error,
    form_faults,
    read_document,
    readable,
)
from lingjing.dsl.feasibility.providers import missing_files
from lingjing.dsl.loading.load import load_mission
from lingjing.dsl.loading.shipped import find_mission, shipped_missions
from lingjing.errors import Fault, LingjingError, MissionError, UsageError
from lingjing.mission.instance import GivenOption
from lingjing.mission.instantiate import instantiate, parameters
from lingjing.mission.model import Mission
from lingjing.mission.settings import read_setting
from lingjing.option_reading import unknown_option
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import PolicyDeclaration, is_file
from lingjing.play.policy_processes.examination import PolicyDeclarations
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.host import PluginHost
from lingjing.suggest import did_you_mean

_READ_ELSEWHERE = {
    "suite": 1, "name": "x", "missions": ["x"], "seeds": 1, "entrants": [{"policy": "x"}], "conditions": []
}  # fmt: skip
"""Stands for what a suite must have, and for what is read part by part: faults there are told there, and hide nothing
of the rest."""

GROUPS = {"commercial": "Commercial models", "open": "Open-source models"}
"""The headings of the paper's tables, by a model's tier."""


@dataclass(frozen=True, slots=True)
class Player:
    """An entrant with its names looked up: `policy` is how `PlayOptions` names it, `declared` what it declares there,
    `args` its own options, `privileged` true if one of its policies asks to see the truth."""

    name: str
    group: str
    policy: str
    declared: PolicyDeclaration
    args: Mapping[str, GivenOption] = field(default_factory=dict)
    model: ModelPlugin | None = None
    policies_for: Mapping[str, str] = field(default_factory=dict)
    blank_pictures: bool = False
    privileged: bool = False


@dataclass(frozen=True, slots=True)
class SuiteCell:
    """One entrant in one column; `args` are its options with those of suite and condition, `place` where the suite
    lists entrant and condition."""

    player: Player
    column: Column
    condition: str = ""
    baseline: bool = False
    args: Mapping[str, GivenOption] = field(default_factory=dict)
    place: tuple[int, int] = (0, 0)

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Entrant, mission, mode and condition: what tells it from all other cells of its suite."""
        return self.player.name, self.column.mission, self.column.mode, self.condition


@dataclass(frozen=True, slots=True)
class SuitePlan:
    """A checked suite: its cells in the order of the file, and the missions it plays by name."""

    suite: Suite
    path: Path
    cells: tuple[SuiteCell, ...]
    missions: Mapping[str, Mission]
    files: tuple[Path, ...]

    @property
    def players(self) -> tuple[Player, ...]:
        """Who plays, in the order of the file."""
        return tuple({cell.player.name: cell.player for cell in self.cells}.values())


def read_plan(path: Path, host: PluginHost, policies: Sequence[str] = ()) -> SuitePlan:
    """Read and check a suite file. With `policies` these play it instead of its own entrants, which need no model.
    Policies in files are loaded by processes of their own.

    Raises `UsageError` that tells every fault with its path.
    """
    document = read_document(path)
    if policies:
        document = _played_by(document, policies)
    faults = list(form_faults(document))
    with PolicyDeclarations(host) as declarations:
        reader = _Reader(document, path.parent, host, declarations)
        cells = reader.cells()
    faults += reader.faults
    if faults:
        raise faults_error(path, tuple(dict.fromkeys(faults)))
    if not cells:
        raise UsageError(f"{path}: nothing to play: no mission has such a mode or sweep", hint="leave modes out")
    return SuitePlan(Suite.model_validate(document), path, cells, reader.missions, tuple(reader.files.values()))


def options_of_cell(cell: SuiteCell, seed: int, policy_seed: int, evaluators: tuple[str, ...]) -> PlayOptions:
    """How the cell's episode of that seed is played."""
    return PlayOptions(
        mission=str(cell.column.path),
        policy=cell.player.policy,
        policies_for=dict(cell.player.policies_for),
        policy_args=dict(cell.args),
        seed=seed,
        policy_seed=policy_seed,
        mode=cell.column.mode,
        settings=dict(cell.column.settings),
        evaluators=evaluators,
        blank_pictures=cell.player.blank_pictures,
        overview=False,
    )


def _played_by(document: Mapping[str, Any], policies: Sequence[str]) -> dict[str, Any]:
    """The suite with other entrants, and without the options that were meant for its own."""
    kept = {name: value for name, value in document.items() if name != "args"}
    kept["entrants"] = [{"policy": _absolute(Path.cwd(), policy)} for policy in policies]
    listed = document.get("conditions")
    if isinstance(listed, list):
        kept["conditions"] = [
            {name: value for name, value in one.items() if name not in ("args", "entrants")}
            if isinstance(one, dict)
            else one
            for one in listed
        ]
    return kept


def _absolute(folder: Path, policy: str) -> str:
    """A policy's file by its whole path; anything else is a name."""
    file, colon, name = policy.partition(":")
    return f"{(folder / file).resolve()}{colon}{name}" if is_file(policy) else policy


class _Reader:
    """Looks up what a suite names, as far as its form can be read, and collects what is wrong."""

    def __init__(
        self, document: Mapping[str, Any], folder: Path, host: PluginHost, declarations: PolicyDeclarations
    ) -> None:
        self.faults: list[Fault] = []
        self.missions: dict[str, Mission] = {}
        self.files: dict[str, Path] = {}
        self._document = document
        self._folder = folder
        self._host = host
        self._declarations = declarations

    def cells(self) -> tuple[SuiteCell, ...]:
        """All cells; those that can be made where there are faults."""
        self._read_missions()
        self._read_evaluators()
        suite = readable(Suite, {**self._document, **_READ_ELSEWHERE})
        modes = suite.modes if suite is not None else None
        self._check_modes("modes", modes, self.missions.values())
        args = suite.args if suite is not None else {}
        conditions = list(_parts(self._document, "conditions", SuiteCondition))
        places = self._columns(conditions, modes, sweeps=suite is not None and suite.sweeps)
        players = [(at, *found) for at, entrant in _parts(self._document, "entrants", Entrant)
                   if (found := self._player(at, entrant)) is not None]  # fmt: skip
        self._check_names("entrants", [(at, player.name) for at, _, player in players])
        self._check_options(players, conditions, args)
        self._check_condition_entrants(conditions, {player.name for _, _, player in players})
        return tuple(
            SuiteCell(
                player,
                place.column,
                place.condition,
                place.baseline,
                {**_taken(player, args), **player.args, **_taken(player, place.args)},
                (at, place.at),
            )
            for place in places
            for at, _, player in players
            if place.entrants is None or player.name in place.entrants
        )

    def _check_options(
        self,
        players: Sequence[tuple[int, Entrant, Player]],
        conditions: Sequence[tuple[int, SuiteCondition]],
        args: Mapping[str, Plain],
    ) -> None:
        """The options of every entrant under every condition, also of those under which it plays nothing: each fault
        where it is written, and options that nobody takes."""
        under: list[tuple[str, Mapping[str, Plain], Sequence[str] | None]] = (
            [("", {}, None)]
            if not conditions
            else [(f"conditions[{at}]", condition.args, condition.entrants) for at, condition in conditions]
        )
        known = {player.name for _, _, player in players}
        untaken = {f"args.{name}": name for name in args}
        idle = list(players)
        for where, own, named in under:
            untaken |= {f"{where}.args.{name}": name for name in own}
            everybody = named is None or not known & set(named)
            for one in players:
                if everybody or (named is not None and one[2].name in named):
                    self._check_merged(one, args, where, own)
                    idle = [other for other in idle if other is not one]
        for one in idle:
            self._check_merged(one, args, "", {})
        declared = [player.declared for _, _, player in players]
        unread = not players or len(players) < len(self._document["entrants"])  # one of those may take it
        for where, name in untaken.items():
            if not unread and not any(each.takes(name) for each in declared):
                self._say(where, unknown_option(name, (one for each in declared for one in each.options)))

    def _check_merged(
        self, one: tuple[int, Entrant, Player], args: Mapping[str, Plain], where: str, own: Mapping[str, Plain]
    ) -> None:
        """The options of an entrant with those of the suite and of the condition that is written at `where`."""
        at, entrant, player = one
        shared, under = _taken(player, args), _taken(player, own)
        for fault in self._option_faults(at, player, {**shared, **player.args, **under}):
            top = fault.where.partition(".")[0]
            if top in under:
                place = f"{where}.args.{top}"
            elif top in entrant.args:
                place = f"entrants[{at}].args.{top}"
            else:
                place = f"args.{top}" if top in shared else f"entrants[{at}]"
            named = "" if place.endswith(f".{top}") or not top else f"option `{top}` "
            self._say(place, Fault(fault.where, f"{named}{fault.message}", fault.hint))

    def _option_faults(self, at: int, player: Player, given: Mapping[str, GivenOption]) -> tuple[Fault, ...]:
        """Return the faults of options; a check of the policy that raises is a fault as well."""
        try:
            return self._declarations.option_faults(player.policy, given)
        except LingjingError as error:
            self._fault(f"entrants[{at}]", str(error), error.hint)
            return ()

    # -- missions, modes, settings

    def _read_missions(self) -> None:
        for at, word in _listed(self._document, "missions"):
            path = self._folder / word if (self._folder / word).is_file() else None
            try:
                found = path or find_mission(word)
                mission = load_mission(found)
            except MissionError as error:
                first = str(error).splitlines()[0] if str(error) else "it has errors"
                self._fault(f"missions[{at}]", f"`{word}` does not compile: {first}", f"see `lingjing validate {word}`")
                continue
            except UsageError as error:
                self._fault(f"missions[{at}]", str(error), did_you_mean(word, shipped_missions(), "missions"))
                continue
            for fault in missing_files(mission):
                self._fault(f"missions[{at}]", f"`{word}`: {fault.message}", fault.hint)
            if mission.name in self.missions:
                self._fault(f"missions[{at}]", f"`{mission.name}` is there twice")
            self.missions[mission.name] = mission
            self.files[mission.name] = Path(found)

    def _read_evaluators(self) -> None:
        for at, name in _listed(self._document, "evaluators"):
            if name not in self._host.evaluators:
                hint = did_you_mean(name, self._host.evaluators, "evaluators")
                self._fault(f"evaluators[{at}]", f"there is no evaluator `{name}`", hint)

    def _check_modes(self, where: str, modes: Iterable[str] | None, missions: Iterable[Mission]) -> None:
        missions = list(missions)
        allowed = {mode for mission in missions for mode in mission.modes.allowed}
        for at, mode in enumerate(modes or ()):
            if missions and mode not in allowed:
                names = ", ".join(mission.name for mission in missions)
                self._fault(
                    f"{where}[{at}]",
                    f"none of {names} is played in mode `{mode}`",
                    f"they have: {', '.join(sorted(allowed))}",
                )

    def _columns(
        self, wanted: Sequence[tuple[int, SuiteCondition]], modes: Sequence[str] | None, *, sweeps: bool
    ) -> list[_Place]:
        if not wanted and not self._document.get("conditions"):
            found = columns(self.files.values(), modes, sweeps=sweeps)
            return [
                _Place("", column, _setting_name(column.settings) if sweeps else "", at=at)
                for at, column in enumerate(found)
            ]
        places: list[_Place] = []
        for at, condition in wanted:
            places += self._places(at, condition, modes)
        names = [((place.column.mission, place.column.mode, place.condition), place.where) for place in places]
        for name, where in names:
            if next(other for key, other in names if key == name) != where:
                self._fault(f"{where}.name", f"`{name[2]}` is the name of another condition in {name[0]}, {name[1]}")
        return places

    def _places(self, at: int, condition: SuiteCondition, modes: Sequence[str] | None) -> Iterator[_Place]:
        where = f"conditions[{at}]"
        chosen = condition.missions if condition.missions is not None else tuple(self.missions)
        for number, name in enumerate(condition.missions or ()):
            listed = [mission for _, mission in _listed(self._document, "missions")]
            if name not in self.missions and name not in listed:
                hint = did_you_mean(name, self.missions, "missions")
                self._fault(f"{where}.missions[{number}]", f"`{name}` is none of the suite's missions", hint)
        missions = [self.missions[name] for name in chosen if name in self.missions]
        self._check_modes(f"{where}.modes", condition.modes, missions)
        for mission in missions:
            settings = self._settings(where, condition.settings, mission)
            whole = settings.keys() == condition.settings.keys()
            for mode in mission.modes.allowed:
                if mode in (condition.modes or modes or mission.modes.allowed):
                    fine = self._check_settings(where, mission, mode, settings, whole)
                    if fine and whole:
                        column = Column(self.files[mission.name], mission.name, mode, settings)
                        yield _Place(
                            where, column, condition.name, condition.args, condition.entrants, condition.baseline, at
                        )

    def _settings(self, where: str, given: Mapping[str, Plain], mission: Mission) -> dict[str, float]:
        """The settings in SI units, but for those that cannot be read."""
        read: dict[str, float] = {}
        for name, value in given.items():
            try:
                read[name] = read_setting(mission, name, value) if isinstance(value, str) else float(value)
            except UsageError as error:
                self._fault(f"{where}.settings.{name}", str(error), error.hint)
        return read

    def _check_settings(
        self, where: str, mission: Mission, mode: str, settings: Mapping[str, float], whole: bool
    ) -> bool:
        """Whether they may be as they are, each by itself and, if they are `whole`, all together."""
        before = len(self.faults)
        for name, value in settings.items():
            try:
                parameters(mission, mode, {name: value})
            except LingjingError as error:
                self._fault(f"{where}.settings.{name}", str(error), error.hint)
        if whole and len(self.faults) == before:
            try:
                instantiate(mission, seed=0, mode=mode, settings=settings)
            except LingjingError as error:
                self._fault(f"{where}.settings", f"{mission.name} in mode {mode}: {error}", error.hint)
        return len(self.faults) == before

    # -- entrants and their options

    def _player(self, at: int, entrant: Entrant) -> tuple[Entrant, Player] | None:
        where = f"entrants[{at}]"
        model = None
        if entrant.model is not None:
            model = self._host.models.get(entrant.model)
            if model is None:
                hint = did_you_mean(entrant.model, self._host.models, "models")
                self._fault(f"{where}.model", f"there is no model `{entrant.model}`", hint)
                return None
        spec = _absolute(self._folder, model.policy if model else str(entrant.policy))
        declared = self._policy(f"{where}.policy", spec)
        others = [self._policy(f"{where}.policies_for.{role}", _absolute(self._folder, named))
                  for role, named in entrant.policies_for.items()]  # fmt: skip
        known = [declaration for declaration in (declared, *others) if declaration is not None]
        if declared is None or len(known) <= len(others):
            return None
        own = {**(model.arguments if model else {}), **entrant.args}
        player = Player(
            name=entrant.name or ((model.title or model.name) if model else declared.name),
            group=entrant.group or (GROUPS[model.tier] if model else ""),
            policy=spec,
            declared=declared,
            args=own,
            model=model,
            policies_for={role: _absolute(self._folder, named) for role, named in entrant.policies_for.items()},
            blank_pictures=entrant.blank_pictures,
            privileged=any(declaration.privileged for declaration in known),
        )
        return entrant, player

    def _policy(self, where: str, spec: str) -> PolicyDeclaration | None:
        try:
            return self._declarations.of(spec)
        except LingjingError as error:
            close = "" if is_file(spec) else did_you_mean(spec, self._host.policies, "policies")
            self._fault(where, str(error), close or error.hint)
            return None

    def _check_names(self, where: str, names: Sequence[tuple[int, str]]) -> None:
        seen: set[str] = set()
        for at, name in names:
            if name in seen:
                self._fault(f"{where}[{at}].name", f"`{name}` is there twice", "give each a name of its own")
            seen.add(name)

    def _check_condition_entrants(self, conditions: Sequence[tuple[int, SuiteCondition]], names: set[str]) -> None:
        for at, condition in conditions:
            for number, name in enumerate(condition.entrants or ()):
                if names and name not in names:
                    where = f"conditions[{at}].entrants[{number}]"
                    self._fault(where, f"there is no entrant `{name}`", did_you_mean(name, names, "entrants"))

    def _fault(self, where: str, message: str, hint: str = "") -> None:
        self.faults.append(Fault(where, message, hint))

    def _say(self, where: str, fault: Fault) -> None:
        self.faults.append(Fault(where, fault.message, fault.hint))


@dataclass(frozen=True, slots=True)
class _Place:
    """A column under a condition, and where the suite says so."""

    where: str
    column: Column
    condition: str
    args: Mapping[str, Plain] = field(default_factory=dict)
    entrants: tuple[str, ...] | None = None
    baseline: bool = False
    at: int = 0


def _taken(player: Player, given: Mapping[str, Plain]) -> dict[str, Plain]:
    """Those of the options that the player's policy has."""
    return {name: value for name, value in given.items() if player.declared.takes(name)}


def _setting_name(settings: Mapping[str, float]) -> str:
    return ", ".join(f"{name}={value:g}" for name, value in settings.items())


def _listed(document: Mapping[str, Any], name: str) -> Iterator[tuple[int, str]]:
    """The texts of a list, each with its place; nothing of what is no list."""
    found = document.get(name)
    for at, one in enumerate(found if isinstance(found, list) else ()):
        if isinstance(one, str) and one:
            yield at, one


def _parts(document: Mapping[str, Any], name: str, kind: Any) -> Iterator[tuple[int, Any]]:
    """What can be read of a list of tables, each with its place."""
    found = document.get(name)
    for at, one in enumerate(found if isinstance(found, list) else ()):
        part = readable(kind, one)
        if part is not None:
            yield at, part


__all__ = ["Player", "SuiteCell", "SuitePlan", "options_of_cell", "read_plan"]
