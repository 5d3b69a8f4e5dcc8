"""Options of plug-ins: pydantic models that declarations name, and the reading of the values that users give.

A declaration (`PolicyPlugin`, `EnginePlugin`, …) names its model as a class or as `package.module:Class`, which is
imported when options are read or listed. An option is spelled as its field's alias, or its name without one;
`lingjing plugins NAME` prints its type, bounds, default and description. Reading reports all faults at once, each at
the option's spelling.

This module loads pydantic. `lingjing.plugins.engine`, `policy`, `hookspecs` and `host` do without it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import lru_cache
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, Field, create_model
from pydantic.errors import PydanticUndefinedAnnotation, PydanticUserError

from lingjing.errors import Fault, PluginError, UsageError
from lingjing.option_reading import read_model
from lingjing.plugins.foreign_errors import one_line

if TYPE_CHECKING:
    from lingjing.mission.instance import Instance


class PluginOptions(BaseModel):
    """The base class of models of options. Unknown names are faults, and values do not change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False, protected_namespaces=()
    )

    def fingerprint(self) -> dict[str, str]:
        """Return values that decide the behaviour beside the given options, such as the SHA-256 of a file that an
        option names. The trace keeps them."""
        return {}


OptionsT = TypeVar("OptionsT", bound=PluginOptions)


def declared_model(reference: type[Any] | str | None, owner: str) -> type[PluginOptions] | None:
    """Return the model that a declaration names; None if it names none.

    `owner` is the declared thing in words, such as "policy `scout`". Raises `PluginError` for a reference to anything
    else.
    """
    if not reference:
        return None
    model: object = reference
    if isinstance(reference, str):
        try:
            model = resolve_name(reference)
        except (Exception, SystemExit) as error:
            message = f"the options of {owner} cannot be loaded from `{reference}`: {one_line(error)}"
            raise PluginError(message, hint="correct `options` in its declaration: package.module:Class") from error
    if not (isinstance(model, type) and issubclass(model, PluginOptions)):
        hint = "extend lingjing.plugins.options.PluginOptions"
        raise PluginError(
            f"the options of {owner} are declared by `{reference}`, which is no model of options", hint=hint
        )
    try:
        model.model_rebuild()
    except (PydanticUserError, PydanticUndefinedAnnotation) as error:
        raise PluginError(f"the options of {owner} cannot be read from `{model.__name__}`: {error.message}") from error
    return model


def model_of_parameters(factory: Callable[..., object]) -> type[PluginOptions]:
    """Return the model that a factory's own parameters declare: annotations are types, defaults are defaults.

    A parameter without an annotation takes anything; `**others` takes options of any name. The model of a hashable
    factory is built once, because it takes 2 ms.
    """
    try:
        return _kept_model(factory)
    except TypeError:  # it cannot be hashed
        return _model(factory)


@lru_cache(maxsize=64)
def _kept_model(factory: Callable[..., object]) -> type[PluginOptions]:
    return _model(factory)


def _model(factory: Callable[..., object]) -> type[PluginOptions]:
    parameters = _parameters(factory)
    fields: dict[str, Any] = {}
    for number, parameter in enumerate(parameters.values()):
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY):
            annotation = parameter.annotation
            kind = Any if annotation is parameter.empty or isinstance(annotation, str) else annotation
            default = ... if parameter.default is parameter.empty else parameter.default
            fields[f"option_{number}"] = (kind, Field(default, alias=parameter.name))
    takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    return create_model("Parameters", __base__=_AnyParameters if takes_any else _Parameters, **fields)


def given_parameters(options: PluginOptions) -> dict[str, Any]:
    """Return the given options as keyword arguments for the factory that the model was made from."""
    fields, names = type(options).model_fields, options.model_fields_set
    arguments = {fields[name].alias or name: getattr(options, name) for name in fields if name in names}
    return {**arguments, **(options.model_extra or {})}


def read_options(model: type[OptionsT], given: Mapping[str, object], owner: str) -> OptionsT:
    """Return the checked options. Raises `UsageError` with every fault. `owner` is the declared thing in words."""
    options, faults = read_model(model, given)
    if options is None:  # not within an `except`: pydantic's error holds what was given, which may be a secret
        raise options_error({owner: faults})
    return options


def option_faults(model: type[PluginOptions], given: Mapping[str, object]) -> tuple[Fault, ...]:
    """Return every fault of the options, at their spellings."""
    return read_model(model, given)[1]


def options_error(faults: Mapping[str, tuple[Fault, ...]]) -> UsageError:
    """Return the error that lists all faults. `faults` are by the owner of the options in words."""
    each = [(owner, fault) for owner, of_owner in faults.items() for fault in of_owner]
    lines = [
        f"{owner}: {f'option `{fault.where}` ' if fault.where else ''}{fault.message}{fault.hint and f'; {fault.hint}'}"
        for owner, fault in each
    ]
    names = dict.fromkeys(owner.partition("`")[2].partition("`")[0] or "NAME" for owner, _ in each)
    hint = f"`lingjing plugins {next(iter(names)) if len(names) == 1 else 'NAME'}` lists the options"
    if all(fault.hint for _, fault in each):
        hint = ""  # each line names its own way out
    return UsageError("\n".join(lines), hint=hint, faults=tuple(fault for _, fault in each))


class EngineEpisode(Protocol):
    """The part of `lingjing.plugins.engine.EngineSpec` that holds the options of an engine."""

    @property
    def engine(self) -> str:
        """The engine's name."""
        ...

    @property
    def instance(self) -> Instance:
        """The instance that is played."""
        ...


def engine_options(model: type[OptionsT], spec: EngineEpisode) -> OptionsT:
    """Return the options of an engine for an episode. Raises `UsageError` with every fault."""
    return read_options(model, spec.instance.engine_options.get(spec.engine, {}), f"engine `{spec.engine}`")


# -- private


class _Parameters(PluginOptions, arbitrary_types_allowed=True):
    """The options of a factory that declares no model."""


class _AnyParameters(_Parameters, extra="allow"):
    """The options of a factory that takes `**others`."""


def _parameters(factory: Callable[..., object]) -> Mapping[str, inspect.Parameter]:
    try:
        return inspect.signature(factory, eval_str=True).parameters
    except (NameError, SyntaxError, AttributeError):  # an annotation for type checkers alone
        return inspect.signature(factory).parameters
    except (TypeError, ValueError):  # a callable in C
        return {}


__all__ = [
    "EngineEpisode", "Fault", "Field", "PluginOptions", "declared_model", "engine_options", "given_parameters",
    "model_of_parameters", "option_faults", "options_error", "read_options",
]  # fmt: skip
