"""The plan of a suite file: names are looked up, values are checked, and all errors are reported at once.

A `SuiteCell` is one entrant in one column under one condition. It has an episode for each of the suite's seeds, so all
cells of a mission are matched: a seed is the same instance in each of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from lingjing.bench.columns import Column, columns
from lingjing.bench.suite import (
    Entrant,
    Plain,
    Suite,
    SuiteCondition,
    faults_error,
    form_faults,
    mission_file_of,
    read_document,
    readable,
)
from lingjing.dsl.feasibility.providers import missing_files
from lingjing.dsl.loading.load import load_mission
from lingjing.dsl.loading.shipped import shipped_missions
from lingjing.errors import Fault, LingjingError, MissionError, UsageError, hint_of
from lingjing.installed_plugins.discovery import installed_plugins
from lingjing.mission.instance import GivenOption
from lingjing.mission.instantiate import instantiate, parameters
from lingjing.mission.languages import ORIGINAL, in_language
from lingjing.mission.model import Mission
from lingjing.mission.settings import read_setting
from lingjing.mission.tiers import USUAL, tiers_of
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
"""Stand-ins for required fields, and for parts that are read separately. Errors in the originals are reported there
and must not prevent reading the rest.
"""

GROUPS = {"commercial": "Commercial models", "open": "Open-source models"}
"""The headings of the paper's tables, by the tier of a model."""


@dataclass(frozen=True, slots=True)
class Player:
    """An entrant with its names looked up."""

    name: str
    group: str
    """The entrant's heading in tables."""
    policy: str
    """The policy's name or file, as in `PlayOptions`."""
    declared: PolicyDeclaration
    """The policy's declaration."""
    args: Mapping[str, GivenOption] = field(default_factory=dict)
    """The entrant's own options."""
    model: ModelPlugin | None = None
    """The model; None for other policies."""
    policies_for: Mapping[str, str] = field(default_factory=dict)
    """Other policies by role or agent."""
    blank_pictures: bool = False
    """True if the policies receive black pictures."""
    swap_pictures: bool = False
    """True if the policies receive the pictures of the neighbouring seed."""
    privileged: bool = False
    """True if one of its policies observes the ground truth."""
    foreign: bool = False
    """True if one of its policies is not this project's."""


