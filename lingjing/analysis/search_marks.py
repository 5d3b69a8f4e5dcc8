"""Metrics of a search, from the paper's table of diagnostic metrics.

*Redundant revisit rate*, "number of search visits to cells that were already covered, divided by all search visits": a
visit is a downward picture from above a cell that the entity was not above in its previous picture. The visit is
redundant if an earlier picture of any entity covered the cell.

*Area coverage* is no metric of the paper: its cells count as visited by one picture from above any of their points,
however little of them it shows. Here the footprints of all pictures are united (ADR 0054).

*Communication at discovery events*, "number of messages aligned with a validated target discovery event, divided by all
evaluated messages": a discovery is the first report of a target that a matching rule accepts. The messages of its tick,
counted once for each recipient, are aligned with it.
"""

from __future__ import annotations

from lingjing.analysis.detection import matching_rules, ratio, shots
from lingjing.analysis.memo import cache_by_trace
from lingjing.kernel.registry import DOWNWARD_DEG, cells_at
from lingjing.trace.reader import Trace


def redundant_revisit_rate(trace: Trace) -> float | None:
    """Return the share of redundant visits, or None if agents observe no cells or visited none."""
    instance = trace.header.instance
    grids = {channel.name for agent in instance.agents for channel in agent.observes if channel.source == "grid"}
    cells = [cell for cell in instance.cells if cell.grid in grids]
    above: dict[str, set[str]] = {}
    covered: set[str] = set()
    visits = redundant = 0
    for frame in shots(trace):
        if frame.pose.tilt_deg < DOWNWARD_DEG:
            continue
        here = {cell.name for cell in cells_at(cells, frame.pose.position[0], frame.pose.position[1])}
        entered = here - above.get(frame.entity, set())
        visits += len(entered)
        redundant += len(entered & covered)
        above[frame.entity] = here
        covered |= here
    return ratio(redundant, visits)


@cache_by_trace
def area_coverage(trace: Trace) -> float | None:
    """Return the share of the ground of the observed cells that pictures showed, or None if agents observe no cells."""
    instance = trace.header.instance
    grids = {channel.name for agent in instance.agents for channel in agent.observes if channel.source == "grid"}
    cells = [cell.polygon for cell in instance.cells if cell.grid in grids]
    if not cells:
        return None
    from lingjing.scene.ground_coverage import seen_share  # loads shapely, which most traces need not wait for

    return seen_share(cells, [frame.pose for frame in shots(trace)], instance.scene.datum_m)


def discoveries(trace: Trace) -> dict[str, int]:
    """Return the tick of the first matched report of each discovered target."""
    rules = matching_rules(trace)
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    ticks: dict[str, int] = {}
    for record in trace.boundaries:
        for event in record.events:
            if event.kind in rules:
                for name in targets & set(event.bindings):
                    ticks.setdefault(name, record.tick)
    return ticks


def communication_at_discovery(trace: Trace) -> float | None:
    """Return the share of messages that were sent in a tick with a discovery, or None if there were no messages."""
    ticks = set(discoveries(trace).values())
    sent = [edge.tick for record in trace.boundaries for edge in record.messages]
    return ratio(sum(tick in ticks for tick in sent), len(sent))
