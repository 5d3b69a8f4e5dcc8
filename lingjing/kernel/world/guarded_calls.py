"""The guarded call through which every engine method is called, and the errors of this boundary."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from typing import TypeVar

from lingjing.errors import InfrastructureError, LingjingError, UsageError, hint_of
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.foreign_errors import one_line
from lingjing.plugins.host import PluginHost
from lingjing.trace.records import Absent

OWN_ENGINES = "builtin"
"""The plug-in that offers the project's own engines."""

ResultT = TypeVar("ResultT")

Enter = Callable[[str, str], None]
"""A function that receives (engine, call) before each engine call. A worker stores them where the caller can read them
after a hang.
"""


def no_note(engine: str, call: str) -> None:
    """Do nothing: the `Enter` of a world that runs in the caller."""


def engine_error(engine: str, call: str, problem: str, *, hint: str = "") -> InfrastructureError:
    """Return the error for an engine that failed in one of its five methods, or in `start`, its factory."""
    return InfrastructureError(f"engine `{engine}` failed in {call}: {problem}", hint=hint, engine=engine)


def name_plugin(error: BaseException, host: PluginHost) -> None:
    """Add the plug-in of the engine that failed to the message of an error, unless it is this project's own."""
    engine = error.engine if isinstance(error, InfrastructureError) else ""
    plugin = host.sources.get(("lingjing_engines", engine), OWN_ENGINES)
    if plugin != OWN_ENGINES:
        named = f"engine `{engine}`"
        error.args = (str(error).replace(named, f"{named} of plug-in `{plugin}`", 1),)
        if isinstance(error, InfrastructureError) and not error.hint and not error.cause:  # it raised, or was too slow
            error.hint = "correct the engine: `check_engine` of the conformance kit tests it"


def guarded(enter: Enter, engine: str, call: str, action: Callable[[], ResultT]) -> tuple[ResultT, float]:
    """Return the result of `action` and its wall-clock seconds. Raises `InfrastructureError` with the engine's name.

    `SystemExit` counts as a failure of the engine. A `KeyboardInterrupt` belongs to the user and propagates.
    """
    enter(engine, call)
    started = time.perf_counter()
    try:
        result = action()
    except (Exception, SystemExit) as error:
        hint = hint_of(error) if isinstance(error, LingjingError) else ""
        raise engine_error(engine, call, one_line(error), hint=hint) from error
    return result, time.perf_counter() - started


def engine_seed(seed: int, engine: str) -> int:
    """Return the seed of an engine: the first 63 bits of SHA-256 over the mission's seed and the engine's path."""
    digest = hashlib.sha256(f"{seed}/engine/{engine}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def absent(request: CaptureRequest, reason: str) -> Absent:
    """Return the answer to a request without a picture; `reason` is `late` or `not_drawn`."""
    return Absent(entity=request.entity, camera=request.camera, tick=request.tick, reason=reason)


def no_episode() -> UsageError:
    """Return the error for a call between episodes."""
    return UsageError("no episode is running", hint="call reset first")


def no_sensor() -> UsageError:
    """Return the error for a capture without an installed sensor engine."""
    return UsageError("no installed engine draws pictures", hint="see `lingjing plugins`")
