"""The threads that policies run in."""

from __future__ import annotations

import asyncio
import gc
import os
import threading
import warnings

import pytest

from lingjing.kernel.barrier import AgentThread


async def _answer() -> int:
    return 4


def test_an_interrupt_while_a_thread_starts_leaves_no_coroutine_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(self: AgentThread) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(AgentThread, "_ready", interrupted)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        with pytest.raises(KeyboardInterrupt):
            AgentThread("a").submit(_answer)
        gc.collect()
    assert not told


def test_a_thread_answers() -> None:
    thread = AgentThread("a")
    try:
        assert thread.submit(_answer).result(timeout=600)[0] == 4
    finally:
        thread.close()


async def _lose_the_descriptor() -> int:
    os.close(asyncio.get_running_loop()._selector.fileno())  # type: ignore[attr-defined]
    return 5


def test_a_thread_whose_loop_is_broken_ends_without_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    """The traceback would be Python's own, in the middle of what a run prints."""
    told: list[object] = []
    monkeypatch.setattr(threading, "excepthook", told.append)
    thread = AgentThread("broken")
    future = thread.submit(_lose_the_descriptor)
    for running in [one for one in threading.enumerate() if one.name == "policy-broken"]:
        running.join(600)
        assert not running.is_alive()
    assert not told
    assert not future.done() or future.result()[0] == 5
