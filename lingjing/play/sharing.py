"""Data that the episodes of one fork server share: their city, its meshes for viewers, and caches.

`share` runs in the fork server, where no code of a policy or of a foreign plug-in may run. Scenes and engines that are
not built in are left to each episode.
"""

from __future__ import annotations

import contextlib
from importlib import import_module

import msgspec
import PIL.Image

from lingjing.decoding import from_json
from lingjing.errors import LingjingError
from lingjing.installation import CORE
from lingjing.installed_plugins.entry_points import hold_entries
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.world.held_cities import hold, packed
from lingjing.kernel.world.placed_worlds import announce, world_start
from lingjing.kernel.world.selection import select_engines
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.salts import instance_seed
from lingjing.numerics import versions
from lingjing.play.option_sharing import engine_options
from lingjing.play.options import PlayOptions, compiled
from lingjing.play.siting import sited_mission
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.scene.surroundings import surroundings
from lingjing.trace.schemas import RECORDS, container_schema


class SharedStart(msgspec.Struct, frozen=True):
    """The common beginning of episodes that will be forked."""

    options: PlayOptions
    """The options that decide the instance. Policies may differ."""
    repeated: bool = True
    """True if several episodes begin with the same instance, so that its world is placed once."""


def share(text: str) -> None:
    """Prepare and keep the city and the caches that the episodes of a `SharedStart` (JSON text) use."""
    versions()
    hold_entries()
    for name in RECORDS:
        container_schema(name)
    PIL.Image.preinit()
    start = from_json(text, SharedStart)
    options = start.options
    host = PluginHost(entry_points=False, extra=(import_module(CORE.plugin),))
    mission = sited_mission(compiled(options), options.scene, host)
    instance = instantiate(
        mission,
        seed=instance_seed(options.salt, options.seed),
        mode=options.mode,
        settings=options.settings,
        tier=options.tier,
        language=options.language,
    )
    if instance.scene.kind not in host.scenes:
        return
    cities = CityBuilder(host)
    placed, city = cities.place(instance, imported=bool(mission.origin.places), hold=True)
    hold(city)
    surroundings(city, instance)
    if start.repeated:
        with contextlib.suppress(LingjingError):  # a plug-in's engine, or a fault that each episode reports
            _announce(options, instance, placed, city, host)


def _announce(options: PlayOptions, instance: Instance, placed: Instance, city: City, host: PluginHost) -> None:
    """Announce the world. It is placed when the first episode requests it."""
    engines = select_engines(instance, host)
    shares = engine_options(options.engine_args, host, engines.names)
    announce(world_start(engines.local, msgspec.structs.replace(placed, engine_options=shares), packed(city)))
