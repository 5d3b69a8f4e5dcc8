"""Options of policies, engines and scenes: pydantic models that plug-ins declare, and the reading of what people write.

A declaration (`PolicyPlugin`, `EnginePlugin`, `ScenePlugin`) names its model as a class or as `package.module:Class`,
which is imported when somebody gives, reads or lists options. A field's name, or its alias if it has one, is how an
option is spelled; its type, bounds, default and description are what `lingjing plugins NAME` prints. Reading tells
every fault at once, each at the option's spelling.

This module loads pydantic. `lingjing.plugins.engine`, `policy`, `hookspecs` and `host` do without it.
"""

from __future__ import annotations

import difflib
import inspect
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

import msgspec
from pydantic import AliasChoices, AliasPath, BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic.errors import PydanticUndefinedAnnotation, PydanticUserError
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema

from lingjing.errors import Fault, PluginError, UsageError
from lingjing.plugins.engine import EnginePlugin, EngineSpec
from lingjing.validation import worded

_FEW = 8
"""A message lists so many names at most."""

_SHARE = 0.7
"""How alike two names must be, 0 to 1, for one to be suggested for the other."""


class PluginOptions(BaseModel):
    """What a plug-in's own model of options extends: unknown names are faults, values do not change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False, protected_namespaces=()
    )


OptionsT = TypeVar("OptionsT", bound=PluginOptions)


class OptionSpec(msgspec.Struct, frozen=True, kw_only=True):
    """One declared option as it is listed: its spelling, type and bounds in words, default as text, and help."""

    name: str
    type: str
    bounds: str = ""
    default: str = ""
    required: bool = False
    help: str = ""


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


def shared_among_engines(
    given: Mapping[str, str], plugins: Mapping[str, EnginePlugin], used: Iterable[str] = ()
) -> dict[str, dict[str, str]]:
    """`{"camera.quality": "80"}` by engine and option; the engines `used` are checked even if they are given nothing.

    Raises `UsageError` that tells every fault.
    """
    shares: dict[str, dict[str, str]] = {}
    faults: dict[str, tuple[Fault, ...]] = {}
    for key, value in given.items():
        name, dot, option = key.partition(".")
        if name not in plugins or not dot:
            faults["engines"] = (*faults.get("engines", ()), _unknown_engine(key, plugins))
        else:
            shares.setdefault(name, {})[option] = value
    for name in dict.fromkeys((*shares, *used)):
        owner = f"engine `{name}`"
        model = declared_model(plugins[name].options, owner) or PluginOptions
        faults[owner] = option_faults(model, shares.get(name, {}))
    if any(faults.values()):
        raise options_error(faults)
    return shares


def spellings(model: type[PluginOptions]) -> tuple[str, ...]:
    """How the options of a model are spelled, in the order of declaration, with every alias of each."""
    return tuple(one for name, field in model.model_fields.items() for one in _spelled(name, field))


def unknown_option(name: str, known: Iterable[str]) -> Fault:
    """The fault of an option that nobody takes, with the nearest of the known ones."""
    names = tuple(dict.fromkeys(known))
    close = difflib.get_close_matches(name, names, n=1, cutoff=_SHARE)
    return Fault(
        name, "is not known", f"did you mean `{close[0]}`?" if close else f"known: {', '.join(names) or 'none'}"
    )


def takes_any_name(model: type[PluginOptions]) -> bool:
    """Whether a model takes options that it does not name."""
    return model.model_config.get("extra") == "allow"


def option_specs(model: type[PluginOptions]) -> tuple[OptionSpec, ...]:
    """Every option of a model as it is listed, in the order of declaration.

    One whose type JSON Schema has no words for, such as a function, is listed as `any`.
    """
    schema = model.model_json_schema(mode="validation", schema_generator=_ListedSchema)
    required = frozenset(schema.get("required", ()))
    return tuple(
        OptionSpec(
            name=name,
            type=_type(one),
            bounds=_bounds(one),
            default="" if name in required or one.get("default") is None else _text(one["default"]),
            required=name in required,
            help=str(one.get("description", "")),
        )
        for name, one in schema.get("properties", {}).items()
    )


# -- private


class _Parameters(PluginOptions, arbitrary_types_allowed=True):
    """The options of a factory that declares no model."""


class _AnyParameters(_Parameters, extra="allow"):
    """Those of a factory that takes `**others`."""


class _ListedSchema(GenerateJsonSchema):
    """The JSON Schema of what it can express; the rest may be anything, and a default without JSON is left out."""

    def handle_invalid_for_json_schema(self, schema: object, error_info: str) -> dict[str, Any]:
        return {}

    def emit_warning(self, kind: object, detail: str) -> None:
        """Say nothing: the list is for people, who need no warning of pydantic's."""


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


def _unknown_engine(key: str, plugins: Mapping[str, EnginePlugin]) -> Fault:
    fault = unknown_option(key.partition(".")[0], plugins)
    return Fault(key, "names no installed engine and one of its options", fault.hint)


def _validated(model: type[OptionsT], given: Mapping[str, object]) -> tuple[OptionsT | None, tuple[Fault, ...]]:
    try:
        return model.model_validate(dict(given)), ()
    except ValidationError as error:
        return None, tuple(_faults(model, error))
    except Exception as error:  # noqa: BLE001 - a validator is a stranger's code and may raise anything
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"cannot be checked: its validator raised {type(error).__name__} at {Path(at.filename).name}:{at.lineno}"
        return None, (Fault(_breaking(model, given), said),)


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


def _faults(model: type[PluginOptions], error: ValidationError) -> Iterator[Fault]:
    for one in error.errors(include_url=False):
        where = ".".join(map(str, one["loc"]))
        unknown = one["type"] == "extra_forbidden" and len(one["loc"]) == 1
        yield unknown_option(where, spellings(model)) if unknown else Fault(where, worded(one))


def _type(one: Mapping[str, Any]) -> str:
    if "enum" in one or "const" in one:
        return "word"
    if "anyOf" in one:
        kinds = dict.fromkeys(_type(part) for part in one["anyOf"] if part.get("type") != "null")
        return " or ".join(kinds)
    if one.get("type") == "array":
        return f"list of {_type(one['items'])}" if one.get("items") else "list"
    return _TYPES.get(str(one.get("type", "")), "any")


_TYPES = {"number": "number", "integer": "whole number", "string": "text", "boolean": "yes or no", "object": "object"}


def _bounds(one: Mapping[str, Any]) -> str:
    if "anyOf" in one:
        return ", ".join(filter(None, dict.fromkeys(_bounds(part) for part in one["anyOf"])))
    if "enum" in one or "const" in one:
        return ", ".join(_text(value) for value in one.get("enum", (one.get("const"),)))
    words = {
        "minimum": "at least {}", "exclusiveMinimum": "more than {}", "maximum": "at most {}",
        "exclusiveMaximum": "less than {}", "minItems": "{} or more", "pattern": "like {}",
    }  # fmt: skip
    if "minimum" in one and "maximum" in one:
        return f"{_text(one['minimum'])} to {_text(one['maximum'])}"
    return ", ".join(text.format(_text(one[key])) for key, text in words.items() if key in one)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return f"{value:.15g}"
    return value if isinstance(value, str) else msgspec.json.encode(value).decode()


__all__ = [
    "Fault", "Field", "OptionSpec", "PluginOptions", "declared_model", "engine_options", "given_parameters",
    "model_of_parameters", "option_faults", "option_specs", "options_error", "read_options", "shared_among_engines",
    "spellings", "takes_any_name", "unknown_option",
]  # fmt: skip
