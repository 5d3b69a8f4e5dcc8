"""Normalisation of policy outputs: a decision becomes a copy in plain values that a trace can store.

A policy may return numpy scalars, lists, texts with lone surrogates, numbers that are not finite and very long
thoughts. `normalise_decision` copies a decision into plain values or replaces it by (no-op, no messages) as
`malformed`. It does not judge the content. A number that no file can represent (NaN, infinity, beyond 64 bits) becomes
a text such as `"NaN"`. Validation then rejects its field with a receipt, instead of treating it as left out.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from lingjing.articles import with_article
from lingjing.decoding import converted
from lingjing.trace.records import Decision, DecisionRecord, Usage

THOUGHT_LETTERS = 20_000
"""Characters after which a thought is truncated. Chosen: thoughts decide nothing, and the trace should stay
readable.
"""

DECISION_BYTES = 1_000_000
"""Largest decision as JSON, without its thought. Chosen: far above any legal decision."""

_WORD = 2**63
"""Bound of a signed 64-bit integer."""


def normalise_decision(made: DecisionRecord) -> DecisionRecord:
    """Return the record with its decision as plain values, or with a no-op and the reason `malformed`."""
    try:
        decision = plain_copy(made.decision)
    except (msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError) as error:
        instead = Decision(usage=_plain_usage(made.decision))  # its calls were made all the same
        return msgspec.structs.replace(made, decision=instead, substituted="malformed", detail=f"{error}"[:300])
    return msgspec.structs.replace(made, decision=decision)


def _plain_usage(decision: Decision) -> Usage | None:
    """Return the usage of a decision that cannot be represented; None if the usage cannot either."""
    try:
        return plain_copy(Decision(usage=decision.usage)).usage
    except (msgspec.MsgspecError, TypeError, ValueError, OverflowError, RecursionError):
        return None


def plain_copy(decision: Decision) -> Decision:
    """Return a copy of `decision` in plain values.

    Raises `msgspec.ValidationError`, `TypeError`, `ValueError`, `OverflowError` or `RecursionError` if it does not fit
    the schema or `DECISION_BYTES`.
    """
    content = _representable(msgspec.to_builtins(decision, enc_hook=_from_numpy))
    content["thought"] = str(content["thought"])[:THOUGHT_LETTERS]
    copy = converted(content, Decision)
    size = len(msgspec.json.encode(msgspec.structs.replace(copy, thought="")))
    if size > DECISION_BYTES:
        raise ValueError(f"the decision has {size} bytes, at most {DECISION_BYTES}")
    return copy


def _from_numpy(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{with_article(type(value).__name__)} cannot stand in a decision")


def _representable(value: Any) -> Any:
    """Return `value` with numbers that JSON cannot represent as texts, and with lone surrogates replaced."""
    if isinstance(value, str):
        return value if value.isascii() else value.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
    if isinstance(value, float):
        return value if math.isfinite(value) else _name(value)
    if isinstance(value, int):
        return value if -_WORD <= value < _WORD else _name(math.copysign(math.inf, 1 if value > 0 else -1))
    if isinstance(value, dict):
        return {_representable(key): _representable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_representable(item) for item in value]
    return value


def _name(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    return "Infinity" if value > 0 else "-Infinity"
