"""The one guarded call by which every engine method is called, and the words for what can go wrong there."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from typing import TypeVar

from lingjing.errors import InfrastructureError, LingjingError, UsageError
from lingjing.plugins.engine import CaptureRequest
from lingjing.trace.records import Absent

ResultT = TypeVar("ResultT")

Enter = Callable[[str, str], None]
"""Told (engine, call) before each engine call: a worker notes it where the caller can read it after a hang."""


def ignore(engine: str, call: str) -> None:
    """The `Enter` of a world that runs in the caller: nobody has to be told."""


def broken(engine: str, call: str, what: str, *, hint: str = "") -> InfrastructureError:
    """The error for an engine that failed in one of its five methods (or in `start`, its factory)."""
    return InfrastructureError(f"engine `{engine}` failed in {call}: {what}", hint=hint)


def guarded(enter: Enter, engine: str, call: str, action: Callable[[], ResultT]) -> tuple[ResultT, float]:
    """The result of `action` and the wall-clock seconds it took; raises `InfrastructureError` naming the engine.

    `SystemExit` counts as a failure of the engine; a `KeyboardInterrupt` is the user's and passes.
    """
    enter(engine, call)
    started = time.perf_counter()
    try:
        result = action()
    except (Exception, SystemExit) as error:
        hint = error.hint if isinstance(error, LingjingError) else ""
        raise broken(engine, call, _describe(error), hint=hint) from error
    return result, time.perf_counter() - started


def engine_seed(seed: int, engine: str) -> int:
    """The engine's own stream: the first 63 bits of SHA-256 over the mission's seed and the engine's path."""
    digest = hashlib.sha256(f"{seed}/engine/{engine}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def absent(request: CaptureRequest, reason: str) -> Absent:
    """The answer to a request that brought no picture: `late` or `not_drawn`."""
    return Absent(entity=request.entity, camera=request.camera, tick=request.tick, reason=reason)


def no_episode() -> UsageError:
    """The error for a call between episodes."""
    return UsageError("the world plays no episode", hint="call reset first")


def no_sensor() -> UsageError:
    """The error for a capture when nothing draws."""
    return UsageError("no installed engine draws pictures", hint="see `lingjing plugins`")


def _describe(error: BaseException) -> str:
    text = str(error)
    name = type(error).__name__
    return f"{name}: {text}" if text else name
