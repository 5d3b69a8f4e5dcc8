"""The compiled instances of the shipped missions, seeds 0 to 99, are those that are stored.

`instances.json` holds one hash for each column and seed. A commit that changes an instance says which and why, and
stores the hashes anew: `python -m pytest tests/mission/test_frozen_instances.py --update`.

The hash leaves out what equals its default and rounds numbers to nine digits: a new field with a default, or another
C library's last bit, is no other instance.
"""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing.bench.columns import Column, columns
from lingjing.testing import instantiate, shipped_missions

STORE = Path(__file__).parent / "golden" / "instances.json"
SEEDS = range(100)
COLUMNS = {column.name: column for column in columns(shipped_missions())}


def plain(value: object) -> object:
    """A record as plain values without what equals its default, numbers to nine digits."""
    if isinstance(value, float):
        return float(f"{value:.9g}") + 0.0  # without the sign of a zero
    if isinstance(value, msgspec.Struct):
        written = {
            name: plain(content)
            for name, key, default in _fields(type(value))
            if (content := getattr(value, key)) != default
        }
        tag = type(value).__struct_config__.tag
        return written if tag is None else {"": tag, **written}
    if isinstance(value, dict):
        return {str(key): plain(content) for key, content in value.items()}
    if isinstance(value, list | tuple):
        return [plain(content) for content in value]
    return value


@functools.cache
def _fields(kind: type[msgspec.Struct]) -> tuple[tuple[str, str, object], ...]:
    """Encoded name, attribute and default of each field."""
    return tuple(
        (
            field.encode_name,
            field.name,
            field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory(),
        )
        for field in msgspec.structs.fields(kind)
    )


def hashes(column: Column) -> dict[str, str]:
    """The hash of the column's instance for each seed."""
    mission = lingjing.compile(column.path)
    return {
        str(seed): hashlib.sha256(
            msgspec.json.encode(
                plain(instantiate(mission, seed=seed, mode=column.mode, settings=column.settings)), order="sorted"
            )
        ).hexdigest()[:16]
        for seed in SEEDS
    }


@pytest.mark.parametrize("name", sorted(COLUMNS))
def test_instances_match_the_stored_hashes(name: str, request: pytest.FixtureRequest) -> None:
    stored: dict[str, dict[str, str]] = json.loads(STORE.read_text()) if STORE.is_file() else {}
    computed = hashes(COLUMNS[name])
    if request.config.getoption("--update"):
        STORE.write_text(json.dumps({**stored, name: computed}, indent=1, sort_keys=True) + "\n")
        return
    assert name in stored, "a new column: store its instances with --update"
    differing = [seed for seed in computed if computed[seed] != stored[name].get(seed)]
    assert not differing, f"{name}: other instances for seeds {', '.join(differing)}"


def test_the_stored_columns_are_the_shipped_columns() -> None:
    assert set(json.loads(STORE.read_text())) == set(COLUMNS)


def test_different_instances_have_different_plain_values() -> None:
    column = COLUMNS["ssr-star"]
    mission = lingjing.compile(column.path)
    instances = [instantiate(mission, seed=seed, mode="star") for seed in (1, 2)]
    assert plain(instances[0]) != plain(instances[1])
    moved = msgspec.structs.replace(instances[0], title="x")
    assert plain(moved) != plain(instances[0])
