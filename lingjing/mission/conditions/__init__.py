"""Conditions of a mission: one reading of success, failure, rules, unlocks, permits, constraints and stages.

Concepts. A *leaf* is a part of a condition without `and`, `or`, `not` and quantifiers. It reads *quantities*; each
quantity has its *causes*, which change it (a verb, an interaction, a message, an event, an engine), and is hidden or
public. A condition *gates* something: the end of the episode, an event, a command. A `Need` is an event that must have
happened once a condition holds; the needs of a condition form a tree. An `Outline` is a mission or an instance with
its unknown values widened to bounds, so that one tree stands for every seed.

The checker of leaks, the proofs, the tasks of the oracle and the visibility of events read this package (ADR 0040).

Modules in control-flow order:

- `quantities`: quantities and causes. `declarations`: the declarations that conditions refer to, of a mission or an
  instance.
- `taint`: the changes of interactions that a hidden value permits, which are hidden too.
- `reads`: the leaves of one condition. `survey`: all conditions with their leaves and gates.
- `leaks`: hidden values that decide something which agents notice. `public_values`: every value that agents may learn.
  `exposures`: hidden values in those, in motions and in bodies of agents.
- `drawn_params`: the values of drawn params, and bounds where there are too many values.
- `spread`: places and numbers before the seed is known. `motion`: upper bounds of speed and flight time.
- `outline`: a mission (every seed) or an instance (one seed) in the form that the builder of needs and proofs read.
- `episode`: bounds of every quantity that hold during the whole episode.
- `listing`: the survey with bounds and declassifications, for people and other programs.
- `needs`: the tree of needs. `condition_needs`: its construction from a condition.
- `declared_values`: the numbers that nothing changes. `goals`: the tree of goals, for agents. `goal_reading`: its
  construction from the success of an instance; `leaf_goals`: from single comparisons and facts.
"""
