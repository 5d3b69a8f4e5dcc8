"""Forks in mid-episode: a branch without changes ends with its parent's digest, a branch with changes does not."""

import pytest

from lingjing.kernel.step import Kernel
from lingjing.testing import PluginHost, city_of, instantiate
from lingjing.testing.worlds import open_world
from lingjing.trace.records import Action, Decision, DecisionRecord


@pytest.fixture(scope="module")
def host():
    return PluginHost()


@pytest.fixture
def kernel(host):
    instance = instantiate("ssr", seed=7)
    world = open_world("process", host=host)
    kernel = Kernel(instance, city_of(instance.scene, host), world)
    kernel.reset()
    yield kernel
    world.close()


def deciding(tick):
    """Return the decisions of a tick: at first moves for all agents, at tick 6 one photograph, otherwise nothing."""
    moves = {
        "scout[1]": Action(verb="setDestination", arguments={"x": 250.0, "y": -800.0, "z": 100.0}),
        "scout[2]": Action(verb="setDestination", arguments={"x": 450.0, "y": -780.0, "z": 90.0}),
        "skipper": Action(verb="moveTo", arguments={"x": 100.0, "y": -1200.0}),
    }
    if tick == 0:
        return tuple(DecisionRecord(agent=name, decision=Decision(command=move)) for name, move in moves.items())
    if tick == 6:
        photo = Decision(command=Action(verb="takePhoto"))
        return (DecisionRecord(agent="scout[1]", decision=photo),)
    return ()


def played(kernel, start, stop, change=()):
    """Return the digests of the records and of the pictures after each tick."""
    digests = []
    for tick in range(start, stop):
        record = kernel.step(change if change and tick == start else deciding(tick)).record
        digests.append((record.digest, kernel.state.frames_digest))
    return digests


def test_a_null_fork_of_the_real_engines_and_its_parent_have_the_digests_of_an_unforked_run(kernel):
    unforked = played(kernel, 0, 8)
    kernel.reset()
    assert played(kernel, 0, 4) == unforked[:4]
    branch = kernel.fork()
    child, parent = played(branch, 4, 8), played(kernel, 4, 8)
    branch.world.close()
    assert child == parent == unforked[4:]
    assert len({digest for digest, _ in unforked}) == 8


def test_forks_with_other_decisions_have_other_digests_than_their_parent(kernel):
    played(kernel, 0, 3)
    branch, control = kernel.fork(), kernel.fork()
    stop = (DecisionRecord(agent="skipper", decision=Decision(command=Action(verb="stop"))),)
    other = (DecisionRecord(agent="scout[3]", decision=Decision(command=Action(verb="takeoff"))),)
    changed = played(branch, 3, 6, other)
    refused = played(control, 3, 4, stop)
    parent = played(kernel, 3, 6)
    branch.world.close()
    control.world.close()
    assert changed[0] != parent[0]
    assert refused[0] != parent[0]  # the fork must also repeat the receipt of the refusal
