"""The options of each plug-in: policies receive those that their models declare, engines and evaluators those by name.

Every error lists all faults, each with the plug-in that it belongs to.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Protocol, TypeVar

from lingjing.errors import Fault
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import options_model
from lingjing.plugins.policy import PolicyPlugin

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

ValueT = TypeVar("ValueT")


class _Configurable(Protocol):
    """A declaration with a model of options: `EnginePlugin` or `EvaluatorPlugin`."""

    @property
    def options(self) -> type[PluginOptions] | str | None: ...


def share_arguments(
    plugins: Mapping[str, PolicyPlugin], arguments: Mapping[str, ValueT], *, whole: bool = True
) -> dict[str, dict[str, ValueT]]:
    """Return the options of each policy: those that its model declares.

    `plugins` are by the names of the request, folders included, because two folders may hold files of the same name.
    `whole` is true if these are all the policies of the request. Otherwise an option that none of them declares may
    belong to another policy and is no fault. Raises `UsageError` that lists every fault of the options.
    """
    from lingjing.option_reading import spellings, takes_any_name, unknown_option
    from lingjing.plugins.options import option_faults, options_error

    models = {name: options_model(plugin) for name, plugin in plugins.items()}
    spelled = {name: spellings(model) for name, model in models.items()}
    shares = {
        name: {key: value for key, value in arguments.items() if takes_any_name(model) or key in spelled[name]}
        for name, model in models.items()
    }
    faults = {f"policy `{name}`": option_faults(model, shares[name]) for name, model in models.items()}
    names = [name for spellings_of_model in spelled.values() for name in spellings_of_model]
    unclaimed = [key for key in arguments if whole and not any(key in share for share in shares.values())]
    owners = f"polic{'y' if len(models) == 1 else 'ies'} {', '.join(f'`{name}`' for name in models)}"
    faults[owners] = (*faults.get(owners, ()), *(unknown_option(key, names) for key in unclaimed))
    if any(faults.values()):
        raise options_error(faults)
    return shares


def engine_options(
    arguments: Mapping[str, ValueT], host: PluginHost, used: Iterable[str] = ()
) -> dict[str, dict[str, ValueT]]:
    """Return the `--engine-arg` pairs by engine and option.

    `used` are the engines of the episode. Their required options must be present. Raises `UsageError` that lists every
    fault.
    """
    return _shared("engine", arguments, host.engines, used)


def evaluator_options(
    arguments: Mapping[str, ValueT], scoring: Mapping[str, EvaluatorPlugin]
) -> dict[str, dict[str, ValueT]]:
    """Return the `--evaluator-arg` pairs by evaluator and option. Only the evaluators in `scoring` accept options.

    Raises `UsageError` that lists every fault.
    """
    return _shared("evaluator", arguments, scoring, scoring)


_KNOWN = {"engine": "installed engine", "evaluator": "evaluator that scores"}
"""The plug-in that the name before the dot must denote, in words of an error message."""


def _shared(
    kind: str, pairs: Mapping[str, ValueT], plugins: Mapping[str, _Configurable], used: Iterable[str]
) -> dict[str, dict[str, ValueT]]:
    """Return pairs such as `{"camera.quality": "80"}` by plug-in and option.

    Options of the plug-ins in `used` are checked even if the user gives none.
    """
    declaring = [name for name in used if plugins[name].options]
    if not pairs and not declaring:
        return {}
    from lingjing.option_reading import unknown_option
    from lingjing.plugins.options import PluginOptions, declared_model, option_faults, options_error

    shares: dict[str, dict[str, ValueT]] = {}
    faults: dict[str, tuple[Fault, ...]] = {}
    for key, value in pairs.items():
        name, dot, option = key.partition(".")
        if name not in plugins or not dot:
            hint = f"write {name}.OPTION" if name in plugins else unknown_option(name, plugins).hint
            fault = Fault(key, f"names no {_KNOWN[kind]} and one of its options", hint)
            faults[f"{kind}s"] = (*faults.get(f"{kind}s", ()), fault)
        else:
            shares.setdefault(name, {})[option] = value
    for name in dict.fromkeys((*shares, *declaring)):
        owner = f"{kind} `{name}`"
        model = declared_model(plugins[name].options, owner) or PluginOptions
        faults[owner] = option_faults(model, shares.get(name, {}))
    if any(faults.values()):
        raise options_error(faults)
    return shares
