"""The road network of a city, as SUMO's programs read it."""

from __future__ import annotations

from pathlib import Path

from lingjing.errors import UsageError
from lingjing.scene.city import City


def encode(city: City) -> bytes:
    """Return the network (`.net.xml`) in world coordinates; its `location` names the projection to WGS84.

    Raises `UsageError` for a city without roads, and if its network's file was removed.
    """
    if not city.network:
        raise UsageError(
            f"`{city.id}` has no roads, so there is no network for SUMO", hint="choose glb, geojson or mjcf"
        )
    try:
        network = Path(city.network).read_bytes()
    except OSError as error:
        hint = "build the scene again: its cached files were removed"
        raise UsageError(f"cannot read the network `{city.network}`: {error.strerror}", hint=hint) from error
    head, line, rest = network.partition(b"\n")
    credit = city.attribution.replace("--", "- -")  # XML allows no double hyphen in a comment
    return head + line + f"<!-- {credit or 'no attribution'} -->\n".encode() + rest
