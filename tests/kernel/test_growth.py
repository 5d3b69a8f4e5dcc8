"""The cost of a boundary depends on its own events, not on the length of the episode."""

import sys

import msgspec

from lingjing.testing import does, says, together
from lingjing.testing import rescue as kit


def chatter(tick):
    """Return two good reports, two bad ones, two orders and two commands at every other boundary, pictures in
    between.
    """
    made = []
    for number, east in ((1, 100.0), (2, -100.0)):
        order = says("order", assignee="boat", position=(280.0, float(tick % 90)))
        frame = f"f{tick - 1}-uav[{number}]-nadir"
        if tick % 2:
            made.append(together(does("takePhoto"), order))
        else:
            good, bad = kit.report(frame, position=(east, tick * 0.01)), kit.report(frame, box=(0.0, 0.0, 0.1, 0.1))
            made.append(together(good, bad, order, does("go", x=east, y=0.0)))
    return kit.decisions(scout_1=made[0], scout_2=made[1])


def calls(kernel, tick):
    """Return the Python function calls of one boundary: a measure that no other program disturbs."""
    count = 0

    def counted(frame, event, argument):
        nonlocal count
        count += event == "call"

    sys.setprofile(counted)
    try:
        kernel.step(chatter(tick))
    finally:
        sys.setprofile(None)
    return count


def test_a_late_boundary_costs_no_more_than_an_early_one():
    instance = kit.instance(victims=((100.0, 0.0), (-100.0, 0.0), (250.0, 250.0)), ticks=10_000)
    kernel = kit.kernel(msgspec.structs.replace(instance, clock=msgspec.structs.replace(instance.clock, sync_s=5.0)))
    kernel.reset()
    cost = {}
    for tick in range(1, 402):
        if tick in (40, 41, 400, 401):
            cost[tick] = calls(kernel, tick)
        else:
            kernel.step(chatter(tick))
    assert len(kernel.state.registry.reports) > 1000
    assert cost[400] <= 1.3 * cost[40]
    assert cost[401] <= 1.3 * cost[41]
