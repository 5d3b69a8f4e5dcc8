"""What episodes share that are forked from one process: their city, its meshes for viewers, what is made but once.

Called in that process, where nothing of a policy and no plug-in of a stranger may run: a scene that is not built in is
left to each episode.
"""

from __future__ import annotations

from lingjing.engines import builtin
from lingjing.kernel.world.held_cities import hold
from lingjing.mission.instantiate import instantiate
from lingjing.numerics import versions
from lingjing.play.options import PlayOptions, checked_options, compiled, read_options
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene.surroundings import surroundings
from lingjing.trace.schemas import RECORDS, container_schema


def share(text: str) -> None:
    """Hold the city of these options (JSON), and its meshes, for the episodes that will be forked."""
    versions()
    for name in RECORDS:
        container_schema(name)
    options: PlayOptions = checked_options(read_options(text, "the options"))
    instance = instantiate(compiled(options), seed=options.seed, mode=options.mode, settings=options.settings)
    host = PluginHost(entry_points=False, extra=(builtin,))
    if instance.scene.kind in host.scenes:
        city = build_city(instance.scene, host)
        hold(city)
        surroundings(city, instance)
