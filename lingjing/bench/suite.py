"""A suite as people write it: a TOML file that says who plays what, how often, and which tables are made of it.

`read_suite` reads one and tells every fault of its form with its path; what the names in it mean is for `planning`.
`readable` is what can still be made of a faulty part, so that the faults of its form hide none of its names' faults.
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
from lingjing.errors import Fault, UsageError
from lingjing.mission.faults import lines_of
from lingjing.option_reading import unknown_option
from lingjing.validation import shown, worded

FORMAT = 1
"""The version of the form; a file of another one is refused."""

MOST_BYTES = 4 * 2**20
"""Of a suite file."""

MOST_SEEDS = 100_000
"""A range beyond this is a slip of the finger."""

SuiteMode = Literal["star", "broadcast", "single"]
TableKind = Literal[
    "success",
    "intervals",
    "modes",
    "conditions",
    "stages",
    "behaviour",
    "perception",
    "failures",
    "drift",
    "paired",
    "cost",
]


def _seeds(given: object) -> tuple[int, ...]:
    """`20` or `"20"` is the seeds 0 to 19, `"3-7"` those from 3 to 7, a list is what it lists."""
    numbers = [_whole(part) for part in given.split("-")] if isinstance(given, str) else [given]
    match numbers:
        case [bool()]:
            pass
        case [int(count)] if 1 <= count <= MOST_SEEDS:
            return tuple(range(count))
        case [int(first), int(last)] if _is_seed(last) and 0 <= last - first < MOST_SEEDS:
            return tuple(range(first, last + 1))
        case [list(listed) | tuple(listed)] if listed and all(_is_seed(one) for one in listed):
            return tuple(dict.fromkeys(listed))
    raise ValueError(f"is {shown(given)}, and names no seeds: write a number of seeds, as 20, or a range, as '0-19'")


def _whole(text: str) -> int | None:
    """The number of up to 19 digits, as the largest seed has; None for any other text."""
    return int(text) if re.fullmatch(r"\s*[0-9]{1,19}\s*", text) else None


def _is_seed(given: object) -> bool:
    return isinstance(given, int) and not isinstance(given, bool) and 0 <= given < 2**63


Seeds = Annotated[tuple[int, ...], BeforeValidator(_seeds, json_schema_input_type=int | str | list[int])]
ShortText = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[^\x00-\x1f\x7f]+$")]
NameOrFile = Annotated[str, Field(min_length=1, max_length=4096, pattern=r"^[^\x00-\x1f\x7f]+$")]
Plain = str | int | float | bool
"""A value as an option or a setting has it in TOML."""


class SuitePart(BaseModel):
    """What the parts of a suite share: unknown names are faults, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Entrant(SuitePart):
    """One row of the tables: a chat model or a policy, with what it is told."""

    name: ShortText | None = Field(
        None, description="what it is called in tables (default: the model's or policy's name)"
    )
    model: ShortText | None = Field(None, description="a model that `lingjing plugins` lists; its policy plays it")
    policy: NameOrFile | None = Field(None, description="a policy's name, or FILE.py:CLASS beside the suite")
    group: ShortText | None = Field(None, description="the heading under which it stands (default: a model's tier)")
    args: dict[str, Plain] = Field({}, description="options of the policy")
    policies_for: dict[str, str] = Field({}, description="other policies by role or agent")
    blank_pictures: bool = Field(False, description="hand the policy black pictures (a control)")

    @model_validator(mode="after")
    def _is_one_of_two(self) -> Self:
        if (self.model is None) == (self.policy is None):
            raise ValueError("needs either a model or a policy" if self.model is None else "is a model or a policy")
        return self


