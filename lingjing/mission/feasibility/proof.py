"""`Proof`: a reason why a mission cannot be won, with the arithmetic in its message."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

_OTHERS_SHOWN = 3
"""Further members of a group that a message names (chosen)."""

_SLACK = 1e-9
"""Relative and absolute slack of every comparison (chosen): an exactly sufficient amount is feasible."""


class Proof(msgspec.Struct, frozen=True):
    """One requirement that cannot be met."""

    code: str
    """The diagnostic code."""
    at: str
    """The path of the declaration at fault: `success`, `rule/rescued`, `stage/detect`, `asset/boat`, `target/victim`,
    `budget/ticks`, `relation/2` (counted from 0), `unlock/rescue`, `limit/moves`."""
    message: str
    hint: str = ""
    related: tuple[tuple[str, str], ...] = ()
    """Further paths, each with its relation to the proof."""
    subject: str = ""
    """The entity or message that the proof is about."""
    partly: bool = False
    """True if it holds in some modes of the mission, but not in its own one."""


def gathered(proofs: Iterable[Proof]) -> tuple[Proof, ...]:
    """One proof for all members of a group with the same proof: that of the first member, which names the others."""
    alike_proofs: dict[tuple[str, str], list[Proof]] = {}
    for proof in proofs:
        key = (proof.code, proof.subject.partition("[")[0] or f"{proof.at} {proof.message}")
        alike_proofs.setdefault(key, []).append(proof)
    return tuple(_for_all(alike) for alike in alike_proofs.values())


def _for_all(alike: list[Proof]) -> Proof:
    first = alike[0]
    others = [name for name in dict.fromkeys(proof.subject for proof in alike) if name != first.subject]
    if not others:
        return first
    shown = ", ".join(f"`{name}`" for name in others[:_OTHERS_SHOWN])
    more = f" and {len(others) - _OTHERS_SHOWN} more" if len(others) > _OTHERS_SHOWN else ""
    return msgspec.structs.replace(first, message=f"{first.message}; the same holds for {shown}{more}")


def exceeds(needed: float, available: float) -> bool:
    """True if the needed amount exceeds the available one by more than the slack."""
    return needed > available * (1.0 + _SLACK) + _SLACK


def both(needed: float, available: float) -> tuple[str, str]:
    """The two amounts with as many decimals as needed to differ; the needed one is rounded down."""
    for decimals in range(9):
        scale = 10.0**decimals
        low = int(needed * scale) / scale if needed < 1e12 else needed
        if low > available:
            return f"{low:,.{decimals}f}", spelled(available)
    return f"{needed!r}", f"{available!r}"


def spelled(amount: float) -> str:
    """A number for messages: a comma between thousands, no trailing zeros."""
    text = f"{amount:,.3f}".rstrip("0").rstrip(".")
    return text if text not in ("0", "-0") or amount == 0 else f"{amount:g}"