@dataclass(frozen=True, slots=True)
class SuiteCell:
    """One entrant in one column under one condition."""

    player: Player
    column: Column
    condition: str = ""
    """The condition's name; empty without conditions."""
    baseline: bool = False
    """True if other conditions are compared with this one."""
    args: Mapping[str, GivenOption] = field(default_factory=dict)
    """The options of the entrant, the suite and the condition."""
    place: tuple[int, int] = (0, 0)
    """Positions of entrant and condition in the suite file."""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Entrant, mission, mode and condition, which identify the cell in its suite."""
        return self.player.name, self.column.mission, self.column.mode, self.condition

    @property
    def column_name(self) -> str:
        """Mission and mode, such as `ssr-star`; the tier is not in it."""
        return f"{self.column.mission}-{self.column.mode}"


@dataclass(frozen=True, slots=True)
class SuitePlan:
    """A checked suite."""

    suite: Suite
    path: Path
    """The suite file."""
    cells: tuple[SuiteCell, ...]
    """The cells, in the order of the file."""
    missions: Mapping[str, Mission]
    """The missions by name."""
    files: tuple[Path, ...]
    """The mission files."""

    @property
    def players(self) -> tuple[Player, ...]:
        """The entrants, in the order of the file."""
        return tuple({cell.player.name: cell.player for cell in self.cells}.values())


def read_plan(
    path: Path,
    host: PluginHost,
    policies: Sequence[str] = (),
    *,
    models: Sequence[str] = (),
    tier: int | None = None,
    language: str | None = None,
    isolate: Isolation = "no",
) -> SuitePlan:
    """Read and check a suite file. `policies` replace its entrants and need no model, `models` replace them and play
    under the suite's options, `tier` and `language` replace its own. Policy files are loaded in separate processes,
    behind walls unless `isolate` is `no`; so are installed policies that `host` does not offer.

    Raises `UsageError` with the path of every error.
    """
    document = read_document(path)
    if policies:
        document = _played_by(document, policies)
    elif models:
        document = {**document, "entrants": [{"model": model} for model in models]}
    if tier is not None:
        document = {**document, "tier": tier}
    if language is not None:
        document = {**document, "language": language}
    return plan_document(document, path, host, isolate=isolate)


def plan_document(document: dict[str, Any], path: Path, host: PluginHost, *, isolate: Isolation = "no") -> SuitePlan:
    """Check the values of a suite; names of files in it are relative to `path`. See `read_plan`."""
    faults = list(form_faults(document))
    with PolicyDeclarations(host, isolate=isolate != "no") as declarations:
        reader = _Reader(document, path.parent, host, declarations)
        cells = reader.cells()
    faults += reader.faults
    if faults:
        raise faults_error(path, tuple(dict.fromkeys(faults)))
    if not cells:
        raise UsageError(f"{path}: nothing to play: no mission has such a mode or sweep", hint="remove `modes`")
    return SuitePlan(Suite.model_validate(document), path, cells, reader.missions, tuple(reader.files.values()))


Isolation = Literal["no", "foreign", "yes", "strict"]
"""The walls of a suite: around no policy, around those that are not this project's, around all, or around all and none
may be missing."""


def walls_of_player(player: Player, isolate: Isolation) -> Literal["no", "yes", "strict"]:
    """Return the walls around the policies of an entrant."""
    if isolate == "foreign":
        return "yes" if player.foreign else "no"
    return isolate


def options_of_cell(
    cell: SuiteCell, seed: int, policy_seed: int, evaluators: tuple[str, ...], isolate: Isolation = "no"
) -> PlayOptions:
    """Return the options that play the cell's episode of a seed."""
    return PlayOptions(
        mission=str(cell.column.path),
        policy=cell.player.policy,
        policies_for=dict(cell.player.policies_for),
        policy_args=dict(cell.args),
        seed=seed,
        policy_seed=policy_seed,
        mode=cell.column.mode,
        tier=cell.column.tier,
        language=cell.column.language,
        settings=dict(cell.column.settings),
        evaluators=evaluators,
        blank_pictures=cell.player.blank_pictures,
        swap_pictures=cell.player.swap_pictures,
        overview=False,
        isolate=walls_of_player(cell.player, isolate),
    )


def _played_by(document: Mapping[str, Any], policies: Sequence[str]) -> dict[str, Any]:
    """Return the suite document with other entrants, and without the options of its own entrants."""
    kept = {name: value for name, value in document.items() if name != "args"}
    kept["entrants"] = [{"policy": _absolute(Path.cwd(), policy)} for policy in policies]
    listed = document.get("conditions")
    if isinstance(listed, list):
        kept["conditions"] = [
            {name: value for name, value in condition.items() if name not in ("args", "entrants")}
            if isinstance(condition, dict)
            else condition
            for condition in listed
        ]
    return kept


def policy_file(spec: str) -> str:
    """Return `FILE.py:CLASS` of `package.module:Class`, which is then an entrant's file like any other.

    Any other spec is returned unchanged. Raises `UsageError` if the module is not installed.
    """
    module, _, name = spec.partition(":")
    if is_file(spec) or not re.fullmatch(r"\w+(\.\w+)+", module) or not name.isidentifier():
        return spec
    try:
        spec_of_module = find_spec(module)
    except ModuleNotFoundError:
        spec_of_module = None
    if spec_of_module is None or spec_of_module.origin is None:
        raise UsageError(f"the module of the policy `{spec}` is not installed", hint="install the package that has it")
    return f"{spec_of_module.origin}:{name}"


def _absolute(folder: Path, policy: str) -> str:
    """Return the absolute path of a policy file; a name is returned unchanged."""
    file, colon, name = policy.partition(":")
    return f"{(folder / file).resolve()}{colon}{name}" if is_file(policy) else policy


