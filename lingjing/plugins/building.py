"""The building of scenes from their declarations, with checks of their contract.

An error names the scene and the plug-in that offers it, for every exception and every wrong value of foreign code.
"""

from __future__ import annotations

import msgspec

from lingjing.errors import LingjingError, PluginError
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import DISPLACEMENT
from lingjing.plugins.foreign_errors import kind_of_value, one_line
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City


def build_city(spec: SceneSpec, host: PluginHost) -> City:
    """Return the city of a scene. Raises `UsageError` if no plug-in has this scene, `PluginError` if the plug-in fails
    to build it."""
    plugin = host.scene(spec.kind)
    own = {name: value for name, value in spec.options.items() if name != DISPLACEMENT}
    failed = f"scene `{spec.kind}` of plug-in `{host.sources['lingjing_scenes', spec.kind]}` failed"
    try:
        city = plugin.build(spec if own == spec.options else msgspec.structs.replace(spec, options=own))
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{failed}: {one_line(error)}", hint="correct its `build`") from error
    if not isinstance(city, City):
        raise PluginError(f"{failed}: it built {kind_of_value(city)}, no City", hint="correct its `build`")
    return city


__all__ = ["build_city", "kind_of_value"]
