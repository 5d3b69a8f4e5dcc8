"""`language_card`: the whole language on one card, for prompts of language models and for readers in a hurry.

It is made from the table of statements, the functions and units, the engines' words and the standard library, so that
it cannot differ from them. A test holds it below 3,000 tokens.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby

from lingjing.dsl.checking.library import known_paths, shipped_folder
from lingjing.dsl.checking.scope import CameraDecl, RecordDecl, TypeDecl, WeatherDecl
from lingjing.dsl.checking.toplevel import load_library
from lingjing.dsl.pages.statements import forms
from lingjing.dsl.syntax.keys import PropertyKey
from lingjing.dsl.syntax.statement_kinds import FILE, TYPE, StatementKind
from lingjing.dsl.syntax.statements import STATEMENTS
from lingjing.mission import model
from lingjing.mission.functions import AGGREGATES, DISTRIBUTIONS, FUNCTIONS, MESSAGE_FIELDS, STATE_FIELDS, Signature
from lingjing.mission.kinds import builtin_engines, builtin_scenes
from lingjing.mission.units import UNITS, dimension_unit
from lingjing.mission.vocabulary import PHOTO

_HEAD = """# .ljs on one card

No loops, no `if`. A statement ends with its line or a comma in a block; `#` is a comment; texts: "…" or \"""…\""". Numbers have their unit (`10 s`, `4 m/s`, `20 %`), except counts. `=` fixes, `~` draws, `<=` bounds. Conditions: `and or not == != < <= > >= in`, `exists r: c`, `forall v in group: c`. Places: `(east, north[, elevation])`; ranges `1..4`; lists `[a, b]`; sizes `3 by 4`. Members count from 1: `uav[1]`. A line with `when` replaces that without. […] is optional; … goes on after commas.

A mission needs goal, scene, clock, budget with ticks, success, an agent. Hidden values are read by `adjudicate` and sensors; what agents notice needs `declassify … because "…"`.
"""  # noqa: E501 - a paragraph of Markdown is one line
EXAMPLE = """ljs 2
use std.air { quadrotor }
use std.sea { lifeboat, person_in_water }
use std.messages { report }
use std.sensors { nadir_hd }

mission rescue {
  goal "Save the person."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  region search = box((-100 m, -1000 m), (300 m, -700 m))
  target victim : person_in_water { hidden position ~ sites(search) }
  asset uav[i in 1..2] : quadrotor {
    position = at(i, [(300 m, -620 m, 1 m)], spread 8 m)
    camera nadir : nadir_hd
  }
  asset boat : lifeboat { position = (10 m, -1350 m) }
  agent scout[i in 1..2] as searcher controls uav[i] { observes uav[i].*, events }
  agent skipper as rescuer controls boat { observes boat.*, events }
  message detection : report from searcher to all
  adjudicate matched(v: victim, r: detection) {
    when r.class == person_in_water and iou(r.box, truth(v, r.frame).box) >= 0.5
  }
  unlock rescue(v: victim) when exists r: matched(v, r)
  adjudicate rescued(v: victim) { when emitted(rescue, v) }
  stage find { done when exists r: matched(victim, r) }
  stage save { done when rescued(victim) }
  relation dependency find -> save
  declassify end because "it ends"
  success when rescued(victim)
}
"""
"""The example of the card. A test compiles it."""
_PLACES = {FILE: "At the top of a file", "mission": "In a mission", TYPE: "In a type"}


def language_card() -> str:
    """The card as Markdown."""
    parts = [_HEAD, f"```ljs\n{EXAMPLE}```", *_statements(), *_expressions(), *_bodies(), *_library()]
    card = "\n".join(part.rstrip("\n") + "\n" for part in parts)
    card = card.replace("[when ‹condition›]", "[when …]")
    return card.replace("‹", "<").replace("›", ">")  # ASCII costs fewer tokens


