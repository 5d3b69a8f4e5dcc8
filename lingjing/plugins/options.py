"""Options of policies, engines and scenes: pydantic models that plug-ins declare, and the reading of what people write.

A declaration (`PolicyPlugin`, `EnginePlugin`, `ScenePlugin`) names its model as a class or as `package.module:Class`,
which is imported when somebody gives, reads or lists options. A field's name, or its alias if it has one, is how an
option is spelled; its type, bounds, default and description are what `lingjing plugins NAME` prints. Reading tells
every fault at once, each at the option's spelling.

This module loads pydantic. `lingjing.plugins.engine`, `policy`, `hookspecs` and `host` do without it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, Field, create_model
from pydantic.errors import PydanticUndefinedAnnotation, PydanticUserError

from lingjing.errors import Fault, PluginError, UsageError
from lingjing.option_reading import read_model

if TYPE_CHECKING:
    from lingjing.mission.instance import Instance


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
    options, faults = read_model(model, given)
    if options is None:  # not within an `except`: pydantic's error holds what was given, which may be a secret
        raise options_error({owner: faults})
    return options


def option_faults(model: type[PluginOptions], given: Mapping[str, object]) -> tuple[Fault, ...]:
    """Everything that is wrong with the options, at their spellings; empty if nothing is."""
    return read_model(model, given)[1]


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
    """Those of a factory that takes `**others`."""


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
