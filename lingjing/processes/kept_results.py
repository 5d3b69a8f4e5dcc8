"""Results that a process of a fork server computes once for the later ones.

A module sends a result to its server (`ForkServerClient.keep_result`), which keeps it in memory. Every process that the
server forks afterwards finds it here, policies included: so a result must hold nothing that a policy may not read.
"""

from __future__ import annotations

MOST_RESULTS = 64
"""The most kept results; the oldest is dropped. Chosen: a suite has fewer sets of policies."""

MOST_BYTES = 100_000
"""The size of the largest kept result, bytes. Chosen: each fork shares the memory."""

_results: dict[bytes, bytes] = {}


def keep_result(key: bytes, result: bytes) -> None:
    """Keep a result for this process and its later forks. A result above `MOST_BYTES` is not kept."""
    if len(key) + len(result) > MOST_BYTES:
        return
    _results.pop(key, None)
    _results[key] = result
    while len(_results) > MOST_RESULTS:
        del _results[next(iter(_results))]


def find_result(key: bytes) -> bytes | None:
    """Return the result with this key; None if there is none."""
    return _results.get(key)


__all__ = ["MOST_BYTES", "MOST_RESULTS", "find_result", "keep_result"]
