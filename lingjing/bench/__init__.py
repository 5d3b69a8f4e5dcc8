"""Benchmark suites: many episodes, the rows of their results, and the tables made from the rows.

A *suite* is a TOML file that names missions, seeds and *entrants*. An entrant is a policy with its options and, for a
model policy, its model. A *column* is a mission in one mode, at given settings. A *condition* changes options or
settings for a comparison. A *cell* is one entrant in one column under one condition; it has one episode per seed. A
*row* is the stored result of one episode. Its *standing* is `counted`, `aborted` (the infrastructure failed, and the
episode is played again) or `lost` (aborted three times).

Modules in the order of a run:

- `suite`        reads a suite file and checks its form
- `columns`      missions in their modes, and at the values of their sweeps
- `planning`     looks up names and makes the cells
- `money`        estimates model calls, their price and their duration
- `model_check`  makes one real request in each column, before a suite
- `executors`, `on_ray`  play episodes in local processes or on a Ray cluster
- `countdown`, `durations`  estimate the remaining time and cost; `memory_watch` measures the memory of an episode
- `running`      plays the episodes that the folder lacks
- `services`     waits for services that are down
- `folder`       stores rows while the suite is played
- `rows`, `parquet`  rows, and their file format
- `evidence`, `version`  the seal of a row, and the versions of benchmark and missions; `auditing` checks them
- `merging`      joins the results of several machines
- `played`       rates and means of a cell, with `statistics` for intervals and tests
- `unresolved`   entrants with lost episodes, and the bounds of their rates
- `tables` ← `table_cells`, `paired_tests`, `failure_tables`, `controls_table`   the tables of the paper
- `exports`      Markdown, LaTeX, CSV and HTML
- `leaderboard`, `dataset_card`   a page that ranks entrants, and a description of the rows; `croissant`: for machines;
  `tensorboard_log`, `mlflow_log`: rows as curves
- `planting` → `planted` → `attribution`   episodes with planted faults, and a test of attribution methods on them
- `adversaries`  the matrix of adversaries and columns, and the sequential test of the worst
- `validity`     the studies of the project as one program of suites, with its record and tables
- `inspect_task`  a mission as a task of Inspect AI
- `playing`  plays a suite in one call of Python
- `prompt_search`  revises a policy's prompt on development episodes
- `frame_sets`   labelled sets of frames for detectors

Invariants: a seed is the same instance in every cell of a mission. A row is written completely or not at all. An
infrastructure abort never counts for or against an entrant, and every table reports it. An entrant with lost episodes
is neither ranked nor marked as best.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspect import Signature


class _CallablePackage(ModuleType):
    """The class of this package: `lingjing.bench(…)` plays a suite.

    An import of any module in here sets the attribute `bench` of `lingjing` to this package, so that a function under
    the same name would be overwritten by chance (ADR 0051).
    """

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Play a suite: `lingjing.bench.playing.bench`."""
        from lingjing.bench.playing import bench

        return bench(*arguments, **options)

    @property
    def __signature__(self) -> Signature:
        from inspect import signature

        from lingjing.bench.playing import bench

        return signature(bench)


sys.modules[__name__].__class__ = _CallablePackage
