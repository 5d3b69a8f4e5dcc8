"""Plug-ins in addition to the installed ones, as `module:attribute`: equal in the caller and in its workers."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from lingjing.errors import PluginError
from lingjing.plugins.host import PluginHost


def host_with(plugins: Iterable[str], *, installed: bool = True) -> PluginHost:
    """Return a host with these plug-ins, and with all installed ones unless `installed` is False.

    Raises `PluginError` if a plug-in cannot be loaded.
    """
    return PluginHost(entry_points=installed, extra=[_load(name) for name in plugins])


def _load(name: str) -> object:
    module, _, attribute = name.partition(":")
    try:
        plugin: object = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise PluginError(f"plug-in `{name}` cannot be loaded: {error}", hint="name it as module:attribute") from error
    return plugin
