"""Suites of many episodes: entrants x missions x modes x conditions x seeds, and the tables that are made of them.

`suite` reads what people write → `planning` looks its names up and makes cells of it (`columns` are missions in their
modes and at the values of their sweeps) → `money` reckons what it will cost → `running` plays what a `folder` does not
have yet, through an executor of `executors` or `on_ray`, and says with `countdown` how long the rest takes → `rows` are
what is kept, as `parquet` → `played` is what a cell's rows amount to, with `statistics` for intervals and tests →
`tables` of `table_cells`, with `paired_tests` and `failure_tables`, and with what `unresolved` says of lost episodes →
`exports`. `merging` joins results, `leaderboard`
ranks their entrants on a page, `dataset_card` describes them. `planting` makes the episodes of `planted`, by which
`attribution` measures methods that say what made an episode fail. `prompt_search` improves a policy's prompt on
development episodes ← `failed_episode`. `frame_sets` makes labelled sets of traces' frames.
In: a TOML file; out: rows that one can query, tables in the paper's form.

Invariants: a seed is the same instance in every cell of a mission; a row is written whole or not at all; an
infrastructure abort never counts for or against an entrant, and is never hidden; an entrant with lost episodes is
neither ranked nor marked as best.
"""
