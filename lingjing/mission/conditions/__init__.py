"""Conditions of a mission: one reading of success, failure, rules, unlocks, permits, constraints, stages and limits.

Concepts. A `Need` is an event that must have happened once a condition holds; the needs of a condition form a tree. An
`Outline` is a mission or an instance with its unknown values widened to bounds, so that one tree stands for every seed.

Modules in control-flow order:

- `spread`: places and numbers before the seed is known. `motion`: upper bounds of speed and flight time.
- `outline`: a mission (every seed) or an instance (one seed) in the form that the builder of needs and proofs read.
- `needs`: the tree of needs. `condition_needs`: its construction from a condition.
"""
