"""The form of a suite file: a TOML file with missions, seeds, entrants, conditions and tables.

`read_document` reads a file, and `form_faults` lists all errors of its form with their paths. The meaning of names is
checked in `planning`. `readable` returns the valid rest of a faulty part, so that errors of form do not hide errors of
names.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import msgspec
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from lingjing.data import data_path
from lingjing.dsl.loading.shipped import find_mission
from lingjing.errors import Fault, UsageError
from lingjing.mission.faults import lines_of
from lingjing.mission.tiers import HIGHEST
from lingjing.option_reading import unknown_option
from lingjing.validation import shown, worded

FORMAT = 1
"""The version of the form; files of other versions are rejected."""

MOST_BYTES = 4 * 2**20
"""The greatest size of a suite file. Chosen."""

MOST_SEEDS = 100_000
"""Seeds in a range, at most; a longer range is a typing error. Chosen."""

SuiteMode = Literal["star", "broadcast", "single"]
"""The communication modes of missions."""

TableKind = Literal[
    "success",
    "intervals",
    "modes",
    "conditions",
    "stages",
    "behaviour",
    "perception",
    "controls",
    "failures",
    "drift",
    "paired",
    "cost",
]
"""The kinds of tables (`lingjing.bench.tables.TABLES`)."""


def seeds_of(value: object) -> tuple[int, ...]:
    """Parse seeds: `20` or `"20"` means 0 to 19, `"3-7"` means 3 to 7, and a list names them singly."""
    numbers = [_whole(part) for part in value.split("-")] if isinstance(value, str) else [value]
    match numbers:
        case [bool()]:
            pass
        case [int(count)] if 1 <= count <= MOST_SEEDS:
            return tuple(range(count))
        case [int(first), int(last)] if _is_seed(last) and 0 <= last - first < MOST_SEEDS:
            return tuple(range(first, last + 1))
        case [list(listed) | tuple(listed)] if listed and all(_is_seed(seed) for seed in listed):
            return tuple(dict.fromkeys(listed))
    raise ValueError(f"is {shown(value)}, which is neither a number of seeds, such as 20, nor a range, such as '0-19'")


def _whole(text: str) -> int | None:
    """Return the number of a text of up to 19 digits (the length of the greatest seed), or None."""
    return int(text) if re.fullmatch(r"\s*[0-9]{1,19}\s*", text) else None


def _is_seed(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


Seeds = Annotated[tuple[int, ...], BeforeValidator(seeds_of, json_schema_input_type=int | str | list[int])]
"""Seeds in order, in any of the forms of `seeds_of`."""

ShortText = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[^\x00-\x1f\x7f]+$")]
"""A name without control characters."""

NameOrFile = Annotated[str, Field(min_length=1, max_length=4096, pattern=r"^[^\x00-\x1f\x7f]+$")]
"""A name, or a path relative to the suite file."""

Plain = str | int | float | bool
"""A value as an option or a setting has it in TOML."""


class SuitePart(BaseModel):
    """The base of all parts of a suite: unknown names are errors, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Entrant(SuitePart):
    """One row of the tables: a model or another policy, with its options."""

    name: ShortText | None = Field(None, description="its name in tables (default: the model's or policy's name)")
    model: ShortText | None = Field(None, description="a model that `lingjing plugins` lists; its policy plays")
    policy: NameOrFile | None = Field(
        None, description="a policy's name, FILE.py:CLASS beside the suite, or PACKAGE.MODULE:CLASS"
    )
    group: ShortText | None = Field(None, description="its heading in tables (default: the model's tier)")
    args: dict[str, Plain] = Field({}, description="options of the policy")
    policies_for: dict[str, str] = Field({}, description="other policies by role or agent")
    blank_pictures: bool = Field(False, description="give the policy black pictures (a control experiment)")
    swap_pictures: bool = Field(False, description="give the policy the pictures of the neighbouring seed (a control)")

    @model_validator(mode="after")
    def _is_one_of_two(self) -> Self:
        if (self.model is None) == (self.policy is None):
            raise ValueError("needs either a model or a policy" if self.model is None else "is a model or a policy")
        return self


class SuiteCondition(SuitePart):
    """One setting of a comparison: values of the missions' parameters, and options of the policies."""

    name: ShortText = Field(description="its name in tables")
    missions: tuple[ShortText, ...] | None = Field(None, min_length=1, strict=False, description="default: the suite's")
    modes: tuple[SuiteMode, ...] | None = Field(None, min_length=1, strict=False, description="default: the suite's")
    settings: dict[str, Plain] = Field({}, description="values of the mission's parameters, with their units")
    args: dict[str, Plain] = Field({}, description="options of the policies")
    entrants: tuple[ShortText, ...] | None = Field(
        None, min_length=1, strict=False, description="names of the entrants that play under it (default: all)"
    )
    baseline: bool = Field(False, description="other conditions of its missions are compared with it")


