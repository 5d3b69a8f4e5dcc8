"""The files that a project has beside its code: citation, container recipe, security, conduct and templates."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

import lingjing

ROOT = Path(__file__).resolve().parents[2]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
TEXTS = [ROOT / name for name in ("CITATION.cff", "SECURITY.md", "CODE_OF_CONDUCT.md", "Containerfile")]
RECIPE = (ROOT / "Containerfile").read_text(encoding="utf-8")


def test_the_citation_is_of_this_version_and_names_no_person() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == lingjing.__version__
    assert citation["authors"] == [{"name": "the Lingjing developers"}]
    assert {"message", "title", "type", "license"} <= set(citation)


@pytest.mark.parametrize("path", [*TEXTS, *FORMS, ROOT / ".github" / "PULL_REQUEST_TEMPLATE.md"], ids=lambda p: p.name)
def test_project_files_contain_no_addresses(path: Path) -> None:
    assert re.findall(r"https?://\S+|[\w.]+@[\w-]+\.\w+", path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("path", [path for path in FORMS if path.stem != "config"], ids=lambda p: p.stem)
def test_an_issue_form_has_the_fields_that_the_repository_host_requires(path: Path) -> None:
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= set(form)
    fields = [field for field in form["body"] if field["type"] != "markdown"]
    assert fields
    assert len({field["id"] for field in fields}) == len(fields)
    assert all(field["attributes"]["label"] for field in fields)
    assert any(field.get("validations", {}).get("required") for field in fields)


def test_the_container_has_the_libraries_and_sources_of_an_installation() -> None:
    *_, last_stage = RECIPE.split("\nFROM ")
    libraries = (ROOT / "lingjing" / "cli" / "libraries.py").read_text(encoding="utf-8")
    packages = set(re.findall(r'SystemLibrary\("[^"]+", "([^"]+)"', libraries))
    assert len(packages) >= 7
    assert packages <= set(last_stage.split())
    copied = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (included,) = re.findall(r"^only-include = \[(.*)\]$", project, flags=re.MULTILINE)
    assert set(re.findall(r'"([^"]+)"', included)) <= copied
    assert all((ROOT / name).exists() for name in copied)
