"""The dataset card of results: the meaning of the columns, the origin of the rows, and the limits of the data."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from lingjing.analysis.metrics import table as metrics_table
from lingjing.analysis.played_city import credit
from lingjing.bench.exports import escape_markdown, to_markdown
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import cost_of
from lingjing.bench.tables import make_tables

PAPER = "Lingjing: A Simulation Testbed for Multi-Agent Embodied Tasks in Open-Ended Cities"
"""The title of the paper."""

_FIELDS = (
    ("entrant, mission, mode, condition, seed", "identify the episode; a seed is the same instance for all entrants"),
    ("tries, standing", "number of the try; `counted`, `aborted` (played again) or `lost` (the third abort)"),
    ("policy, model, privileged", "the policy and its model; true if it observes the ground truth"),
    ("served", "the models that the service named in its answers"),
    (
        "policy_seed, salt_sha256",
        "seed of the policies' own random streams; fingerprint of the salt that it depends on",
    ),
    ("code, version", "SHA-256 over all code and missions that decide an episode; lingjing's version"),
    ("wall_s", "duration in wall-clock seconds, which includes the load of the machine"),
    ("attention_iou", "IoU of the attention maps beside the trace; null without maps"),
    ("digest, frames_digest", "digest of the decisions, states, messages and events; digest of the pixels"),
    ("settings, options, report", "JSON: parameters of the mission, all options, the complete report"),
)
"""Columns of the Parquet file, and their meaning."""


def column_meanings() -> dict[str, str]:
    """Return the meaning of each column of the Parquet file that is no metric, by name."""
    return {name: text for names, text in _FIELDS for name in names.split(", ")}


def dataset_card(rows: Sequence[SuiteRow], about: str = "") -> str:
    """Return the card in Markdown, with the YAML header that dataset hubs read."""
    return "\n".join([*_head(rows), *_made_of(rows, about), *_columns(), *_results(rows), *_limits(rows)]) + "\n"


def _head(rows: Sequence[SuiteRow]) -> Iterator[str]:
    size = len(rows)
    classes = ("n<1K", "1K<n<10K", "10K<n<100K", "100K<n<1M")
    name = f"Lingjing results: {rows[0].suite if rows else 'none'}"
    yield "---"
    yield f"pretty_name: {json.dumps(name)}"
    yield "tags: [embodied-agents, multi-agent, simulation, benchmark]"
    yield f"size_categories: [{classes[min(3, max(0, len(str(size)) - 3))]}]"
    yield "configs: [{config_name: default, data_files: results.parquet}]"
    yield "---"
    yield f"\n# {escape_markdown(name)}\n"


def _made_of(rows: Sequence[SuiteRow], about: str) -> Iterator[str]:
    standings = Counter(row.standing for row in rows)
    if about:
        yield f"{escape_markdown(' '.join(about.split()))}\n"
    yield (
        f"{len(rows)} episodes of missions for unmanned systems in simulated cities, as specified in *{PAPER}*: "
        f"{standings['counted']} counted, {standings['aborted']} aborted by the infrastructure and played again, "
        f"{standings['lost']} lost.\n"
    )
    for name, values in (
        ("Entrants", dict.fromkeys(row.entrant for row in rows)),
        ("Columns", dict.fromkeys(row.column for row in rows)),
        ("Conditions", dict.fromkeys(row.condition for row in rows if row.condition)),
        ("Seeds", (seed_ranges({row.seed for row in rows}),)),
        ("Code", dict.fromkeys(f"{row.version} ({row.code[:12]})" for row in rows)),
        ("Salts", dict.fromkeys(row.salt_sha256 for row in rows)),
    ):
        text = ", ".join(filter(None, values))
        if text:
            yield f"- **{name}**: {escape_markdown(text)}"
    yield f"- **Cost**: {sum(map(cost_of, rows)):.2f} USD of model calls"
    for credited in dict.fromkeys(credit(row.report.attribution) for row in rows):
        if credited:
            yield f"- **Map**: {escape_markdown(credited)}"


def _columns() -> Iterator[str]:
    yield "\n## Columns\n"
    yield "| column | meaning |"
    yield "| --- | --- |"
    for names, text in _FIELDS:
        yield f"| {', '.join(f'`{name}`' for name in names.split(', '))} | {text} |"
    yield "\nand one for each metric of an episode:\n"
    yield metrics_table()


def _results(rows: Sequence[SuiteRow]) -> Iterator[str]:
    yield "## Results\n"
    yield from (to_markdown(table) for table in make_tables(rows, ("intervals",)))


def _limits(rows: Sequence[SuiteRow]) -> Iterator[str]:
    yield "## Limits\n"
    yield "- Instances are drawn from public seeds: they are known to everyone with the code."
    yield "- Wall times depend on the machine and its load."
    if any(row.privileged for row in rows):
        shown = ", ".join(dict.fromkeys(row.entrant for row in rows if row.privileged))
        yield f"- {escape_markdown(shown)} observes the ground truth and is not ranked: it shows what can be won."
    if any(row.report.withdrawn for row in rows):
        number = sum(bool(row.report.withdrawn) for row in rows)
        yield f"- {number} episodes were played on a processor whose digests may differ from others."
    yield "\n`lingjing bench table results.parquet` makes further tables."


def seed_ranges(seeds: Iterable[int]) -> str:
    """Return seeds in order, with ranges for runs: `0-99, 200`."""
    runs: list[list[int]] = []
    for seed in sorted(seeds):
        if runs and runs[-1][1] == seed - 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return ", ".join(str(low) if low == high else f"{low}-{high}" for low, high in runs)


__all__ = ["PAPER", "column_meanings", "dataset_card", "seed_ranges"]
