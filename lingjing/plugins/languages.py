"""The languages of texts for agents: catalogues of sentences that a policy writes (`lingjing.mission.languages`)."""

from __future__ import annotations

from lingjing.mission.languages import ORIGINAL, WRITTEN, Phrases, phrases

__all__ = ["ORIGINAL", "WRITTEN", "Phrases", "phrases"]
