"""Missions that test themselves: the expectations of a mission, and what they are good for.

An *expectation* is a line of a mission's block `expect`: a policy wins or loses on some seeds, settings make the
mission infeasible, or the draws cover a region. A *check* is one expectation of one file, ready to be run; its result
is passed, failed, error (it cannot be evaluated) or aborted (the infrastructure failed).

Modules in the order of a run:

- `checks`        checks of missions, their names, and the selection of some (`-k`)
- `shares`        decides a check on episodes as soon as its share is certain
- `impossible`    settings for which a condition holds, and their proofs
- `coverage`      the share of a region that drawn positions cover
- `running`       runs checks; episodes run in processes of their own
- `junit`         results as JUnit XML
- `composing`     a seed → the text of a mission
- `screening`     tests a composed mission and writes its certificate
- `drafting`      a sentence → a mission, in a conversation with a chat model

An infrastructure abort never passes or fails a check. A check is decided in the order of its seeds, so that its result
does not depend on the number of processes.
"""