def _statements() -> Iterator[str]:
    for place, title in _PLACES.items():
        lines = _joined([kind for kind in STATEMENTS if _home(kind) == place])
        yield f"## {title}\n\n" + "\n".join(lines)
    places: dict[str, list[str]] = {}
    for kind in STATEMENTS:
        if _home(kind) == "" and kind.keyword not in ("ljs", *_TWINS.values()) and kind.within != _IN_EXPECT:
            places.setdefault(", ".join(kind.within), []).append(_written(kind))
    yield "## Inside blocks\n\n" + "\n".join(f"- {place}: {'; '.join(lines)}" for place, lines in places.items())


def _joined(kinds: list[StatementKind]) -> list[str]:
    """The lines of statements. Those that differ in their keyword alone share a line: `success|failure when …`."""
    keywords: dict[str, list[str]] = {}
    for kind in kinds:
        for line in _statement(kind):
            keywords.setdefault(line.replace(f"`{kind.keyword} ", "`‹keyword› ", 1), []).append(kind.keyword)
    return [line.replace("‹keyword›", "|".join(words), 1) for line, words in keywords.items()]


def _home(kind: StatementKind) -> str:
    return next((place for place in _PLACES if place in kind.within and place != FILE), "") or (
        FILE if FILE in kind.within else ""
    )


def _statement(kind: StatementKind) -> Iterator[str]:
    if kind.keyword not in ("ljs", *_TWINS.values()):
        yield f"- {_written(kind)}"


def _written(kind: StatementKind) -> str:
    first = next(forms(kind)) if kind.keyword in _MUTUAL else _alternatives(tuple(forms(kind)))
    written = kind.example if not kind.keys and kind.keyword in _BY_EXAMPLE else first
    for label, place in kind.names.items():
        if place.choices and place.spaces == () and label != "allowed":
            written = written.replace(f"‹{label}›", "|".join(place.choices), 1)
    written = written.replace("when ‹condition›", "when …")
    twin = _TWINS.get(kind.keyword)
    written = written.replace(kind.keyword, f"{kind.keyword}|{twin}", 1) if twin else written
    keys = f": {', '.join(map(_key, kind.keys.values()))}" if kind.keys else ""
    return f"`{written}`{keys}"


def _alternatives(ways: tuple[str, ...]) -> str:
    """Forms of a statement side by side; a common beginning and end is written once."""
    if len(ways) != 2:
        return " | ".join(ways)
    first, second = (way.split(" ") for way in ways)
    begin = next((n for n, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), 0)
    rest = list(zip(reversed(first[begin:]), reversed(second[begin:]), strict=False))
    end = next((n for n, (a, b) in enumerate(rest) if a != b), len(rest))
    if begin < 2 or end < 1:
        return " | ".join(ways)
    middles = " | ".join(" ".join(words[begin : len(words) - end]) for words in (first, second))
    return " ".join((*first[:begin], f"({middles})", *first[len(first) - end :]))


_IN_EXPECT = ("expect",)
"""Place of the statements that the example of `expect` shows."""
_MUTUAL = ("relation",)
"""Statements with two forms that differ in one sign; the card shows the first."""
_TWINS = {"target": "asset", "success": "failure", "appear": "vanish", "close": "reopen"}
"""Statements with one form: the card writes both keywords on one line."""
_BY_EXAMPLE = ("hidden", "state", "override", "verb", "record", "camera", "use", "actions", "expect", "capabilities")
"""Statements that an example shows better than their form. That of `expect` shows the statements inside it too."""


def _key(key: PropertyKey) -> str:
    unit = dimension_unit(key.type.dimension) if key.type.dimension else ""
    value = (
        "/".join(key.choices[:3]) if key.choices else unit or {"size": "a by b", "directed": "…"}.get(key.type.kind, "")
    )
    return f"{key.name} {key.relations[-1]}{' ' + value if value else ''}{'!' if key.required else ''}"


