"""Signals: deferred to the end of a block, and left to the parent process."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from lingjing.processes.signals import deferring_signals


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_deferred_to_the_end_of_the_block(number):
    def interrupt(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(number, interrupt)
    done = []
    try:
        with pytest.raises(KeyboardInterrupt), deferring_signals():
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), number)
            done.append("written")
        assert done == ["written"]
        assert signal.getsignal(number) is interrupt
    finally:
        signal.signal(number, before)


def test_a_recording_handler_does_not_replace_a_raising_one():
    """A handler that only records a signal does not prevent a later handler from raising."""

    def interrupt(number, frame):
        raise KeyboardInterrupt

    before = {number: signal.signal(number, handler) for number, handler in NOTED.items()}
    before[signal.SIGHUP] = signal.signal(signal.SIGHUP, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt), deferring_signals():
            for number in before:
                os.kill(os.getpid(), number)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


NOTED = dict.fromkeys((signal.SIGINT, signal.SIGTERM), lambda number, frame: None)


def test_an_error_within_the_block_precedes_the_signal():
    with pytest.raises(OSError, match="full"), deferring_signals():
        os.kill(os.getpid(), signal.SIGINT)
        raise OSError("full")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ignored_signals_and_other_threads_are_unaffected():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with deferring_signals():
            os.kill(os.getpid(), signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        ran = []

        def work():
            with deferring_signals():
                ran.append(signal.getsignal(signal.SIGINT))

        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        assert ran == [signal.default_int_handler]
    finally:
        signal.signal(signal.SIGHUP, before)


WORKER = """
import os, signal
from lingjing.processes.signals import blocked_signals, leave_interrupts_to_parent
with blocked_signals():
    leave_interrupts_to_parent()
    os.kill(os.getpid(), signal.SIGINT)
print("goes on", signal.getsignal(signal.SIGINT) == signal.SIG_IGN, flush=True)
"""


def test_a_worker_leaves_interrupts_to_its_parent():
    done = subprocess.run([sys.executable, "-c", WORKER], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "goes on True\n", "")
