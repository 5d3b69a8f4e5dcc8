"""No property means anything to an engine that the language's page does not say."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
READ = re.compile(
    r'properties\.get\(\s*"(\w+)"'
    r'|"(\w+)" in (?:entity\.)?properties'
    r'|number(?:_or)?\(\s*"(\w+)"'
    r'|(?:_given|number)\(entity, "(\w+)"'
    r'|bounds\((?:\w+, )*"(\w+)"'
    r'|"(\w+)" (?:not )?in (?:\w+\.)*properties'
)
UNITS = re.compile(r"(_low|_high)?_(m|mps2|mps|s|kg|hz|deg)$")
THE_SCENES_OWN = {"building"}
"""Written by the scene where it anchors something, and by nobody else."""


def test_every_property_that_an_engine_reads_is_on_the_page():
    page = (ROOT / "docs" / "language.md").read_text("utf-8")
    rows = re.findall(r"^\| ((?:state )?`.*?) \|", page, re.MULTILINE)
    said = {word for row in rows for word in re.findall(r"`(\w+)`", row)} | {"radius", "arrivals", "departures"}
    assert all(f"`{word}`" in page for word in said)
    packages = [ROOT / "lingjing" / name for name in ("engines", "plugins", "kernel", "scene", "mission", "analysis")]
    code = "\n".join(path.read_text("utf-8") for one in packages for path in sorted(one.rglob("*.py")))
    read = {next(filter(None, groups)) for groups in READ.findall(code)}
    assert len(read) > 12
    assert {UNITS.sub("", name) for name in read} - THE_SCENES_OWN - said == set()
