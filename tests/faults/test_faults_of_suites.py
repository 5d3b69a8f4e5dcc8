"""Ten of the hundred faults that every run of the tests plants: episodes in several processes, and suites."""

import sys

import pytest

from tests.faults.planted import assert_all_end_well


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")
def test_faults_of_episodes_in_several_processes_and_of_suites_are_handled_correctly() -> None:
    assert_all_end_well(10, "process", "suite")
