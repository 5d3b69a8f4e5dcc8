"""The form of the program of the studies: `suites/validity.toml`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from lingjing.bench.suite import (
    Entrant,
    NameOrFile,
    Seeds,
    ShortText,
    SuitePart,
    faults_error,
    faults_of,
    find_suite,
    read_document,
    readable,
)
from lingjing.errors import Fault
from lingjing.mission.tiers import HIGHEST, USUAL

SUITE = "validity"
"""The name of the shipped program."""
FORMAT = 1
"""The version of the form; programs of other versions are rejected."""
ADVERSARIES = "adversaries"
"""The name of the study that plays the matrix of adversaries."""

Sees = Literal["truth", "pictures", "nothing"]
"""The source from which an entrant knows where targets are."""

Comparison = Literal["modes", "redrawn"]
"""`modes`: star and broadcast on the same instances. `redrawn`: instances of a sealed split beside those of public
seeds.
"""

Tier = Annotated[int, Field(ge=0, le=HIGHEST)]


class StudyEntrant(Entrant):
    """An entrant of a part."""

    sees: Sees = Field(description="truth: the ground truth, pictures: drawn pictures, nothing: neither")


class ProgramPart(SuitePart):
    """A question: entrants that play missions at some tiers."""

    name: str = Field(pattern=r"^[a-z][a-z0-9-]{0,23}$", description="the beginning of the names of its folders")
    about: str = Field("", max_length=4000, description="its question")
    missions: tuple[NameOrFile, ...] | None = Field(
        None, min_length=1, strict=False, description="missions in place of the program's"
    )
    columns: tuple[ShortText, ...] | None = Field(
        None, min_length=1, strict=False, description="only these missions in these modes, such as ssr-broadcast"
    )
    tiers: tuple[Tier, ...] = Field((0, USUAL), min_length=1, strict=False, description="a study for each tier")
    seeds: Seeds = Field(description="a number of seeds from 0, a range 'A-B', or a list")
    policy_seed: int | None = Field(
        None, ge=0, lt=2**63, description="the seed of all policies (default: drawn for each episode)"
    )
    compares: Comparison | None = Field(None, description="the comparison that it is made for")
    entrants: tuple[StudyEntrant, ...] = Field(min_length=1, strict=False, description="the policies to compare")


class ProgramAdversaries(SuitePart):
    """The study of the worst adversaries, at tier 1 on a sealed split."""

    matrix: NameOrFile = Field(ADVERSARIES, description="the matrix, as for `lingjing bench adversaries`")
    columns: tuple[ShortText, ...] = Field((), strict=False, description="only these columns (default: all)")
    selection: int = Field(3, ge=1, le=1000, description="seeds on which the worst adversary of a column is chosen")
    fresh: int = Field(20, ge=1, le=1000, description="fresh seeds that the worst one then plays")


class Program(SuitePart):
    """The form of the file."""

    validity: Literal[1] = Field(description="the version of this form")
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$", description="the name of its folder")
    title: str = Field("", max_length=200, description="the heading of its tables")
    about: str = Field("", max_length=4000, description="its question")
    missions: tuple[NameOrFile, ...] = Field(
        min_length=1, strict=False, description="shipped names, or files beside the program"
    )
    rounds: tuple[Annotated[int, Field(ge=1)], ...] = Field(
        (3, 10, 20, 40, 100), min_length=1, strict=False, description="seeds of each study played after each round"
    )
    seconds: dict[str, Annotated[float, Field(gt=0)]] = Field(
        {}, description="measured seconds of an episode by column"
    )
    parts: tuple[ProgramPart, ...] = Field(min_length=1, strict=False, description="the questions")
    adversaries: ProgramAdversaries | None = Field(None, description="the study of the worst adversaries")


@dataclass(frozen=True, slots=True)
class ProgramFile:
    """A program that was read, and its file."""

    program: Program
    path: Path


def read_program(path: Path | None = None) -> ProgramFile:
    """Return the program of a file, by default the shipped one. Raises `UsageError` with the path of every error."""
    path = path or find_suite(SUITE)
    document = read_document(path)
    faults = tuple(dict.fromkeys((*_faults_of_form(document), *_faults_of_meaning(document))))
    if faults:
        raise faults_error(path, faults)
    return ProgramFile(Program.model_validate(document), path)


def _faults_of_form(document: Mapping[str, Any]) -> Iterator[Fault]:
    version = document.get("validity")
    if isinstance(version, int) and version != FORMAT:
        yield Fault("validity", f"is {version}; this version of lingjing reads programs of form {FORMAT}")
        document = {**document, "validity": FORMAT}
    try:
        Program.model_validate(document)
    except ValidationError as error:
        parts: dict[str, type[SuitePart]] = {
            "parts": ProgramPart,
            "entrants": StudyEntrant,
            "adversaries": ProgramAdversaries,
        }
        yield from faults_of(error, Program, parts)


def _faults_of_meaning(document: Mapping[str, Any]) -> Iterator[Fault]:
    """Yield the errors between values, as far as the form of these is valid."""
    rounds = document.get("rounds")
    if isinstance(rounds, list) and all(isinstance(count, int) for count in rounds) and rounds != sorted(set(rounds)):
        yield Fault("rounds", "must grow: each number counts the seeds that are played after the round")
    listed = document.get("parts")
    parts = [(at, readable(ProgramPart, part)) for at, part in enumerate(listed if isinstance(listed, list) else ())]
    known = [(at, part) for at, part in parts if part is not None]
    names = Counter(part.name for _, part in known)
    seen: dict[tuple[str, int], str] = {}
    for at, part in known:
        if names[part.name] > 1:
            yield Fault(
                f"parts[{at}].name", f"`{part.name}` is the name of another part", "give each a name of its own"
            )
        if part.name == ADVERSARIES:
            yield Fault(f"parts[{at}].name", f"`{ADVERSARIES}` is the name of the study of adversaries")
        if len(set(part.tiers)) < len(part.tiers):
            yield Fault(f"parts[{at}].tiers", "the same tier is listed twice")
        for place, entrant in enumerate(part.entrants):
            if entrant.sees == "pictures" and entrant.blank_pictures:
                where = f"parts[{at}].entrants[{place}].sees"
                yield Fault(where, "is `pictures`, and the pictures are black", "write `nothing`")
            name = entrant.name or entrant.policy or entrant.model or ""
            for tier in part.tiers if part.compares is None else ():
                other = seen.setdefault((name, tier), part.name)
                if other != part.name:
                    where = f"parts[{at}].entrants[{place}]"
                    yield Fault(where, f"`{name}` plays tier {tier} in the part `{other}` already")


__all__ = [
    "ADVERSARIES", "SUITE", "Comparison", "Program", "ProgramAdversaries", "ProgramFile", "ProgramPart", "Sees",
    "StudyEntrant", "read_program",
]  # fmt: skip
