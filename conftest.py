"""What holds for every test: hypotheses are tried with the same examples everywhere and without a clock, for what a
loaded machine takes longer for is not wrong."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("lingjing", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("lingjing")