def _expressions() -> Iterator[str]:
    rules = _calls(each for each in FUNCTIONS.values() if each.where != "static")
    before = _calls(each for each in FUNCTIONS.values() if each.where == "static")
    draws = [_call(each) for each in DISTRIBUTIONS.values()]
    yield (
        "## Expressions\n\n"
        f"- in rules: {_listed(rules)}; over a group `{'|'.join(AGGREGATES)}(… for v in g)`; `now`; "
        f"`v.{', v.'.join(STATE_FIELDS)}`, {_shares()} and properties; "
        f"`r.{', r.'.join(MESSAGE_FIELDS)}` of a message\n"
        f"- before the run: {_listed(before)}\n"
        f"- after `~`: {_listed(draws)}\n"
        f"- units: {' '.join(UNITS)}, compounds `m/s^2`"
    )


def _shares() -> str:
    return ", ".join(dict.fromkeys(f"`v.{share}`" for kind in builtin_engines().values() for share in kind.shares))


def _calls(signatures: Iterable[Signature]) -> list[str]:
    """The calls of functions. Those with the same parameters share one: `floor|ceil(value)`."""
    names: dict[str, list[str]] = {}
    for signature in signatures:
        name, _, parameters = _call(signature).partition("(")
        names.setdefault(parameters, []).append(name)
    return [f"{'|'.join(words)}({parameters}" for parameters, words in names.items()]


def _call(signature: Signature) -> str:
    parameters = [f"{each.name}{'?' if each.optional else ''}" for each in signature.parameters]
    more = ["…"] if signature.variadic else []
    options = [f"{option.name} {option.relation} …" for option in signature.options]
    return f"{signature.name}({', '.join([*parameters, *more, *options])})"


def _listed(calls: Iterable[str]) -> str:
    """The calls; those that differ in their name alone share one: `inspected|clear(inspection)`."""
    names: dict[str, list[str]] = {}
    for call in calls:
        name, _, arguments = call.partition("(")
        names.setdefault(arguments, []).append(name)
    return " ".join(f"`{'|'.join(several)}({arguments}`" for arguments, several in names.items())


def _bodies() -> Iterator[str]:
    engines = [
        f"{name} ({', '.join(kind.words)})" for name, kind in builtin_engines().items() if kind.words is not None
    ]
    yield (
        "## Scenes and engines\n\n"
        f"- scenes: {', '.join(builtin_scenes())}; all have `datum`, most `extent`, `shore`, `traffic`\n"
        f"- engines and status words: {'; '.join(engines)}; city: by the target"
    )


_NOT_ON_THE_CARD = ("std.rivals",)
"""Libraries that no mission needs: what resembles targets is for authors of benchmarks, and the card is short."""


def _library() -> Iterator[str]:
    lines = []
    for path in (path for path in known_paths("std") if path not in _NOT_ON_THE_CARD):
        declared = load_library(f"{shipped_folder('std')}/{path.removeprefix('std.')}.ljs")[0].declared
        lines.append(f"- `{path}`: {', '.join(map(_declared, declared.values()))}")
    yield "## The standard library\n\n" + "\n".join(lines)


def _declared(decl: object) -> str:
    if isinstance(decl, TypeDecl):
        acts = [_interaction(each) for each in decl.interactions.values()]
        verbs = list(_verbs([verb for verb in decl.verbs.values() if verb.name != PHOTO])) if not decl.bases else []
        inside = "; ".join(acts or ([" ".join(verbs)] if verbs else []))
        return f"{decl.name}{f' ({inside})' if inside else ''}"
    if isinstance(decl, RecordDecl):
        return f"{decl.name} ({' '.join(field.name for field in decl.fields)})"
    assert isinstance(decl, CameraDecl | WeatherDecl)
    return decl.name


def _verbs(verbs: list[model.Verb]) -> Iterator[str]:
    """Verbs with their arguments; neighbours with the same arguments are joined."""
    for arguments, alike in groupby(verbs, lambda verb: ", ".join(argument.name for argument in verb.arguments)):
        yield f"{'|'.join(verb.name for verb in alike)}({arguments})"


def _interaction(interaction: model.Interaction) -> str:
    reach = getattr(interaction.within, "value", 0.0)
    return f"{interaction.name} by {interaction.by}, {reach:g} m"
