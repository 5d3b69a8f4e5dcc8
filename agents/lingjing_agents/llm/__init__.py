"""Chat models behind one small Protocol, so that `react` does not know which service answers.

`models` reads what is known of models and their services (`models.toml`, and a user's own list) → `options` is what a
policy is told of its model, and the profile that comes of both → `asking` asks it: `AskedModel` records each question,
retries (`retry`: backoff within a deadline) and bills. Below it are `chat` (the values and `ModelClient`), `direct`
(the OpenAI chat protocol; `dialect` remembers what a service refuses to be told) or `through_litellm` (everything
litellm speaks), both over `wire` (one bounded HTTP exchange), within the service's `limits` and behind `guard` (nothing
passes with a key or password in it: `redaction`; `address` takes them out of URLs). `probing` asks a service, apart
from any policy, if it can be reached.
"""