class _Reader:
    """Looks up the names in a suite document, as far as its form is valid, and collects errors."""

    def __init__(
        self, document: Mapping[str, Any], folder: Path, host: PluginHost, declarations: PolicyDeclarations
    ) -> None:
        self.faults: list[Fault] = []
        self.missions: dict[str, Mission] = {}
        self.files: dict[str, Path] = {}
        self.tiers: dict[str, int] = {}
        self.language = ORIGINAL
        self._document = document
        self._folder = folder
        self._host = host
        self._declarations = declarations

    def cells(self) -> tuple[SuiteCell, ...]:
        """Return all cells that can be made; errors are in `faults`."""
        self._read_missions()
        self._read_evaluators()
        suite = readable(Suite, {**self._document, **_READ_ELSEWHERE})
        modes = suite.modes if suite is not None else None
        self._check_modes("modes", modes, self.missions.values())
        self._choose_tiers(suite.tier if suite is not None else None)
        self._choose_language(suite.language if suite is not None else ORIGINAL)
        args = suite.args if suite is not None else {}
        conditions = list(_parts(self._document, "conditions", SuiteCondition))
        places = self._columns(conditions, modes, sweeps=suite is not None and suite.sweeps)
        places = self._chosen(places, suite.columns if suite is not None else None)
        players = [(at, *read) for at, entrant in _parts(self._document, "entrants", Entrant)
                   if (read := self._player(at, entrant)) is not None]  # fmt: skip
        self._check_names("entrants", [(at, player.name) for at, _, player in players])
        self._check_options(players, conditions, args)
        self._check_condition_entrants(conditions, {player.name for _, _, player in players})
        return tuple(
            SuiteCell(
                player,
                place.column,
                place.condition,
                place.baseline,
                {**_accepted_options(player, args), **player.args, **_accepted_options(player, place.args)},
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
        """Check the options of every entrant under every condition, and report options that no entrant's policy
        accepts. Each error is reported where the option is written; entrants without a condition are checked too.
        """
        under: list[tuple[str, Mapping[str, Plain], Sequence[str] | None]] = (
            [("", {}, None)]
            if not conditions
            else [(f"conditions[{at}]", condition.args, condition.entrants) for at, condition in conditions]
        )
        known = {player.name for _, _, player in players}
        unused = {f"args.{name}": name for name in args}
        idle = list(players)
        for where, own, named in under:
            unused |= {f"{where}.args.{name}": name for name in own}
            applies_to_all = named is None or not known & set(named)
            for option_or_player in players:
                if applies_to_all or (named is not None and option_or_player[2].name in named):
                    self._check_merged(option_or_player, args, where, own)
                    idle = [other for other in idle if other is not option_or_player]
        for option_or_player in idle:
            self._check_merged(option_or_player, args, "", {})
        declared = [player.declared for _, _, player in players]
        unread = not players or len(players) < len(self._document["entrants"])  # an unreadable entrant may accept it
        for where, name in unused.items():
            if not unread and not any(each.takes(name) for each in declared):
                self._add(
                    where,
                    unknown_option(name, (option_or_player for each in declared for option_or_player in each.options)),
                )

    def _check_merged(
        self, listed: tuple[int, Entrant, Player], args: Mapping[str, Plain], where: str, own: Mapping[str, Plain]
    ) -> None:
        """Check the options of an entrant with those of the suite and of the condition at `where`."""
        at, entrant, player = listed
        shared, under = _accepted_options(player, args), _accepted_options(player, own)
        for fault in self._option_faults(at, player, {**shared, **player.args, **under}):
            top = fault.where.partition(".")[0]
            if top in under:
                place = f"{where}.args.{top}"
            elif top in entrant.args:
                place = f"entrants[{at}].args.{top}"
            else:
                place = f"args.{top}" if top in shared else f"entrants[{at}]"
            named = "" if place.endswith(f".{top}") or not top else f"option `{top}` "
            self._add(place, Fault(fault.where, f"{named}{fault.message}", fault.hint))

    def _option_faults(self, at: int, player: Player, options: Mapping[str, GivenOption]) -> tuple[Fault, ...]:
        """Return the errors of options. An exception in the policy's own check is an error too."""
        try:
            return self._declarations.option_faults(player.policy, options)
        except LingjingError as error:
            self._fault(f"entrants[{at}]", str(error), hint_of(error))
            return ()

    # -- missions, modes, settings

    def _read_missions(self) -> None:
        for at, word in _listed(self._document, "missions"):
            try:
                file = mission_file_of(word, self._folder)
                mission = load_mission(file)
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
                self._fault(f"missions[{at}]", f"`{mission.name}` is listed twice")
            self.missions[mission.name] = mission
            self.files[mission.name] = file

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

    def _choose_tiers(self, tier: int | None) -> None:
        """Choose the tier of each mission: the suite's, or else the usual one if the mission declares it."""
        for mission in self.missions.values():
            declared = tiers_of(mission)
            usual = USUAL if USUAL in declared else 0
            self.tiers[mission.name] = tier if tier in declared else usual
            if tier is not None and tier not in declared:
                known = ", ".join(map(str, declared))
                hint = f"its tiers: {known}; leave `tier` out to play each mission at its usual one"
                self._fault("tier", f"`{mission.name}` declares no tier {tier}", hint)

    def _choose_language(self, language: str) -> None:
        """Choose the language of all missions. A mission without it is a fault, because tables have one language."""
        for mission in self.missions.values():
            try:
                in_language(mission, language)
            except UsageError as error:
                self._fault("language", str(error), hint_of(error))
        if not any(fault.where == "language" for fault in self.faults):
            self.language = language

    def _columns(
        self, conditions: Sequence[tuple[int, SuiteCondition]], modes: Sequence[str] | None, *, sweeps: bool
    ) -> list[_Place]:
        if not conditions and not self._document.get("conditions"):
            all_columns = columns(self.files.values(), modes, sweeps=sweeps, tiers=self.tiers, language=self.language)
            return [
                _Place("", column, _setting_name(column.settings) if sweeps else "", at=at)
                for at, column in enumerate(all_columns)
            ]
        places: list[_Place] = []
        for at, condition in conditions:
            places += self._places(at, condition, modes)
        names = [((place.column.mission, place.column.mode, place.condition), place.where) for place in places]
        for name, where in names:
            if next(other for key, other in names if key == name) != where:
                self._fault(f"{where}.name", f"`{name[2]}` is the name of another condition in {name[0]}, {name[1]}")
        return places

    def _chosen(self, places: list[_Place], names: Sequence[str] | None) -> list[_Place]:
        """Return the places in the columns that the suite names; all without names."""
        if names is None:
            return places
        known = {f"{place.column.mission}-{place.column.mode}" for place in places}
        for at, name in enumerate(names):
            if self.missions and name not in known:
                hint = did_you_mean(name, known, "columns")
                self._fault(f"columns[{at}]", f"no mission of the suite has the column `{name}`", hint)
        return [place for place in places if f"{place.column.mission}-{place.column.mode}" in names]

    def _places(self, at: int, condition: SuiteCondition, modes: Sequence[str] | None) -> Iterator[_Place]:
        where = f"conditions[{at}]"
        chosen = condition.missions if condition.missions is not None else tuple(self.missions)
        for number, name in enumerate(condition.missions or ()):
            listed = [mission for _, mission in _listed(self._document, "missions")]
            if name not in self.missions and name not in listed:
                hint = did_you_mean(name, self.missions, "missions")
                self._fault(f"{where}.missions[{number}]", f"`{name}` is not a mission of the suite", hint)
        missions = [self.missions[name] for name in chosen if name in self.missions]
        self._check_modes(f"{where}.modes", condition.modes, missions)
        for mission in missions:
            settings = self._settings(where, condition.settings, mission)
            whole = settings.keys() == condition.settings.keys()
            for mode in mission.modes.allowed:
                if mode in (condition.modes or modes or mission.modes.allowed):
                    fine = self._check_settings(where, mission, mode, settings, whole)
                    if fine and whole:
                        tier = self.tiers[mission.name]
                        column = Column(self.files[mission.name], mission.name, mode, settings, tier, self.language)
                        yield _Place(
                            where, column, condition.name, condition.args, condition.entrants, condition.baseline, at
                        )

    def _settings(self, where: str, texts: Mapping[str, Plain], mission: Mission) -> dict[str, float]:
        """Return the readable settings in SI units."""
        read: dict[str, float] = {}
        for name, value in texts.items():
            try:
                read[name] = read_setting(mission, name, value) if isinstance(value, str) else float(value)
            except UsageError as error:
                self._fault(f"{where}.settings.{name}", str(error), hint_of(error))
        return read

    def _check_settings(
        self, where: str, mission: Mission, mode: str, settings: Mapping[str, float], whole: bool
    ) -> bool:
        """Return whether the settings are valid, each by itself and, if they are `whole`, all together."""
        before = len(self.faults)
        for name, value in settings.items():
            try:
                parameters(mission, mode, {name: value})
            except LingjingError as error:
                self._fault(f"{where}.settings.{name}", str(error), hint_of(error))
        if whole and len(self.faults) == before:
            try:
                instantiate(mission, seed=0, mode=mode, settings=settings, tier=self.tiers[mission.name])
            except LingjingError as error:
                self._fault(f"{where}.settings", f"{mission.name} in mode {mode}: {error}", hint_of(error))
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
        try:
            spec = _absolute(self._folder, policy_file(model.policy if model else str(entrant.policy)))
        except UsageError as error:
            self._fault(f"{where}.policy", str(error), hint_of(error))
            return None
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
            swap_pictures=entrant.swap_pictures,
            privileged=any(declaration.privileged for declaration in known),
            foreign=any(map(self._is_foreign, (spec, *(entrant.policies_for.values())))),
        )
        return entrant, player

    def _is_foreign(self, spec: str) -> bool:
        """True if a policy is not this project's."""
        own = {point.name for point in installed_plugins().own}
        return is_file(spec) or self._host.sources.get(("lingjing_policies", spec), "") not in own

    def _policy(self, where: str, spec: str) -> PolicyDeclaration | None:
        try:
            return self._declarations.of(spec)
        except LingjingError as error:
            close = "" if is_file(spec) else did_you_mean(spec, self._host.policies, "policies")
            self._fault(where, str(error), close or hint_of(error))
            return None

    def _check_names(self, where: str, names: Sequence[tuple[int, str]]) -> None:
        seen: set[str] = set()
        for at, name in names:
            if name in seen:
                self._fault(f"{where}[{at}].name", f"`{name}` is listed twice", "give each a different name")
            seen.add(name)

    def _check_condition_entrants(self, conditions: Sequence[tuple[int, SuiteCondition]], names: set[str]) -> None:
        for at, condition in conditions:
            for number, name in enumerate(condition.entrants or ()):
                if names and name not in names:
                    where = f"conditions[{at}].entrants[{number}]"
                    self._fault(where, f"there is no entrant `{name}`", did_you_mean(name, names, "entrants"))

    def _fault(self, where: str, message: str, hint: str = "") -> None:
        self.faults.append(Fault(where, message, hint))

    def _add(self, where: str, fault: Fault) -> None:
        self.faults.append(Fault(where, fault.message, fault.hint))


@dataclass(frozen=True, slots=True)
class _Place:
    """A column under a condition."""

    where: str
    """The path of the condition in the document."""
    column: Column
    condition: str
    args: Mapping[str, Plain] = field(default_factory=dict)
    entrants: tuple[str, ...] | None = None
    """The names of its entrants; None: all."""
    baseline: bool = False
    at: int = 0
    """The condition's position in the suite file."""


def _accepted_options(player: Player, options: Mapping[str, Plain]) -> dict[str, Plain]:
    """Return the options that the player's policy accepts."""
    return {name: value for name, value in options.items() if player.declared.takes(name)}


def _setting_name(settings: Mapping[str, float]) -> str:
    return ", ".join(f"{name}={value:g}" for name, value in settings.items())


def _listed(document: Mapping[str, Any], name: str) -> Iterator[tuple[int, str]]:
    """Yield the texts of a list with their positions; nothing if the value is no list."""
    value = document.get(name)
    for at, text in enumerate(value if isinstance(value, list) else ()):
        if isinstance(text, str) and text:
            yield at, text


def _parts(document: Mapping[str, Any], name: str, kind: Any) -> Iterator[tuple[int, Any]]:
    """Yield the readable tables of a list with their positions."""
    value = document.get(name)
    for at, item in enumerate(value if isinstance(value, list) else ()):
        part = readable(kind, item)
        if part is not None:
            yield at, part


__all__ = ["Isolation", "Player", "SuiteCell", "SuitePlan", "options_of_cell", "plan_document", "read_plan"]
