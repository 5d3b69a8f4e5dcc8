"""Candidate outputs made plain: what a policy returned becomes a value that nobody else holds and a trace can keep.

A policy may hand over numpy scalars, lists, texts with lone surrogates, numbers that are not finite and novels for
thoughts. `received` copies a decision into plain data or replaces it by (no-op, no messages) as `malformed`. It does
not judge: a number that no file can spell (NaN, infinity, beyond 64 bits) stays visible as a text such as `"NaN"`, so
that the field which holds it is refused by validation, with a receipt, and is never mistaken for one left out.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from lingjing.trace.records import Decision, DecisionRecord

THOUGHT_LETTERS = 20_000
"""A longer thought is cut: it decides nothing, and the trace should stay readable."""

DECISION_BYTES = 1_000_000
"""A decision that is larger as JSON, its thought apart, is malformed."""

_WORD = 2**63


def received(made: DecisionRecord) -> DecisionRecord:
    """The record with its decision copied and made plain; a no-op with reason `malformed` if that cannot be done."""
    try:
        decision = plain(made.decision)
    except (msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError) as error:
        return msgspec.structs.replace(made, decision=Decision(), substituted="malformed", detail=f"{error}"[:300])
    return msgspec.structs.replace(made, decision=decision)


def plain(decision: Decision) -> Decision:
    """A copy of `decision` made of plain values alone.

    Raises `msgspec.ValidationError`, `TypeError`, `ValueError`, `OverflowError` or `RecursionError` if it does not
    fit the schema or `DECISION_BYTES`.
    """
    content = _spelled(msgspec.to_builtins(decision, enc_hook=_from_numpy))
    content["thought"] = str(content["thought"])[:THOUGHT_LETTERS]
    copy = msgspec.convert(content, Decision)
    size = len(msgspec.json.encode(msgspec.structs.replace(copy, thought="")))
    if size > DECISION_BYTES:
        raise ValueError(f"the decision has {size} bytes, at most {DECISION_BYTES}")
    return copy


def _from_numpy(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot stand in a decision")


def _spelled(value: Any) -> Any:
    """`value` with unspeakable numbers as texts and lone surrogates replaced."""
    if isinstance(value, str):
        return value if value.isascii() else value.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
    if isinstance(value, float):
        return value if math.isfinite(value) else _name(value)
    if isinstance(value, int):
        return value if -_WORD <= value < _WORD else _name(math.copysign(math.inf, 1 if value > 0 else -1))
    if isinstance(value, dict):
        return {_spelled(key): _spelled(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_spelled(item) for item in value]
    return value


def _name(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    return "Infinity" if value > 0 else "-Infinity"
