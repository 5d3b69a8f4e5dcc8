"""Reader of a plug-in's `kinds.json`, which reports all errors of the file at once, each with its JSON path.

It is loaded only if a mission names a kind that is not built in; a test checks the built-in file.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from lingjing.decoding import converted, from_json
from lingjing.errors import Fault, PluginError
from lingjing.mission.faults import lines_of, schema_faults
from lingjing.mission.kinds_format import KindsFile, SceneOption, joined, names_of
from lingjing.mission.vocabulary import PHOTO, STOP

_NAME = re.compile(r"[^\W\d]\w*")
"""A valid name of an option or a verb."""
_EVERY_SCENE = ("datum", "displacement", "layout", "origin")
"""Options of every scene, which no file may describe."""
_NUMBERS = {"number": 1, "metres": 1, "size": 2, "range": 2}
"""Count of numbers in the default of an option, by its type; other types have no default."""


def read(file: Path, plugin: str, builtin: KindsFile) -> KindsFile:
    """The kinds in a plug-in's file. None of them may be among `builtin`.

    Raises `PluginError` that names plug-in and file, with all errors of the file.
    """
    prefix = f"plug-in `{plugin}`: {file} does not describe kinds of scenes and engines"
    hint = "docs/kinds.md has a table of all fields"
    try:
        content = from_json(file.read_bytes())
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise PluginError(f"{prefix}: {error}", hint=hint) from error
    document = joined(content)
    faults = _without_inherited(document, dict.fromkeys((*_type_faults(document), *_value_faults(document, builtin))))
    if faults:
        hints = dict.fromkeys(fault.hint for fault in faults if fault.hint)
        raise PluginError(f"{prefix}:\n{lines_of(faults)}", hint="; ".join(hints) or hint, faults=faults)
    return converted(document, KindsFile)


def _without_inherited(document: object, faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """The faults without those that a scene inherits through `like` from a scene that has the same fault."""
    places = {scene.get("name"): place for place, scene in _likeable(document)}
    bases = {place: places.get(scene.get("like")) for place, scene in _likeable(document)}
    known = {(fault.where, fault.message) for fault in faults}

    def inherited(fault: Fault) -> bool:
        place, bracket, rest = fault.where.partition("]")
        base = bases.get(place + bracket)
        return base is not None and base != place + bracket and (base + rest, fault.message) in known

    return tuple(fault for fault in faults if not inherited(fault))


def _likeable(document: object) -> list[tuple[str, dict[str, Any]]]:
    """The scenes with texts as `name` and `like`, each with its path."""
    scenes = _records(document, "scenes")
    return [
        (place, scene)
        for place, scene in scenes
        if isinstance(scene.get("name"), str) and isinstance(scene.get("like", ""), str)
    ]


def _type_faults(document: object) -> tuple[Fault, ...]:
    try:
        converted(document, KindsFile)
    except msgspec.ValidationError as error:
        return schema_faults(document, KindsFile) or (Fault("", str(error)),)
    return ()


def _value_faults(document: object, builtin: KindsFile) -> Iterator[Fault]:
    """Errors that no type expresses. Only parts of the right type are examined, so that one run reports all errors."""
    for part, builtin_kinds in (("scenes", builtin.by_scene), ("engines", builtin.by_engine)):
        records = _records(document, part)
        counts = Counter(name for _, record in records if isinstance(name := record.get("name"), str))
        for place, record in records:
            name = record.get("name")
            if isinstance(name, str) and name in builtin_kinds:
                yield Fault(f"{place}.name", f"`{name}` is built in", "give it a name of its own")
            if isinstance(name, str) and counts[name] > 1:
                yield Fault(f"{place}.name", f"`{name}` is described {counts[name]} times", "describe it once")
    scenes = _records(document, "scenes")
    likes = {scene["name"]: scene.get("like") for _, scene in scenes if isinstance(scene.get("name"), str)}
    for place, scene in scenes:
        yield from _like_faults(place, scene, likes)
        yield from _options_faults(place, scene)
    for place, engine in _records(document, "engines"):
        yield from _verbs_faults(place, engine)


def _records(document: object, part: str) -> list[tuple[str, dict[str, Any]]]:
    """The objects of a list of the file, each with its path."""
    items = document.get(part) if isinstance(document, dict) else None
    numbered = enumerate(items) if isinstance(items, list) else ()
    return [(f"{part}[{index}]", record) for index, record in numbered if isinstance(record, dict)]


def _like_faults(place: str, scene: dict[str, Any], likes: dict[str, Any]) -> Iterator[Fault]:
    like = scene.get("like", "")
    if not isinstance(like, str) or not like:
        return
    if like not in likes:
        yield Fault(f"{place}.like", f"no scene of this file is called `{like}`", f"known: {', '.join(likes)}")
        return
    passed: list[str] = []
    while isinstance(like, str) and like in likes and like not in passed:
        passed.append(like)
        like = likes[like]
    if scene.get("name") in passed:
        yield Fault(
            f"{place}.like", f"`{scene['name']}` refers to itself through `like`", "name another scene of the file"
        )


def _options_faults(place: str, scene: dict[str, Any]) -> Iterator[Fault]:
    declared_options = scene.get("options")
    options = (
        {name: _option(value) for name, value in declared_options.items()} if isinstance(declared_options, dict) else {}
    )
    for spelled, option in options.items():
        where = f"{place}.options.{spelled}"
        if not _NAME.fullmatch(spelled):
            yield Fault(where, f"an option cannot be called `{spelled}`", "letters, digits and _, no digit first")
        if spelled in _EVERY_SCENE:
            yield Fault(where, f"every scene has the option `{spelled}`", "give it another name")
        if option:
            yield from _bounds_faults(where, option)
    known = {
        name for spelled, option in options.items() for name in (names_of(spelled, option) if option else (spelled,))
    }
    for where, name in _references(place, scene):
        if isinstance(name, str) and name and name not in known:
            yield Fault(where, f"there is no option `{name}`", f"known: {', '.join(sorted(known))}")


def _verbs_faults(place: str, engine: dict[str, Any]) -> Iterator[Fault]:
    verbs = engine.get("verbs")
    for name in verbs if isinstance(verbs, dict) else ():
        where = f"{place}.verbs.{name}"
        if not _NAME.fullmatch(name):
            yield Fault(where, f"a verb cannot be called `{name}`", "letters, digits and _, no digit first")
        if name in (STOP, PHOTO):
            yield Fault(where, f"`{name}` means the same for all engines", "leave it out")


def _option(value: object) -> SceneOption | None:
    try:
        return converted(value, SceneOption)
    except msgspec.ValidationError:
        return None


def _bounds_faults(where: str, option: SceneOption) -> Iterator[Fault]:
    low, high = option.low, option.high
    if low is not None and high is not None and low > high:
        yield Fault(f"{where}.low", f"{low:g} is more than `high`, which is {high:g}", "exchange them")
        low = high = None
    if option.default is None:
        return
    numbers = option.default if isinstance(option.default, tuple) else (option.default,)
    count = _NUMBERS.get(option.type, 0)
    if len(numbers) != count:
        words = {0: "no default", 1: "one number", 2: "two numbers"}[count]
        yield Fault(f"{where}.default", f"an option of type {option.type} has {words}", "correct or remove `default`")
        return
    for number in numbers:
        if (low is not None and number < low) or (high is not None and number > high):
            yield Fault(f"{where}.default", f"{number:g} is outside of the option's bounds", "correct it or the bounds")
    if option.type == "range" and numbers[0] > numbers[-1]:
        yield Fault(f"{where}.default", f"{numbers[0]:g} is more than {numbers[-1]:g}", "exchange them")


def _references(place: str, scene: dict[str, Any]) -> Iterator[tuple[str, object]]:
    """(path, name) of each reference of a scene to an option of its own, in the instance's spelling (`depth_m`)."""
    for field in ("one_of", "wider_by"):
        listed = scene.get(field)
        for index, name in enumerate(listed if isinstance(listed, list) else ()):
            yield f"{place}.{field}[{index}]", name
    unless = scene.get("unless")
    for surface, name in (unless if isinstance(unless, dict) else {}).items():
        yield f"{place}.unless.{surface}", name
    options = scene.get("options")
    for spelled, option in (options if isinstance(options, dict) else {}).items():
        if isinstance(option, dict):
            yield f"{place}.options.{spelled}.without", option.get("without")
