"""Ninety of the hundred faults that every run of the tests plants: episodes that play in one process.

`test_faults_of_suites` has the others: two files, so that two workers share them.
"""

import sys

import pytest

from tests.faults.planted import assert_all_end_well


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")
def test_faults_of_episodes_in_one_process_are_handled_correctly() -> None:
    assert_all_end_well(90, "trip", "chat")
