"""Option values checked by a pydantic model, with every fault at the spelling of its option.

Generic over the model; `lingjing.plugins.options` determines the model of a plug-in. A text that its option rejects is
read as JSON if it is valid JSON.
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

from lingjing.decoding import from_json
from lingjing.errors import Fault, LingjingError, hint_of
from lingjing.suggest import nearest
from lingjing.validation import worded

ModelT = TypeVar("ModelT", bound=BaseModel)

_Error = Mapping[str, Any]
"""An entry of `ValidationError.errors()`."""
_Errors = tuple[_Error, ...]


def read_model(model: type[ModelT], values: Mapping[str, object]) -> tuple[ModelT | None, tuple[Fault, ...]]:
    """Return the checked options or their faults. A text that its option rejects is read as JSON if it is valid
    JSON.
    """
    options, errors, broken = _tried(model, values)
    decoded = {name: value for name in _places(errors) if (value := _decoded(values.get(name))) is not values.get(name)}
    if decoded:
        first, values = errors, {**values, **decoded}
        options, errors, broken = _tried(model, values)
        plain = {name for name in _places(errors) if name in decoded and not isinstance(decoded[name], list | dict)}
        errors = (
            *(error for error in first if _place(error) in plain),  # report a number in the user's spelling
            *(error for error in errors if _place(error) not in plain),
        )
    return options, (*broken, *_faults(model, values, errors))


def spellings(model: type[BaseModel]) -> tuple[str, ...]:
    """Return the spellings of a model's options with all aliases, in the order of declaration."""
    return tuple(spelling for name, field in model.model_fields.items() for spelling in _spelled(name, field))


def takes_any_name(model: type[BaseModel]) -> bool:
    """Return whether a model accepts options that it does not declare."""
    return model.model_config.get("extra") == "allow"


def unknown_option(name: str, known: Iterable[str]) -> Fault:
    """Return the fault of an undeclared option, with the nearest declared one."""
    names = tuple(dict.fromkeys(known))
    close = nearest(name, names)
    return Fault(name, "is not known", f"did you mean `{close}`?" if close else f"known: {', '.join(names) or 'none'}")


# -- private


def _tried(model: type[ModelT], values: Mapping[str, object]) -> tuple[ModelT | None, _Errors, tuple[Fault, ...]]:
    """Return the checked options, or pydantic's errors, or the fault of a validator that raised."""
    try:
        return model.model_validate(dict(values)), (), ()
    except ValidationError as error:
        return None, tuple(error.errors(include_url=False)), ()
    except LingjingError as error:  # such as the fault of a plug-in that an option names
        fault = Fault(_breaking(model, values), f"cannot be used: {error}", hint_of(error))
        return None, (), (fault,)
    except Exception as error:  # noqa: BLE001 - a plug-in's validator may raise anything
        at = traceback.extract_tb(error.__traceback__)[-1]
        problem = (
            f"cannot be checked: its validator raised {type(error).__name__} at {Path(at.filename).name}:{at.lineno}"
        )
        return None, (), (Fault(_breaking(model, values), problem),)


def _place(error: _Error) -> str:
    """Return the option of an error; "" for the model as a whole."""
    return str(error["loc"][0]) if error["loc"] else ""


def _places(errors: _Errors) -> tuple[str, ...]:
    return tuple(dict.fromkeys(map(_place, errors)))


def _decoded(value: object) -> object:
    """Return the JSON value of a text; any other value unchanged."""
    if not isinstance(value, str):
        return value
    try:
        return from_json(value)
    except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
        return value


def _breaking(model: type[BaseModel], values: Mapping[str, object]) -> str:
    """Return the option with a validator that raises another error than `ValueError`, found by adding one option at a
    time.
    """
    some: dict[str, object] = {}
    for name in ("", *values):
        if name:
            some[name] = values[name]
        try:
            model.model_validate(some)
        except ValidationError:
            continue
        except Exception:  # noqa: BLE001 - as above
            return name
    return ""


def _faults(model: type[BaseModel], values: Mapping[str, object], errors: _Errors) -> Iterator[Fault]:
    """Yield the faults in pydantic's order; of a value with several allowed types, one fault with all of them."""
    due: dict[tuple[str, str], list[str]] = {}
    hints: dict[tuple[str, str], str] = {}
    for error in errors:
        where, message = _path(values, error), worded(error)
        hints[where, message] = _hint_behind(error)
        is_due = _DUE_WORDS.fullmatch(message)
        due.setdefault((where, is_due[1] if is_due else message), []).append(is_due[2] if is_due else "")
    unknown = {
        _path(values, error) for error in errors if error["type"] == "extra_forbidden" and len(error["loc"]) == 1
    }
    for (where, message), words in due.items():
        kinds = tuple(dict.fromkeys(words))
        if where in unknown:
            yield unknown_option(where, spellings(model))
        elif kinds == ("",):
            yield Fault(where, message, hints.get((where, message), ""))
        else:
            as_json = {"a list", "an object"}.intersection(kinds) and message.endswith("'")
            yield Fault(where, f"{message}, {' or '.join(kinds)} is due", _AS_JSON if as_json else "")


def _hint_behind(error: _Error) -> str:
    """Return the hint of the project's error from which a validator has raised its own; "" without one."""
    cause = getattr(error.get("ctx", {}).get("error"), "__cause__", None)
    return hint_of(cause) if isinstance(cause, LingjingError) else ""


_DUE_WORDS = re.compile(r"(is .*), (.+) is due", re.DOTALL)
_AS_JSON = 'write it as JSON: ["a", "b"] or {"a": 1}'


def _path(value: object, error: _Error) -> str:
    """Return the path of a faulty value, without pydantic's names of the types of a union."""
    names: list[str] = []
    for at, key in enumerate(error["loc"], 1):
        keys = range(len(value)) if isinstance(value, list | tuple) else value if isinstance(value, Mapping) else ()
        within = key in keys
        if within:
            value = value[key]  # type: ignore[index]
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
