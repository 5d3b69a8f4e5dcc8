"""The threads that policies run in."""

from __future__ import annotations

import gc
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
