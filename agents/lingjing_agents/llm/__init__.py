"""Chat models behind one small Protocol, so that `react` does not depend on a service.

Concepts. A *service* is an HTTP address that serves models. A *call* is one question of a policy, possibly answered
after several attempts. Calls are recorded in the trace, so that a replay needs no service.

Modules in the order of a call: `models` reads the known models and services (`models.toml` and a user's own list).
`picture_tokens` counts the tokens of pictures by the rules of that list. `options` are a policy's options for its
model, and the profile that results from both. `asking` makes the calls:
`AskedModel` records each, retries it (`retry`: backoff within a deadline) and sums up the cost. Below it are `chat`
(the wire form of a request) and the clients: `direct` (the OpenAI chat protocol; it stores parameters that a
service rejects) or `through_litellm` (all services of litellm). Both use `wire` (one bounded HTTP exchange), within the
service's `limits` and behind `guard`, which removes keys and passwords (`redaction`; `address` removes them from URLs).
`own_calls` and `model_server` record the calls of policies that speak to a model by themselves.
`probing` tests whether a service can be reached, independently of policies.
"""
