"""Limits of money and tokens: never exceeded, by threads and processes together, and valid after a kill."""

import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import pytest

from lingjing.errors import UsageError
from lingjing.play.spending import Amount, SpendingAccount, SpendingLimits
from lingjing.plugins.calls import SpendingLimitError
from lingjing.trace.calls import CallRequest, CallResult

REQUEST = CallRequest(tick=0, number=0, head=b"{}", messages=(), most_usd=1.0, most_tokens=1000)
CHEAP = CallResult(cost_usd=0.25, prompt_tokens=100, completion_tokens=10)


def test_a_reservation_counts_until_it_is_settled() -> None:
    limits = SpendingLimits(2.5, None)
    limits.reserve(REQUEST)
    limits.reserve(REQUEST)
    with pytest.raises(SpendingLimitError, match=r"^money: the limit of \$2.5 does not cover another call: \$2.0000"):
        limits.reserve(REQUEST)
    limits.settle(REQUEST, CHEAP)
    limits.settle(REQUEST, CHEAP)
    assert limits.spent() == Amount(0.5, 220)
    limits.reserve(REQUEST)


def test_no_sequence_of_answers_passes_a_limit() -> None:
    limits, spent = SpendingLimits(10.0, None), 0.0
    with pytest.raises(SpendingLimitError):
        for turn in range(100):
            limits.reserve(REQUEST)
            cost = (turn * 37 % 101) / 100
            limits.settle(REQUEST, CallResult(cost_usd=cost, prompt_tokens=1))
            spent += cost
    assert 9.0 < spent <= 10.0


def test_calls_that_may_have_been_billed_count_in_full() -> None:
    limits = SpendingLimits(10.0, None)
    limits.reserve(REQUEST)
    limits.settle(REQUEST, CallResult(failure="no answer", fault="time", attempts=3, unknown_usd=3.0))
    assert limits.spent().usd == 3.0
    limits.reserve(REQUEST)
    limits.settle(REQUEST, CallResult(failure="refused", fault="service"))
    assert limits.spent().usd == 3.0


def test_tokens_are_limited_too() -> None:
    limits = SpendingLimits(None, 1500)
    limits.reserve(REQUEST)
    with pytest.raises(SpendingLimitError, match=r"^tokens: the limit of 1500"):
        limits.reserve(REQUEST)


CHILD = """
import sys
from pathlib import Path
from lingjing.play.spending import SpendingLimits
from lingjing.plugins.calls import SpendingLimitError
from lingjing.trace.calls import CallRequest, CallResult
asked = CallRequest(tick=0, number=0, head=b"{}", messages=(), most_usd=1.0, most_tokens=1)
limits, calls = SpendingLimits(100.0, None, Path(sys.argv[1])), 0
try:
    while True:
        limits.reserve(asked)
        if sys.argv[2:] == ["die"]:
            import os, signal
            os.kill(os.getpid(), signal.SIGKILL)
        limits.settle(asked, CallResult(cost_usd=0.5, prompt_tokens=1))
        calls += 1
except SpendingLimitError:
    print(calls)
"""


def test_processes_that_share_a_ledger_are_counted_together(tmp_path: Path) -> None:
    command = [sys.executable, "-c", CHILD, str(tmp_path / "ledger")]
    children = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(3)]
    calls = sum(int(child.communicate()[0]) for child in children)
    assert 197 <= calls <= 199  # the last dollar of each may be set aside
    again = SpendingLimits(100.0, None, tmp_path / "ledger")
    assert again.spent() == Amount(calls * 0.5, calls)


def test_the_reservation_of_a_killed_process_counts_as_spent(tmp_path: Path) -> None:
    path = tmp_path / "ledger"
    subprocess.run([sys.executable, "-c", CHILD, str(path), "die"], check=False)
    assert msgspec.json.decode(path.read_bytes(), type=SpendingAccount).spent.usd == 0.0
    limits = SpendingLimits(100.0, None, path)
    assert limits.spent() == Amount(1.0, 1)
    assert msgspec.json.decode(path.read_bytes(), type=SpendingAccount).held == {}


def test_threads_are_counted_together() -> None:
    limits = SpendingLimits(100.0, None)
    made: list[int] = []

    def ask() -> None:
        try:
            while True:
                limits.reserve(REQUEST)
                limits.settle(REQUEST, CHEAP)
                made.append(1)
        except SpendingLimitError:
            return

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) * 0.25 == limits.spent().usd
    assert 95.0 <= limits.spent().usd <= 100.0


def test_a_file_that_is_no_ledger_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "ledger").write_text("hello")
    with pytest.raises(UsageError, match="is not a ledger"):
        SpendingLimits(1.0, None, tmp_path / "ledger").reserve(REQUEST)
