"""Pictures that were not taken during an episode, rendered from its trace.

A picture is a function of the city and the states, and the trace holds the states of every boundary, including
background traffic. So the camera can be set to any recorded state.
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
from lingjing.trace.occurrences import recorded_occurrences
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord


def redraw(trace: Trace, views: Sequence[tuple[str, str, BoundaryRecord]]) -> Iterator[StoredFrame]:
    """Yield the picture of each (entity, camera, boundary) in order, without those that the camera does not render.

    Yields nothing if the city cannot be rebuilt exactly, or if no plug-in renders pictures. Raises
    `InfrastructureError` if the camera cannot work here.
    """
    instance, host = trace.header.instance, PluginHost()
    city = city_of(trace) if views else None
    name = select_engines(instance, host).sensor
    if city is None or name is None:
        return
    engines = start_engines(host, (name,))
    try:
        sensor = Sensor(name, engines[name])
        sensor.reset(instance, city)
        for entity, camera, record in views:
            now = record.snapshots[-1]
            occurrences = recorded_occurrences(trace.boundaries, record.tick)
            sensor.move_to(now.time_s, now.states + now.ambient, occurrences)
            request = CaptureRequest(
                frame=f"l{record.tick}-{entity}-{camera}", entity=entity, camera=camera, tick=record.tick,
                time_s=now.time_s,
            )  # fmt: skip
            picture = sensor.picture(request)
            if picture is not None:
                yield picture
    finally:
        close_engines(engines)