class Suite(SuitePart):
    """A suite: entrants × missions × modes × conditions × seeds."""

    suite: Literal[1] = Field(description="the version of this form")
    name: str = Field(
        pattern=r"^[a-z0-9][a-z0-9-]{0,39}$", description="the name of its folder: letters, digits, hyphens"
    )
    title: str = Field("", max_length=200, description="the heading of its tables")
    about: str = Field("", max_length=4000, description="the question of the study, and the table of the paper")
    missions: tuple[NameOrFile, ...] = Field(
        min_length=1, strict=False, description="shipped names, or files beside the suite"
    )
    modes: tuple[SuiteMode, ...] | None = Field(
        None, min_length=1, strict=False, description="only these modes (default: all modes of a mission)"
    )
    columns: tuple[ShortText, ...] | None = Field(
        None, min_length=1, strict=False, description="only these missions in these modes, such as ssr-broadcast"
    )
    seeds: Seeds = Field(description="a number of seeds from 0, a range 'A-B', or a list")
    args: dict[str, Plain] = Field({}, description="options of every entrant's policy")
    entrants: tuple[Entrant, ...] = Field(min_length=1, strict=False, description="the policies and models to compare")
    conditions: tuple[SuiteCondition, ...] = Field(
        (), strict=False, description="settings to compare (default: the missions' own)"
    )
    tier: int | None = Field(
        None, ge=0, le=HIGHEST, description="the missions' tier (default: 1 for missions that declare it, else 0)"
    )
    language: ShortText = Field("en", description="the language of goal, prompts, rules and requests, by its code")
    sweeps: bool = Field(False, description="play the values of the missions' sweeps")
    evaluators: tuple[ShortText, ...] = Field(
        ("mission",), min_length=1, strict=False, description="the evaluators that score"
    )
    executor: Literal["local", "ray"] = Field("local", description="processes of this machine, or a Ray cluster")
    tables: tuple[TableKind, ...] = Field(
        ("success",), min_length=1, strict=False, description="the kinds of tables to print"
    )

    @model_validator(mode="after")
    def _has_one_kind_of_condition(self) -> Self:
        if self.sweeps and self.conditions:
            raise ValueError("has both conditions and sweeps: remove one of them")
        return self


PartT = TypeVar("PartT", bound=SuitePart)
"""A part of a suite."""


ATTRIBUTION = "planted"
"""The key of a suite that measures attribution methods (`lingjing.bench.attribution`) and has another form."""
ADVERSARIES = "adversaries"
"""The key of the matrix of adversaries (`lingjing.bench.adversaries`), which has another form."""
PROGRAM = "parts"
"""The key of the program of the studies (`lingjing.bench.validity`), which has another form."""


def shipped_suites() -> tuple[str, ...]:
    """Return the names of the shipped suites of this form, sorted."""
    others = {ATTRIBUTION, ADVERSARIES, PROGRAM}
    return tuple(name for name in _shipped_names() if not others & read_document(_shipped_path(name)).keys())


def mission_file_of(word: str, folder: Path) -> Path:
    """Return the file of a mission that a suite in this folder names: beside it, else a shipped one.

    Raises `UsageError` if there is neither.
    """
    beside = folder / word
    return beside if beside.is_file() else find_mission(word)


def mission_files_of(suite: Path) -> list[Path]:
    """Return the mission files of a suite file. Raises `UsageError` for a missing one, and for a file that is no
    suite.
    """
    words = read_document(suite).get("missions")
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise UsageError(f"`{suite}` is not a suite: `missions` is no list of names")
    return [mission_file_of(word, suite.parent) for word in words]


def _shipped_names() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in data_path("suites").glob("*.toml")))


def _shipped_path(name: str) -> Path:
    return data_path("suites", f"{name}.toml")


def attribution_suites() -> tuple[str, ...]:
    """Return the names of the shipped suites that measure attribution methods, sorted."""
    return tuple(name for name in _shipped_names() if ATTRIBUTION in read_document(_shipped_path(name)))


def find_suite(word: str) -> Path:
    """Return an existing file, else a shipped suite by name (`main`, `suites/main.toml`). Raises `UsageError`."""
    from lingjing.suggest import did_you_mean

    path = Path(word)
    try:
        if path.is_file():
            return path
    except OSError:  # the name is longer than the file system allows
        pass
    named = path.parts[1:] if path.parts[:1] == ("suites",) else path.parts
    if len(named) == 1 and named[0].removesuffix(".toml") in _shipped_names():
        return _shipped_path(named[0].removesuffix(".toml"))
    hint = did_you_mean(path.stem, _shipped_names(), "suites")
    raise UsageError(f"there is no suite `{word[:300]}`", hint=hint or "`lingjing bench list` lists the shipped suites")


