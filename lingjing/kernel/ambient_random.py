"""Detection of global random generators in policies, by their states before and after a call.

In the caller's process, nothing seeds the generators of `random` and `numpy.random` for an episode. A policy that draws
from them produces a different digest in each run.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Awaitable, Callable
from importlib import import_module
from typing import Any

GeneratorStates = tuple[object, object]
"""The states of `random` and of `numpy.random`; None for a module that is not loaded."""


def generator_states() -> GeneratorStates:
    """Return the states of the global generators, for comparison."""
    # numpy loads the module at its first use; another policy's thread may be loading it now.
    read = getattr(sys.modules.get("numpy.random"), "get_state", None)
    if read is None:
        return random.getstate(), None
    state = read(legacy=False)
    drawn = state["state"]
    return random.getstate(), (drawn["key"].tobytes(), drawn["pos"], state["has_gauss"], state["gauss"])


def load_generators() -> None:
    """Import the modules of the generators, and a library that draws from them when it is imported.

    Without this, a first use, which imports a generator, would go undetected. `rich` draws at its import, and `httpx`
    imports it: the first call to a chat model would be reported as a draw of its policy.
    """
    import_module("numpy.random")
    import_module("rich.style")


def with_detection(call: Callable[[], Awaitable[Any]], note: Callable[[], None]) -> Callable[[], Awaitable[Any]]:
    """Return the call with detection: `note` is called if a global generator has advanced when it ends.

    Calls that run at the same time in one process cannot be distinguished.
    """

    async def watch() -> Any:
        before = generator_states()
        try:
            return await call()
        finally:
            if generators_advanced(before, generator_states()):
                note()

    return watch


def generators_advanced(before: GeneratorStates, after: GeneratorStates) -> bool:
    """Return whether a generator that was loaded before is in another state."""
    return any(earlier is not None and earlier != later for earlier, later in zip(before, after, strict=True))
