"""Lookup of installed scaffolds and backbones by name, for policies that use them.

Each call reads the entry points of all installed plug-ins; a policy calls it once, when it is built.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lingjing.errors import LingjingError, PluginError
from lingjing.plugins.backbone import Backbone, ChatRequest, ModelCompletion, ModelError, ServiceAccess
from lingjing.plugins.foreign_errors import kind_of_value, one_line
from lingjing.plugins.host import PluginHost
from lingjing.plugins.options import PluginOptions, declared_model, read_options
from lingjing.plugins.scaffold import AgentParts, ScaffoldContext, ScaffoldPlugin
from lingjing.plugins.scaffold_parts import named_parts

ScaffoldBuilder = Callable[[ScaffoldContext], AgentParts]
"""Builds the parts of one agent."""


def scaffold_builder(name: str, arguments: Mapping[str, object], host: PluginHost | None = None) -> ScaffoldBuilder:
    """Return the builder of an installed scaffold with its checked options.

    Raises `UsageError` for an unknown name or wrong options. The builder raises `PluginError` if the scaffold fails.
    """
    host = host or PluginHost()
    plugin = host.scaffold(name)
    owner = f"scaffold `{name}` of plug-in `{host.sources['lingjing_scaffolds', name]}`"
    return _checked_builder(plugin, arguments, owner)


def scaffold_owner(name: str, host: PluginHost | None = None) -> str:
    """Return the distribution of an installed scaffold with its version. Raises `UsageError` for an unknown name."""
    return _owner(PluginHost.scaffold, "lingjing_scaffolds", name, host)


def backbone_owner(name: str, host: PluginHost | None = None) -> str:
    """Return the distribution of an installed backbone with its version. Raises `UsageError` for an unknown name."""
    return _owner(PluginHost.backbone, "lingjing_backbones", name, host)


def _owner(find: Callable[[PluginHost, str], object], hook: str, name: str, host: PluginHost | None) -> str:
    """Return the distribution of the plug-in that declares `name` in `hook`. `find` raises for an unknown name."""
    host = host or PluginHost()
    find(host, name)
    return host.owner(hook, name)


def backbone_models(name: str, host: PluginHost | None = None) -> tuple[str, ...] | None:
    """Return the names of the models that an installed backbone serves; None if it may serve any. Raises `UsageError`
    for an unknown backbone."""
    return (host or PluginHost()).backbone(name).models


def open_backbone(name: str, access: ServiceAccess, host: PluginHost | None = None) -> Backbone:
    """Return an installed backbone for a service. Raises `UsageError` for an unknown name, `PluginError` if it cannot
    be built."""
    host = host or PluginHost()
    plugin = host.backbone(name)
    owner = f"backbone `{name}` of plug-in `{host.sources['lingjing_backbones', name]}`"
    try:
        backbone = plugin.factory(access)
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{owner} cannot be built: {one_line(error)}", hint="correct its `factory`") from error
    if not callable(getattr(backbone, "complete", None)):
        built = kind_of_value(backbone)
        raise PluginError(f"{owner} built {built}, which has no method `complete`", hint="correct its `factory`")
    return _NamedBackbone(owner, backbone)


class _NamedBackbone:
    """A backbone that raises `ModelError` with its name for exceptions of its code and for wrong answers."""

    def __init__(self, owner: str, backbone: Backbone) -> None:
        self._owner = owner
        self._backbone = backbone

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        try:
            answer: object = await self._backbone.complete(request, timeout_s)
        except (ModelError, LingjingError, TimeoutError):
            raise
        except (Exception, SystemExit) as error:  # noqa: BLE001 - foreign code; no traceback, which may hold the key
            failure = ModelError(f"{self._owner} failed: {one_line(error)}", fault="backbone", billed=True)
        else:
            if isinstance(answer, ModelCompletion):
                return answer
            built = kind_of_value(answer)
            failure = ModelError(f"{self._owner} returned {built}, no ModelCompletion", fault="backbone", billed=True)
        raise failure  # outside of the `except`: the exception may quote the request with its key


def _checked_builder(plugin: ScaffoldPlugin, arguments: Mapping[str, object], owner: str) -> ScaffoldBuilder:
    model = declared_model(plugin.options, owner)
    options = (read_options(model or PluginOptions, arguments, f"scaffold `{plugin.name}`"),)

    def build(context: ScaffoldContext) -> AgentParts:
        try:
            parts: object = plugin.build(context, *(options if model else ()))
        except LingjingError:
            raise
        except (Exception, SystemExit) as error:
            raise PluginError(f"{owner} cannot be built: {one_line(error)}", hint="correct its `build`") from error
        if not isinstance(parts, AgentParts):
            raise PluginError(f"{owner} built {kind_of_value(parts)}, no AgentParts", hint="correct its `build`")
        return named_parts(parts, context.react, owner)

    return build


__all__ = [
    "ScaffoldBuilder", "backbone_models", "backbone_owner", "open_backbone", "scaffold_builder", "scaffold_owner",
]  # fmt: skip
