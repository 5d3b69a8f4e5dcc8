"""Architecture decision records: their sections, and their citations in the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECORDS = sorted(path for path in (ROOT / "docs" / "adr").glob("*.md") if not path.name.startswith("0000"))
SECTIONS = ["Context", "Decision", "Consequences"]
CODE = [
    path
    for folder in ("lingjing", "agents", "tests", "tools", "benchmarks")
    for path in (ROOT / folder).rglob("*.py")
    if ".venv" not in path.parts
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda path: path.stem[:4])
def test_a_record_has_status_context_decision_and_consequences(record: Path) -> None:
    text = record.read_text(encoding="utf-8")
    sections = re.findall(r"(?m)^## (.+)$", text)
    assert [section for section in sections if section in SECTIONS] == SECTIONS
    assert re.search(r"(?m)^.*\b(accepted|proposed|replaced by|withdrawn)\b", text.partition("## Context")[0])


def test_numbers_are_used_once() -> None:
    numbers = [record.name[:4] for record in RECORDS]
    assert len(numbers) == len(set(numbers))


def test_each_record_is_cited_by_code() -> None:
    texts = [path.read_text(encoding="utf-8") for path in CODE] + [
        (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    ]
    cited = set(re.findall(r"\bADR[ \n]+(\d{4})\b", "\n".join(texts)))
    assert [record.stem for record in RECORDS if record.name[:4] not in cited] == []