class SuiteCondition(SuitePart):
    """One setting under which entrants play: values of the missions' parameters, options of the policies."""

    name: ShortText = Field(description="what it is called in tables")
    missions: tuple[ShortText, ...] | None = Field(None, min_length=1, strict=False, description="default: the suite's")
    modes: tuple[SuiteMode, ...] | None = Field(None, min_length=1, strict=False, description="default: the suite's")
    settings: dict[str, Plain] = Field({}, description="values of the mission's parameters, with their units")
    args: dict[str, Plain] = Field({}, description="options of the policies")
    entrants: tuple[ShortText, ...] | None = Field(
        None, min_length=1, strict=False, description="names of those who play under it (default: all)"
    )
    baseline: bool = Field(False, description="what the others of its missions are compared with")


class Suite(SuitePart):
    """A suite: entrants x missions x modes x conditions x seeds."""

    suite: Literal[1] = Field(description="the version of this form")
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$", description="a word for folders: letters, digits, hyphens")
    title: str = Field("", max_length=200, description="what its tables are headed with")
    about: str = Field("", max_length=4000, description="what is studied, and which table of the paper it makes")
    missions: tuple[NameOrFile, ...] = Field(
        min_length=1, strict=False, description="shipped names, or files beside it"
    )
    modes: tuple[SuiteMode, ...] | None = Field(
        None, min_length=1, strict=False, description="only these modes (default: all that a mission allows)"
    )
    seeds: Seeds = Field(description="how many seeds from 0, a range 'A-B', or a list")
    args: dict[str, Plain] = Field({}, description="options of every entrant's policy")
    entrants: tuple[Entrant, ...] = Field(min_length=1, strict=False, description="who plays")
    conditions: tuple[SuiteCondition, ...] = Field(
        (), strict=False, description="under what (default: as missions are)"
    )
    sweeps: bool = Field(False, description="play the values that the missions' sweeps declare")
    evaluators: tuple[ShortText, ...] = Field(("mission",), min_length=1, strict=False, description="who scores")
    executor: Literal["local", "ray"] = Field("local", description="processes of this machine, or a Ray cluster")
    tables: tuple[TableKind, ...] = Field(("success",), min_length=1, strict=False, description="what is printed")

    @model_validator(mode="after")
    def _has_one_kind_of_condition(self) -> Self:
        if self.sweeps and self.conditions:
            raise ValueError("has conditions and sweeps too: leave one of them out")
        return self


PartT = TypeVar("PartT", bound=SuitePart)


ATTRIBUTION = "planted"
"""The key of a suite that measures methods of attribution (`lingjing.bench.attribution`) and is of another form."""


def shipped_suites() -> tuple[str, ...]:
    """The names of the suites of this form that come with the package, sorted."""
    return tuple(name for name in _shipped_names() if ATTRIBUTION not in read_document(_shipped_path(name)))


def _shipped_names() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in data_path("suites").glob("*.toml")))


def _shipped_path(name: str) -> Path:
    return data_path("suites", f"{name}.toml")


def attribution_suites() -> tuple[str, ...]:
    """The names of the suites that measure methods of attribution, sorted."""
    return tuple(name for name in _shipped_names() if ATTRIBUTION in read_document(_shipped_path(name)))


def find_suite(word: str) -> Path:
    """A file that is there wins; else a shipped suite by name (`main`, `suites/main.toml`). Raises `UsageError`."""
    from lingjing.suggest import did_you_mean

    path = Path(word)
    try:
        if path.is_file():
            return path
    except OSError:  # a name longer than any file system takes
        pass
    named = path.parts[1:] if path.parts[:1] == ("suites",) else path.parts
    if len(named) == 1 and named[0].removesuffix(".toml") in _shipped_names():
        return _shipped_path(named[0].removesuffix(".toml"))
    said = did_you_mean(path.stem, _shipped_names(), "suites")
    raise UsageError(f"there is no suite `{word[:300]}`", hint=said or "`lingjing bench list` lists those that ship")


