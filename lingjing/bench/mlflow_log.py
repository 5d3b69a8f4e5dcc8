"""The rows of a suite as runs of MLflow: a run for each entrant and column, a step for each seed."""

from __future__ import annotations

import time
from importlib import import_module
from typing import Any, Self

from lingjing.bench.rows import SuiteRow
from lingjing.errors import UsageError


class MlflowLog:
    """A receiver of rows for `lingjing.bench(…, progress=…)`, which writes runs of an MLflow experiment.

    A run is `ENTRANT/MISSION-MODE`, a step is a seed, and each metric that is a number is one of the run. Its tags tell
    the policy, the model, the tier, the language and the versions of the benchmark and of the mission. Rows of aborted
    episodes are left out. `tracking_uri` is MLflow's, such as `sqlite:///mlflow.db`; None for the one of the
    environment. `close` ends the runs.

        with MlflowLog("small", "sqlite:///mlflow.db") as log:
            lingjing.bench("small.toml", out="runs/bench/small", progress=log)

    Raises `UsageError` if the package mlflow is not installed, and if MLflow refuses the experiment.
    """

    def __init__(self, experiment: str, tracking_uri: str | None = None) -> None:
        try:
            self._mlflow: Any = import_module("mlflow")
        except ImportError as error:
            raise UsageError("the log needs the package mlflow", hint="pip install mlflow") from error
        self._runs: dict[str, str] = {}
        try:
            self._client: Any = self._mlflow.MlflowClient(tracking_uri)
            present = self._client.get_experiment_by_name(experiment)
            self._experiment = present.experiment_id if present else self._client.create_experiment(experiment)
        except self._mlflow.MlflowException as error:
            raise UsageError(
                f"MLflow refuses the experiment `{experiment}`: {error}", hint="correct the tracking URI, or its store"
            ) from error

    def __call__(self, row: SuiteRow) -> None:
        """Write the metrics of a row."""
        metrics = row.report.metrics
        if row.standing == "aborted" or metrics is None:
            return
        run = f"{row.entrant}/{row.mission}-{row.mode}"
        run_id = self._runs.get(run) or self._runs.setdefault(run, self._created(run, row))
        now_ms = int(time.time() * 1000)
        metric = self._mlflow.entities.Metric
        numbers = [
            metric(name, float(value), now_ms, row.seed)
            for name, value in metrics.items()
            if isinstance(value, bool | int | float)
        ]
        self._client.log_batch(run_id, metrics=numbers)

    def close(self) -> None:
        """End all runs."""
        for run_id in self._runs.values():
            self._client.set_terminated(run_id)
        self._runs.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _created(self, name: str, row: SuiteRow) -> str:
        about = {
            "policy": row.policy,
            "model": row.model,
            "tier": row.report.tier,
            "language": row.language,
            "benchmark": row.benchmark,
            "mission_sha256": row.mission_sha256,
        }
        tags = {f"lingjing.{key}": str(value) for key, value in about.items() if value != ""}
        return str(self._client.create_run(self._experiment, run_name=name, tags=tags).info.run_id)


__all__ = ["MlflowLog"]
