"""Which plug-in gets which of the given options: policies by what they declare, engines and evaluators by name.

Every fault is told at once, each with its owner.
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
    """What declares a model of options: `EnginePlugin`, `EvaluatorPlugin`."""

    @property
    def options(self) -> type[PluginOptions] | str | None: ...


def share_arguments(
    plugins: Mapping[str, PolicyPlugin], arguments: Mapping[str, ValueT], *, whole: bool = True
) -> dict[str, dict[str, ValueT]]:
    """Which of the given options each policy gets: those of its model; a policy alone gets them all.

    The policies are told apart and called by the names they were asked for with, folders and all: two files of one
    name in two folders hold two policies. Where they are not all that were asked for (`whole`), what none of them takes
    may be another's.

    Raises `UsageError` that tells every fault: of each policy's options, and what none of them takes.
    """
    from lingjing.option_reading import spellings, takes_any_name, unknown_option
    from lingjing.plugins.options import option_faults, options_error

    models = {name: options_model(plugin) for name, plugin in plugins.items()}
    taken = {name: spellings(model) for name, model in models.items()}
    shares = {
        name: {key: value for key, value in arguments.items() if takes_any_name(model) or key in taken[name]}
        for name, model in models.items()
    }
    faults = {f"policy `{name}`": option_faults(model, shares[name]) for name, model in models.items()}
    names = [name for each in taken.values() for name in each]
    strangers = [key for key in arguments if whole and not any(key in share for share in shares.values())]
    owners = f"polic{'y' if len(models) == 1 else 'ies'} {', '.join(f'`{name}`' for name in models)}"
    faults[owners] = (*faults.get(owners, ()), *(unknown_option(key, names) for key in strangers))
    if any(faults.values()):
        raise options_error(faults)
    return shares


def engine_options(
    arguments: Mapping[str, ValueT], host: PluginHost, used: Iterable[str] = ()
) -> dict[str, dict[str, ValueT]]:
    """The `--engine-arg` pairs by engine and option. `used` are the engines that take part: each must have been given
    what it requires. Raises `UsageError` that tells every fault."""
    return _shared("engine", arguments, host.engines, used)


def evaluator_options(
    arguments: Mapping[str, ValueT], scoring: Mapping[str, EvaluatorPlugin]
) -> dict[str, dict[str, ValueT]]:
    """The `--evaluator-arg` pairs by evaluator and option; only those that score take any. Raises `UsageError` that
    tells every fault."""
    return _shared("evaluator", arguments, scoring, scoring)


_KNOWN = {"engine": "installed engine", "evaluator": "evaluator that scores"}
"""What the name before the dot must be."""


def _shared(
    kind: str, given: Mapping[str, ValueT], plugins: Mapping[str, _Configurable], used: Iterable[str]
) -> dict[str, dict[str, ValueT]]:
    """`{"camera.quality": "80"}` by plug-in and option; those `used` are checked even if they are given nothing."""
    declaring = [name for name in used if plugins[name].options]
    if not given and not declaring:
        return {}
    from lingjing.option_reading import unknown_option
    from lingjing.plugins.options import PluginOptions, declared_model, option_faults, options_error

    shares: dict[str, dict[str, ValueT]] = {}
    faults: dict[str, tuple[Fault, ...]] = {}
    for key, value in given.items():
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
