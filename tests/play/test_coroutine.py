"""Episodes as coroutines: the digests of `run`, two episodes at a time, and the trace of a cancelled one."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

import lingjing
from lingjing import UsageError
from lingjing.testing import shortened

pytestmark = pytest.mark.slow


@pytest.mark.usefixtures("workers_are_interpreters_once")
async def test_concurrent_episodes_have_the_digest_of_run(tmp_path: Path) -> None:
    mission = shortened("ssr", 3)
    alone = lingjing.run(mission, seed=1, policy="random", overview=False, out=tmp_path / "alone")
    beats = 0

    async def beat() -> None:
        nonlocal beats
        while True:
            beats += 1
            await asyncio.sleep(0.01)

    beating = asyncio.create_task(beat())
    first, second = await asyncio.gather(
        *(
            lingjing.arun(mission, seed=seed, policy="random", overview=False, out=tmp_path / str(seed))
            for seed in (1, 2)
        )
    )
    beating.cancel()
    assert beats > 1  # the loop was free meanwhile
    assert first.digest == alone.digest != second.digest


async def test_a_cancelled_episode_closes_its_trace(tmp_path: Path) -> None:
    started = asyncio.Event()
    loop, ticks = asyncio.get_running_loop(), []

    def progress(state: object) -> None:
        ticks.append(state)
        loop.call_soon_threadsafe(started.set)

    playing = asyncio.create_task(
        lingjing.arun("ssr", policy="random", overview=False, out=tmp_path, world="inline", progress=progress)
    )
    await started.wait()
    playing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await playing
    trace = lingjing.read(tmp_path)
    assert trace.outcome is not None
    assert trace.outcome.reason == "interrupted"
    assert not trace.complete
    assert 0 < len(ticks) < 60


async def test_arun_raises_the_same_errors_as_run() -> None:
    with pytest.raises(UsageError, match="no mode 'loud'"):
        await lingjing.arun("ssr", mode="loud")
    with pytest.raises(TypeError, match="unexpected keyword argument 'speed'"):
        await lingjing.arun("ssr", speed=2)  # type: ignore[call-arg]
