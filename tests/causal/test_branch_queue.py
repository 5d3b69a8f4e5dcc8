"""Branches begun ahead: reported only on request, and ended when they are not needed any more."""

import os
import signal
import socket
import time
from collections.abc import Iterator

import msgspec
import pytest

from lingjing.causal.branch_queue import BranchQueue, introduce
from lingjing.causal.branching import BranchResult
from lingjing.causal.interventions import BranchPlan
from lingjing.processes.channel import Channel

ENDLESS = 90
"""The boundary of branches that never end."""
SILENT = 80
"""The boundary of branches that end without a result."""


class Branches:
    """Starts branches that report their first boundary."""

    def __init__(self) -> None:
        self.begun: list[int] = []
        self.pids: list[int] = []

    def begin(self, plan: BranchPlan) -> Channel:
        ours, theirs = map(Channel, socket.socketpair())
        self.begun.append(plan.at)
        pid = os.fork()
        if pid == 0:
            try:
                ours.close()
                if plan.at != ENDLESS:
                    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it ends by itself
                if plan.at != SILENT:
                    introduce(theirs)
                    while plan.at == ENDLESS:
                        time.sleep(60.0)
                    theirs.send(msgspec.msgpack.encode(BranchResult(ticks=plan.at, cpu_s=1.0)))
            finally:
                os._exit(0)
        self.pids.append(pid)
        theirs.close()
        return ours


@pytest.fixture
def branches() -> Iterator[Branches]:
    made = Branches()
    yield made
    for pid in made.pids:
        os.kill(pid, signal.SIGTERM)  # comes too late for one that the queue has ended
    ended = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in made.pids]
    assert -signal.SIGTERM not in ended, "a branch was left running"


def played(queue: BranchQueue, plans: list[int], ahead: tuple[int, ...] = ()) -> list[BranchResult]:
    results: dict[int, BranchResult] = {}
    queue.play([BranchPlan(at=at) for at in plans], [BranchPlan(at=at) for at in ahead], results.__setitem__)
    return [results[number] for number in range(len(plans))]


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_each_plan_has_its_result_for_any_number_of_jobs(branches: Branches, jobs: int) -> None:
    queue = BranchQueue(branches.begin, jobs)
    assert [result.ticks for result in played(queue, [3, 1, 2, 1])] == [3, 1, 2, 1]
    assert [result.ticks for result in played(queue, [1])] == [1]
    assert sorted(branches.begun) == [1, 1, 2, 3]
    queue.close()


def test_one_worker_begins_nothing_ahead(branches: Branches) -> None:
    queue = BranchQueue(branches.begin, 1)
    played(queue, [1, 2], ahead=(7,))
    assert branches.begun == [1, 2]
    queue.close()


def test_a_branch_that_was_begun_ahead_is_played_once(branches: Branches) -> None:
    queue = BranchQueue(branches.begin, 2)
    played(queue, [1], ahead=(7, 8))
    assert branches.begun[:2] == [1, 7]
    assert [result.ticks for result in played(queue, [7])] == [7]
    assert branches.begun.count(7) == 1
    queue.close()


def test_branches_that_are_no_longer_needed_are_ended_and_free_their_workers(branches: Branches) -> None:
    queue = BranchQueue(branches.begin, 2)
    played(queue, [1], ahead=(ENDLESS,))
    assert [result.ticks for result in played(queue, [2, 3])] == [2, 3]
    assert queue.unused_s > 0.0
    played(queue, [4], ahead=(ENDLESS,))
    queue.close()


def test_a_branch_that_ends_without_a_result_is_reported_as_failed(branches: Branches) -> None:
    queue = BranchQueue(branches.begin, 2)
    (result,) = played(queue, [SILENT])
    assert "without a result" in result.failed
    queue.close()
