"""Weather words of a `resetScenario`, and the numbers that they stand for.

A word stands for a range of visibility and cloud. It changes a mission only if the mission's own numbers are outside
that range. The bounds of visibility are those of aviation reports (fog below 1 km, haze and mist below 5 km: WMO-No.
306, code table 4678). Cloud is the covered fraction of the sky.
"""

from __future__ import annotations

import math
import unicodedata
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Sky:
    """A weather word with its ranges, upper ends excluded."""

    word: str
    visibility_m: tuple[float, float]
    """Range of visibility, metres."""
    cloud: tuple[float, float]
    """Range of the covered fraction of the sky."""
    typical_visibility_m: float
    """Visibility that it sets in a mission outside of the ranges, metres (chosen)."""
    typical_cloud: float
    """Cloud that it sets in a mission outside of the ranges (chosen)."""
    synonyms: tuple[str, ...]
    """Words for it in documents, in lower case."""

    def fits(self, visibility_m: float, cloud: float) -> bool:
        """True if the numbers are within the ranges."""
        return self.visibility_m[0] <= visibility_m < self.visibility_m[1] and self.cloud[0] <= cloud < self.cloud[1]


RAINY = "Rain"

RAIN = ("rain", "rainy", "raining", "drizzle", "shower", "light rain", "heavy rain", "storm", "thunderstorm",
        "雨", "雨天", "下雨", "小雨", "中雨", "大雨", "暴雨", "阵雨", "雷雨")  # fmt: skip
"""Synonyms of rain. Rain reduces visibility and covers the sky; no drops are drawn."""

SKIES = (
    Sky("Clear", (5_000, math.inf), (0.0, 0.4), 10_000, 0.1, ("clear", "sunny", "fine", "晴", "晴天")),
    Sky("Cloudy", (5_000, math.inf), (0.4, math.inf), 10_000, 0.7, ("cloudy", "overcast", "多云", "阴", "阴天")),
    Sky("Haze", (1_000, 5_000), (0.0, math.inf), 3_000, 0.4, ("haze", "hazy", "mist", "misty", "霾", "轻雾")),
    Sky(RAINY, (1_000, 10_000), (0.7, math.inf), 4_000, 0.9, RAIN),
    Sky("Fog", (0, 1_000), (0.0, math.inf), 500, 0.9, ("fog", "foggy", "雾", "大雾")),
)
"""The weather words in order of preference."""


def sky_of(word: str) -> Sky | None:
    """The sky that a word names, or None if the word is unknown."""
    folded = unicodedata.normalize("NFKC", word).strip().casefold().replace("_", " ").replace("-", " ")
    return next((sky for sky in SKIES if folded in sky.synonyms), None)


def word_for(visibility_m: float, cloud: float) -> str:
    """The word for a mission's numbers."""
    return next((sky.word for sky in SKIES if sky.fits(visibility_m, cloud)), SKIES[0].word)
