"""The plan of a mission's placed instance: its city from above, with regions and the places where bodies begin."""

from __future__ import annotations

import hashlib
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lingjing.analysis.fonts import families, note_of_boxes
from lingjing.kernel.cities import CityBuilder
from lingjing.mission.document import encode
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.siting import sited_mission
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.scene.plan import PlanMarker, PlanRegion, draw_plan

MOST_KEPT = 8
"""Number of plans that are kept in memory (chosen): a notebook shows the same mission several times."""

_kept: dict[bytes, bytes] = {}


def place_mission(
    mission: Mission, *, seed: int = 0, mode: str | None = None, tier: int = 0, scene: str = ""
) -> tuple[Instance, City]:
    """Return the instance of a seed with all bodies in their places, and its city.

    `scene` names a map or a built city to find the mission's places in. Raises `UsageError` for a mode, tier or scene
    that does not exist, `MissionError` if a body has no place.
    """
    host = PluginHost()
    sited = sited_mission(mission, scene, host)
    instance = instantiate(sited, seed=seed, mode=mode, tier=tier)
    return CityBuilder(host).place(instance, imported=bool(sited.origin.places))


def write_plan(city: City, instance: Instance | None, path: Path) -> tuple[str, ...]:
    """Write the plan, and return notes on missing letters; the suffix gives the format (`.png`, `.svg`, `.pdf`).

    Without an instance the plan shows the city alone. Raises `UsageError` if the file cannot be written.
    """
    with lettered(words_of(city, instance)) as notes:
        draw_plan(city, path, markers=markers(instance), regions=regions(instance), title=title_of(instance))
    return notes


@contextmanager
def lettered(words: str) -> Iterator[tuple[str, ...]]:
    """Let matplotlib draw with fonts that have the letters of `words`, and yield notes on missing ones."""
    from matplotlib import rc_context

    with rc_context({"font.family": families(words)}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # the notes report it instead
        yield note_of_boxes(words)


def plan_png(mission: Mission) -> bytes:
    """Return the plan of the instance of seed 0 as a PNG. Raises the errors of `place_mission`."""
    key = hashlib.sha256(encode(mission).encode()).digest()
    if key not in _kept:
        instance, city = place_mission(mission)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plan.png"
            write_plan(city, instance, path)
            _kept[key] = path.read_bytes()
        while len(_kept) > MOST_KEPT:
            del _kept[next(iter(_kept))]
    return _kept[key]


def title_of(instance: Instance | None) -> str:
    """Return the title of a picture of an instance; empty without one."""
    return "" if instance is None else f"{instance.title}, seed {instance.seed}, {instance.mode}"


def words_of(city: City, instance: Instance | None) -> str:
    """Return all words that a picture of an instance may show, for the choice of its fonts."""
    names = () if instance is None else (*(e.id for e in instance.entities), *(r.name for r in instance.regions))
    return " ".join((city.id, city.attribution, title_of(instance), *names))


def markers(instance: Instance | None) -> list[PlanMarker]:
    """Return a mark for each entity of an instance."""
    entities = () if instance is None else instance.entities
    return [PlanMarker(e.id, *e.position[:2], e.role, "position" in e.hidden) for e in entities]


def regions(instance: Instance | None) -> list[PlanRegion]:
    """Return the outline of each region of an instance that has one."""
    outlines = () if instance is None else instance.regions
    return [PlanRegion(region.name, region.polygon, region.hidden) for region in outlines if region.polygon]
