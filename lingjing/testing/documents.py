"""Missions as JSON for tests: `mission.json`, and the paper's `resetScenario` documents with their templates."""

from __future__ import annotations

from lingjing.dsl.loading.load import templates_beside
from lingjing.mission.document import decode, encode, read

__all__ = ["decode", "encode", "read", "templates_beside"]
