"""Missions in a city from a map: the mission with its places found there, cached by content.

The city is named by the option `scene` of an episode, or by the option `city` of the mission's scene. The places that
were found are kept in `sites` of the project's cache folder, under the hash of mission, city and this project's rules.
"""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

import msgspec

from lingjing.data import cache_folder, cache_is_off, kept_path
from lingjing.decoding import from_msgpack
from lingjing.errors import UsageError
from lingjing.kept_files import prune, read_kept, write_kept
from lingjing.mission import expression as ex
from lingjing.mission.instance import SceneSpec
from lingjing.mission.model import Mission
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene import siting
from lingjing.scene.city import content_sha256
from lingjing.scene.siting.sited import city_option, sited, with_city_option
from lingjing.scene.store import code_sha256

SITES = "sites"
"""Name of the folder in the cache folder."""
MOST_FILES, MOST_BYTES = 200, 1 << 26
"""Most missions in the cache, and their bytes (chosen)."""


def sited_mission(mission: Mission, scene: str, host: PluginHost) -> Mission:
    """Return the mission in its city; the mission itself if neither it nor `scene` names one.

    Raises `UsageError` for a map that cannot be read, `MissionError` that says what the city lacks.
    """
    named = with_city_option(mission, scene) if scene else mission
    path = city_option(named)
    if path is None:
        return mission
    if not Path(path).exists():
        raise UsageError(f"no map at `{path}`: the file does not exist", hint="a path begins in the working folder")
    option = "folder" if Path(path).is_dir() else "file"
    city = build_city(SceneSpec(kind="map", options={option: path}), host)
    key = _key(named, content_sha256(city))
    known = _kept(key)
    if known is not None:
        return known
    placed = sited(named, city, {option: ex.Text(value=path)})
    _keep(key, placed)
    return placed


# -- private


def _key(mission: Mission, city: str) -> str:
    code = code_sha256(Path(siting.__file__).parent)
    return hashlib.sha256(msgspec.msgpack.encode((mission, city, code))).hexdigest()[:40]


def _kept(key: str) -> Mission | None:
    if cache_is_off():
        return None
    try:
        data = read_kept(kept_path(SITES, key))
        return None if data is None else from_msgpack(data, Mission)
    except (OSError, msgspec.DecodeError):
        return None


def _keep(key: str, mission: Mission) -> None:
    if cache_is_off():
        return
    folder = Path(cache_folder(), SITES)
    with contextlib.suppress(OSError):
        write_kept(str(folder / key), msgspec.msgpack.encode(mission))
        prune(str(folder), most_bytes=MOST_BYTES, most_files=MOST_FILES)