def read_document(path: Path) -> dict[str, Any]:
    """Return the values of a suite file. Raises `UsageError` for an unreadable file or one that is not TOML."""
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise UsageError(f"`{path}` is not a suite: it is longer than {MOST_BYTES // 2**20} MB")
        return tomllib.loads(data.decode())
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"`{path}` is not UTF-8 text") from error
    except ValueError as error:  # `TOMLDecodeError`, or a number of more than 4,300 digits
        raise UsageError(f"`{path}` is not TOML: {error}") from error
    except RecursionError as error:  # the parser recurses for each bracket
        raise UsageError(f"`{path}` is not a suite: its values are nested too deeply") from error


def form_faults(document: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return the errors of form in a suite's values, each with its path."""
    version = document.get("suite")
    if isinstance(version, int) and version != FORMAT:
        fault = Fault("suite", f"is {version}; this version of lingjing reads suites of form {FORMAT}")
        return (fault, *form_faults({**document, "suite": FORMAT}))
    try:
        Suite.model_validate(document)
    except ValidationError as error:
        return tuple(faults_of(error, Suite, {"entrants": Entrant, "conditions": SuiteCondition}))
    return ()


def readable(kind: type[PartT], values: object) -> PartT | None:
    """Return the part without its faulty values, with a substitute name if only the name is missing; None if nothing
    remains.
    """
    for _ in range(10):
        try:
            return kind.model_validate(values)
        except ValidationError as error:
            faulty = {
                str(problem["loc"][0]) for problem in error.errors() if problem["loc"] and problem["type"] != "missing"
            }
            lacking = {problem["loc"] for problem in error.errors() if problem["type"] == "missing"}
        if not isinstance(values, Mapping):
            return None
        if faulty & set(values):
            values = {name: value for name, value in values.items() if name not in faulty}
        elif lacking == {("name",)}:
            values = {**values, "name": f"one without a name {id(values)}"}
        else:
            return None
    return None


def faults_error(path: Path, faults: tuple[Fault, ...]) -> UsageError:
    """Return the error that lists all errors of a suite file."""
    lines = lines_of(
        (Fault(fault.where, f"{fault.message}{fault.hint and f'; {fault.hint}'}") for fault in faults), str(path)
    )
    return UsageError(lines, hint="docs/studies.md describes the form of a suite", faults=faults)


def json_schema() -> bytes:
    """Return the JSON Schema of a suite's values (draft 2020-12), for editors and for programs that write suites."""
    schema = Suite.model_json_schema(mode="validation")
    whole = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": "suite.schema.json", **schema}
    return msgspec.json.format(msgspec.json.encode(whole, order="deterministic"), indent=2) + b"\n"


def faults_of(error: ValidationError, whole: type[SuitePart], parts: Mapping[str, type[SuitePart]]) -> Iterator[Fault]:
    """Yield the errors of form in the values of a `whole`, each with its path. `parts`: the forms of its lists and
    tables, by their names.
    """
    from lingjing.suggest import nearest

    problems = error.errors(include_url=False)
    for problem in problems:
        where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in problem["loc"]).removeprefix(
            "."
        )
        if problem["type"] == "too_short" and any(
            other is not problem and other["loc"][: len(problem["loc"])] == problem["loc"] for other in problems
        ):
            continue  # it is too short because its content is wrong, which is reported
        if problem["type"] == "extra_forbidden":
            inside = [part for part in problem["loc"][:-1] if part in parts]
            kind = parts[str(inside[-1])] if inside else whole
            fault = unknown_option(str(problem["loc"][-1]), kind.model_fields)
            yield Fault(where, fault.message, fault.hint)
        elif problem["type"] == "literal_error":
            close = nearest(str(problem["input"]), re.findall(r"'([^']+)'", problem["ctx"]["expected"]))
            yield Fault(where, worded(problem), f"did you mean `{close}`?" if close else "")
        else:
            yield Fault(where, worded(problem))


__all__ = [
    "FORMAT",
    "Entrant",
    "Suite",
    "SuiteCondition",
    "SuitePart",
    "faults_error",
    "faults_of",
    "find_suite",
    "form_faults",
    "json_schema",
    "read_document",
    "readable",
    "shipped_suites",
]  # fmt: skip


if __name__ == "__main__":
    (Path(__file__).resolve().parents[2] / "schemas" / "suite.schema.json").write_bytes(json_schema())
