"""What episodes share that are forked from one process: their city, its meshes for viewers, what is made but once.

Called in that process, where nothing of a policy and no plug-in of a stranger may run: a scene or an engine that is not
built in is left to each episode.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import msgspec
import PIL.Image

from lingjing.errors import LingjingError
from lingjing.installation import CORE
from lingjing.installed_plugins.entry_points import hold_entries
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.world.held_cities import hold, packed
from lingjing.kernel.world.placed_worlds import announce, world_start
from lingjing.kernel.world.selection import select_engines
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.numerics import versions
from lingjing.play.option_sharing import engine_options
from lingjing.play.options import PlayOptions, compiled
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.scene.surroundings import surroundings
from lingjing.trace.schemas import RECORDS, container_schema


class SharedStart(msgspec.Struct, frozen=True):
    """Which episodes will be forked: those of the options, whoever plays them. `repeated` says that several begin with
    the same instance, so that their world is placed once."""

    options: PlayOptions
    repeated: bool = True


def share(text: str) -> None:
    """Hold what the episodes of a `SharedStart` (JSON) begin with."""
    versions()
    with _as_a_module_has_it():
        hold_entries()
    for name in RECORDS:
        container_schema(name)
    PIL.Image.preinit()
    start = msgspec.json.decode(text, type=SharedStart)
    options = start.options
    host = PluginHost(entry_points=False, extra=(import_module(CORE.plugin),))
    mission = compiled(options)
    instance = instantiate(mission, seed=options.seed, mode=options.mode, settings=options.settings)
    if instance.scene.kind not in host.scenes:
        return
    cities = CityBuilder(host)
    placed, city = cities.place(instance, imported=bool(mission.origin.places), hold=True)
    hold(city)
    surroundings(city, instance)
    if start.repeated:
        with contextlib.suppress(LingjingError):  # an engine of a plug-in, or a fault that each episode reports
            _announce(options, instance, placed, city, host)


@contextlib.contextmanager
def _as_a_module_has_it() -> Iterator[None]:
    """Python's path as a module has it that is run in this folder."""
    sys.path.insert(0, str(Path.cwd()))
    try:
        yield
    finally:
        del sys.path[0]


def _announce(options: PlayOptions, instance: Instance, placed: Instance, city: City, host: PluginHost) -> None:
    """Have the world placed when it is asked for the first time."""
    engines = select_engines(instance, host)
    given = engine_options(options.engine_args, host, engines.names)
    announce(world_start(engines.local, msgspec.structs.replace(placed, engine_options=given), packed(city)))
