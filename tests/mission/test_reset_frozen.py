"""Documents that fit their template's scene keep that scene and their instance: hashes of what they compile to.

`pytest tests/mission/test_reset_frozen.py --update` writes the hashes anew; a commit that does so says which and why.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import msgspec
import pytest

from lingjing.testing import instantiate
from lingjing.testing.documents import read, templates_beside

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = Path(__file__).parent / "golden" / "reset_frozen.json"
FILES = (
    *sorted((ROOT / "scenarios" / "reset").glob("*.json")),
    *sorted((Path(__file__).parent / "wild").glob("*.json")),
    *sorted((Path(__file__).parent / "made_up").glob("1[45]-*.json")),
)
SEEDS = (0, 1, 2)
LATER = {"ice": 0.0, "effects": False, "seen": False}
"""Fields of the weather and of cells that are newer than the hashes, with their defaults: they are hashed where they
differ."""


def earlier(record: msgspec.Struct) -> dict[str, object]:
    """Return the fields of a record without later ones that have their defaults."""
    missing = object()
    return {name: value for name, value in msgspec.structs.asdict(record).items() if LATER.get(name, missing) != value}


def frozen(file: Path, seed: int) -> str:
    """The hash of a document's scene, budget, regions, cells, and bodies with their places, headings and properties."""
    mission, _ = read(file.read_text(encoding="utf-8"), file.name, templates_beside(ROOT / "nowhere"))
    instance = instantiate(mission, seed=seed)
    bodies = [
        (
            entity.id,
            entity.type,
            entity.engine,
            entity.position,
            entity.heading_deg,
            entity.label,
            entity.properties,
            entity.hidden,
        )
        for entity in instance.entities
    ]
    parts = (
        instance.scene,
        instance.clock,
        instance.budget,
        earlier(instance.weather),
        instance.regions,
        tuple(map(earlier, instance.cells)),
        bodies,
    )
    return hashlib.sha256(msgspec.json.encode(parts)).hexdigest()[:16]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_document_that_fits_keeps_its_scene_and_its_instance(file: Path, request: pytest.FixtureRequest) -> None:
    known = json.loads(GOLDEN.read_text(encoding="utf-8")) if GOLDEN.is_file() else {}
    instances = [frozen(file, seed) for seed in SEEDS]
    if request.config.getoption("--update"):
        GOLDEN.write_text(json.dumps(known | {file.stem: instances}, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    else:
        assert instances == known[file.stem]
