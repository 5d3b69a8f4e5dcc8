"""Chat models behind one small Protocol, so that `react` does not know which service answers.

`chat` (the values and `ModelClient`) → `capabilities` (what a model can do, by name) → `direct` (the OpenAI chat
protocol; `dialect` remembers what a service refuses to be told) or `through_litellm` (everything litellm speaks), both
over `wire` (one bounded HTTP exchange) → `guard` (nothing passes with a key or password in it: `redaction`; `address`
takes them out of URLs) → `retry` (backoff within a deadline).
"""
