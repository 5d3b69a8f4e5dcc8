"""The one word that a `resetScenario` says about the weather, and what a mission says in numbers.

A word stands for a range of visibility and cloud; it changes a mission only where the mission's own numbers do not
already fit it. Bounds of visibility are those of aviation reports (fog below 1 km, haze and mist below 5 km: WMO-No.
306, code table 4678); cloud is the covered fraction of the sky.
"""

from __future__ import annotations

import math
import unicodedata
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Sky:
    """A word's ranges, upper ends excluded, and the values it sets in a mission that does not fit."""

    word: str
    visibility_m: tuple[float, float]
    cloud: tuple[float, float]
    typical_visibility_m: float
    typical_cloud: float
    synonyms: tuple[str, ...]

    def fits(self, visibility_m: float, cloud: float) -> bool:
        """Whether the numbers are what the word means."""
        return self.visibility_m[0] <= visibility_m < self.visibility_m[1] and self.cloud[0] <= cloud < self.cloud[1]


RAINY = "Rain"

RAIN = ("rain", "rainy", "raining", "drizzle", "shower", "light rain", "heavy rain", "storm", "thunderstorm",
        "雨", "雨天", "下雨", "小雨", "中雨", "大雨", "暴雨", "阵雨", "雷雨")  # fmt: skip
"""Rain dims and covers the sky; no drops fall."""

SKIES = (
    Sky("Clear", (5_000, math.inf), (0.0, 0.4), 10_000, 0.1, ("clear", "sunny", "fine", "晴", "晴天")),
    Sky("Cloudy", (5_000, math.inf), (0.4, math.inf), 10_000, 0.7, ("cloudy", "overcast", "多云", "阴", "阴天")),
    Sky("Haze", (1_000, 5_000), (0.0, math.inf), 3_000, 0.4, ("haze", "hazy", "mist", "misty", "霾", "轻雾")),
    Sky(RAINY, (1_000, 10_000), (0.7, math.inf), 4_000, 0.9, RAIN),
    Sky("Fog", (0, 1_000), (0.0, math.inf), 500, 0.9, ("fog", "foggy", "雾", "大雾")),
)


def sky_of(word: str) -> Sky | None:
    """The sky a word names, or None if the word is not understood."""
    folded = unicodedata.normalize("NFKC", word).strip().casefold().replace("_", " ").replace("-", " ")
    return next((sky for sky in SKIES if folded in sky.synonyms), None)


def word_for(visibility_m: float, cloud: float) -> str:
    """The word for a mission's numbers."""
    return next((sky.word for sky in SKIES if sky.fits(visibility_m, cloud)), SKIES[0].word)
