"""Pictures of an episode that nobody took while it ran.

A picture is a function of the city and the states alone, and the trace holds the states of every boundary with the
background traffic: the camera is put there once more and asked.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.analysis.played_city import city_of
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.engine_group import close_engines, start_engines
from lingjing.kernel.world.selection import select_engines
from lingjing.kernel.world.sensor import Sensor
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord


def look_back(trace: Trace, wanted: Sequence[tuple[str, str, BoundaryRecord]]) -> Iterator[StoredFrame]:
    """The picture of each (entity, camera, boundary), in that order but for those that the camera does not draw.

    None come if the city is no longer to be had exactly as it was, or if no plug-in draws pictures. Raises
    `InfrastructureError` if the camera cannot work here.
    """
    instance, host = trace.header.instance, PluginHost()
    city = city_of(trace) if wanted else None
    name = select_engines(instance, host).sensor
    if city is None or name is None:
        return
    engines = start_engines(host, (name,))
    try:
        sensor = Sensor(name, engines[name])
        sensor.reset(instance, city)
        for entity, camera, record in wanted:
            now = record.snapshots[-1]
            sensor.settle(now.time_s, now.states + now.ambient)
            request = CaptureRequest(
                frame=f"l{record.tick}-{entity}-{camera}", entity=entity, camera=camera, tick=record.tick,
                time_s=now.time_s,
            )  # fmt: skip
            picture = sensor.picture(request)
            if picture is not None:
                yield picture
    finally:
        close_engines(engines)