def read_document(path: Path) -> dict[str, Any]:
    """A suite file's values. Raises `UsageError` for a file that cannot be read or is no TOML."""
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise UsageError(f"`{path}` is no suite: it is longer than {MOST_BYTES // 2**20} MB")
        return tomllib.loads(data.decode())
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"`{path}` is no text in UTF-8") from error
    except ValueError as error:  # beside `TOMLDecodeError`, a number of more than 4,300 digits
        raise UsageError(f"`{path}` is not TOML: {error}") from error
    except RecursionError as error:  # the parser calls itself for each bracket
        raise UsageError(f"`{path}` is no suite: its values are nested too deeply") from error


def form_faults(document: Mapping[str, Any]) -> tuple[Fault, ...]:
    """What is wrong with the form of a suite's values, each with its path."""
    version = document.get("suite")
    if isinstance(version, int) and version != FORMAT:
        fault = Fault("suite", f"is {version}; this version of lingjing reads suites of form {FORMAT}")
        return (fault, *form_faults({**document, "suite": FORMAT}))
    try:
        Suite.model_validate(document)
    except ValidationError as error:
        return tuple(_form_faults(error))
    return ()


def readable(kind: type[PartT], given: object) -> PartT | None:
    """What `given` is without its faults of form, with a name of its own where only that is missing; None if nothing
    that means anything is left of it."""
    for _ in range(10):
        try:
            return kind.model_validate(given)
        except ValidationError as error:
            faulty = {str(one["loc"][0]) for one in error.errors() if one["loc"] and one["type"] != "missing"}
            lacking = {one["loc"] for one in error.errors() if one["type"] == "missing"}
        if not isinstance(given, Mapping):
            return None
        if faulty & set(given):
            given = {name: value for name, value in given.items() if name not in faulty}
        elif lacking == {("name",)}:
            given = {**given, "name": f"one without a name {id(given)}"}
        else:
            return None
    return None


def faults_error(path: Path, faults: tuple[Fault, ...]) -> UsageError:
    """The error that tells all faults of a suite file."""
    told = lines_of((Fault(one.where, f"{one.message}{one.hint and f'; {one.hint}'}") for one in faults), str(path))
    return UsageError(told, hint="docs/studies.md says what a suite may hold", faults=faults)


def json_schema() -> bytes:
    """The JSON Schema of a suite's values (draft 2020-12), for editors and for those who write suites by program."""
    schema = Suite.model_json_schema(mode="validation")
    whole = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": "suite.schema.json", **schema}
    return msgspec.json.format(msgspec.json.encode(whole, order="deterministic"), indent=2) + b"\n"


def _form_faults(error: ValidationError) -> Iterator[Fault]:
    from lingjing.suggest import nearest

    found = error.errors(include_url=False)
    for one in found:
        where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in one["loc"]).removeprefix(".")
        if one["type"] == "too_short" and any(other["loc"][:-1] == one["loc"] for other in found if other is not one):
            continue  # it is too short because what is in it is wrong, which is told
        if one["type"] == "extra_forbidden":
            kinds: dict[object, type[SuitePart]] = {"entrants": Entrant, "conditions": SuiteCondition}
            kind = kinds.get(one["loc"][0], Suite) if len(one["loc"]) > 1 else Suite
            fault = unknown_option(str(one["loc"][-1]), kind.model_fields)
            yield Fault(where, fault.message, fault.hint)
        elif one["type"] == "literal_error":
            close = nearest(str(one["input"]), re.findall(r"'([^']+)'", one["ctx"]["expected"]))
            yield Fault(where, worded(one), f"did you mean `{close}`?" if close else "")
        else:
            yield Fault(where, worded(one))


__all__ = [
    "FORMAT",
    "Entrant",
    "Suite",
    "SuiteCondition",
    "SuitePart",
    "faults_error",
    "find_suite",
    "form_faults",
    "json_schema",
    "read_document",
    "readable",
    "shipped_suites",
]  # fmt: skip


if __name__ == "__main__":
    (Path(__file__).resolve().parents[2] / "schemas" / "suite.schema.json").write_bytes(json_schema())
