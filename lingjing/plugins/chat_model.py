"""The declaration of a chat model that a policy plays with: its name, its options and the price of its tokens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Tier = Literal["commercial", "open"]


@dataclass(frozen=True, slots=True)
class ModelPlugin:
    """A model that a suite may name as an entrant."""

    name: str
    policy: str
    """The policy that plays with it, such as `react`."""
    arguments: Mapping[str, str] = field(default_factory=dict)
    """The options of the policy, such as `model=NAME`."""
    tier: Tier = "open"
    """The group of its row in a table."""
    price_in: float | None = None
    """US dollars per million tokens of a request; 0 for a model that the user serves, None if it is not known."""
    price_out: float | None = None
    """US dollars per million tokens of an answer; as `price_in`."""
    image_tokens: int = 1500
    """Tokens of one picture in a request, about."""
    summary: str = ""
    title: str = ""
    """The model's name in tables."""
    key_variable: str = ""
    """The environment variable with the key of its service; "" if it needs none."""


__all__ = ["ModelPlugin", "Tier"]
