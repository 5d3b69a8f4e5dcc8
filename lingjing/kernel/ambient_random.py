"""Use of the global random generators: detected by their states before and after a policy's call.

In the caller's process the generators of `random` and `numpy.random` are the caller's, and nothing seeds them for an
episode: a policy that draws from them gives another digest in each run.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Awaitable, Callable
from importlib import import_module
from typing import Any

GeneratorStates = tuple[object, object]
"""The states of `random` and of `numpy.random`; None for one that is not loaded."""


def generator_states() -> GeneratorStates:
    """The states of the global generators, to be compared."""
    # numpy loads the module when it is first used: another policy's thread may be loading it now.
    read = getattr(sys.modules.get("numpy.random"), "get_state", None)
    if read is None:
        return random.getstate(), None
    state = read(legacy=False)
    drawn = state["state"]
    return random.getstate(), (drawn["key"].tobytes(), drawn["pos"], state["has_gauss"], state["gauss"])


def load_generators() -> None:
    """Load the generators that are watched: a first use, which loads one, would not be seen."""
    import_module("numpy.random")


def watched(call: Callable[[], Awaitable[Any]], note: Callable[[], None]) -> Callable[[], Awaitable[Any]]:
    """The call; `note` is called if a global generator has moved on when it ends. Calls that run at the same time in
    one process cannot be told apart."""

    async def watch() -> Any:
        before = generator_states()
        try:
            return await call()
        finally:
            if has_moved(before, generator_states()):
                note()

    return watch


def has_moved(before: GeneratorStates, after: GeneratorStates) -> bool:
    """True if a generator that was loaded before is in another state."""
    return any(one is not None and one != other for one, other in zip(before, after, strict=True))
