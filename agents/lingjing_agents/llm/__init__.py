"""Chat models behind one small Protocol, so that `react` does not know which service answers.

`chat` (the values and `ModelClient`) → `capabilities` (what a model can do, by name) → `direct` (the OpenAI chat
protocol over httpx) or `through_litellm` (everything litellm speaks) → `retry` (backoff within a deadline).
"""
