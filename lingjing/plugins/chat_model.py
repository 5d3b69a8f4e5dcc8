"""How a chat model is declared that a policy plays with: what it is called, and what its tokens cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Tier = Literal["commercial", "open"]


@dataclass(frozen=True, slots=True)
class ModelPlugin:
    """A model that a suite may name as an entrant.

    `policy` plays it with `arguments` (`react` with `model=NAME`). `tier` is the group of a table in which its row
    stands. Prices are US dollars per million tokens: 0 for a model that one serves oneself, None where the price is not
    known. `image_tokens` is about how many tokens of a prompt a picture takes. `title` is the model's name in tables,
    and `key_variable` the environment variable that holds its service's key, if it needs one.
    """

    name: str
    policy: str
    arguments: Mapping[str, str] = field(default_factory=dict)
    tier: Tier = "open"
    price_in: float | None = None
    price_out: float | None = None
    image_tokens: int = 1500
    summary: str = ""
    title: str = ""
    key_variable: str = ""


__all__ = ["ModelPlugin", "Tier"]
