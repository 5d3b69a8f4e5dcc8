"""Options of policies, engines and scenes: pydantic models that plug-ins declare, and the reading of what people write.

A declaration (`PolicyPlugin`, `EnginePlugin`, `ScenePlugin`) names its model as a class or as `package.module:Class`,
which is imported when somebody gives, reads or lists options. A field's name, or its alias if it has one, is how an
option is spelled; its type, bounds, default and description are what `lingjing plugins NAME` prints. Reading tells
every fault at once, each at the option's spelling.

This module loads pydantic. `lingjing.plugins.engine`, `policy`, `hookspecs` and `host` do without it.
"""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

import msgspec
from pydantic import AliasChoices, AliasPath, BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic.errors import PydanticUndefinedAnnotation, PydanticUserError
from pydantic.fields import FieldInfo

from lingjing.errors import Fault, PluginError, UsageError
from lingjing.plugins.engine import EngineSpec
from lingjing.suggest import nearest
from lingjing.validation import worded

_Error = Mapping[str, Any]
"""An entry of `ValidationError.errors()`."""
_Errors = tuple[_Error, ...]


class PluginOptions(BaseModel):
    """What a plug-in's own model of options extends: unknown names are faults, values do not change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False, protected_namespaces=()
    )

    def fingerprint(self) -> dict[str, str]:
        """What decides beside the options as they were given, such as the SHA-256 of a file that one of them names; the
        trace keeps it."""
        return {}


OptionsT = TypeVar("OptionsT", bound=PluginOptions)


def declared_model(reference: type[Any] | str | None, owner: str) -> type[PluginOptions] | None:
    """The model that a declaration names, or None if it names none.

    `owner` is the plug-in's item in words, such as "policy `scout`". Raises `PluginError` for what is no such model.
    """
    if not reference:
        return None
    found: object = reference
    if isinstance(reference, str):
        try:
            found = resolve_name(reference)
        except Exception as error:
            raise PluginError(f"the options of {owner} cannot be loaded from `{reference}`: {error}") from error
    if not (isinstance(found, type) and issubclass(found, PluginOptions)):
        hint = "extend lingjing.plugins.options.PluginOptions"
        raise PluginError(
            f"the options of {owner} are declared by `{reference}`, which is no model of options", hint=hint
        )
    try:
        found.model_rebuild()
    except (PydanticUserError, PydanticUndefinedAnnotation) as error:
        raise PluginError(f"the options of {owner} cannot be read from `{found.__name__}`: {error.message}") from error
    return found


def model_of_parameters(factory: Callable[..., object]) -> type[PluginOptions]:
    """The model that a factory's own parameters declare: annotations are types, defaults are defaults.

    A parameter without an annotation takes anything; `**others` takes options of any name.
    """
    parameters = _parameters(factory)
    fields: dict[str, Any] = {}
    for number, one in enumerate(parameters.values()):
        if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY):
            kind = Any if one.annotation is one.empty or isinstance(one.annotation, str) else one.annotation
            default = ... if one.default is one.empty else one.default
            fields[f"option_{number}"] = (kind, Field(default, alias=one.name))
    takes_any = any(one.kind is one.VAR_KEYWORD for one in parameters.values())
    return create_model("Parameters", __base__=_AnyParameters if takes_any else _Parameters, **fields)


def given_parameters(options: PluginOptions) -> dict[str, Any]:
    """The keyword arguments for a factory whose parameters are the model: those that were given."""
    fields = type(options).model_fields
    given = {fields[name].alias or name: getattr(options, name) for name in fields if name in options.model_fields_set}
    return {**given, **(options.model_extra or {})}


def read_options(model: type[OptionsT], given: Mapping[str, object], owner: str) -> OptionsT:
    """The checked options. Raises `UsageError` with every fault; `owner` is the plug-in's item in words."""
    options, faults = _validated(model, given)
    if options is None:  # not within an `except`: pydantic's error holds what was given, which may be a secret
        raise options_error({owner: faults})
    return options


def option_faults(model: type[PluginOptions], given: Mapping[str, object]) -> tuple[Fault, ...]:
    """Everything that is wrong with the options, at their spellings; empty if nothing is."""
    return _validated(model, given)[1]


def options_error(faults: Mapping[str, tuple[Fault, ...]]) -> UsageError:
    """The error that tells all faults, by the owner of the options in words."""
    each = [(owner, one) for owner, found in faults.items() for one in found]
    lines = [
        f"{owner}: {f'option `{one.where}` ' if one.where else ''}{one.message}{one.hint and f'; {one.hint}'}"
        for owner, one in each
    ]
    names = dict.fromkeys(owner.partition("`")[2].partition("`")[0] or "NAME" for owner, _ in each)
    hint = f"`lingjing plugins {next(iter(names)) if len(names) == 1 else 'NAME'}` lists the options"
    return UsageError("\n".join(lines), hint=hint, faults=tuple(one for _, one in each))


def engine_options(model: type[OptionsT], spec: EngineSpec) -> OptionsT:
    """What an engine is told for an episode. Raises `UsageError` with every fault."""
    return read_options(model, spec.instance.engine_options.get(spec.engine, {}), f"engine `{spec.engine}`")


def spellings(model: type[PluginOptions]) -> tuple[str, ...]:
    """How the options of a model are spelled, in the order of declaration, with every alias of each."""
    return tuple(one for name, field in model.model_fields.items() for one in _spelled(name, field))


def unknown_option(name: str, known: Iterable[str]) -> Fault:
    """The fault of an option that nobody takes, with the nearest of the known ones."""
    names = tuple(dict.fromkeys(known))
    close = nearest(name, names)
    return Fault(name, "is not known", f"did you mean `{close}`?" if close else f"known: {', '.join(names) or 'none'}")


def takes_any_name(model: type[PluginOptions]) -> bool:
    """Whether a model takes options that it does not name."""
    return model.model_config.get("extra") == "allow"


# -- private


class _Parameters(PluginOptions, arbitrary_types_allowed=True):
    """The options of a factory that declares no model."""


class _AnyParameters(_Parameters, extra="allow"):
    """Those of a factory that takes `**others`."""


def _spelled(name: str, field: FieldInfo) -> tuple[str, ...]:
    match field.validation_alias:
        case AliasChoices() as choices:
            return tuple(str(path[0]) for path in choices.convert_to_aliases())
        case AliasPath() as path:
            return (str(path.path[0]),)
    return (field.validation_alias or name,)


def _parameters(factory: Callable[..., object]) -> Mapping[str, inspect.Parameter]:
    try:
        return inspect.signature(factory, eval_str=True).parameters
    except (NameError, SyntaxError, AttributeError):  # an annotation for type checkers alone
        return inspect.signature(factory).parameters
    except (TypeError, ValueError):  # a callable in C
        return {}


def _validated(model: type[OptionsT], given: Mapping[str, object]) -> tuple[OptionsT | None, tuple[Fault, ...]]:
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


def _tried(model: type[OptionsT], given: Mapping[str, object]) -> tuple[OptionsT | None, _Errors, tuple[Fault, ...]]:
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


def _breaking(model: type[PluginOptions], given: Mapping[str, object]) -> str:
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


def _faults(model: type[PluginOptions], given: Mapping[str, object], errors: _Errors) -> Iterator[Fault]:
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


__all__ = [
    "Fault", "Field", "PluginOptions", "declared_model", "engine_options", "given_parameters",
    "model_of_parameters", "option_faults", "options_error", "read_options",
    "spellings", "takes_any_name", "unknown_option",
]  # fmt: skip
