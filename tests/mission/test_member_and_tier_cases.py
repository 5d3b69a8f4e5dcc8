"""Missions with members, tiers, goods and radio that cannot be won have an error, and near ones that can have none."""

from __future__ import annotations

import pytest

from lingjing.testing import compile_text
from tests.mission.language_cases import Variant
from tests.mission.member_and_tier_cases import IMPOSSIBLE, WINNABLE, LandVariant

LEAK = "LJ0404"
"""A leak is no proof; the texts state no declassification."""


def errors(text: str) -> list[str]:
    """The messages of errors that are proofs."""
    diagnostics = compile_text(text).diagnostics
    return [item.message for item in diagnostics if item.severity == "error" and item.code != LEAK]


@pytest.mark.parametrize("variant", IMPOSSIBLE, ids=lambda variant: variant.name)
def test_an_impossible_variant_has_one_error(variant: Variant | LandVariant) -> None:
    assert len(errors(variant.text)) == 1


@pytest.mark.parametrize("variant", WINNABLE, ids=lambda variant: variant.name)
def test_a_winnable_variant_has_no_error(variant: Variant | LandVariant) -> None:
    assert errors(variant.text) == []


@pytest.mark.parametrize("name", ["tier-too-short", "tier-permit-late", "tier-limit-0"])
def test_a_tier_that_cannot_be_won_is_named(name: str) -> None:
    (message,) = errors(next(variant.text for variant in IMPOSSIBLE if variant.name == name))
    assert message.startswith("at tier 1, ")


def test_a_larger_displacement_of_the_scene_removes_the_proof() -> None:
    text = next(variant.text for variant in IMPOSSIBLE if variant.name == "demand-beyond-no-depot")
    assert errors(text) != []
    assert errors(text.replace("extent = 1500 m", "extent = 1500 m, displacement = 1 km")) == []
