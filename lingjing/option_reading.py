"""A pydantic model read from what people wrote as options, every fault at the spelling of its option.

Generic over the model: `lingjing.plugins.options` says which model a plug-in declares. A text that its option refuses
is read as JSON, where it is any.
"""

from __future__ import annotations

import re
import traceback
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from pydantic import AliasChoices, AliasPath, BaseModel, ValidationError
from pydantic.fields import FieldInfo

from lingjing.errors import Fault
from lingjing.suggest import nearest
from lingjing.validation import worded

ModelT = TypeVar("ModelT", bound=BaseModel)

_Error = Mapping[str, Any]
"""An entry of `ValidationError.errors()`."""
_Errors = tuple[_Error, ...]


def read_model(model: type[ModelT], given: Mapping[str, object]) -> tuple[ModelT | None, tuple[Fault, ...]]:
    """The checked options, or their faults. A text that its option refuses is read as JSON, where it is any."""
    options, errors, broken = _tried(model, given)
    decoded = {name: value for name in _places(errors) if (value := _decoded(given.get(name))) is not given.get(name)}
    if decoded:
        first, given = errors, {**given, **decoded}
        options, errors, broken = _tried(model, given)
        plain = {name for name in _places(errors) if name in decoded and not isinstance(decoded[name], list | dict)}
        errors = (
            *(one for one in first if _place(one) in plain),  # of a number it is said how it was written
            *(one for one in errors if _place(one) not in plain),
        )
    return options, (*broken, *_faults(model, given, errors))


def spellings(model: type[BaseModel]) -> tuple[str, ...]:
    """How the options of a model are spelled, in the order of declaration, with every alias of each."""
    return tuple(one for name, field in model.model_fields.items() for one in _spelled(name, field))


def takes_any_name(model: type[BaseModel]) -> bool:
    """Whether a model takes options that it does not name."""
    return model.model_config.get("extra") == "allow"


def unknown_option(name: str, known: Iterable[str]) -> Fault:
    """The fault of an option that nobody takes, with the nearest of the known ones."""
    names = tuple(dict.fromkeys(known))
    close = nearest(name, names)
    return Fault(name, "is not known", f"did you mean `{close}`?" if close else f"known: {', '.join(names) or 'none'}")


# -- private


def _tried(model: type[ModelT], given: Mapping[str, object]) -> tuple[ModelT | None, _Errors, tuple[Fault, ...]]:
    """The checked options; else pydantic's errors, or the fault of a validator that broke."""
    try:
        return model.model_validate(dict(given)), (), ()
    except ValidationError as error:
        return None, tuple(error.errors(include_url=False)), ()
    except Exception as error:  # noqa: BLE001 - a validator is a stranger's code and may raise anything
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"cannot be checked: its validator raised {type(error).__name__} at {Path(at.filename).name}:{at.lineno}"
        return None, (), (Fault(_breaking(model, given), said),)


def _place(error: _Error) -> str:
    """The option that an error is of; "" for the model as a whole."""
    return str(error["loc"][0]) if error["loc"] else ""


def _places(errors: _Errors) -> tuple[str, ...]:
    return tuple(dict.fromkeys(map(_place, errors)))


def _decoded(value: object) -> object:
    """What a text says in JSON; anything else is left as it is."""
    if not isinstance(value, str):
        return value
    try:
        return msgspec.json.decode(value)
    except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
        return value


def _breaking(model: type[BaseModel], given: Mapping[str, object]) -> str:
    """The option whose validator raises what is no `ValueError`, found by giving one more at a time; "" if none is."""
    some: dict[str, object] = {}
    for name in ("", *given):
        if name:
            some[name] = given[name]
        try:
            model.model_validate(some)
        except ValidationError:
            continue
        except Exception:  # noqa: BLE001 - as above
            return name
    return ""


def _faults(model: type[BaseModel], given: Mapping[str, object], errors: _Errors) -> Iterator[Fault]:
    """The faults in pydantic's order; of a value that may be of several types, one fault with all of them."""
    due: dict[tuple[str, str], list[str]] = {}
    for one in errors:
        where, message = _path(given, one), worded(one)
        is_due = _DUE_WORDS.fullmatch(message)
        due.setdefault((where, is_due[1] if is_due else message), []).append(is_due[2] if is_due else "")
    unknown = {_path(given, one) for one in errors if one["type"] == "extra_forbidden" and len(one["loc"]) == 1}
    for (where, said), words in due.items():
        kinds = tuple(dict.fromkeys(words))
        if where in unknown:
            yield unknown_option(where, spellings(model))
        elif kinds == ("",):
            yield Fault(where, said)
        else:
            as_json = {"a list", "an object"}.intersection(kinds) and said.endswith("'")
            yield Fault(where, f"{said}, {' or '.join(kinds)} is due", _AS_JSON if as_json else "")


_DUE_WORDS = re.compile(r"(is .*), (.+) is due", re.DOTALL)
_AS_JSON = 'write it as JSON: ["a", "b"] or {"a": 1}'


def _path(given: object, error: _Error) -> str:
    """The path of what is wrong; pydantic's names of the types of a union are no part of it."""
    names: list[str] = []
    for at, key in enumerate(error["loc"], 1):
        keys = range(len(given)) if isinstance(given, list | tuple) else given if isinstance(given, Mapping) else ()
        within = key in keys
        if within:
            given = given[key]  # type: ignore[index]
        if within or not names or (at == len(error["loc"]) and error["type"] == "missing"):
            names.append(str(key))
    return ".".join(names)


def _spelled(name: str, field: FieldInfo) -> tuple[str, ...]:
    match field.validation_alias:
        case AliasChoices() as choices:
            return tuple(str(path[0]) for path in choices.convert_to_aliases())
        case AliasPath() as path:
            return (str(path.path[0]),)
    return (field.validation_alias or name,)


__all__ = ["ModelT", "read_model", "spellings", "takes_any_name", "unknown_option"]
